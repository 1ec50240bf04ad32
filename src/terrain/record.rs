//! Records of the commit log: the requests of each commit, and its changes of the world.

use std::sync::Arc;

use super::edit_settings::EditSettings;
use super::order::Order;
use crate::world::Patch;

/// Changes when the same edits of the same ground no longer give the same [hash](super::World::hash): a log that was
/// written under another number can't be replayed.
pub const SIMULATION: u32 = 2;

/// One item of a commit. Items of one commit apply in order.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LogEntry {
    /// An order that was carried out, under the rules and settings of the orders before it: an edit, another ground, or
    /// rules and settings for what follows.
    Order(Order),
    /// A step through history, or replaced parts: the record's [change](CommitRecord::change) contains them.
    Change,
}

impl LogEntry {
    /// Whether it changes the world, and not only what later edits obey.
    fn is_commit(&self) -> bool {
        !matches!(self, Self::Order(order) if order.kind().is_setting())
    }
}

/// A commit: the requests and their results.
#[derive(Clone, Debug)]
pub struct CommitRecord {
    /// The commit's number in the log that it was taken from: one more than that of the record before. A log whose
    /// numbers have a gap has lost records. A saved record has the number 0.
    pub number: u64,
    /// The [revision](super::World::revision) that it led to: one more than that of the record before, or the same
    /// where only rules or settings changed.
    pub revision: u64,
    /// The world's [hash](super::World::hash) after it.
    pub hash: u64,
    /// The items of the commit, in order. Rejected edits are left out; a commit of such edits alone has no entry.
    pub entries: Vec<LogEntry>,
    /// What changed.
    pub change: Patch,
}

impl CommitRecord {
    /// Whether it is a commit. Otherwise it only holds rules and settings for later edits, and the revision does not
    /// change.
    pub fn is_commit(&self) -> bool {
        self.entries.is_empty() || self.entries.iter().any(LogEntry::is_commit)
    }

    /// Whether it sets another ground.
    pub(super) fn sets_ground(&self) -> bool {
        self.entries.iter().any(|entry| matches!(entry, LogEntry::Order(Order::Ground(_))))
    }

    /// Whether its [change](Self::change) counts: a step through history or replaced parts. Edits lead to theirs again.
    pub fn has_change(&self) -> bool {
        let is_change = |entry: &LogEntry| match entry {
            LogEntry::Change => true,
            LogEntry::Order(order) => order.kind().is_logged_as_change(),
        };
        self.entries.iter().any(is_change)
    }

    /// The orders that it was made of. Its change stands for steps through history; without any entry, all of its edits
    /// were rejected.
    pub(crate) fn orders(&self) -> impl Iterator<Item = Order> {
        let hash = Some(self.hash);
        let nothing = self.entries.is_empty().then(|| Order::Parts { change: Arc::default(), hash });
        let order = move |entry: &LogEntry| match entry {
            LogEntry::Order(order) => order.clone(),
            LogEntry::Change => Order::Parts { change: Arc::new(self.change.clone()), hash },
        };
        self.entries.iter().map(order).chain(nothing)
    }
}

/// All of a world except its ground, for saving: [`Terrain::restore`](super::Terrain::restore) makes a terrain of it.
#[derive(Clone, Debug, Default)]
pub struct WorldParts {
    /// Every stored brick, and all fields.
    pub change: Patch,
    /// Cells along the side of the chunks that the fields belong to.
    pub chunk_size: u32,
    /// The world's revision.
    pub revision: u64,
    /// The rules and the search for loose pieces that edits obey.
    pub edit_settings: EditSettings,
}
