//! What there is after a run: facts that each repeat must come to again, and bytes.

use std::panic::resume_unwind;

use bevy_burrow::surface::SeamReport;
use bevy_burrow::terrain::{Memory, Terrain, World};

use crate::full::{DenseField, FullWorld};

/// What there is after a run.
#[derive(Clone, Copy, Debug)]
pub struct Ending {
    /// Triangles of the whole terrain, as drawn.
    pub triangles: usize,
    /// Of a world; not known of a dense field.
    pub world: Option<EndingWorld>,
    /// Bytes of a dense field's samples.
    pub sample_bytes: usize,
    /// Bytes of a full field's vertex and index buffers.
    pub mesh_bytes: usize,
}

/// What there is of a world after a run.
#[derive(Clone, Copy, Debug)]
pub struct EndingWorld {
    /// Of all samples; the same for all chunk sizes.
    pub hash: u64,
    /// Is all that is drawn one closed surface?
    pub is_flawless: bool,
    pub data: Memory,
}

impl EndingWorld {
    fn new(world: &World, seams: &SeamReport, data: Memory) -> Self {
        Self { hash: world.hash(), is_flawless: seams.is_flawless(), data }
    }
}

/// Looks at what there is in a thread that has memory of its own: glibc would give back what a look frees in the middle of
/// some later edit, where that takes ten times as long as the edit.
fn aside<T: Send>(look: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| scope.spawn(look).join().unwrap_or_else(|panic| resume_unwind(panic)))
}

impl Ending {
    pub fn of_terrain(terrain: &Terrain) -> Self {
        let world = terrain.world();
        let seams = aside(|| world.check_seams());
        let (triangles, world) = (seams.triangles, EndingWorld::new(world, &seams, terrain.memory()));
        Self { triangles, world: Some(world), sample_bytes: 0, mesh_bytes: 0 }
    }

    pub fn of_full(full: &FullWorld) -> Self {
        let seams = aside(|| full.check_seams());
        let world = Some(EndingWorld::new(full.world(), &seams, full.memory()));
        Self { triangles: seams.triangles, world, sample_bytes: 0, mesh_bytes: full.mesh_bytes() }
    }

    pub fn of_field(field: &DenseField) -> Self {
        Self {
            triangles: field.mesh().indices.len() / 3,
            world: None,
            sample_bytes: field.sample_bytes(),
            mesh_bytes: field.mesh_bytes(),
        }
    }

    /// Bytes of ground and samples, with all that is kept besides, history aside.
    pub fn data_bytes(&self) -> usize {
        self.world.map_or(self.sample_bytes, |world| world.data.ground + world.data.edits())
    }

    /// Bytes of what can be undone.
    pub fn undo_bytes(&self) -> usize {
        self.world.map_or(0, |world| world.data.undo)
    }

    /// Did the same come out?
    pub fn agrees(&self, other: &Self) -> bool {
        let facts =
            |ending: &Self| (ending.triangles, ending.world.map(|world| (world.hash, world.is_flawless)));
        facts(self) == facts(other)
    }
}
