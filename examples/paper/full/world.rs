//! The whole terrain as one field with the hybrid's own mesher: a world whose mask holds every cell.

use bevy_burrow::brush::{Brush, Shape};
use bevy_burrow::ground::MaterialId;
use bevy_burrow::lattice::{BrickPos, LatticeBox, ONE, SNAP};
use bevy_burrow::surface::block::{Block, Mesher, Parts};
use bevy_burrow::surface::vertex::WorldView;
use bevy_burrow::surface::{Indices, Mask, MaskView, SeamChecker, SeamReport, SurfaceMesh, Vertex};
use bevy_burrow::terrain::{Memory, Receipt, Terrain, World};
use glam::{IVec3, Vec3};

use crate::edits::Scene;
use crate::error::PaperError;

/// Cells along a chunk's side: a multiple of the brick size, so that no block is cut.
const CHUNK_SIZE: u32 = 32;

/// A terrain with one vertex and one index buffer over all of it; no cell is drawn by the heightmap.
pub struct FullWorld {
    terrain: Terrain,
    /// A mask of every cell of the world. The terrain's own mask only has edited cells.
    mask: Mask,
    /// Every block of the cube, by stacks, from below.
    blocks: Vec<Block>,
    mesher: Mesher,
    /// The blocks' surfaces; their vertices form the vertex buffer.
    parts: Parts,
    indices: Vec<u32>,
}

impl FullWorld {
    /// The ground from y = 0 to the height of the cube, meshed once, so that all buffers are allocated.
    pub fn new(scene: &Scene) -> Result<Self, PaperError> {
        let terrain = scene.terrain(CHUNK_SIZE)?;
        let mut full = Self {
            mask: whole_mask(scene)?,
            blocks: blocks(terrain.world()),
            terrain,
            mesher: Mesher::default(),
            parts: Parts::default(),
            indices: Vec::new(),
        };
        full.remesh();
        Ok(full)
    }

    /// Runs the usual transaction, then rebuilds the whole mesh.
    pub fn edit(&mut self, brush: &Brush) -> Vec<Receipt> {
        let receipts = self.terrain.apply([brush]);
        self.remesh();
        receipts
    }

    /// Meshes every block into the buffers.
    fn remesh(&mut self) {
        let world = self.terrain.world();
        let view = WorldView { mask: MaskView::new(&self.mask), ..world.view() };
        self.parts.clear();
        self.indices.clear();
        self.mesher.mesh(&view, &self.blocks, &mut self.parts);
        // Each part's positions are relative to its chunk, and its indices to its own first vertex.
        let Parts { list, vertices, indices } = &mut self.parts;
        let (mut vertex, mut index) = (0, 0);
        for part in list {
            let origin = world.grid().origin(part.block.chunk) * SNAP;
            vertices[vertex..part.vertices].iter_mut().for_each(|vertex| vertex.position += origin);
            self.indices.extend(indices[index..part.indices].iter().map(|&at| vertex as u32 + u32::from(at)));
            (vertex, index) = (part.vertices, part.indices);
        }
    }

    pub fn world(&self) -> &World {
        self.terrain.world()
    }

    /// Bytes of the world's ground, samples and derived data.
    pub fn memory(&self) -> Memory {
        self.terrain.memory()
    }

    /// The vertex buffer; positions in 1/4096 voxel.
    pub fn vertices(&self) -> &[Vertex] {
        &self.parts.vertices
    }

    /// The index buffer.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// A copy of both buffers as a mesh.
    pub fn mesh(&self) -> SurfaceMesh {
        let indices = Indices::new(self.vertices().len(), self.indices.clone());
        SurfaceMesh { vertices: self.vertices().to_vec(), indices }
    }

    /// Bytes of both buffers.
    pub fn mesh_bytes(&self) -> usize {
        size_of_val(self.vertices()) + size_of_val(self.indices())
    }

    /// Checks that the mesh is a closed surface.
    pub fn check_seams(&self) -> SeamReport {
        let mut checker = SeamChecker::default();
        checker.add(&self.mesh(), IVec3::ZERO);
        checker.check(self.world().grid())
    }
}

/// A mask of all cells: that of a world that is painted all over.
fn whole_mask(scene: &Scene) -> Result<Mask, PaperError> {
    let mut painted = scene.terrain(CHUNK_SIZE)?;
    let (low, high) = scene.ground.height_range();
    let (low, high) = (low as f32 / ONE as f32, high as f32 / ONE as f32);
    let size = Vec3::new(scene.ground.width() as f32, high - low, scene.ground.depth() as f32);
    let everything = Shape::cuboid(size / 2.0 + Vec3::Y * low, size / 2.0 + 2.0);
    painted.apply([Brush::paint(everything, MaterialId(0))]);
    Ok(painted.world().mask().clone())
}

/// Every block of a cube as high as the world is wide.
fn blocks(world: &World) -> Vec<Block> {
    let grid = world.grid();
    let cube = LatticeBox { min: IVec3::ZERO, max: IVec3::new(grid.width(), grid.width(), grid.depth()) - 1 };
    let mut bricks: Vec<BrickPos> = BrickPos::covering(cube).collect();
    bricks.sort_unstable_by_key(|brick| (brick.0.x, brick.0.z, brick.0.y));
    let of_brick = |brick: BrickPos| {
        let cells = brick.samples().intersection(cube);
        cells
            .into_iter()
            .flat_map(move |cells| grid.chunks_of(cells))
            .map(move |chunk| Block { brick, chunk })
    };
    bricks.into_iter().flat_map(of_brick).collect()
}
