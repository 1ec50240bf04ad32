//! Raise and lower.

use bevy_burrow::lattice::{Column, LatticeBox};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::measured::{CLOSE, assert_closed, bumpy, dug, heights, terrain};

#[test]
fn raising_and_lowering_restores_the_surface() {
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
    // Outside the shape nothing has moved.
    for (x, z) in [(20, 32), (43, 32), (32, 21), (40, 40)] {
        let found = heights(terrain.world(), x, z, 0, 55);
        assert!((found[0] - f64::from(ground.height(Column::new(x, z))) / 256.0).abs() < CLOSE);
    }
    assert_closed(&terrain);
}

#[test]
fn a_cave_that_is_raised_again_and_again_closes_from_its_walls() {
    // The middle of the cave was clamped at four voxels, and must not turn solid at once.
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
