//! Orders: what can be asked of a terrain.

use std::sync::Arc;

use super::replacement::ChangeError;
use crate::brush::Edit;
use crate::ground::Ground;
use crate::loose::LooseSettings;
use crate::volume::{DiggingRules, RulesError};
use crate::world::Patch;

/// A request to a terrain, as replayed logs, servers and clients make it:
/// [`Terrain::submit_order`](super::Terrain::submit_order).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Order {
    /// An edit, under the rules and settings of the orders before it.
    Edit(Edit),
    /// Undoes the last group of edits.
    Undo,
    /// Redoes the step that was undone last.
    Redo,
    /// Replaces parts of the world.
    Parts {
        /// The parts.
        change: Arc<Patch>,
        /// The [hash](super::World::hash) that the world must have afterwards.
        hash: Option<u64>,
    },
    /// Another ground of the same size lies below all edits.
    Ground(Arc<Ground>),
    /// Later edits obey these rules.
    Rules(Option<Arc<DiggingRules>>),
    /// Later edits search for loose pieces with these settings.
    Loose(Option<LooseSettings>),
}

/// Why an order was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OrderError {
    /// The rules are invalid.
    #[error(transparent)]
    Rules(#[from] RulesError),
    /// The parts or the ground do not fit, or too much work waits.
    #[error(transparent)]
    Parts(#[from] ChangeError),
}
