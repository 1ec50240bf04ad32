//! Errors and warnings of saved worlds, each with a message of one sentence.

use std::{fmt, io};

use crate::terrain::{ReplayError, RestoreError, Terrain};

/// Why a world can't be opened, created or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// There is no world.
    #[error("there is no world in {0}")]
    Missing(String),
    /// There is a world already.
    #[error("there is a world in {0} already")]
    Exists(String),
    /// Another process has the world open, or this process has it open already.
    #[error("the world in {0} is open already: close the game or server that has it open")]
    Locked(String),
    /// A newer version of the crate wrote it.
    #[error(
        "the world was saved by a newer version, with schema {found}, and this version reads up to {known}: use that version, or a newer one"
    )]
    Newer {
        /// The schema of what was read.
        found: u32,
        /// The greatest schema that this version reads.
        known: u32,
    },
    /// A newer version of the database wrote its file. Nothing was changed.
    #[error(
        "the world was saved by a newer version: the file regions.redb has the format {found}, and this version reads up to {known}; use \
         that version, or a newer one"
    )]
    NewerDatabase {
        /// The format of the file.
        found: u8,
        /// The greatest format that this version reads.
        known: u8,
    },
    /// The ground has another size than that of the saved world, which can't continue on it. Nothing was changed.
    #[error("the saved world has a ground of {saved}, and the given ground has {given}: {why}")]
    GroundSize {
        /// The size of the ground that the world was saved with; a lower bound if only that is known.
        saved: String,
        /// The size of the ground that is given.
        given: String,
        /// The reason why it can't continue on this ground, and what to do.
        why: &'static str,
    },
    /// The ground is not the one that the world was saved with, and [`BaseChanged::Refuse`](super::BaseChanged::Refuse)
    /// holds.
    #[error(
        "the ground is not the one that the world was saved with{}: give that one, or allow `base_changed`, which moves the world",
        if *.regions == 0 { String::new() } else { format!(", and differs below {regions} saved regions") }
    )]
    BaseChanged {
        /// Regions with edits over changed ground; 0 if only materials or places without edits changed.
        regions: usize,
    },
    /// The world is based on a level that was not given. Nothing is lost.
    #[error(
        "the world was created from the level `{label}`, without which it can't be opened: give that level"
    )]
    LevelMissing {
        /// The name that the game gave the level.
        label: String,
    },
    /// The world is based on another level than the given one, or the level has changed since, and
    /// [`BaseChanged::Refuse`](super::BaseChanged::Refuse) is set. Nothing is lost.
    #[error(
        "the world was created from the level `{label}` with the hash {expected:#018x}; the one given has {found:#018x}: give that \
         level, or allow `base_changed`, which moves the world"
    )]
    LevelChanged {
        /// The name that the game gave the level.
        label: String,
        /// The [hash](super::LevelName::hash) of the world's level.
        expected: u64,
        /// The hash of the given level.
        found: u64,
    },
    /// Nothing of it can be read, and no log is left to rebuild it from.
    #[error("the world can't be read: {0}")]
    Unreadable(String),
    /// A part of a file takes more bytes than can be read, so it is neither read nor written.
    #[error("a part of the file takes {length} bytes, more than the {limit} that can be read")]
    TooLarge {
        /// Bytes of the part.
        length: u64,
        /// The most that can be read.
        limit: u64,
    },
    /// The files can't be read or written.
    #[error("{doing}: {error}")]
    Files {
        /// The operation that failed.
        doing: &'static str,
        /// The system's error.
        error: io::Error,
    },
    /// A terrain can't be made from the saved data.
    #[error("the saved world does not fit its ground or settings: {0}")]
    Restore(#[from] RestoreError),
    /// Replaying a log does not give the hashes that it contains.
    #[error("the log can't be replayed: {0}")]
    Replay(#[from] ReplayError),
    /// The log can't be replayed from the first commit on, as its beginning is gone. The world itself may be whole.
    #[error("the log does not reach back to the first commit, so the world can't be made of it alone")]
    LogNotWhole,
    /// The log does not lead to the world that it describes.
    #[error("replaying the log does not give the saved world: {0}")]
    LogRefused(String),
    /// Records do not follow those that were taken before.
    #[error("records are missing: the next one leads to revision {found}, and the store is at {at}")]
    Gap {
        /// The store's revision.
        at: u64,
        /// The record's.
        found: u64,
    },
    /// The terrain has another size than the saved world. Nothing of it was written.
    #[error("the saved world has {saved}, and the terrain has {given}: save it in another folder")]
    OtherSize {
        /// The size of the saved world.
        saved: WorldSize,
        /// The size of the terrain.
        given: WorldSize,
    },
    /// A server keeps the world of this terrain, and saves it.
    #[error("the terrain is shared, so its server saves it: remove SharedTerrain to save it here")]
    Shared,
    /// A terrain over another ground, or of another size, replaced the one that the world was being read for.
    #[error("another level has replaced the terrain that the world was read for, so it is not saved there")]
    OtherTerrain,
    /// The store's thread is gone.
    #[error("the store's thread has ended: nothing is saved any more until the world is opened again")]
    Ended,
    /// The disk does not answer, and waiting data takes all the memory that it may. Nothing was taken.
    #[error("too much data waits to be saved, because the disk does not answer")]
    Full,
    /// The disk has not answered in time. Data that the store has taken is still written if the disk answers later.
    #[error("the disk has not answered in time")]
    TimedOut,
    /// Saving fails at present. The data stays in memory, and saving is retried.
    #[error("the world can't be saved for now: {0}")]
    NotSaved(String),
}

/// The sizes that a world keeps for as long as it is saved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldSize {
    /// Cells along x and along z.
    pub cells: [u32; 2],
    /// Cells along the side of a chunk.
    pub chunk_size: u32,
    /// Metres along the side of a voxel.
    pub voxel_size: f32,
}

