//! The result of a transaction's work.

use std::sync::Arc;

use super::field_log::FieldChange;
use crate::lattice::ChunkPos;
use crate::redraw::{MeshUpdates, Stages};
use crate::terrain::history::UndoDelta;
use crate::terrain::receipt::Receipt;
use crate::volume::UniformBricks;
use crate::world::{NewSurfaces, Patch, World};

/// The result of a transaction's work: the parts that change, how they are drawn, and the answers.
pub(crate) struct Resolved {
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
    pub meshes: MeshUpdates,
    pub stages: Stages,
}

impl Resolved {
    /// Nothing changes.
    pub fn nothing(world: &World) -> Self {
        Self::new(world, Vec::new(), world.sample_hash, MeshUpdates::default())
    }

    /// These parts change, and this is drawn then.
    pub fn new(world: &World, changes: Vec<UndoDelta>, sample_hash: u64, meshes: MeshUpdates) -> Self {
        Self {
            changes,
            sample_hash,
            uniform: None,
            next_field: world.next_field,
            receipts: Vec::new(),
            news: Vec::new(),
            whole: None,
            meshes,
            stages: Stages::default(),
        }
    }
}

/// Makes parts those of a world, in order, and returns what they replaced.
pub(crate) fn install(
    world: &mut World,
    mut changes: Vec<UndoDelta>,
    uniform: Option<UniformBricks>,
    kept: NewSurfaces,
    next_field: u64,
) -> Vec<UndoDelta> {
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

/// The bricks and fields that changes in order lead to, or those of another world.
pub(crate) fn patch_of(changes: &[UndoDelta], whole: Option<&World>, next_field: u64) -> Patch {
    if let Some(whole) = whole {
        return whole.all_parts();
    }
    let mut changes = changes.iter().map(|own| own.change.patch.clone());
    let mut patch = changes.next().unwrap_or_default();
    changes.for_each(|later| patch.then(later));
    patch.next_field = next_field;
    patch
}
