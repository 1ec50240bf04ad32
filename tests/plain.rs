//! The fast mesher against the reference mesher: the same vertices and triangles in every block, bit for bit.

mod worlds;

use bevy_burrow::lattice::{BrickPos, LatticeBox};
use bevy_burrow::surface::block::{Block, Mesher, Parts};
use bevy_burrow::surface::{Vertex, plain};
use bevy_burrow::terrain::World;
use glam::IVec3;

/// A vertex as bit patterns: 0.0 and -0.0 differ.
type Bits = ([i32; 3], [u32; 3], [u8; 4], [u8; 4]);

fn bits(vertex: &Vertex) -> Bits {
    let normal = vertex.normal.to_array().map(f32::to_bits);
    (vertex.position.to_array(), normal, vertex.materials.ids, vertex.materials.weights)
}

/// Triangles in a canonical order.
fn sorted(vertices: &[Vertex], indices: impl Iterator<Item = usize>) -> Vec<[Bits; 3]> {
    let corners: Vec<Bits> = indices.map(|index| bits(&vertices[index])).collect();
    let mut triangles: Vec<[Bits; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    triangles.sort_unstable();
    triangles
}

/// Every block that could draw something: all stored bricks and their neighbours.
fn blocks(world: &World) -> Vec<Block> {
    let grid = world.grid();
    let inside = LatticeBox {
        min: IVec3::new(0, i32::MIN, 0),
        max: IVec3::new(grid.width() - 1, i32::MAX, grid.depth() - 1),
    };
    let mut blocks = Vec::new();
    let sheets = world.mask().iter().flat_map(|cell| {
        let rows = bevy_burrow::surface::mask::cell_sheet(world.ground(), cell);
        rows.map(move |y| BrickPos::of(cell.at(y)))
    });
    for brick in world.bricks().map(|(brick, _)| brick).chain(sheets) {
        for i in 0..27 {
            let near = BrickPos(brick.0 + IVec3::new(i % 3, i / 3 % 3, i / 9) - 1);
            let Some(cells) = near.samples().intersection(inside) else { continue };
            blocks.extend(world.grid().chunks_of(cells).map(|chunk| (near.0.to_array(), near, chunk)));
        }
    }
    blocks.sort_unstable_by_key(|&([x, y, z], _, chunk)| (x, z, y, chunk));
    blocks.dedup();
    blocks.into_iter().map(|(_, brick, chunk)| Block { brick, chunk }).collect()
}

#[test]
fn every_block_equals_the_reference_meshers() {
    let count = worlds::world_count(200);
    let (mut triangles, mut parts, mut mesher) = (0, Parts::default(), Mesher::default());
    for seed in 0..count {
        let terrain = worlds::random_world(&mut fastrand::Rng::with_seed(seed), seed);
        let world = terrain.world();
        let view = world.view();
        let blocks = blocks(world);
        parts.clear();
        mesher.mesh(&view, &blocks, &mut parts);
        let mut drawn = 0;
        for (block, vertices, indices) in parts.iter() {
            let cells = block.brick.samples().intersection(world.grid().chunk_cells(block.chunk));
            let cells = cells.expect("blocks hold cells");
            let expected = plain::mesh(&view, block.brick, cells, world.grid().origin(block.chunk));
            let ours = sorted(vertices, indices.iter().map(|&index| usize::from(index)));
            let theirs = sorted(&expected.vertices, expected.indices.iter().map(|index| index as usize));
            if ours != theirs {
                let extra: Vec<_> = ours.iter().filter(|t| !theirs.contains(t)).take(2).collect();
                let missing: Vec<_> = theirs.iter().filter(|t| !ours.contains(t)).take(2).collect();
                println!("{} {}: extra {extra:?}\nmissing {missing:?}", ours.len(), theirs.len());
            }
            assert!(ours == theirs, "world {seed}, {block:?}: triangles differ from the reference mesher's");
            assert_eq!(
                vertices.len(),
                expected.vertices.len(),
                "world {seed}, {block:?}: vertices are shared"
            );
            drawn += ours.len();
        }
        let kept: usize = world.drawn_chunks().map(|chunk| world.chunk_mesh(chunk).indices.len() / 3).sum();
        assert_eq!(drawn, kept, "world {seed}: the world keeps the triangles of all its blocks");
        triangles += drawn;
    }
    assert!(triangles > 500 * count as usize, "too little was drawn: {triangles} triangles");
    println!("{count} worlds, {triangles} triangles");
}
