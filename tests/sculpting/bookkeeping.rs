//! What holds for all sculpting operations: bounds, materials, receipts and hash.

use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Vec2, Vec3};

use crate::measured::{assert_closed, terrain};
use crate::worlds::{any_random_brush, random_ground, random_sculpting_brush, world_count};

#[test]
fn nothing_changes_outside_the_shape() {
    let (worlds, mut changed) = (world_count(60), 0);
    for seed in 0..worlds {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = random_ground(&mut rng, seed);
        let brushes: Vec<Brush> = (0..4).map(|_| any_random_brush(&mut rng, &ground)).collect();
        let brush = random_sculpting_brush(&mut rng, &ground);
        let Ok(edit) = Edit::quantize(&brush) else { panic!("{brush:?}") };
        let mut terrain =
            Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid");
        terrain.apply(&brushes);
        let before = terrain.snapshot();
        terrain.apply([&brush]);
        changed += u64::from(terrain.world().hash() != before.hash());
        let evaluator = edit.evaluator();
        for point in edit.reach().grown(2).points() {
            let (old, new) = (before.samples(), terrain.world().samples());
            let is_same = old.sample(point) == new.sample(point)
                && old.stored_material(point) == new.stored_material(point);
            assert!(is_same || evaluator.distance(point) <= 0, "world {seed} at {point}: {brush:?}");
            let is_kept =
                !new.is_edited(point) || old.is_edited(point) || old.distance(point) != new.distance(point);
            assert!(is_kept, "world {seed} at {point}: edited without a change");
        }
    }
    assert!(changed * 5 > worlds, "{changed} of {worlds} brushes changed something");
}

#[test]
fn new_ground_has_the_material_below_or_beside_it_or_the_given_one() {
    let mut terrain = terrain(Ground::flat(64, 64, 20.0).expect("valid"));
    let half = Vec3::new(40.0, 2.0, 64.0);
    terrain.apply([Brush::paint(Shape::cuboid(Vec3::new(0.0, 19.0, 32.0), half), MaterialId(5))]);
    let raise = |x: f32| Brush::raise(Shape::sphere(Vec3::new(x, 20.0, 32.0), 8.0), 4.0);
    let receipts = terrain.apply([raise(20.0), raise(52.0).with_material(MaterialId(7))]);
    let added: Vec<_> = receipts
        .iter()
        .map(|receipt| receipt.outcome.as_ref().expect("valid").added.iter().collect::<Vec<_>>())
        .collect();
    assert_eq!((added[0].len(), added[0][0].0), (1, MaterialId(5)));
    assert_eq!((added[1].len(), added[1][0].0), (1, MaterialId(7)));
    assert_eq!(terrain.world().samples().material(IVec3::new(20, 22, 32)), MaterialId(5));
    assert_eq!(terrain.world().samples().material(IVec3::new(52, 22, 32)), MaterialId(7));
    // In the air above nothing, it takes the nearest neighbour's material, here the ceiling's.
    let ceiling = Shape::cuboid(Vec3::new(32.0, 150.5, 32.0), Vec3::splat(6.0));
    terrain.apply([Brush::add(ceiling, MaterialId(2))]);
    let below = Vec3::new(32.0, 144.0, 32.0);
    terrain.apply([Brush::raise(Shape::sphere(below, 5.0), 2.0)]);
    assert_eq!(terrain.world().samples().material(IVec3::new(32, 143, 32)), MaterialId(2));
    // Ground that was lowered and raised again does not keep its former material.
    assert_closed(&terrain);
}

#[test]
fn receipts_of_sculpting_count_what_changed() {
    let mut sums = (0, 0);
    for seed in 0..40 {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = random_ground(&mut rng, seed);
        let mut terrain =
            Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid");
        for _ in 0..4 {
            let brush = random_sculpting_brush(&mut rng, terrain.world().ground());
            let Ok(edit) = Edit::quantize(&brush) else { panic!("{brush:?}") };
            let before = terrain.snapshot();
            let receipts = terrain.apply([&brush]);
            let Ok(applied) = &receipts[0].outcome else { continue };
            let (old, new) = (before.samples(), terrain.world().samples());
            let (mut added, mut removed) = (0, 0);
            for point in edit.reach().points() {
                match (old.is_solid(point), new.is_solid(point)) {
                    (true, false) => removed += 1,
                    (false, true) => added += 1,
                    _ => {}
                }
            }
            assert_eq!(
                (applied.added.total(), applied.removed.total()),
                (added, removed),
                "{seed}: {brush:?}"
            );
            sums = (sums.0 + added, sums.1 + removed);
        }
    }
    assert!(sums.0 > 200 && sums.1 > 200, "{sums:?} voxels were added and removed");
}

#[test]
fn the_hash_of_a_sculpted_world_is_the_same_on_every_machine() {
    let height =
        |x: i32, z: i32| f64::from((x * x * 7 + z * z * 5 + x * z * 3) % 97) / 12.0 + f64::from(x) / 4.0;
    let ground = Ground::from_fn(60, 60, height).expect("finite heights");
    let at = |x: i32, z: i32| {
        let y = ground.height(Column::new(x, z)) as f32 / 256.0;
        Vec3::new(x as f32 + 0.3, y, z as f32 - 0.2)
    };
    let image =
        GreyImage::from_samples(3, 3, vec![0, 9000, 65535, 3, 30_000, 7, 65535, 1, 0]).expect("9 samples");
    let stamp = Stamp::new(image, at(40, 40), Vec2::new(9.0, 11.0), 4.5).onto(Vec3::new(0.2, 1.0, 0.1));
    let ball = |x, z, radius| Shape::sphere(at(x, z), radius);
    let script = [
        Brush::dig(ball(12, 12, 7.0)),
        Brush::add(ball(30, 14, 6.0), MaterialId(2)),
        Brush::raise(ball(12, 14, 8.0), 1.3),
        Brush::smooth(ball(28, 12, 8.0), 0.8),
        Brush::sharpen(ball(16, 40, 9.0), 1.0),
        Brush::flatten(ball(44, 18, 8.0), at(44, 18), Vec3::new(0.4, 1.0, -0.3)),
        Brush::level(Shape::cone(at(20, 30), Vec3::Y * 14.0, 9.0), 14.4).with_strength(0.7),
        Brush::stamp(Shape::cuboid(at(40, 40), Vec3::splat(9.0)), stamp),
        Brush::terrace(ball(50, 50, 9.0), 2.5),
        Brush::lower(ball(30, 44, 7.0), 2.2).with_roughness(Roughness::new(1.0, 4.0, 5)),
    ];
    let mut terrain = terrain(ground);
    let receipts = terrain.apply(&script);
    for (receipt, brush) in receipts.iter().zip(&script) {
        assert!(receipt.outcome.as_ref().is_ok_and(|applied| applied.bounds.is_some()), "{brush:?}");
    }
    assert_closed(&terrain);
    assert_eq!(
        format!("{:#018x}", terrain.world().hash()),
        "0x210d2d631d1eb3de",
        "sculpting gives another hash than before, or than on other machines; saved journals would change too"
    );
}
