//! Two terrains side by side agree on the column that they share.

use std::sync::Arc;

use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Quat, UVec3, Vec2, Vec3};

use crate::measured::terrain;
use crate::worlds;

const SIDE: i32 = 48;

/// A place near the shared column, in steps of 1/256 voxel.
fn place(rng: &mut Rng) -> Vec3 {
    let by = Vec3::new(rng.f32() * 8.0 - 4.0, rng.f32() * 10.0 - 5.0, rng.f32() * 40.0);
    ((Vec3::new(SIDE as f32, 20.0, 4.0) + by) * 256.0).round() / 256.0
}

/// A brush of those whose changes depend on their own sample only.
fn brush(rng: &mut Rng, grid: &ShapeGrid) -> Brush {
    let (at, to) = (place(rng), place(rng));
    let radius = 2.0 + rng.u8(..16) as f32 / 4.0;
    let turn = Quat::from_rotation_y(1.0) * Quat::from_rotation_x(0.5);
    let path = BrushPath::spline([(at, radius), (to, 2.0), (place(rng), 3.0)]);
    let material = MaterialId(rng.u8(..4));
    if rng.u8(..4) == 0 {
        return Brush::road(Corridor::new(path, 6.0, 6.0), 2.0).with_material(material);
    }
    let custom = match rng.u8(..3) {
        0 => Some(Brush::dig(path)),
        1 => Some(Brush::dig(Corridor::new(path, 3.0, 2.0))),
        _ => Some(Brush::dig(GridShape::new(grid.clone(), at).with_rotation(turn))),
    };
    let shape = match rng.u8(..3) {
        0 => Shape::sphere(at, radius),
        1 => Shape::turned_cuboid(at, Vec3::new(radius, 3.0, 4.0), turn),
        _ => Shape::cone(at, Vec3::new(0.5, 7.0, 1.0), radius),
    };
    let image = Arc::new(GreyImage::from_samples(3, 3, (0..9).map(|i| i * 7000).collect()).expect("nine"));
    let brush = match rng.u8(..7) {
        0 | 1 => Brush::dig(shape),
        2 => Brush::add(shape, material),
        3 => Brush::flatten(shape, at, Vec3::new(0.3, 1.0, 0.2)).with_material(material),
        4 => Brush::level(shape, at.y).with_material(material),
        5 => Brush::stamp(shape, Stamp::new(image, at, Vec2::new(6.0, 8.0), 3.0)).with_material(material),
        _ => Brush::reset(shape),
    };
    let brush = match custom.filter(|_| rng.bool()) {
        Some(custom) => Brush { custom: custom.custom, ..brush },
        None => brush,
    };
    match rng.u8(..3) {
        0 => brush.with_roughness(worlds::random_roughness(rng, 2.0)),
        _ => brush,
    }
}

#[test]
fn brushes_agree_on_the_column_that_two_terrains_share() {
    let height = |x: i32, z: i32| 20.0 + 3.0 * (f64::from(x) * 0.3).sin() + 2.0 * (f64::from(z) * 0.4).cos();
    let ground =
        |from: i32| Ground::from_fn(SIDE as u32, SIDE as u32, |x, z| height(x + from, z)).expect("finite");
    let grid = ShapeGrid::from_fn(UVec3::splat(13), |at| (at - 6).as_vec3().abs().max_element() - 4.0)
        .expect("valid");
    let mut edited = 0;
    for seed in 0..6 {
        let mut rng = Rng::with_seed(seed);
        let (mut left, mut right) = (terrain(ground(0)), terrain(ground(SIDE)));
        for _ in 0..25 {
            let brush = brush(&mut rng, &grid);
            if brush.custom.is_some() && matches!(brush.operation, Operation::Stamp { .. }) {
                continue;
            }
            left.apply([brush.clone()]);
            right.apply([brush.transformed(Quat::IDENTITY, Vec3::NEG_X * SIDE as f32, 1.0)]);
            for (y, z) in (0..50).flat_map(|y| (0..=SIDE).map(move |z| (y, z))) {
                let [own, other] = [(&left, SIDE), (&right, 0)].map(|(terrain, x)| {
                    let (samples, at) = (terrain.world().samples(), IVec3::new(x, y, z));
                    (samples.is_edited(at), samples.distance(at), samples.material(at))
                });
                assert_eq!(own, other, "seed {seed} at height {y}, {z} after {brush:?}");
                edited += usize::from(own.0);
            }
        }
    }
    assert!(edited > 5000, "{edited}");
}
