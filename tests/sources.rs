//! Grounds with a source: edits, receipts and meshes are those of the same heights in memory, wherever in the world.

mod worlds;

use bevy_burrow::ground::{ColumnGrid, FunctionSource, Ground, HeightSource};
use bevy_burrow::lattice::{ChunkPos, Column, TilePos};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::Applied;
use fastrand::Rng;
use glam::{IVec3, Vec3};
use worlds::{any_random_brush, random_ground, random_strata};

/// The heights of a ground in memory.
struct Copy(Vec<i32>, (i32, i32), i32);

impl Copy {
    fn of(ground: &Ground) -> Self {
        let columns = (0..=ground.depth()).flat_map(|z| (0..=ground.width()).map(move |x| Column::new(x, z)));
        let heights = columns.map(|column| ground.height(column)).collect();
        Self(heights, ground.height_range(), ground.width() + 1)
    }
}

impl HeightSource for Copy {
    fn id(&self) -> u64 {
        1
    }
    fn bounds(&self) -> (i32, i32) {
        self.1
    }
    fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]) {
        for (height, column) in heights.iter_mut().zip(grid.columns()) {
            *height = self.0[(column.z * self.2 + column.x) as usize];
        }
    }
}

fn terrain(ground: Ground, chunk_size: u32) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size, ..TerrainSettings::default() })
        .expect("valid settings")
}

#[test]
fn edits_give_equal_receipts_and_meshes() {
    for seed in 0..40 {
        let rng = &mut Rng::with_seed(seed);
        let (ground, chunk_size) = random_ground(rng, seed * 15 + 1);
        let (low, high) = ground.height_range();
        let strata = random_strata(rng, [low as f32 / 256.0 - 20.0, high as f32 / 256.0]);
        let copy = Copy::of(&ground);
        let made = Ground::from_source(ground.width() as u32, ground.depth() as u32, copy).expect("a size");
        let made = made.with_page_budget([0, 100_000, 1 << 26][seed as usize % 3]);
        let [made, expected] = [made, ground].map(|ground| match seed % 2 {
            0 => ground,
            _ => ground.with_strata(&strata).expect("valid strata"),
        });
        let brushes: Vec<Brush> = (0..12).map(|_| any_random_brush(rng, &expected)).collect();
        let [mut made, mut expected] = [made, expected].map(|ground| terrain(ground, chunk_size));
        for edits in brushes.chunks(4) {
            assert_eq!(made.apply(edits), expected.apply(edits), "world {seed}");
        }
        let drawn = |terrain: &Terrain| terrain.world().drawn().collect::<Vec<_>>();
        assert!(drawn(&made) == drawn(&expected), "meshes of world {seed}");
        assert!(made.world().check_seams().is_closed(), "world {seed}");
        for _ in 0..50 {
            let (x, z) = (rng.f64() * 60.0, rng.f64() * 60.0);
            assert_eq!(made.world().spans(x, z), expected.world().spans(x, z));
        }
    }
}

/// Cells along a side of the block of ground in which the same is dug here and at the far corner.
const BLOCK: i32 = 128;

fn bumps(x: i32, z: i32) -> f64 {
    f64::from((x * 7 + z * 3) % 13) / 2.0 + f64::from(x - z) / 9.0
}

/// A world that ends where the block does, `from` voxels along x and z.
fn world_with_block(from: i32) -> Terrain {
    let height = move |x: i32, z: i32| bumps((x - from).clamp(0, BLOCK), (z - from).clamp(0, BLOCK));
    let size = (from + BLOCK) as u32;
    let ground = Ground::from_source(size, size, FunctionSource::new(1, -40.0, 40.0, height));
    terrain(ground.expect("a size within the limit"), 32)
}

fn moved(applied: &Applied, by: i32) -> Applied {
    let mut applied = applied.clone();
    for scenario in &mut applied.chunks {
        scenario.chunk.x += by / 32;
        scenario.chunk.z += by / 32;
    }
    if let Some(bounds) = &mut applied.bounds {
        let by = IVec3::new(by, 0, by);
        (bounds.min, bounds.max) = (bounds.min + by, bounds.max + by);
    }
    applied
}

#[test]
fn digging_at_the_far_corner_is_digging_at_the_origin() {
    let away = Ground::MAX_SOURCE_SIZE as i32 - BLOCK;
    let rng = &mut Rng::with_seed(8);
    let [mut near, mut far] = [0, away].map(world_with_block);
    for step in 0..60 {
        // Places that `f32` holds there too.
        let sixteenths = |rng: &mut Rng, low: i32, high: i32| rng.i32(low * 16..=high * 16) as f32 / 16.0;
        let (x, z) = (sixteenths(rng, 40, BLOCK), sixteenths(rng, 40, BLOCK));
        let place = Vec3::new(x, bumps(x as i32, z as i32) as f32 + sixteenths(rng, -6, 3), z);
        let brush = |by: i32| {
            let place = place + Vec3::new(by as f32, 0.0, by as f32);
            match step % 5 {
                0 => Brush::add(Shape::sphere(place, 4.0), MaterialId(3)),
                1 => Brush::dig(Shape::capsule(place, place + Vec3::new(-6.0, -3.0, -5.0), 2.5)),
                2 => Brush::smooth(Shape::sphere(place, 5.0), 0.8),
                3 => Brush::flatten(Shape::cuboid(place, Vec3::splat(4.0)), place, Vec3::Y),
                _ => Brush::dig(Shape::sphere(place, 5.5)),
            }
        };
        let receipts = [near.apply([brush(0)]), far.apply([brush(away)])];
        let [here, there] = receipts.map(|receipts| receipts[0].outcome.clone().expect("accepted"));
        assert_eq!(moved(&here, away).bounds, there.bounds, "step {step}");
        assert_eq!((&here.removed, &here.added), (&there.removed, &there.added), "step {step}");
        let scenarios = |applied: &Applied| {
            applied.chunks.iter().map(|chunk| (chunk.chunk, chunk.scenario)).collect::<Vec<_>>()
        };
        assert_eq!(scenarios(&moved(&here, away)), scenarios(&there), "step {step}");
    }
    let (here, there) = (near.world(), far.world());
    let tiles = away / 32;
    for (x, z) in (1..4).flat_map(|z| (1..4).map(move |x| (x, z))) {
        let far = here.tile_mesh(TilePos { x, z }) == there.tile_mesh(TilePos { x: x + tiles, z: z + tiles });
        assert!(far, "tile {x} {z}");
        for y in -3..3 {
            let far = ChunkPos { x: x + tiles, y, z: z + tiles };
            assert!(here.chunk_mesh(ChunkPos { x, y, z }) == there.chunk_mesh(far), "chunk {x} {y} {z}");
        }
    }
    for _ in 0..500 {
        let [x, z] = [(); 2].map(|()| 34.0 + rng.f64() * f64::from(BLOCK - 34));
        let [x, z] = [x, z].map(|at| (at * 1024.0).round() / 1024.0);
        let away = f64::from(away);
        assert_eq!(here.spans(x, z).len(), there.spans(x + away, z + away).len(), "over ({x}, {z})");
        for (here, there) in here.spans(x, z).iter().zip(there.spans(x + away, z + away)) {
            assert!((here.floor - there.floor).abs() < 1e-6, "over ({x}, {z})");
        }
    }
}
