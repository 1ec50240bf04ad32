//! What sculpting does to ground: what each operation promises, measured on the surface itself.

mod worlds;

use std::sync::Arc;

use bevy_burrow::ground::GreyImage;
use bevy_burrow::lattice::{Column, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{IVec3, Vec2, Vec3};

/// A voxel's fraction that counts as on the spot.
const CLOSE: f64 = 1.0 / 16.0;

fn terrain(ground: Ground) -> Terrain {
    Terrain::new(ground, &TerrainSettings::default()).expect("valid settings")
}

/// Bumps a few voxels high, the same each time.
fn bumpy(high: f64) -> Ground {
    let mut rng = Rng::with_seed(4);
    let bumps: Vec<f64> = (0..65 * 65).map(|_| rng.f64() * high).collect();
    Ground::from_fn(64, 64, |x, z| 20.0 + bumps[(z * 65 + x) as usize]).expect("finite heights")
}

/// Ground with a cave, a shaft, a heap and a tower in it.
fn dug(ground: Ground) -> Terrain {
    let mut terrain = terrain(ground);
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    terrain.apply([
        Brush::dig(Shape::sphere(at(30.0, 12.0, 30.0), 9.0)),
        Brush::dig(Shape::cylinder(at(40.0, 8.0, 36.0), Vec3::Y * 30.0, 3.0)),
        Brush::add(Shape::sphere(at(22.0, 22.0, 40.0), 6.0), MaterialId(3)),
        Brush::add(Shape::cuboid(at(44.0, 26.0, 24.0), at(2.0, 9.0, 2.0)), MaterialId(4)),
    ]);
    terrain
}

/// Where along a line of samples the surface lies: each change of sides, by the densities beside it.
fn crossings(world: &World, from: IVec3, step: IVec3, count: i32) -> Vec<f64> {
    let samples = world.samples();
    let density = |i: i32| f64::from(samples.distance(from + step * i));
    let crossing = |i: i32| {
        let (a, b) = (density(i), density(i + 1));
        ((a < 0.0) != (b < 0.0)).then(|| f64::from(i) + a.abs() / (a.abs() + b.abs()))
    };
    (0..count).filter_map(crossing).collect()
}

/// The heights of the surface in a column between two heights.
fn heights(world: &World, x: i32, z: i32, low: i32, high: i32) -> Vec<f64> {
    let found = crossings(world, IVec3::new(x, low, z), IVec3::Y, high - low);
    found.into_iter().map(|along| f64::from(low) + along).collect()
}

fn solid(world: &World) -> u64 {
    let all = LatticeBox::new(IVec3::new(0, -10, 0), IVec3::new(64, 60, 64)).expect("not empty");
    world.samples().solid_count(all)
}

/// Parts of the solid in a box that touch neither its rim nor each other.
fn crumbs(world: &World, within: LatticeBox) -> usize {
    let samples = world.samples();
    let mut seen = std::collections::HashSet::new();
    let mut found = 0;
    for start in within.points().filter(|&point| samples.is_solid(point)) {
        if !seen.insert(start) {
            continue;
        }
        let (mut open, mut is_tied) = (vec![start], false);
        while let Some(point) = open.pop() {
            for step in [IVec3::X, IVec3::Y, IVec3::Z].into_iter().flat_map(|axis| [axis, -axis]) {
                let near = point + step;
                is_tied |= !within.contains(near);
                if within.contains(near) && samples.is_solid(near) && seen.insert(near) {
                    open.push(near);
                }
            }
        }
        found += usize::from(!is_tied);
    }
    found
}

/// Mean square of second differences of height: what a smooth takes away.
fn roughness(world: &World, from: i32, to: i32) -> f64 {
    let height = |x: i32, z: i32| heights(world, x, z, 0, 60).last().copied().expect("ground everywhere");
    let mut sum = 0.0;
    for (x, z) in (from..=to).flat_map(|x| (from..=to).map(move |z| (x, z))) {
        let around = height(x - 1, z) + height(x + 1, z) + height(x, z - 1) + height(x, z + 1);
        sum += (around - 4.0 * height(x, z)).powi(2);
    }
    sum / f64::from((to - from + 1).pow(2))
}

fn assert_closed(terrain: &Terrain) {
    let report = terrain.world().check_seams();
    assert!(report.is_flawless(), "{report}");
}

#[test]
fn flattened_ground_is_a_plane() {
    let point = Vec3::new(32.25, 21.5, 31.75);
    for normal in [Vec3::Y, Vec3::new(0.3, 1.0, -0.2), Vec3::new(-1.0, 1.1, 0.4)] {
        for mut terrain in [terrain(bumpy(6.0)), dug(bumpy(2.0))] {
            let shape = Shape::sphere(point, 9.0);
            for _ in 0..60 {
                terrain.apply([Brush::flatten(shape, point, normal)]);
            }
            let mut seen = 0;
            for (x, z) in (24..=40).flat_map(|x| (24..=40).map(move |z| (x, z))) {
                let from = point - Vec3::new(x as f32, 0.0, z as f32);
                let y = point.y + (normal.x * from.x + normal.z * from.z) / normal.y;
                let place = Vec3::new(x as f32, y, z as f32);
                // Half a voxel inside, so that both ends of each edge are.
                if place.distance(point) > 7.5 {
                    continue;
                }
                let low = (y - 1.0).floor() as i32;
                let found = heights(terrain.world(), x, z, low, low + 3);
                assert_eq!(found.len(), 1, "{normal} at {x} {z}");
                assert!((found[0] - f64::from(y)).abs() < CLOSE, "{normal} at {x} {z}: {} not {y}", found[0]);
                seen += 1;
            }
            assert!(seen > 60, "{seen}");
            assert_closed(&terrain);
        }
    }
}

#[test]
fn walls_and_ceilings_are_flattened_by_their_normals() {
    let mut terrain = dug(bumpy(2.0));
    let wall = Vec3::new(36.0, 12.0, 30.0);
    for _ in 0..40 {
        terrain.apply([Brush::flatten(Shape::sphere(wall, 5.0), wall, Vec3::NEG_X)]);
    }
    // The cave lies on this side of the wall, ground on the other.
    for (y, z) in (9..=15).flat_map(|y| (27..=33).map(move |z| (y, z))) {
        let found = crossings(terrain.world(), IVec3::new(34, y, z), IVec3::X, 4);
        assert_eq!(found.len(), 1);
        assert!((found[0] - 2.0).abs() < CLOSE, "{y} {z}: {found:?}");
        assert!(!terrain.world().samples().is_solid(IVec3::new(35, y, z)));
    }
    assert_closed(&terrain);
}

#[test]
fn level_ground_has_exactly_its_height() {
    for height in [20.0, 21.5, 22.0 + 77.0 / 256.0] {
        let mut terrain = terrain(bumpy(5.0));
        let middle = Vec3::new(30.0, height, 30.0);
        terrain.apply([Brush::level(Shape::sphere(middle, 12.0), height).with_falloff(2.0)]);
        for (x, z) in (23..=37).flat_map(|x| (23..=37).map(move |z| (x, z))) {
            let samples = terrain.world().samples();
            for y in [height.floor() as i32, height.floor() as i32 + 1] {
                let distance = samples.distance(IVec3::new(x, y, z));
                assert_eq!(distance, y * 256 - (height * 256.0) as i32, "{x} {y} {z}");
            }
        }
        assert_closed(&terrain);
    }
}

#[test]
fn what_was_raised_and_lowered_again_is_as_it_was() {
    let mut rng = Rng::with_seed(8);
    for mut terrain in [terrain(bumpy(6.0)), dug(bumpy(3.0))] {
        let before = terrain.snapshot();
        for _ in 0..8 {
            let middle = Vec3::new(24.0 + 16.0 * rng.f32(), 14.0 + 10.0 * rng.f32(), 24.0 + 16.0 * rng.f32());
            let (shape, by) =
                (Shape::sphere(middle, 4.0 + 6.0 * rng.f32()), [0.25, 1.0, 2.5][rng.usize(0..3)]);
            terrain.apply([Brush::raise(shape, by), Brush::lower(shape, by)]);
        }
        let (now, mut worst) = (terrain.world(), 0.0f64);
        for (x, z) in (10..54).flat_map(|x| (10..54).map(move |z| (x, z))) {
            let (old, new) = (heights(&before, x, z, -5, 50), heights(now, x, z, -5, 50));
            assert_eq!(old.len(), new.len(), "{x} {z}");
            old.iter().zip(&new).for_each(|(old, new)| worst = worst.max((old - new).abs()));
        }
        assert!(worst < CLOSE, "{worst}");
        assert_closed(&terrain);
    }
}

#[test]
fn raised_ground_is_higher_by_the_amount() {
    let ground = bumpy(4.0);
    let mut terrain = terrain(bumpy(4.0));
    let shape = Shape::cylinder(Vec3::new(32.0, 0.0, 32.0), Vec3::Y * 60.0, 10.0);
    let receipts = terrain.apply([Brush::raise(shape, 3.25)]);
    let applied = receipts[0].outcome.as_ref().expect("a valid brush");
    assert_eq!((applied.removed.total(), applied.painted.total()), (0, 0));
    for (x, z) in (28..=36).flat_map(|x| (28..=36).map(move |z| (x, z))) {
        let found = heights(terrain.world(), x, z, 0, 55);
        let expected = f64::from(ground.height(Column::new(x, z))) / 256.0 + 3.25;
        assert!(found.len() == 1 && (found[0] - expected).abs() < CLOSE, "{found:?} not {expected}");
    }
    // Beside the shape nothing has moved.
    for (x, z) in [(20, 32), (43, 32), (32, 21), (40, 40)] {
        let found = heights(terrain.world(), x, z, 0, 55);
        assert!((found[0] - f64::from(ground.height(Column::new(x, z))) / 256.0).abs() < CLOSE);
    }
    assert_closed(&terrain);
}

#[test]
fn a_cave_that_is_raised_again_and_again_closes_from_its_walls() {
    // Its middle was cut off at four voxels and would turn solid at once.
    let mut terrain = terrain(Ground::flat(64, 64, 40.0).expect("valid"));
    let middle = Vec3::new(32.0, 16.0, 32.0);
    terrain.apply([Brush::dig(Shape::sphere(middle, 10.0))]);
    let shape = Shape::cuboid(middle, Vec3::splat(14.0));
    let mut last = u64::MAX;
    for step in 1..=20 {
        terrain.apply([Brush::raise(shape, 0.5).with_falloff(1.0)]);
        let around = LatticeBox { min: IVec3::new(16, 0, 16), max: IVec3::new(48, 32, 48) };
        let air = around.volume() - terrain.world().samples().solid_count(around);
        let radius = 10.0 - 0.5 * f64::from(step);
        let expected = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        assert!(
            air <= last && (air as f64 - expected).abs() < 40.0 + 0.25 * expected,
            "{step}: {air}, {expected}"
        );
        last = air;
    }
    assert!(last < 20, "{last}");
    assert_closed(&terrain);
}

#[test]
fn smoothing_takes_roughness_away_and_little_ground() {
    let mut terrain = terrain(bumpy(5.0));
    let shape = Shape::cylinder(Vec3::new(32.0, 0.0, 32.0), Vec3::Y * 60.0, 14.0);
    let (rough, volume) = (roughness(terrain.world(), 26, 38), solid(terrain.world()));
    let mut last = rough;
    for _ in 0..6 {
        terrain.apply([Brush::smooth(shape, 1.0)]);
        let now = roughness(terrain.world(), 26, 38);
        assert!(now < last, "{now} after {last}");
        last = now;
    }
    assert!(last < rough / 50.0, "{rough} to {last}");
    assert!(solid(terrain.world()).abs_diff(volume) < 200, "{volume} to {}", solid(terrain.world()));
    assert_closed(&terrain);
}

#[test]
fn slopes_and_flat_ground_are_smooth_already() {
    for slope in [0.0, 0.4, -3.0] {
        let mut terrain =
            terrain(Ground::from_fn(64, 64, |x, _| 20.25 + slope * f64::from(x)).expect("valid"));
        let middle = Vec3::new(32.0, 20.0 + 32.0 * slope as f32, 32.0);
        for _ in 0..3 {
            let receipts = terrain.apply([
                Brush::smooth(Shape::sphere(middle, 10.0), 1.0),
                Brush::sharpen(Shape::sphere(middle, 10.0), 1.0),
            ]);
            assert!(receipts.iter().all(|receipt| receipt.outcome == Ok(Applied::default())), "{slope}");
        }
        assert_eq!(terrain.world().bricks().count(), 0, "nothing is edited where nothing changes");
    }
}

#[test]
fn a_hundred_smooths_neither_hollow_out_nor_inflate() {
    let cliff = |x: i32, _| if x < 32 { 12.0 } else { 40.0 };
    for (name, mut terrain, most) in [
        ("bumps", terrain(bumpy(9.0)), 300),
        // Cave and shaft hold 3,400 voxels, and close.
        ("dug", dug(bumpy(2.0)), 3400),
        ("cliff", terrain(Ground::from_fn(64, 64, cliff).expect("valid")), 300),
    ] {
        let within = LatticeBox::new(IVec3::new(14, 0, 14), IVec3::new(50, 55, 50)).expect("not empty");
        let (volume, loose) = (solid(terrain.world()), crumbs(terrain.world(), within));
        // Tall enough to undercut nothing that it does not reach.
        let shape = Shape::cylinder(Vec3::new(32.0, 2.0, 32.0), Vec3::Y * 46.0, 12.0);
        for _ in 0..100 {
            terrain.apply([Brush::smooth(shape, 1.0)]);
        }
        let now = solid(terrain.world());
        // The cylinder holds some 20,000 voxels.
        assert!(now.abs_diff(volume) < most, "{name}: {volume} to {now}");
        assert!(crumbs(terrain.world(), within) <= loose, "{name}: crumbs");
        assert_closed(&terrain);
    }
}

#[test]
fn sharpening_makes_edges_steeper_and_stays_in_bounds() {
    let hills = |x: i32, z: i32| 20.0 + 3.0 * (f64::from(x) * 0.45).sin() + 2.0 * (f64::from(z) * 0.5).cos();
    let mut terrain = terrain(Ground::from_fn(64, 64, hills).expect("valid"));
    let shape = Shape::cylinder(Vec3::new(32.0, 0.0, 32.0), Vec3::Y * 60.0, 14.0);
    let (rough, volume) = (roughness(terrain.world(), 26, 38), solid(terrain.world()));
    terrain.apply([Brush::sharpen(shape, 1.0), Brush::sharpen(shape, 1.0), Brush::sharpen(shape, 1.0)]);
    let sharper = roughness(terrain.world(), 26, 38);
    assert!(sharper > rough * 1.1, "{rough} to {sharper}");
    for _ in 0..100 {
        terrain.apply([Brush::sharpen(shape, 1.0)]);
    }
    assert!(solid(terrain.world()).abs_diff(volume) < 6000, "{volume} to {}", solid(terrain.world()));
    assert_closed(&terrain);
}

#[test]
fn a_stamp_leaves_the_heights_of_its_image() {
    let mut rng = Rng::with_seed(2);
    let hill =
        |i: u32, k: u32| ((f64::from(i) * 0.8).sin() * (f64::from(k) * 0.7).cos() * 0.5 + 0.5) * 65535.0;
    let samples: Vec<u16> = (0..9 * 7).map(|at| hill(at % 9, at / 9) as u16).collect();
    let image = Arc::new(GreyImage::from_samples(9, 7, samples).expect("63 samples"));
    for height in [5.0, -4.0] {
        let center = Vec3::new(30.0, 22.0 + rng.f32(), 31.0);
        let size = Vec2::new(24.0, 18.0);
        let mut terrain = terrain(bumpy(2.0));
        let stamp = Stamp::new(Arc::clone(&image), center, size, height);
        let shape = Shape::cuboid(center, Vec3::new(14.0, 12.0, 11.0));
        terrain.apply([Brush::stamp(shape, stamp)]);
        for (x, z) in (20..=40).flat_map(|x| (24..=38).map(move |z| (x, z))) {
            let along =
                |at: f32, middle: f32, side: f32, steps: f32| (at - middle + side / 2.0) / side * steps;
            let u = along(x as f32, center.x, size.x, 8.0).clamp(0.0, 7.999);
            let v = along(z as f32, center.z, size.y, 6.0).clamp(0.0, 5.999);
            let grey = |i: f32, k: f32| f32::from(image.grey(i as u32, k as u32)) / 65535.0;
            let row = |k: f32| grey(u.floor(), k) * (1.0 - u.fract()) + grey(u.floor() + 1.0, k) * u.fract();
            let relief = row(v.floor()) * (1.0 - v.fract()) + row(v.floor() + 1.0) * v.fract();
            let expected = f64::from(center.y + relief * height);
            let found = heights(terrain.world(), x, z, 8, 36);
            assert!(
                found.len() == 1 && (found[0] - expected).abs() < 0.125,
                "{x} {z}: {found:?} not {expected}"
            );
        }
        assert_closed(&terrain);
    }
}

#[test]
fn terraces_have_treads_at_every_step() {
    let mut terrain = terrain(Ground::from_fn(64, 64, |x, _| 10.0 + 0.4 * f64::from(x)).expect("valid"));
    let shape = Shape::cuboid(Vec3::new(32.0, 22.0, 32.0), Vec3::new(24.0, 30.0, 20.0));
    terrain.apply(vec![Brush::terrace(shape, 4.0); 4]);
    let mut on_tread = 0;
    for x in 14..=50 {
        let found = heights(terrain.world(), x, 32, 0, 50);
        assert_eq!(found.len(), 1);
        on_tread += u32::from((found[0] / 4.0 - (found[0] / 4.0).round()).abs() < CLOSE / 4.0);
    }
    assert!(on_tread >= 33, "{on_tread} of 37 columns");
    assert_closed(&terrain);
}

#[test]
fn nothing_changes_outside_the_shape() {
    for seed in 0..worlds::world_count(60) {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = worlds::random_ground(&mut rng, seed);
        let brushes: Vec<Brush> = (0..4).map(|_| worlds::any_random_brush(&mut rng, &ground)).collect();
        let brush = worlds::random_sculpting_brush(&mut rng, &ground);
        let Ok(edit) = Edit::quantize(&brush) else { panic!("{brush:?}") };
        let mut terrain =
            Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid");
        terrain.apply(&brushes);
        let before = terrain.snapshot();
        terrain.apply([&brush]);
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
}

#[test]
fn new_ground_is_what_lies_below_or_beside_it_or_what_it_is_told() {
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
    // In the air, over nothing: the nearest neighbour's, here the ceiling's.
    let ceiling = Shape::cuboid(Vec3::new(32.0, 150.5, 32.0), Vec3::splat(6.0));
    terrain.apply([Brush::add(ceiling, MaterialId(2))]);
    let below = Vec3::new(32.0, 144.0, 32.0);
    terrain.apply([Brush::raise(Shape::sphere(below, 5.0), 2.0)]);
    assert_eq!(terrain.world().samples().material(IVec3::new(32, 143, 32)), MaterialId(2));
    // What is lowered and raised again has forgotten what it was.
    assert_closed(&terrain);
}

#[test]
fn receipts_of_sculpting_count_what_changed() {
    for seed in 0..40 {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = worlds::random_ground(&mut rng, seed);
        let mut terrain =
            Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid");
        for _ in 0..4 {
            let brush = worlds::any_random_brush(&mut rng, terrain.world().ground());
            let Ok(edit) = Edit::quantize(&brush) else { continue };
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
        }
    }
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
        "sculpting gives other worlds than before, or than on other machines: saved journals would too"
    );
}
