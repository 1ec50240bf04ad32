//! The committed world: ground, bricks, fields, mask and the surface parts that were meshed from them.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::IVec3;
use rustc_hash::FxHashMap;

use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, TilePos, hash};
use crate::surface::block::Part;
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView, SeamReport, SeamSoup, SurfaceMesh, tile};
use crate::volume::{Brick, Bricks, Fields, SampleView};

/// The surface parts of one chunk, one for each block that shows something, in order of their bricks (y, z, x).
#[derive(Clone, Debug, Default)]
pub struct ChunkSurface(BTreeMap<[i32; 3], Arc<Part>>);

impl ChunkSurface {
    /// Puts the part of a block in place of its old one; says whether that is another one.
    pub(super) fn replace(&mut self, brick: BrickPos, part: Part) -> bool {
        let key = [brick.0.y, brick.0.z, brick.0.x];
        if part.indices.is_empty() {
            return self.0.remove(&key).is_some();
        }
        if self.0.get(&key).is_some_and(|old| **old == part) {
            return false;
        }
        self.0.insert(key, Arc::new(part));
        true
    }

    /// Does the chunk draw nothing?
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The chunk's mesh: its parts one after the other.
    pub fn mesh(&self) -> SurfaceMesh {
        let mut mesh = SurfaceMesh {
            vertices: Vec::with_capacity(self.0.values().map(|part| part.vertices.len()).sum()),
            indices: Vec::with_capacity(self.0.values().map(|part| part.indices.len()).sum()),
        };
        for part in self.0.values() {
            mesh.append(&part.vertices, &part.indices);
        }
        mesh
    }

    fn bytes(&self) -> usize {
        self.0.values().map(|part| part.bytes() + size_of::<Part>()).sum()
    }
}

/// Something that is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Drawn {
    /// A tile of the heightmap.
    Tile(TilePos),
    /// A chunk of marching cubes.
    Chunk(ChunkPos),
}

/// Bytes that a world takes, Bevy's meshes not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Heights and material control.
    pub ground: usize,
    /// Samples and materials of bricks.
    pub bricks: usize,
    /// Mask, fields and indices.
    pub index: usize,
    /// Surface parts kept for assembly.
    pub surfaces: usize,
}

impl Memory {
    /// What edits cost: all but the ground.
    pub fn edits(&self) -> usize {
        self.bricks + self.index + self.surfaces
    }
}

/// A world at one revision.
#[derive(Clone)]
pub struct World {
    pub(super) ground: Arc<Ground>,
    pub(super) grid: ChunkGrid,
    pub(super) bricks: Bricks,
    /// Brick heights (y) over each brick column (x, z), ascending.
    pub(super) stacks: FxHashMap<(i32, i32), Vec<i32>>,
    pub(super) fields: FxHashMap<ChunkPos, Fields>,
    pub(super) mask: Mask,
    pub(super) surfaces: FxHashMap<ChunkPos, Arc<ChunkSurface>>,
    pub(super) sample_hash: u64,
    pub(super) next_field: u64,
    /// Tells worlds of one process apart.
    lineage: u64,
    pub(super) revision: u64,
}

/// Which world, and how many commits old.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    lineage: u64,
    revision: u64,
}

impl World {
    pub(super) fn new(ground: Arc<Ground>, chunk_size: i32) -> Self {
        let grid = ChunkGrid::new(chunk_size, ground.width(), ground.depth());
        Self {
            ground,
            grid,
            bricks: Bricks::default(),
            stacks: FxHashMap::default(),
            fields: FxHashMap::default(),
            mask: Mask::default(),
            surfaces: FxHashMap::default(),
            sample_hash: 0,
            next_field: 0,
            lineage: super::unique(),
            revision: 0,
        }
    }

    /// The pristine world.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// How the world is cut into chunks.
    pub fn grid(&self) -> ChunkGrid {
        self.grid
    }

    /// The cells that marching cubes draws.
    pub fn mask(&self) -> &Mask {
        &self.mask
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

    /// What the surface is made from.
    pub fn view(&self) -> WorldView<'_> {
        WorldView { samples: self.samples(), mask: MaskView::new(&self.mask), grid: self.grid }
    }

    /// Hash of the ground and of every edited sample. It does not depend on chunk size, on how edits were batched, nor on
    /// the machine.
    pub fn hash(&self) -> u64 {
        hash::mix(self.ground.hash() ^ hash::mix(self.sample_hash))
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

    /// The chunks that draw something, in no order.
    pub fn drawn_chunks(&self) -> impl Iterator<Item = ChunkPos> {
        self.surfaces.keys().copied()
    }

    /// The mesh of a tile, relative to its lowest column at y = 0.
    pub fn tile_mesh(&self, tile: TilePos) -> SurfaceMesh {
        tile::mesh(&self.view(), tile)
    }

    /// The mesh of a chunk, relative to its lowest lattice point; empty where it draws nothing.
    pub fn chunk_mesh(&self, chunk: ChunkPos) -> SurfaceMesh {
        self.surfaces.get(&chunk).map(|surface| surface.mesh()).unwrap_or_default()
    }

    /// Where a mesh is placed: the lattice point that its positions count from.
    pub fn origin(&self, drawn: Drawn) -> IVec3 {
        match drawn {
            Drawn::Tile(tile) => self.grid.tile_cells(tile).0.at(0),
            Drawn::Chunk(chunk) => self.grid.origin(chunk),
        }
    }

    /// Everything that is drawn: tiles, then chunks, each in order.
    pub fn drawn(&self) -> impl Iterator<Item = (Drawn, SurfaceMesh)> {
        let mut chunks: Vec<ChunkPos> = self.drawn_chunks().collect();
        chunks.sort_unstable();
        let tiles = self.grid.tiles().map(|tile| (Drawn::Tile(tile), self.tile_mesh(tile)));
        tiles.chain(chunks.into_iter().map(|chunk| (Drawn::Chunk(chunk), self.chunk_mesh(chunk))))
    }

    /// Is everything that is drawn one closed surface? Looks at each triangle of the world.
    pub fn check_seams(&self) -> SeamReport {
        let mut soup = SeamSoup::default();
        for (drawn, mesh) in self.drawn() {
            soup.add(&mesh, self.origin(drawn));
        }
        soup.check(self.grid)
    }

    /// Bytes that the world takes.
    pub fn memory(&self) -> Memory {
        let stacks: usize = self.stacks.values().map(|stack| stack.capacity() * 4 + 32).sum();
        let fields: usize = self.fields.values().map(|fields| fields.len() * 48 + 32).sum();
        Memory {
            ground: self.ground.bytes(),
            bricks: self.bricks.len() * Brick::BYTES,
            index: stacks + fields + self.mask.bytes() + self.bricks.capacity() * 24,
            surfaces: self.surfaces.values().map(|surface| surface.bytes()).sum(),
        }
    }
}
