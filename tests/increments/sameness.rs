//! The result does not depend on batching or threads, and the reported memory is what is actually freed.

use bevy_burrow::lattice::{ChunkPos, TilePos};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::volume::Brick;
use fastrand::Rng;

use crate::bits::{MeshBits, mesh_bits};
use crate::play::{any_brush, any_ground, any_place};
use crate::worlds::{random_brush, random_ground, world_count};

#[test]
fn results_do_not_depend_on_batches_or_threads() {
    let pools = [1, 3].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads"));
    for seed in 0..world_count(30) / 3 {
        let run = |pool: &rayon::ThreadPool, batch: usize| {
            let mut rng = Rng::with_seed(seed);
            let (ground, chunk_size) = any_ground(&mut rng, seed);
            let brushes: Vec<Brush> = (0..12)
                .map(|i| {
                    let place = any_place(&mut rng, &ground);
                    any_brush(&mut rng, place, if i % 4 == 0 { 9.0 } else { 3.0 })
                })
                .collect();
            let settings = TerrainSettings { chunk_size, ..Default::default() };
            let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
            pool.install(|| brushes.chunks(batch).for_each(|brushes| drop(terrain.apply(brushes))));
            let world = terrain.world();
            let meshes: Vec<MeshBits> = world.drawn().map(|(_, mesh)| mesh_bits(&mesh)).collect();
            (world.hash(), meshes)
        };
        let first = run(&pools[0], 1);
        for (pool, batch) in [(0, 12), (1, 1), (1, 5)] {
            let other = run(&pools[pool], batch);
            assert_eq!(first.0, other.0, "world {seed}: hash of batches of {batch}");
            assert!(first.1 == other.1, "world {seed}: meshes of batches of {batch}");
        }
    }
}

#[test]
fn the_reported_memory_is_what_dropping_a_terrain_frees() {
    for seed in 0..24 {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = random_ground(&mut rng, seed);
        let brushes: Vec<Brush> = (0..10).map(|_| random_brush(&mut rng, &ground)).collect();
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        brushes.iter().for_each(|brush| drop(terrain.apply([brush])));
        // Undo and redo may leave spare capacity in lists, which has to be reported as well.
        (0..seed % 4 * 3).for_each(|_| drop(terrain.undo()));
        (0..seed % 3).for_each(|_| drop(terrain.redo()));
        let reported = terrain.memory();
        let blocks = reported.samples / Brick::BYTES + terrain.world().drawn().count() + 2;
        let given_back = allocation_counter::measure(|| drop(terrain)).bytes_current.unsigned_abs() as usize;
        // Two reference counts precede each shared allocation; the rest are the terrain's own lists.
        let least = reported.total();
        assert!((least..=least + blocks * 16 + 2048).contains(&given_back), "{given_back}, not {reported:?}");
    }
}

#[test]
fn tiles_and_chunks_that_the_world_does_not_have_are_empty() {
    let terrain = Terrain::new(Ground::flat(40, 33, 0.0).expect("valid"), &TerrainSettings::default());
    let world = terrain.expect("valid settings");
    for (x, z) in [(2, 0), (0, 2), (-1, 0), (0, -3), (5, 5), (i32::MAX, i32::MIN), (i32::MIN, 0)] {
        assert_eq!(world.world().tile_mesh(TilePos { x, z }), SurfaceMesh::default());
        assert_eq!(world.world().chunk_mesh(ChunkPos { x, y: 0, z }), SurfaceMesh::default());
    }
}
