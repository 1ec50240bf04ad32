//! The committed world: ground, bricks, fields, mask and the surface parts that were meshed from them.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::edited_nodes::EditedNodes;
use super::meshes::Meshes;
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, TilePos, hash, shrink_if_sparse};
use crate::lod::Node;
use crate::surface::mask::Borders;
use crate::surface::tile::{self, Rings};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView, SeamChecker, SeamReport, SurfaceMesh, block};
use crate::volume::{Brick, Bricks, Fields, SampleView, UniformBricks};

/// The pool of uniform bricks is not cleaned up while it holds fewer kinds.
const FEW_KINDS: usize = 64;

/// Identifies a mesh of the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MeshKey {
    /// A tile of the heightmap.
    Tile(TilePos),
    /// A chunk of marching cubes.
    Chunk(ChunkPos),
}

impl MeshKey {
    /// The tile, or that over which the chunk lies.
    pub fn tile(self) -> TilePos {
        match self {
            Self::Tile(tile) => tile,
            Self::Chunk(chunk) => chunk.tile(),
        }
    }
}

/// A number that no other transaction, batch or world of this process has.
pub(crate) fn unique() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// A world at one revision.
#[derive(Clone)]
pub struct World {
    pub(crate) ground: Arc<Ground>,
    pub(crate) grid: ChunkGrid,
    pub(crate) bricks: Bricks,
    /// Brick heights (y) over each brick column (x, z), ascending.
    pub(crate) stacks: FxHashMap<(i32, i32), Vec<i32>>,
    pub(super) edited_nodes: EditedNodes,
    pub(crate) fields: FxHashMap<ChunkPos, Fields>,
    pub(crate) mask: Mask,
    pub(crate) meshes: Meshes,
    pub(crate) uniform: UniformBricks,
    /// With this many kinds, unused ones are removed from the pool.
    many_kinds: usize,
    pub(crate) sample_hash: u64,
    pub(crate) next_field: u64,
    /// Distinguishes worlds of one process.
    lineage: u64,
    pub(crate) revision: u64,
}

/// Identifies a world and its number of commits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    lineage: u64,
    revision: u64,
}

impl Version {
    /// Whether both are versions of one world, whatever was committed in between.
    #[cfg(any(feature = "plugin", feature = "store"))]
    pub(crate) fn is_same_world(self, other: Self) -> bool {
        self.lineage == other.lineage
    }
}

impl fmt::Debug for World {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("World")
            .field("ground", &self.ground)
            .field("chunk_size", &self.grid.size())
            .field("revision", &self.revision)
            .field("hash", &format_args!("{:#018x}", self.hash()))
            .finish_non_exhaustive()
    }
}

impl World {
    pub(crate) fn new(ground: Arc<Ground>, chunk_size: i32) -> Self {
        let grid = ChunkGrid::new(chunk_size, ground.width(), ground.depth());
        block::prepare();
        Self {
            ground,
            grid,
            bricks: Bricks::default(),
            stacks: FxHashMap::default(),
            edited_nodes: EditedNodes::default(),
            fields: FxHashMap::default(),
            mask: Mask::default(),
            meshes: Meshes::default(),
            uniform: UniformBricks::default(),
            many_kinds: FEW_KINDS,
            sample_hash: 0,
            next_field: 0,
            lineage: unique(),
            revision: 0,
        }
    }

    /// The pristine world.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// The pristine world, shared: for another terrain over it.
    pub fn shared_ground(&self) -> Arc<Ground> {
        Arc::clone(&self.ground)
    }

    /// The grid of chunks and tiles.
    #[doc(hidden)]
    pub fn grid(&self) -> ChunkGrid {
        self.grid
    }

    /// The cells that marching cubes draws.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Returns `true` if a node of the [quadtree](Self::lod_grid) contains bricks with edits.
    pub(crate) fn is_edited(&self, node: Node) -> bool {
        self.edited_nodes.contains(node)
    }

    /// The [version](EditedNodes::version) of the nodes with edits.
    pub(crate) fn edited_nodes_version(&self) -> u64 {
        self.edited_nodes.version()
    }