impl WorldSize {
    /// The sizes of a terrain.
    pub fn of(terrain: &Terrain) -> Self {
        let (ground, grid) = (terrain.world().ground(), terrain.world().grid());
        Self {
            cells: [ground.width(), ground.depth()].map(i32::cast_unsigned),
            chunk_size: grid.size().cast_unsigned(),
            voxel_size: terrain.voxel_size(),
        }
    }
}

impl fmt::Display for WorldSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { cells: [width, depth], chunk_size, voxel_size } = self;
        write!(f, "{width} x {depth} cells, chunks of {chunk_size} and voxels of {voxel_size} m")
    }
}

impl StoreError {
    /// Wraps an error of the system with the operation that failed.
    pub(super) fn files(doing: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |error| Self::Files { doing, error }
    }
}

/// A problem to show to a player or an operator. Play continues.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StoreWarning {
    /// The world can't be saved at present. Everything is kept in memory, and saving is retried.
    #[error("saving failed and will be retried: {0}")]
    NotSaved(String),
    /// Saving works again.
    #[error("saving works again")]
    SavedAgain,
    /// The disk does not answer: a network share that is not available, or a sleeping drive. Edits are kept in memory,
    /// up to [`waiting_bytes`](super::StoreOptions::waiting_bytes), and are saved once it answers; then
    /// [`SavedAgain`](Self::SavedAgain) follows.
    #[error("the disk does not answer: edits are kept in memory until it does")]
    Hanging,
    /// Another process has the world open. Opening waits until it is closed.
    #[error("the world is open elsewhere: waiting until it is closed")]
    WaitsForLock,
    /// The store's thread has ended, which only a bug in this crate can cause. Nothing is saved any more.
    #[error("saving has ended, and nothing is saved any more ({0}): save the world in another folder")]
    Ended(String),
    /// The log has a gap, because too much data waited or arrived at once, or another world replaced this one: it can
    /// no longer rebuild damaged regions. The whole world is saved instead.
    #[error("the log has a gap at revision {revision}, so the whole world is saved")]
    LogGap {
        /// The last revision before the gap.
        revision: u64,
    },
    /// The log ends in bytes that are not a record: commits that were not durable when the power or the process was
    /// lost, or damage. A copy of it is kept.
    #[error(
        "the log ends with {bytes} bytes that can't be read after revision {revision}{}",
        copy(quarantine)
    )]
    LogCut {
        /// The last revision that was read.
        revision: u64,
        /// How much was left out.
        bytes: u64,
        /// Where the copy is, below the world's folder; empty where there is none.
        quarantine: String,
    },
    /// Replaying the log does not give the hashes that it contains, so the rest of it was skipped.
    #[error("the log can't be replayed after revision {revision}: {why}{}", copy(quarantine))]
    LogRefused {
        /// The last revision that was replayed.
        revision: u64,
        /// The mismatch.
        why: String,
        /// Where the copy is, below the world's folder; empty where there is none.
        quarantine: String,
    },
    /// A damaged part was rebuilt, from the log or from other files; nothing is lost.
    #[error("{what}; it has been rebuilt, and nothing is lost{}", copy(quarantine))]
    Rebuilt {
        /// The damage, in words.
        what: String,
        /// Where the copy is, below the world's folder; empty where there is none.
        quarantine: String,
    },
    /// A damaged region is lost: the ground there is in its first state.
    #[error(
        "the region {region} is damaged, and the log does not reach back far enough to rebuild it: the ground there is pristine again{}",
        copy(quarantine)
    )]
    RegionLost {
        /// The region, as `x y z` in units of 64 voxels.
        region: String,
        /// Where the copy is, below the world's folder; empty where there is none.
        quarantine: String,
    },
    /// The log is missing, with all commits that were in it only: the folder `journal` was removed after a crash.
    #[error("the log is missing: edits after revision {revision}, before the last crash, are lost")]
    LogMissing {
        /// The revision of the last checkpoint.
        revision: u64,
    },
    /// Only regions are left of a world: its rules and the game's data are lost. Such a world is opened only with
    /// [`salvage`](super::StoreOptions::salvage).
    #[error("only regions are left of the world: its rules and the game's data are lost")]
    CheckpointLost,
    /// Commits that were in the log only were made by a version of the crate whose edits differ; they were
    /// replayed. The ground may differ slightly there.
    #[error("{commits} commits of another version, after the last checkpoint, were replayed")]
    Replayed {
        /// How many.
        commits: u64,
    },
    /// The ground or the level is another one than the world was saved with; edits were kept or replayed.
    #[error(
        "the ground or the level has changed, {} saved regions; the edits were {kept}",
        if *.regions == 0 { "but not below any of the".into() } else { format!("below {regions}") }
    )]
    BaseChanged {
        /// Regions with edits over changed ground; all of them, if it is the level.
        regions: usize,
        /// Whether the edits were "kept" or "replayed".
        kept: &'static str,
    },
}

/// Text that names the copy, if there is one.
fn copy(quarantine: &str) -> String {
    if quarantine.is_empty() { String::new() } else { format!("; a copy is in {quarantine}") }
}
