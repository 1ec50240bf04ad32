//! The log of a terrain: what it keeps, and who takes it.

#[cfg(feature = "store")]
use std::ops::Range;

use super::log::CommitLog;
use super::model::Terrain;
use super::record::CommitRecord;
#[cfg(feature = "store")]
use super::record::WorldParts;

impl Terrain {
    /// Keeps a record of each commit until it is [taken](Self::take_log); `None` keeps none and
    /// drops those that wait. Once they hold more than `bytes` bytes, not counting images of stamps and prefabs, the
    /// oldest are dropped. A reader that finds a gap between [numbers](CommitRecord::number) or
    /// [revisions](CommitRecord::revision), or whose last record does not have the [world's
    /// revision](super::World::revision), has to read all of the [world](Self::world).
    ///
    /// Rules and settings of loose pieces are logged with the first edit that obeys them, or once nothing
    /// waits.
    pub fn keep_log(&mut self, bytes: Option<usize>) {
        match (&mut self.log, bytes) {
            (_, None) => self.log = None,
            (Some(log), Some(limit)) => log.set_limit(limit),
            (None, Some(limit)) => {
                self.log = Some(CommitLog::new(limit));
                // Its commit would hold no record.
                self.abandon();
            }
        }
        self.log_settings();
    }

    /// The records of the commits since the last call, in order; each is returned once.
    pub fn take_log(&mut self) -> Vec<CommitRecord> {
        self.log.as_mut().map(CommitLog::take).unwrap_or_default()
    }

    /// Returns `true` if there is a record to [take](Self::take_log).
    #[doc(hidden)]
    pub fn has_log(&self) -> bool {
        self.log.as_ref().is_some_and(|log| !log.is_empty())
    }

    /// Whether the records since the last [`take_log`](Self::take_log) follow this revision, and one of them sets
    /// another ground: then the world is another one than before, and the terrain is the same. Dropped records count.
    #[cfg(feature = "store")]
    pub(crate) fn log_sets_ground_after(&self, revision: u64) -> bool {
        self.log.as_ref().is_some_and(|log| log.sets_ground_after(revision))
    }

    /// The numbers of the records that wait, which begin with that of the next record if none waits; `None` without a
    /// log.
    #[cfg(feature = "store")]
    pub(crate) fn log_numbers(&self) -> Option<Range<u64>> {
        self.log.as_ref().map(CommitLog::numbers)
    }

    /// All of the world but its ground, with the rules and loose settings from which later records of the log
    /// continue: edits that wait may obey others than later edits.
    #[cfg(feature = "store")]
    pub(crate) fn logged_parts(&self) -> WorldParts {
        let parts = self.parts();
        match self.log.as_ref().and_then(CommitLog::edit_settings) {
            Some(edit_settings) => WorldParts { edit_settings: edit_settings.clone(), ..parts },
            None => parts,
        }
    }

    /// Records the rules and loose settings of later edits in the log, unless waiting edits obey others.
    pub(super) fn log_settings(&mut self) {
        if self.is_busy() || self.queue.len() > 0 {
            return;
        }
        if let Some(log) = &mut self.log {
            log.enter_settings(&self.world, self.edit_settings.clone());
        }
    }
}
