//! Extra data for each surface: built in the same task as the meshes, swapped in by the same commit.

use std::collections::BTreeMap;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use bevy::asset::RenderAssetUsages;
use bevy::ecs::system::SystemParam;
use bevy::platform::collections::HashSet;
use bevy::prelude::*;

use super::builder::{MeshBuilder, TileLights};
use super::new_mesh::PendingMesh;
use super::vertex_kind::VertexExtras;
use crate::lattice::{ChunkGrid, ItemCost, TilePos, parallel_map_into};
use crate::lod::{LodGrid, Node};
use crate::plugin::{BurrowSettings, ShownSurface};
use crate::surface::SurfaceMesh;
use crate::terrain::{DrawnCut, MeshKey, NodeUpdate, SurfaceDraft, Terrain};
use crate::world::sky::LitWorld;

/// A tile or chunk whose surface is built.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// The terrain's entity.
    pub terrain: Entity,
    /// Which tile or chunk.
    pub drawn: MeshKey,
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
        drawn: MeshKey,
    ) -> Self {
        let origin = match drawn {
            MeshKey::Tile(tile) => grid.tile_cells(tile).0.at(0),
            MeshKey::Chunk(chunk) => grid.origin(chunk),
        };
        Self { terrain, drawn, origin, size: grid.size(), voxel_size, revision }
    }
}

/// Changes the entity of a tile or chunk in the frame in which it shows its new surface.
pub type CommitAction = Box<dyn FnOnce(&mut EntityCommands) + Send + Sync>;

/// Builds extra data for each surface off-thread, and swaps it in with the mesh: colliders, or a navigation mesh.
///
/// [`build`](Self::build) runs in the task that makes the surface of a tile or chunk. The [`CommitAction`] that it
/// returns runs on the entity of that tile or chunk in the frame in which the mesh is swapped, on a server without
/// meshes too. Large transactions build several parts at a time on rayon's threads: a processor that uses rayon itself
/// should hold no lock while it does. If a processor panics, that part goes without its data, and an error is logged
/// once.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::plugin::{CommitAction, SurfaceProcessor, SurfaceProcessors, Part};
/// # use bevy_burrow::surface::SurfaceMesh;
/// #[derive(Component)]
/// struct Triangles(usize);
///
/// struct Counter;
///
/// impl SurfaceProcessor for Counter {
///     fn build(&self, _: &Part, surface: &SurfaceMesh) -> Option<CommitAction> {
///         let count = surface.indices.len() / 3;
///         Some(Box::new(move |entity| {
///             entity.try_insert(Triangles(count));
///         }))
///     }
/// }
///
/// # let mut app = App::new();
/// app.init_resource::<SurfaceProcessors>();
/// app.world_mut().resource_mut::<SurfaceProcessors>().add(Counter);
/// ```
pub trait SurfaceProcessor: Send + Sync + 'static {
    /// Whether there is anything to build for this part. A server does not assemble surfaces that no processor wants.
    fn wants(&self, part: &Part) -> bool {
        let _ = part;
        true
    }

    /// Builds the data for a new surface. Its positions are relative to the part's origin; it may be empty.
    fn build(&self, part: &Part, surface: &SurfaceMesh) -> Option<CommitAction>;
}

/// All surface processors. A processor that is added later is not called for surfaces that are already shown.
#[derive(Resource, Clone, Default)]
pub struct SurfaceProcessors {
    processors: Vec<Arc<dyn SurfaceProcessor>>,
    /// Terrains on which one of them panicked, for one message each.
    failed: Arc<Mutex<HashSet<Entity>>>,
}

impl SurfaceProcessors {
    /// Adds a processor.
    pub fn add(&mut self, processor: impl SurfaceProcessor) {
        self.processors.push(Arc::new(processor));
    }

    /// Whether there are no processors.
    pub fn is_empty(&self) -> bool {
        self.processors.is_empty()
    }

    /// Runs code of a processor. If it panics, an error is logged once for each terrain, and the ground is shown
    /// without its data.
    fn guarded<T>(&self, terrain: Entity, work: impl FnOnce() -> T) -> Option<T> {
        let done = catch_unwind(AssertUnwindSafe(work));
        if done.is_err() && self.failed.lock().unwrap_or_else(PoisonError::into_inner).insert(terrain) {
            error!(
                "a surface processor panicked on the terrain {terrain}; the ground is shown without its data"
            );
        }
        done.ok()
    }
}

impl fmt::Debug for SurfaceProcessors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SurfaceProcessors").field("count", &self.processors.len()).finish_non_exhaustive()
    }
}

