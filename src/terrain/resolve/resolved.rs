//! The result of a transaction's work.

use std::sync::Arc;

use super::field_log::FieldChange;
use crate::lattice::ChunkPos;
use crate::redraw::{MeshUpdates, Stages};
use crate::terrain::history::UndoDelta;
use crate::terrain::receipt::Receipt;
use crate::volume::UniformBricks;
use crate::world::{NewSurfaces, Patch, World};

/// The result of a transaction's work: what changes, and how it is drawn.
pub(crate) struct Resolved {
    pub outcome: Outcome,
    pub meshes: MeshUpdates,
    pub stages: Stages,
}

/// What a transaction changes in the world, and the receipts of its orders.
pub(crate) struct Outcome {
    /// The parts that groups of edits change, in order, or a step through history.
    pub changes: Vec<UndoDelta>,
    /// Hash of all samples afterwards.
    pub sample_hash: u64,
    /// The pool of uniform bricks, if it has grown.
    pub uniform: Option<UniformBricks>,
    /// The greatest name that any field has had afterwards.
    pub next_field: u64,
    pub receipts: Vec<Receipt>,
    /// Changes of fields.
    pub news: Vec<(ChunkPos, FieldChange)>,
    /// The new world, if all of it is replaced.
    pub whole: Option<Arc<World>>,
}

impl Resolved {
    /// Nothing changes.
    pub fn nothing(world: &World) -> Self {
        let outcome = Outcome::new(world, Vec::new(), world.sample_hash);
        Self { outcome, meshes: MeshUpdates::default(), stages: Stages::default() }
    }

    /// Sets the receipt of its only order.
    pub fn with_receipt(mut self, receipt: Receipt) -> Self {
        self.outcome.receipts = vec![receipt];
        self
    }
}

impl Outcome {
    /// These parts change.
    pub fn new(world: &World, changes: Vec<UndoDelta>, sample_hash: u64) -> Self {
        Self {
            changes,
            sample_hash,
            uniform: None,
            next_field: world.next_field,
            receipts: Vec::new(),
            news: Vec::new(),
            whole: None,
        }
    }

    /// The bricks and fields that its changes lead to, or those of the new world.
    pub fn patch(&self) -> Patch {
        if let Some(whole) = &self.whole {
            return whole.all_parts();
        }
        let mut changes = self.changes.iter().map(|own| own.change.patch.clone());
        let mut patch = changes.next().unwrap_or_default();
        changes.for_each(|later| patch.then(later));
        patch.next_field = self.next_field;
        patch
    }

    /// Makes its changes those of a world, in order, with the surfaces to keep; returns what they replaced.
    pub fn install(self, world: &mut World, kept: NewSurfaces) -> Vec<UndoDelta> {
        let Self { mut changes, uniform, next_field, .. } = self;
        changes.iter_mut().for_each(|own| own.change.swap(world));
        changes.retain(|own| !own.change.patch.bricks.is_empty());
        if let Some(uniform) = uniform {
            world.set_uniform(uniform);
        }
        world.meshes.apply(kept);
        world.shrink();
        world.next_field = next_field;
        changes
    }
}
