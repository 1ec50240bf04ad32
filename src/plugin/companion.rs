//! What else is made from surfaces: in the same task as the meshes, and shown in the same commit.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use bevy::prelude::*;

use super::ShownSurface;
use super::meshes::{Ready, Wardrobe};
use crate::lattice::ChunkGrid;
use crate::surface::SurfaceMesh;
use crate::terrain::{Drawn, SurfaceDraft};

/// A tile or chunk that a task works on.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// The terrain's entity.
    pub terrain: Entity,
    /// Which tile or chunk.
    pub drawn: Drawn,
    /// The lattice point that positions of its surface count from, in voxels of the terrain.
    pub origin: IVec3,
    /// Cells along its sides.
    pub size: i32,
    /// Metres along a voxel's side.
    pub voxel_size: f32,
    /// The revision of the world that its surface is of.
    pub revision: u64,
}

impl Part {
    pub(crate) fn new(
        terrain: Entity,
        voxel_size: f32,
        grid: ChunkGrid,
        revision: u64,
        drawn: Drawn,
    ) -> Self {
        let origin = match drawn {
            Drawn::Tile(tile) => grid.tile_cells(tile).0.at(0),
            Drawn::Chunk(chunk) => grid.origin(chunk),
        };
        Self { terrain, drawn, origin, size: grid.size(), voxel_size, revision }
    }
}

/// What a companion does to the entity of a tile or chunk, in the frame in which that shows its new surface.
pub type Attachment = Box<dyn FnOnce(&mut EntityCommands) + Send + Sync>;

/// Something that goes with the surfaces of tiles and chunks: colliders, a navigation mesh, grass.
///
/// A companion is asked in the task that also makes the meshes, off the main thread, whenever a terrain loads and
/// whenever a transaction changes a surface. What it hands back is done to the tile's or chunk's entity in the commit, in
/// one frame with the meshes or not at all. That holds on a server without meshes too. Where there are many parts, several
/// threads of rayon's ask at once: a companion that uses rayon itself should hold no lock meanwhile. One that panics makes
/// nothing for that part, and an error says so once.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::plugin::{Attachment, Companion, Companions, Part};
/// # use bevy_burrow::surface::SurfaceMesh;
/// #[derive(Component)]
/// struct Triangles(usize);
///
/// struct Counter;
///
/// impl Companion for Counter {
///     fn build(&self, _: &Part, surface: &SurfaceMesh) -> Option<Attachment> {
///         let count = surface.indices.len() / 3;
///         Some(Box::new(move |entity| {
///             entity.try_insert(Triangles(count));
///         }))
///     }
/// }
///
/// # let mut app = App::new();
/// app.init_resource::<Companions>();
/// app.world_mut().resource_mut::<Companions>().add(Counter);
/// ```
pub trait Companion: Send + Sync + 'static {
    /// Is there anything to build for this part? Without a taker, a server does not assemble the surface.
    fn wants(&self, part: &Part) -> bool {
        let _ = part;
        true
    }

    /// Builds what goes with a new surface, which is relative to the part's origin and may be empty.
    fn build(&self, part: &Part, surface: &SurfaceMesh) -> Option<Attachment>;
}

/// Everything that goes with surfaces. Terrains that have loaded already do not call late-comers.
#[derive(Resource, Clone, Default)]
pub struct Companions(Vec<Arc<dyn Companion>>);

impl Companions {
    /// Adds one more.
    pub fn add(&mut self, companion: impl Companion) {
        self.0.push(Arc::new(companion));
    }

    /// Is there none?
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl fmt::Debug for Companions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Companions").field("count", &self.0.len()).finish_non_exhaustive()
    }
}

/// What a task makes of surfaces.
#[derive(Clone)]
pub(super) struct Workshop {
    /// What meshes are made with, where meshes are made at all.
    pub wardrobe: Option<Wardrobe>,
    pub companions: Companions,
}

/// What a companion does must not take the ground along: one that panics makes nothing, and that is said once.
fn guarded<T>(work: impl FnOnce() -> T) -> Option<T> {
    let done = catch_unwind(AssertUnwindSafe(work));
    if done.is_err() {
        error_once!("a companion panicked; the ground is shown without what it was to make");
    }
    done.ok()
}

/// A tile or chunk, ready to be swapped in.
pub(super) struct Fresh {
    pub drawn: Drawn,
    pub mesh: Ready,
    pub shown: ShownSurface,
    pub attachments: Vec<Attachment>,
}

impl Workshop {
    /// Is there nothing to make?
    pub fn is_idle(&self) -> bool {
        self.wardrobe.is_none() && self.companions.is_empty()
    }

    /// Makes everything for a part whose surface `draft` gives. `is_empty` tells whether there are triangles, as far as
    /// that is known without it.
    pub fn make(&self, part: &Part, is_empty: bool, draft: impl FnOnce() -> SurfaceDraft) -> Fresh {
        let wants = |companion: &&Arc<dyn Companion>| guarded(|| companion.wants(part)).unwrap_or(false);
        let takers: Vec<_> = self.companions.0.iter().filter(wants).collect();
        let mut fresh = Fresh {
            drawn: part.drawn,
            mesh: None,
            shown: ShownSurface { revision: part.revision, is_empty },
            attachments: Vec::new(),
        };
        if self.wardrobe.is_none() && takers.is_empty() {
            return fresh;
        }
        let draft = draft();
        fresh.shown.is_empty = draft.is_empty();
        fresh.mesh = self.wardrobe.as_ref().and_then(|wardrobe| wardrobe.build(part.origin, &draft));
        if !takers.is_empty() {
            let surface = &draft.surface();
            let build = |taker: &Arc<dyn Companion>| guarded(|| taker.build(part, surface)).flatten();
            fresh.attachments = takers.into_iter().filter_map(build).collect();
        }
        fresh
    }
}
