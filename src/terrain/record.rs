//! Records of the commit log: the orders of each commit, and its changes of the world.

use std::sync::Arc;

use super::edit_settings::EditSettings;
use super::order::Order;
use super::receipt::OrderKind;
use crate::world::Patch;

/// A commit: the orders that were carried out, and what they changed.
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
    /// The orders of the commit, in order. A step through history is recorded as the parts that it restored:
    /// [`Order::Parts`] with the [change](Self::change) and the [hash](Self::hash) of this record. Rejected orders are
    /// left out; a commit of such orders alone has none.
    pub orders: Vec<Order>,
    /// What changed.
    pub change: Arc<Patch>,
}

impl CommitRecord {
    /// Whether it is a commit. Otherwise it only holds rules and settings for later edits, and the revision does not
    /// change.
    pub fn is_commit(&self) -> bool {
        self.orders.is_empty() || self.orders.iter().any(|order| !order.kind().is_setting())
    }

    /// Whether it sets another ground.
    pub(super) fn sets_ground(&self) -> bool {
        self.orders.iter().any(|order| order.kind() == OrderKind::Ground)
    }

    /// Whether its [change](Self::change) counts: a step through history or replaced parts. Edits lead to theirs again.
    pub fn has_change(&self) -> bool {
        self.orders.iter().any(|order| order.kind().is_logged_as_parts())
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
