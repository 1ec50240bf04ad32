//! How a store saves, and what it does where the ground has changed.

use std::time::Duration;

use super::base_level::BaseLevel;
use super::progress::Progress;

/// What to do with edits where the ground is another one than they were made on, or where the [level](StoreOptions::level) is
/// another one than the world was begun on, say a new version of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BaseChanged {
    /// Edited samples stay as they are: a hole stays where it is. What was pristine is that of the new ground. Bricks that
    /// differed from the level stay as they are, all of their 512 samples, and all others are those of the new level.
    ///
    /// Commits behind the last checkpoint, which are there after a crash only, are made again.
    #[default]
    Keep,
    /// All edits are made again on the new ground and level, if the log has all of them; else they are kept. What an undo put
    /// back is put back as it was.
    Replay,
    /// The world is not opened.
    Refuse,
}

/// How a store saves. Any duration may be [`Duration::MAX`], which stands for never.
#[derive(Clone, Debug, PartialEq)]
pub struct StoreOptions {
    /// Commits are durable this long after they were appended, and a little more for the disk: what is lost at most when the
    /// power goes. 0 writes each batch at once.
    pub loss_window: Duration,
    /// Bytes that the log may take on the disk; then the oldest part of it goes. Without a whole log, a damaged region can't be
    /// rebuilt. What the last two checkpoints need stays in any case.
    pub log_bytes: u64,
    /// Commits after which a checkpoint is made.
    pub checkpoint_commits: u64,
    /// Time after which a checkpoint is made, if anything changed.
    pub checkpoint_after: Duration,
    /// Bytes of records that wait in memory while saving fails, and once more while the disk does not answer; beyond it they are
    /// dropped, and the world is saved whole once that works.
    pub waiting_bytes: usize,
    /// Bytes that a frame of the log may hold, 256 MiB at most. Commits and game data of more that come at once are saved by a
    /// checkpoint instead, which leaves a gap in the log.
    pub frame_bytes: usize,
    /// Where the ground or the level has changed.
    pub base_changed: BaseChanged,
    /// The level that the world begins as. A new world saves only what differs from it, and can't be opened without a level. With
    /// another one than it was begun on, [`base_changed`](Self::base_changed) says what happens; from then on it is a world on
    /// that one. Worlds that were created without a level ignore it.
    pub level: Option<BaseLevel>,
    /// Where to tell how far opening is.
    pub progress: Option<Progress>,
    /// Opens a world of which anything is left, even where a file can't be read at the moment or nothing says what the world was
    /// beside its regions. Tools that repair worlds set it; a game should ask the player first.
    pub salvage: bool,
    /// How long dropping the store waits for the disk at most. What is left is written in any case, if the process goes on and the
    /// disk answers in the end; the world stays locked until then.
    pub close_timeout: Duration,
}

impl Default for StoreOptions {
    /// A loss window of a second, 64 MiB of log and of a frame, checkpoints each minute or 4096 commits. Closing waits for the disk
    /// as long as it takes.
    fn default() -> Self {
        Self {
            loss_window: Duration::from_secs(1),
            log_bytes: 64 << 20,
            checkpoint_commits: 4096,
            checkpoint_after: Duration::from_secs(60),
            waiting_bytes: 32 << 20,
            frame_bytes: 64 << 20,
            base_changed: BaseChanged::default(),
            level: None,
            progress: None,
            salvage: false,
            close_timeout: Duration::MAX,
        }
    }
}