    /// Counts the commits.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Changes with each commit, and differs from that of every other world of this process.
    pub fn version(&self) -> Version {
        Version { lineage: self.lineage, revision: self.revision }
    }

    /// The samples, edited or not.
    pub fn samples(&self) -> SampleView<'_> {
        SampleView::new(&self.ground, &self.bricks)
    }

    /// The samples that the surface is extracted from.
    pub fn view(&self) -> WorldView<'_> {
        WorldView { samples: self.samples(), mask: MaskView::new(&self.mask), grid: self.grid }
    }

    /// Hash of the ground and of every edited sample. It does not depend on chunk size, on how edits were batched, nor
    /// on the machine.
    pub fn hash(&self) -> u64 {
        Self::hash_of(self.ground.hash(), self.sample_hash)
    }

    /// The hash of a world over a ground with this [hash](Ground::hash), whose [regions](Self::region_hash) have hashes
    /// with this sum, which wraps around.
    pub fn hash_of(ground: u64, regions: u64) -> u64 {
        hash::mix(ground ^ hash::mix(regions))
    }

    /// The fields of each chunk that has any, in no order.
    pub fn fields(&self) -> impl Iterator<Item = (ChunkPos, &Fields)> {
        self.fields.iter().map(|(&chunk, fields)| (chunk, fields))
    }

    /// The fields of one chunk.
    pub fn fields_of(&self, chunk: ChunkPos) -> Option<&Fields> {
        self.fields.get(&chunk)
    }

    /// The stored bricks, in no order.
    pub fn bricks(&self) -> impl Iterator<Item = (BrickPos, &Brick)> {
        self.bricks.iter().map(|(&pos, brick)| (pos, brick.as_ref()))
    }

    /// The chunks that draw something, in no order. Of a world that was restored, or whose terrain
    /// [never meshes](crate::terrain::Meshing::Never), some may turn out to draw nothing.
    pub fn drawn_chunks(&self) -> impl Iterator<Item = ChunkPos> {
        self.meshes.maybe_drawn()
    }

    /// The rings of a tile as it is drawn now: kept since the last edit nearby, or made from the undug ground.
    pub(crate) fn tile_rings(&self, tile: TilePos, borders: &Borders) -> Arc<Rings> {
        match self.meshes.rings.get(&tile) {
            Some(rings) => Arc::clone(rings),
            None if self.ground.steep_cells().is_some() || borders.has_bordering() => {
                Arc::new(Rings::new(&self.view(), tile, borders))
            }
            None => Arc::default(),
        }
    }

    /// The mesh of a tile, relative to its lowest column at y = 0; empty where the world has no tile.
    pub fn tile_mesh(&self, tile: TilePos) -> SurfaceMesh {
        tile::mesh(&self.view(), tile)
    }

    /// The mesh of a chunk, relative to its lowest lattice point; empty where it draws nothing.
    pub fn chunk_mesh(&self, chunk: ChunkPos) -> SurfaceMesh {
        let made = || self.unmeshed(chunk).map(|chunk| chunk.surface().mesh().clone());
        self.meshes
            .surfaces
            .get(chunk)
            .map(|surface| surface.mesh().clone())
            .or_else(made)
            .unwrap_or_default()
    }

    /// Where a mesh is placed: the lattice point that its positions count from.
    pub fn origin(&self, drawn: MeshKey) -> IVec3 {
        match drawn {
            MeshKey::Tile(tile) => self.grid.tile_cells(tile).0.at(0),
            MeshKey::Chunk(chunk) => self.grid.origin(chunk),
        }
    }

    /// Everything that is drawn: tiles, then chunks, each in order.
    pub fn drawn(&self) -> impl Iterator<Item = (MeshKey, SurfaceMesh)> {
        let mut chunks: Vec<ChunkPos> = self.drawn_chunks().collect();
        chunks.sort_unstable();
        let tiles = self.grid.tiles().map(|tile| (MeshKey::Tile(tile), self.tile_mesh(tile)));
        tiles.chain(chunks.into_iter().map(|chunk| (MeshKey::Chunk(chunk), self.chunk_mesh(chunk))))
    }

    /// Checks that everything that is drawn is one closed surface. Visits each triangle of the world.
    pub fn check_seams(&self) -> SeamReport {
        let mut checker = SeamChecker::default();
        for (drawn, mesh) in self.drawn() {
            checker.add(&mesh, self.origin(drawn));
        }
        checker.check(self.grid)
    }

    /// Sets the pool of uniform bricks. Once it holds twice as many kinds as were left the last time, those
    /// are dropped that nothing else refers to: no brick of this world, no history, no other world.
    pub(crate) fn set_uniform(&mut self, uniform: UniformBricks) {
        self.uniform = uniform;
        if self.uniform.len() >= self.many_kinds {
            self.uniform.retain(|_, brick| Arc::strong_count(brick) > 1);
            shrink_if_sparse(&mut self.uniform);
            self.many_kinds = FEW_KINDS.max(2 * self.uniform.len());
        }
    }

    /// Shrinks the tables of bricks, fields and surfaces where many entries are gone.
    pub(crate) fn shrink(&mut self) {
        shrink_if_sparse(&mut self.bricks);
        shrink_if_sparse(&mut self.stacks);
        shrink_if_sparse(&mut self.fields);
        self.meshes.shrink();
        self.mask.shrink_if_sparse();
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::MaterialId;
    use crate::terrain::{Terrain, TerrainSettings};
    use crate::world::Memory;

    /// A box around the brick from (8, 24, 8) to (15, 31, 15), `more` voxels larger on all sides.
    fn cube(more: f32) -> Shape {
        Shape::cuboid(Vec3::new(11.5, 27.5, 11.5), Vec3::splat(4.0 + more))
    }

    /// A block over the ground, so thick that its middle is a uniform brick.
    fn block() -> Terrain {
        let ground = Ground::flat(32, 32, 0.0).unwrap();
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).unwrap();
        terrain.apply([Brush::add(cube(4.0), MaterialId(0))]);
        assert_eq!(terrain.world().uniform.len(), 1);
        terrain
    }

    /// Paints the brick with one material after the other; returns the most kinds there were.
    fn paint(terrain: &mut Terrain, materials: std::ops::Range<u8>) -> usize {
        let kinds = materials.map(|id| {
            terrain.apply([Brush::paint(cube(0.0), MaterialId(id))]);
            terrain.world().uniform.len()
        });
        kinds.max().unwrap_or_default()
    }

    #[test]
    fn kinds_of_bricks_that_came_and_went_are_let_go_of() {
        let mut terrain = block();
        terrain.set_undo_budget(0);
        let (before, most) = (terrain.world().memory(), paint(&mut terrain, 1..250));
        assert!((2..=FEW_KINDS).contains(&most), "{most}");
        let bytes = |memory: Memory| (memory.samples / Brick::BYTES, memory.materials);
        let ((samples, materials), now) = (bytes(before), bytes(terrain.world().memory()));
        let more = terrain.world().uniform.len() - 1;
        assert_eq!(now, (samples + more, materials + more * 512));
    }

    #[test]
    fn kinds_that_history_holds_stay() {
        let mut terrain = block();
        assert_eq!(paint(&mut terrain, 1..100), 100);
        let hash = terrain.world().hash();
        assert_eq!((0..).take_while(|_| terrain.undo().outcome.is_ok()).count(), 100);
        assert!(terrain.world().bricks.is_empty());
        assert_eq!((0..).take_while(|_| terrain.redo().outcome.is_ok()).count(), 100);
        assert_eq!((terrain.world().hash(), terrain.world().uniform.len()), (hash, 100));
        // The brick is that of its kind.
        let middle = BrickPos(IVec3::new(1, 3, 1));
        let shared = terrain
            .world()
            .uniform
            .values()
            .filter(|kind| Arc::ptr_eq(kind, &terrain.world().bricks[&middle]));
        assert_eq!(shared.count(), 1);
        // Without history, they go.
        terrain.set_undo_budget(0);
        paint(&mut terrain, 100..200);
        assert!(terrain.world().uniform.len() <= FEW_KINDS);
    }
}
