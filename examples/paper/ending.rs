//! The result of a run: facts that must be the same in each repeat, and bytes.

use std::panic::resume_unwind;

use bevy_burrow::surface::SeamReport;
use bevy_burrow::terrain::{Memory, Terrain, World};

use crate::full::{DenseField, FullWorld};

/// The result of a run.
#[derive(Clone, Copy, Debug)]
pub struct Ending {
    /// Triangles of the whole terrain, as drawn.
    pub triangles: usize,
    /// Facts about the world; `None` for a dense field.
    pub world: Option<EndingWorld>,
    /// Bytes of a dense field's samples.
    pub sample_bytes: usize,
    /// Bytes of a full field's vertex and index buffers.
    pub mesh_bytes: usize,
}

/// Facts about the world after a run.
#[derive(Clone, Copy, Debug)]
pub struct EndingWorld {
    /// Hash of all samples; the same for all chunk sizes.
    pub hash: u64,
    /// Whether the drawn surface is closed.
    pub is_flawless: bool,
    pub data: Memory,
}

impl EndingWorld {
    fn new(world: &World, seams: &SeamReport, data: Memory) -> Self {
        Self { hash: world.hash(), is_flawless: seams.is_flawless(), data }
    }
}

/// Inspects the result in a separate thread, which has its own allocator arena: otherwise glibc would return the freed
/// memory to the system during some later edit, which takes ten times as long as the edit.
fn in_own_thread<T: Send>(look: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| scope.spawn(look).join().unwrap_or_else(|panic| resume_unwind(panic)))
}

impl Ending {
    pub fn of_terrain(terrain: &Terrain) -> Self {
        let world = terrain.world();
        let seams = in_own_thread(|| world.check_seams());
        let (triangles, world) = (seams.triangles, EndingWorld::new(world, &seams, terrain.memory()));
        Self { triangles, world: Some(world), sample_bytes: 0, mesh_bytes: 0 }
    }

    pub fn of_full(full: &FullWorld) -> Self {
        let seams = in_own_thread(|| full.check_seams());
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

    /// Bytes of ground, samples and derived data, except history.
    pub fn data_bytes(&self) -> usize {
        self.world.map_or(self.sample_bytes, |world| world.data.ground + world.data.edits())
    }

    /// Bytes of the undo history.
    pub fn undo_bytes(&self) -> usize {
        self.world.map_or(0, |world| world.data.undo)
    }

    /// Whether both results are the same.
    pub fn agrees(&self, other: &Self) -> bool {
        let facts =
            |ending: &Self| (ending.triangles, ending.world.map(|world| (world.hash, world.is_flawless)));
        facts(self) == facts(other)
    }
}