/// The new surface of a tile or chunk, ready to be swapped in.
pub(in crate::plugin) struct BuiltSurface {
    pub drawn: MeshKey,
    pub mesh: Option<PendingMesh>,
    pub shown: ShownSurface,
    pub actions: Vec<CommitAction>,
    /// Whether it is drawn. Otherwise a coarser node, or one mesh for all of its node, is drawn in its place.
    pub is_drawn: bool,
}

/// The new mesh of a node.
pub(in crate::plugin) struct BuiltNode {
    pub node: Node,
    /// The node's own mesh; `None` if the node is drawn by its tile and chunks, or not at all.
    pub mesh: Option<Option<PendingMesh>>,
    /// Tile and chunks that are drawn from now on.
    pub shown: Vec<BuiltSurface>,
    /// Tile and chunks that are no longer drawn.
    pub hidden: Vec<MeshKey>,
}

impl BuiltNode {
    /// Meshes that are swapped for it.
    pub fn swaps(&self) -> usize {
        usize::from(self.mesh.is_some()) + self.shown.len()
    }

    /// The meshes that it shows.
    pub fn meshes(&mut self) -> impl Iterator<Item = &mut PendingMesh> {
        let own = self.mesh.iter_mut().flatten();
        own.chain(self.shown.iter_mut().filter_map(|shown| shown.mesh.as_mut()))
    }
}

impl BuiltSurface {
    /// Triangles in the mesh.
    pub fn triangles(&self) -> usize {
        self.mesh.as_ref().map_or(0, |mesh| mesh.triangles)
    }
}

/// The lattice point that positions of a node's mesh count from.
pub(in crate::plugin) fn node_origin(grid: ChunkGrid, node: Node) -> IVec3 {
    let TilePos { x, z } = node.tile();
    IVec3::new(x * grid.size(), 0, z * grid.size())
}

/// The app's use of surfaces: whether there are meshes, where they are kept, and which other data is built.
#[derive(SystemParam)]
pub(in crate::plugin) struct BuildSettings<'w> {
    assets: Option<Res<'w, Assets<Mesh>>>,
    processors: Res<'w, SurfaceProcessors>,
    settings: Res<'w, BurrowSettings>,
}

impl BuildSettings<'_> {
    /// A builder for a terrain's world as it is now.
    pub fn builder(&self, terrain: (Entity, &Terrain), extras: VertexExtras) -> SurfaceBuilder {
        let usages = self.assets.as_ref().map(|_| self.settings.mesh_usages);
        SurfaceBuilder::new(terrain, extras, usages, &self.processors)
    }
}

/// Builds meshes and extra data for the surfaces of one terrain, in a task.
#[derive(Clone)]
pub(in crate::plugin) struct SurfaceBuilder {
    terrain: Entity,
    voxel_size: f32,
    grid: ChunkGrid,
    /// The revision of the world that the surfaces belong to.
    pub revision: u64,
    /// `None` where there are no meshes.
    pub mesh_builder: Option<MeshBuilder>,
    processors: SurfaceProcessors,
}

impl SurfaceBuilder {
    /// A builder for the terrain's world as it is now.
    pub fn new(
        (entity, terrain): (Entity, &Terrain),
        extras: VertexExtras,
        mesh_usages: Option<RenderAssetUsages>,
        processors: &SurfaceProcessors,
    ) -> Self {
        let world = terrain.world();
        Self {
            terrain: entity,
            voxel_size: terrain.voxel_size(),
            grid: world.grid(),
            revision: world.revision(),
            mesh_builder: mesh_usages.map(|usages| MeshBuilder::new(world, extras, usages)),
            processors: processors.clone(),
        }
    }

    /// Whether surfaces have sky light.
    pub fn has_sky_light(&self) -> bool {
        self.mesh_builder.as_ref().is_some_and(MeshBuilder::has_sky_light)
    }

    /// This builder with surfaces lit by a world, if they have sky light.
    pub fn lit_by(mut self, lit: &Arc<LitWorld>) -> Self {
        if let Some(builder) = &mut self.mesh_builder {
            builder.light_by(lit);
        }
        self
    }

    /// Whether there is nothing to build.
    pub fn is_idle(&self) -> bool {
        self.mesh_builder.is_none() && self.processors.is_empty()
    }

