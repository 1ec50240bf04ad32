//! What is drawn: 512 fields of 32x32x32, and their surfaces as the processor makes them.

use bevy_burrow::backend::interop::{BlockRange, SurfaceLayout};
use bevy_burrow::lattice::{BrickPos, SNAP};
use bevy_burrow::surface::block::{Block, Mesher, Parts};
use bevy_burrow::terrain::World;
use glam::IVec3;

#[path = "../../benches/backends/level.rs"]
#[allow(dead_code)]
mod level;

/// A world, the blocks that it draws, and their surfaces.
pub struct Scene {
    pub world: World,
    pub blocks: Vec<Block>,
    pub surfaces: Reference,
}

/// Surfaces in the form in which the mesh kernel writes them.
#[derive(Default)]
pub struct Reference {
    pub positions: Vec<[u16; 4]>,
    pub normals: Vec<[f32; 3]>,
    pub indices: Vec<u16>,
    pub ranges: Vec<BlockRange>,
}

/// Two worlds: each field dug once, and dug again.
pub fn scenes() -> [Scene; 2] {
    let level = level::Level::new();
    let mut terrain = level.terrain();
    [0, 1].map(|pass| {
        terrain.apply(level.brushes(pass, false));
        let world = terrain.world().clone();
        let blocks = blocks(&world);
        let surfaces = Reference::new(&world, &blocks);
        Scene { world, blocks, surfaces }
    })
}

/// Every block of every chunk that draws something, by stacks of bricks, each from below.
fn blocks(world: &World) -> Vec<Block> {
    let of_chunk = |chunk| {
        let bricks = BrickPos::covering(world.grid().chunk_samples(chunk));
        bricks.map(move |brick| Block { brick, chunk })
    };
    let mut blocks: Vec<Block> = world.drawn_chunks().flat_map(of_chunk).collect();
    blocks.sort_unstable_by_key(|Block { brick, chunk }| (brick.0.x, brick.0.z, brick.0.y, *chunk));
    blocks
}

impl Reference {
    fn new(world: &World, blocks: &[Block]) -> Self {
        let (view, mut parts, mut all) = (world.view(), Parts::default(), Self::default());
        Mesher::default().mesh(&view, blocks, &mut parts);
        for (block, vertices, indices) in parts.iter() {
            all.ranges.push(BlockRange {
                vertex: all.positions.len() as u32,
                vertices: vertices.len() as u32,
                index: all.indices.len() as u32,
                indices: indices.len() as u32,
            });
            // Vertices count from the chunk; the kernel's from the brick.
            let base = (block.brick.origin() - world.grid().origin(block.chunk)) * SNAP;
            let near = |at: IVec3| {
                let [x, y, z] = (at - base).to_array().map(|steps| steps as u16);
                [x, y, z, 0]
            };
            all.positions.extend(vertices.iter().map(|vertex| near(vertex.position)));
            all.normals.extend(vertices.iter().map(|vertex| vertex.normal.to_array()));
            all.indices.extend_from_slice(indices);
        }
        all
    }

    pub fn layout(&self) -> SurfaceLayout {
        SurfaceLayout::new(self.positions.len() as u64, self.indices.len() as u64)
    }
}
