//! Flatten, level, stamp and terrace: operations with a given target surface.

use std::sync::Arc;

use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Vec2, Vec3};

use crate::measured::{CLOSE, assert_closed, bumpy, crossings, dug, heights, terrain};

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
                // Half a voxel inside the shape, so that both ends of each edge are inside.
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
    // The cave is on this side of the wall, the ground on the other.
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