    /// Builds everything for these surfaces; many are built in parallel. Where a cut is drawn, those that it does not
    /// show get no meshes.
    pub fn build_all(
        &self,
        drafts: Vec<(MeshKey, SurfaceDraft)>,
        drawn_cut: Option<&DrawnCut>,
    ) -> Vec<BuiltSurface> {
        let cost = if self.processors.is_empty() { ItemCost::Surface } else { ItemCost::Collider };
        let is_drawn = |tile| drawn_cut.is_none_or(|cut| cut.shows_parts(tile));
        if !self.has_sky_light() {
            return parallel_map_into(drafts, cost, |(drawn, draft)| {
                self.build((drawn, is_drawn(drawn.tile())), draft.is_empty(), || draft)
            });
        }
        // A tile and its chunks are lit together.
        let mut by_tile: BTreeMap<TilePos, Vec<(usize, MeshKey, SurfaceDraft)>> = BTreeMap::new();
        for (number, (drawn, draft)) in drafts.into_iter().enumerate() {
            by_tile.entry(drawn.tile()).or_default().push((number, drawn, draft));
        }
        let built = parallel_map_into(by_tile.into_iter().collect(), cost, |(tile, drafts)| {
            let mut lights = self.lights_over(tile);
            let build = |(number, drawn, draft): (usize, MeshKey, SurfaceDraft)| {
                (number, self.build_lit((drawn, is_drawn(tile)), draft.is_empty(), || draft, &mut lights))
            };
            drafts.into_iter().map(build).collect::<Vec<_>>()
        });
        let mut built: Vec<(usize, BuiltSurface)> = built.into_iter().flatten().collect();
        built.sort_unstable_by_key(|(number, _)| *number);
        built.into_iter().map(|(_, built)| built).collect()
    }

    fn lights_over(&self, tile: TilePos) -> TileLights<'_> {
        TileLights::new(self.mesh_builder.as_ref(), self.grid.tile_cells(tile))
    }

    /// Builds what these nodes are drawn with, in parallel.
    pub fn build_nodes(&self, updates: Vec<NodeUpdate>) -> Vec<BuiltNode> {
        parallel_map_into(updates, ItemCost::Surface, |update| {
            let NodeUpdate { node, mesh, shown, hidden } = update;
            let columns = LodGrid::new(self.grid, u8::MAX).columns(node);
            let build = |mesh: Arc<SurfaceMesh>| {
                let builder = self.mesh_builder.as_ref();
                let mesh = builder.and_then(|builder| builder.build_node(columns, node.stride(), &mesh));
                mesh.map(PendingMesh::new)
            };
            let shown = shown.into_iter();
            let shown = shown.map(|(drawn, draft)| self.build((drawn, true), draft.is_empty(), || draft));
            BuiltNode { node, mesh: mesh.map(build), shown: shown.collect(), hidden }
        })
    }

    /// Builds everything for one surface; no mesh if it is not drawn. `draft` is called only if something is built from
    /// it; otherwise `is_empty` says whether the surface is known to have no triangles.
    pub fn build(
        &self,
        (drawn, is_drawn): (MeshKey, bool),
        is_empty: bool,
        draft: impl FnOnce() -> SurfaceDraft,
    ) -> BuiltSurface {
        self.build_lit((drawn, is_drawn), is_empty, draft, &mut self.lights_over(drawn.tile()))
    }

    fn build_lit(
        &self,
        (drawn, is_drawn): (MeshKey, bool),
        is_empty: bool,
        draft: impl FnOnce() -> SurfaceDraft,
        lights: &mut TileLights,
    ) -> BuiltSurface {
        let part = &Part::new(self.terrain, self.voxel_size, self.grid, self.revision, drawn);
        let guarded = &self.processors;
        let wants = |processor: &&Arc<dyn SurfaceProcessor>| {
            guarded.guarded(part.terrain, || processor.wants(part)).unwrap_or(false)
        };
        let processors: Vec<_> = self.processors.processors.iter().filter(wants).collect();
        let mut built = BuiltSurface {
            drawn,
            mesh: None,
            shown: ShownSurface { revision: self.revision, is_empty },
            actions: Vec::new(),
            is_drawn,
        };
        let mesh_builder = self.mesh_builder.as_ref().filter(|_| is_drawn);
        if mesh_builder.is_none() && processors.is_empty() {
            return built;
        }
        let draft = draft();
        built.shown.is_empty = draft.is_empty();
        let surface = (!processors.is_empty()).then(|| draft.surface());
        let mesh =
            mesh_builder.and_then(|builder| builder.build(part.origin, &draft, surface.as_deref(), lights));
        built.mesh = mesh.map(PendingMesh::new);
        if let Some(surface) = &surface {
            let build = |processor: &Arc<dyn SurfaceProcessor>| {
                guarded.guarded(part.terrain, || processor.build(part, surface))
            };
            built.actions = processors.into_iter().filter_map(build).flatten().collect();
        }
        built
    }
}
