//! Lower and raise are inverse: each restores what the other changed.

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::Vec3;

use crate::measured::{assert_closed, bumpy, dug, heights, solid, terrain};
use crate::worlds::{random_brush, random_ground, random_lower_and_raise, world_count};

/// The largest stored density, in 1/256 voxel: it means "at least this far".
const FARTHEST: i32 = 32_767;

/// The density to which dig and add clamp, with the same meaning.
const DEPTH: i32 = 4 * 256;

#[test]
fn ground_lowered_far_and_raised_again_is_no_higher_than_before() {
    let mut terrain = terrain(Ground::flat(256, 256, 0.0).expect("valid"));
    let shape = Shape::sphere(Vec3::new(128.0, 0.0, 128.0), 70.0);
    for brush in [Brush::lower(shape, 64.0), Brush::raise(shape, 64.0)] {
        terrain.apply([&brush, &brush]);
    }
    for (x, z) in (40..=216).flat_map(|x| (40..=216).map(move |z| (x, z))) {
        let found = heights(terrain.world(), x, z, -90, 90);
        let is_back = found.len() == 1 && (-1.0..0.01).contains(&found[0]);
        assert!(is_back, "{found:?} instead of 0 at {x} {z}");
    }
    assert_closed(&terrain);
}

#[test]
fn a_cave_lowered_far_and_raised_again_is_as_large_as_before() {
    let mut terrain = dug(bumpy(3.0));
    let (before, volume) = (terrain.snapshot(), solid(terrain.world()));
    let shape = Shape::sphere(Vec3::new(31.0, 13.0, 31.0), 13.0);
    for _ in 0..3 {
        terrain.apply([Brush::lower(shape, 64.0), Brush::raise(shape, 64.0)]);
        assert_eq!(solid(terrain.world()), volume);
    }
    for (x, z) in (10..54).flat_map(|x| (10..54).map(move |z| (x, z))) {
        let (old, new) = (heights(&before, x, z, -5, 50), heights(terrain.world(), x, z, -5, 50));
        assert_eq!(old.len(), new.len(), "{x} {z}");
    }
    assert_closed(&terrain);
}

#[test]
fn a_pit_lowered_beyond_the_stored_range_is_filled_by_further_raising() {
    let mut terrain = terrain(Ground::flat(64, 64, 20.0).expect("valid"));
    let shape = Shape::sphere(Vec3::new(32.0, 20.0, 32.0), 10.0);
    let (lower, raise) = (Brush::lower(shape, 50.0), Brush::raise(shape, 50.0));
    terrain.apply([&lower; 5]);
    terrain.apply([&raise; 5]);
    let volume = solid(terrain.world());
    let floor = |terrain: &Terrain| terrain.world().height(32.0, 32.0).expect("inside");
    assert!(
        floor(&terrain) < 16.0,
        "the ground was not lowered beyond the stored range, at {}",
        floor(&terrain)
    );
    let mut last = volume;
    for _ in 0..24 {
        terrain.apply([Brush::raise(shape, 2.0)]);
        let now = solid(terrain.world());
        assert!(now >= last, "{now} after {last}");
        last = now;
    }
    assert!(floor(&terrain) > 20.0, "a pit is left, down to {}", floor(&terrain));
    assert_closed(&terrain);
}

/// Differences after a lower and a raise, in 1/256 voxel.
#[derive(Debug, Default)]
struct Found {
    /// Samples that were never clamped: their number, how many were restored exactly, and the largest difference.
    known: u64,
    exact: u64,
    worst: i32,
    /// Samples that a dig or an add had clamped, and the largest difference.
    dug: u64,
    worst_dug: i32,
    /// Samples at the largest stored density or beyond, and how many of them changed sides: as expected, or, where
    /// ground had been dug or built, the other way.
    clamped: u64,
    lost: u64,
    grown: u64,
}

fn densities(world: &World, within: LatticeBox) -> Vec<i32> {
    within.points().map(|at| world.samples().distance(at)).collect()
}

/// Lowers and raises again, or the other way round, and compares with the state before.
fn check_strokes(rng: &mut Rng, terrain: &mut Terrain, is_natural: bool, found: &mut Found, name: &str) {
    let (lower, raise) = random_lower_and_raise(rng, terrain.world().ground());
    let is_lowered = rng.bool();
    let (first, second) = if is_lowered { (&lower, &raise) } else { (&raise, &lower) };
    let count = [1, 1, 2, 3, 5][rng.usize(0..5)];
    let Ok(edit) = Edit::quantize(&lower) else { panic!("{lower:?}") };
    let within = edit.reach();
    let before = densities(terrain.world(), within);
    let mut is_clamped: Vec<bool> = before.iter().map(|density| density.abs() >= FARTHEST).collect();
    let mut cycles = Vec::new();
    for _ in 0..2 {
        for brush in [first, second].into_iter().flat_map(|brush| std::iter::repeat_n(brush, count)) {
            terrain.apply([brush]);
            let now = densities(terrain.world(), within);
            is_clamped.iter_mut().zip(now).for_each(|(is, density)| *is |= density.abs() >= FARTHEST);
        }
        cycles.push(densities(terrain.world(), within));
    }
    for (i, point) in within.points().enumerate() {
        let (old, new, again) = (before[i], cycles[0][i], cycles[1][i]);
        let (by, is_same) = ((new - old).abs(), (new < 0) == (old < 0));
        let what = || format!("{name} at {point}: {old} {new} {again}, {count} of {first:?}");
        if is_clamped[i] {
            found.clamped += 1;
            // A sample that was air before lowering is air again; one that was solid before raising is solid again.
            let is_lost = !is_same && (old < 0) == is_lowered;
            assert!(is_same || is_lost || !is_natural, "{}", what());
            found.lost += u64::from(is_lost);
            found.grown += u64::from(!is_same && !is_lost);
        } else if old.abs() == DEPTH && !is_natural {
            found.dug += 1;
            found.worst_dug = found.worst_dug.max(by);
            assert!(is_same, "{}", what());
        } else {
            found.known += 1;
            found.exact += u64::from(by == 0);
            found.worst = found.worst.max(by);
            assert!(by <= 2 && (is_same || by == 1), "{}", what());
        }
        // No drift: repeating it changes nothing more.
        assert!((again < 0) == (new < 0) || !is_natural, "{}", what());
    }
}

#[test]
fn lower_and_raise_restore_each_other() {
    let mut found = Found::default();
    for seed in 0..world_count(60) {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = match rng.u32(0..4) {
            0 => (Ground::flat(24, 24, [0.0, 3.5, 7.3][rng.usize(0..3)]).expect("valid"), 8),
            _ => random_ground(&mut rng, seed),
        };
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid");
        let is_natural = rng.bool();
        if !is_natural {
            let ground = terrain.world().ground();
            let brushes: Vec<Brush> = (0..4).map(|_| random_brush(&mut rng, ground)).collect();
            terrain.apply(&brushes);
        }
        check_strokes(&mut rng, &mut terrain, is_natural, &mut found, &format!("world {seed}"));
    }
    println!("{found:?}");
}
