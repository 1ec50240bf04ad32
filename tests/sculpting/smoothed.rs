//! Smooth and sharpen.

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use glam::{IVec3, Vec3};

use crate::measured::{assert_closed, bumpy, crumbs, dug, roughness, solid, terrain};

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
        assert_eq!(terrain.world().bricks().count(), 0, "unchanged samples are not stored");
    }
}

#[test]
fn a_hundred_smooths_neither_hollow_out_nor_inflate() {
    let cliff = |x: i32, _| if x < 32 { 12.0 } else { 40.0 };
    for (name, mut terrain, most) in [
        ("bumps", terrain(bumpy(9.0)), 300),
        // Cave and shaft have 3,400 voxels, and smoothing fills them.
        ("dug", dug(bumpy(2.0)), 3400),
        ("cliff", terrain(Ground::from_fn(64, 64, cliff).expect("valid")), 300),
    ] {
        let within = LatticeBox::new(IVec3::new(14, 0, 14), IVec3::new(50, 55, 50)).expect("not empty");
        let (volume, loose) = (solid(terrain.world()), crumbs(terrain.world(), within));
        // The cylinder is tall enough not to undercut ground above it.
        let shape = Shape::cylinder(Vec3::new(32.0, 2.0, 32.0), Vec3::Y * 46.0, 12.0);
        for _ in 0..100 {
            terrain.apply([Brush::smooth(shape, 1.0)]);
        }
        let now = solid(terrain.world());
        // The cylinder has some 20,000 voxels.
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
