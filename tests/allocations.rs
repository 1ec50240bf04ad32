//! Heap allocations of an edit: none while meshing, and a bounded number per transaction.

mod worlds;

use allocation_counter::measure;
use bevy_burrow::dense::{DenseGrid, DenseMesh, DenseMesher, Normals};
use bevy_burrow::lattice::{BrickPos, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::block::{Block, Mesher, Parts};
use bevy_burrow::terrain::World;
use glam::{IVec3, Vec3};

/// Runs `work` and counts its heap allocations.
fn count<T>(work: impl FnOnce() -> T) -> (Option<T>, u64) {
    let mut result = None;
    let allocations = measure(|| result = Some(work())).count_total;
    (result, allocations)
}

/// The blocks of all stored bricks and of their neighbours.
fn blocks(world: &World) -> Vec<Block> {
    let mut bricks: Vec<BrickPos> = world.bricks().map(|(brick, _)| brick).collect();
    bricks.sort_unstable_by_key(|brick| (brick.0.x, brick.0.z, brick.0.y));
    let last = IVec3::new(world.grid().width() - 1, i32::MAX, world.grid().depth() - 1);
    let inside = LatticeBox { min: IVec3::new(0, i32::MIN, 0), max: last };
    let cells = bricks.iter().filter_map(|brick| Some((*brick, brick.samples().intersection(inside)?)));
    cells
        .flat_map(|(brick, cells)| world.grid().chunks_of(cells).map(move |chunk| Block { brick, chunk }))
        .collect()
}

#[test]
fn repeated_meshing_does_not_allocate() {
    for seed in 0..20 {
        let terrain = worlds::random_world(&mut fastrand::Rng::with_seed(seed), seed);
        let (world, blocks) = (terrain.world(), blocks(terrain.world()));
        let (mut mesher, mut parts) = (Mesher::default(), Parts::default());
        let mesh = |mesher: &mut Mesher, parts: &mut Parts| {
            parts.clear();
            mesher.mesh(&world.view(), &blocks, parts);
        };
        mesh(&mut mesher, &mut parts);
        let drawn = parts.indices.len();
        let (_, allocations) = count(|| mesh(&mut mesher, &mut parts));
        assert_eq!((allocations, parts.indices.len()), (0, drawn), "world {seed}");
    }
}

#[test]
fn repeated_dense_meshing_does_not_allocate() {
    let mut rng = fastrand::Rng::with_seed(1);
    let (mut mesher, mut mesh) = (DenseMesher::new(), DenseMesh::default());
    for size in [[40, 33, 20], [70, 9, 9], [5, 70, 8]] {
        let samples: Vec<f32> = (0..size.iter().product()).map(|_| rng.f32() - 0.5).collect();
        let grid = DenseGrid::new(&samples, size).expect("a grid");
        mesher.mesh(grid, Normals::Gradient, &mut mesh);
        let (_, allocations) = count(|| mesher.mesh(grid, Normals::Gradient, &mut mesh));
        assert_eq!(allocations, 0, "{size:?}");
        assert!(mesh.indices.len() > 1000);
    }
}

#[test]
fn the_allocations_of_an_edit_are_bounded() {
    let mut terrain =
        Terrain::new(worlds::real_ground(), &TerrainSettings::default()).expect("valid settings");
    let mut most = [0; 2];
    for i in 0..60 {
        // Ten holes six times, a little deeper each time: from the second time on, bricks, mask and rings exist.
        let (x, z) = (100 + i % 10 * 40, 200 + i % 10 * 3);
        let height = terrain.world().ground().height(bevy_burrow::lattice::Column::new(x, z)) as f32 / 256.0;
        let place = Vec3::new(x as f32, height - 0.3 * (i / 10) as f32, z as f32);
        terrain.submit(Brush::dig(Shape::sphere(place, 4.0)));
        let transaction = terrain.begin().expect("a queued brush");
        let (commit, allocations) = count(|| transaction.run());
        let commit = commit.expect("it ran");
        assert!(!commit.meshes.chunks.is_empty());
        let most = &mut most[usize::from(i >= 10)];
        *most = allocations.max(*most);
        terrain.commit(commit).expect("no other commit");
    }
    let [fresh, dug] = most;
    println!(
        "the transaction of one radius-4 dig: at most {fresh} allocations on fresh ground, {dug} on dug ground"
    );
    // One brick and its part of the receipt for each of some thirty bricks, two buffers per chunk, and a few lists.
    assert!(fresh <= 175 && dug <= 175, "{fresh} and {dug} allocations");
}
