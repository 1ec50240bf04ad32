//! Settings of a store, including its policy for a changed ground.

use std::time::Duration;

use super::base_level::BaseLevel;
use super::progress::Progress;

/// How edits are kept if the ground differs from the one that they were made on, or if the [level](StoreOptions::level)
/// differs from the one that the world is based on, for example in its version.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BaseChanged {
    /// Edited samples are kept: a hole stays where it is. Pristine samples come from the new ground. Bricks that
    /// differed from the level are kept, with all of their 512 samples; all others come from the new level.
    ///
    /// After a crash, commits newer than the last checkpoint are replayed.
    #[default]
    Keep,
    /// All edits are replayed on the new ground and level, if the log is complete; otherwise they are kept. Bricks that
    /// an undo restored get the content that they had.
    Replay,
    /// The world is not opened.
    Refuse,
}

/// How a store saves. Any duration may be [`Duration::MAX`], which stands for never.
#[derive(Clone, Debug, PartialEq)]
pub struct StoreOptions {
    /// The longest time until commits are durable, plus a little for the disk. At most this much is lost in a power
    /// failure. 0 writes each batch at once.
    pub loss_window: Duration,
    /// Bytes that the log may take on the disk; then the oldest part of it is removed. Without a complete log, a
    /// damaged region can't be rebuilt. The part that the last two checkpoints need is kept in any case.
    pub log_bytes: u64,
    /// Commits after which a checkpoint is made.
    pub checkpoint_commits: u64,
    /// Time after which a checkpoint is made, if anything changed.
    pub checkpoint_after: Duration,
    /// Bytes of records that wait in memory while saving fails, and once more while the disk does not answer; beyond it
    /// they are dropped, and the whole world is saved once that works.
    pub waiting_bytes: usize,
    /// Bytes that a frame of the log may hold, 256 MiB at most. Commits and game data of more that come at once are
    /// saved by a checkpoint instead, which leaves a gap in the log.
    pub frame_bytes: usize,
    /// The policy if the ground or the level has changed.
    pub base_changed: BaseChanged,
    /// The level that the world starts from. A new world saves only its differences from it, and can't be opened
    /// without a level. If the level differs from the world's own, [`base_changed`](Self::base_changed) decides what
    /// happens; afterwards the world belongs to the given level. Worlds that were created without a level ignore it.
    pub level: Option<BaseLevel>,
    /// Receives the progress of opening.
    pub progress: Option<Progress>,
    /// Opens a world of which anything is left, even if a file can't be read at the moment or everything except regions
    /// is lost. Tools that repair worlds set it; a game should ask the player first.
    pub salvage: bool,
    /// The longest time that dropping the store waits for the disk. Remaining data is still written if the process
    /// keeps running and the disk answers later; the world stays locked until then.
    pub close_timeout: Duration,
}

impl Default for StoreOptions {
    /// A loss window of a second, 64 MiB of log and of a frame, checkpoints each minute or 4096 commits. Closing waits
    /// for the disk as long as it takes.
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
