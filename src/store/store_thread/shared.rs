//! State that the store shares with its thread: reports, and the game's data.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::store::error::StoreWarning;

/// The game's data in a world, by key.
pub(in crate::store) type GameData = BTreeMap<String, Vec<u8>>;

/// A change of the game's data; `None` removes the value.
pub(in crate::store) type GameChange = (String, Option<Vec<u8>>);

/// Applies changes to the game's data.
pub(in crate::store) fn apply_game(data: &mut GameData, changes: &[GameChange]) {
    for (key, value) in changes {
        match value {
            Some(value) => drop(data.insert(key.clone(), value.clone())),
            None => drop(data.remove(key)),
        }
    }
}

/// A point in the sequence of data that a [`Store`](crate::store::Store) was given, to ask whether everything up to it
/// is durable.
///
/// Revisions alone do not suffice: they start again if another terrain replaces the saved one, and the game's
/// data has none. Points are ordered by the time at which they were given to the store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct SavePoint {
    /// How often the store was given data.
    pub(in crate::store) number: u64,
    /// How often another terrain replaced the previous one.
    pub(in crate::store) terrain: u64,
    pub(in crate::store) revision: u64,
}

impl SavePoint {
    /// The revision of the terrain at this point.
    pub fn revision(self) -> u64 {
        self.revision
    }

    /// Whether both are of one terrain, so that their revisions can be compared.
    pub fn is_same_terrain(self, other: Self) -> bool {
        self.terrain == other.terrain
    }
}

/// The thread's report.
#[derive(Debug, Default)]
pub(in crate::store) struct Shared(Mutex<Report>);

#[derive(Debug, Default)]
struct Report {
    durable: Option<SavePoint>,
    warnings: VecDeque<StoreWarning>,
    /// Why saving fails at the moment.
    failing: Option<String>,
    /// When the disk should have answered, while the thread waits for it.
    answer_due: Option<Instant>,
    /// Whether it was reported that the disk does not answer.
    is_hanging: bool,
    /// Bytes that were sent to the thread, and that it has not taken.
    queued: usize,
}

/// Warnings that are kept until they are taken.
const MAX_WARNINGS: usize = 256;

impl Report {
    fn add(&mut self, warning: StoreWarning) {
        if self.warnings.len() == MAX_WARNINGS {
            self.warnings.pop_front();
        }
        self.warnings.push_back(warning);
    }
}

impl Shared {
    fn report(&self) -> MutexGuard<'_, Report> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The last point up to which everything is durable; `None` where nothing is.
    pub fn durable(&self) -> Option<SavePoint> {
        self.report().durable
    }

    /// Records that everything up to a point is durable. An earlier point changes nothing.
    pub fn set_durable(&self, point: SavePoint) {
        let mut report = self.report();
        report.durable = report.durable.max(Some(point));
    }

    pub fn report_warning(&self, warning: StoreWarning) {
        self.report().add(warning);
    }

    /// Sets the reason why saving fails, or `None` if it works.
    pub fn set_failing(&self, why: Option<&str>) {
        self.report().failing = why.map(Into::into);
    }

    /// Why saving fails, if it does.
    pub fn failing(&self) -> Option<String> {
        self.report().failing.clone()
    }

    /// Records that the thread waits for the disk, and for how long at most.
    pub fn begin_waiting(&self, longest: Duration) {
        self.report().answer_due = Instant::now().checked_add(longest);
    }

    /// The disk has answered.
    pub fn end_waiting(&self) {
        let mut report = self.report();
        report.answer_due = None;
        if std::mem::take(&mut report.is_hanging) {
            report.add(StoreWarning::SavedAgain);
        }
    }

    /// Whether the disk has not answered for longer than it should.
    fn check_waiting(report: &mut Report) {
        let is_late = report.answer_due.is_some_and(|due| due <= Instant::now());
        if is_late && !report.is_hanging {
            report.is_hanging = true;
            report.add(StoreWarning::Hanging);
        }
    }

    pub fn take_warnings(&self) -> Vec<StoreWarning> {
        let mut report = self.report();
        Self::check_waiting(&mut report);
        std::mem::take(&mut report.warnings).into()
    }

    /// Bytes that the thread has not taken.
    pub fn queued(&self) -> usize {
        self.report().queued
    }

    pub fn add_queued(&self, bytes: usize) {
        let mut report = self.report();
        report.queued = report.queued.saturating_add(bytes);
    }

    pub fn remove_queued(&self, bytes: usize) {
        let mut report = self.report();
        report.queued = report.queued.saturating_sub(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_durable_stays_so() {
        let shared = Shared::default();
        let point = |number, terrain, revision| SavePoint { number, terrain, revision };
        assert_eq!(shared.durable(), None);
        for (said, durable) in [
            (point(1, 0, 5), point(1, 0, 5)),
            // Another terrain with a lower revision.
            (point(2, 1, 0), point(2, 1, 0)),
            (point(1, 0, 5), point(2, 1, 0)),
        ] {
            shared.set_durable(said);
            assert_eq!(shared.durable(), Some(durable));
        }
    }

    #[test]
    fn a_disk_that_does_not_answer_is_reported_once_and_so_is_its_answer() {
        let shared = Shared::default();
        shared.begin_waiting(Duration::MAX);
        assert_eq!(shared.take_warnings(), []);
        shared.begin_waiting(Duration::ZERO);
        assert_eq!(shared.take_warnings(), [StoreWarning::Hanging]);
        assert_eq!(shared.take_warnings(), []);
        shared.end_waiting();
        shared.end_waiting();
        assert_eq!(shared.take_warnings(), [StoreWarning::SavedAgain]);
    }
}
