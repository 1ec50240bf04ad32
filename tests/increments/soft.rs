//! Brushes whose falloff is wider than their shape is deep: the full change in the middle, and less around it.

use bevy_burrow::prelude::*;
use glam::{IVec3, Vec2, Vec3};

use crate::checked_terrain::CheckedTerrain;

/// Every shape, including one that is deepest along its axis and one that is deepest across it.
fn shapes(at: Vec3) -> [Shape; 8] {
    [
        Shape::sphere(at, 5.0),
        Shape::cuboid(at, Vec3::new(6.0, 3.0, 5.0)),
        Shape::capsule(at, at + Vec3::new(6.0, 1.0, 2.0), 3.5),
        Shape::cylinder(at - Vec3::Y * 6.0, Vec3::Y * 12.0, 3.0),
        Shape::cylinder(at - Vec3::Y * 2.0, Vec3::new(0.5, 4.0, 0.0), 8.0),
        Shape::cone(at - Vec3::Y * 3.0, Vec3::new(0.0, 14.0, 2.0), 4.0),
        Shape::cone(at - Vec3::Y, Vec3::new(1.0, 5.0, 0.0), 9.0),
        Shape::cone(at + Vec3::X * 8.0, Vec3::new(-15.0, 0.0, 0.0), 6.0),
    ]
}

fn operations(shape: Shape, at: Vec3) -> Vec<Brush> {
    let image =
        GreyImage::from_samples(3, 2, vec![0, 65_535, 9_000, 40_000, 1, 30_000]).expect("six samples");
    let stamp = |size: Vec2| Brush::stamp(shape, Stamp::new(image.clone(), at, size, 3.0));
    vec![
        Brush::raise(shape, 1.5),
        Brush::smooth(shape, 1.0),
        Brush::flatten(shape, at + Vec3::Y, Vec3::Y),
        Brush::flatten(shape, at, -Vec3::X),
        Brush::level(shape, at.y - 0.7),
        stamp(Vec2::new(4.0, 14.0)),
        stamp(Vec2::new(14.0, 4.0)),
    ]
}

#[test]
fn a_falloff_wider_than_the_shape_is_deep_ends_in_its_middle() {
    let at = Vec3::new(15.0, 12.0, 14.0);
    let ground =
        || Ground::from_fn(31, 29, |x, z| 12.0 + f64::from(x * 5 % 7 + z * 3 % 5) * 0.3).expect("finite");
    for (number, shape) in shapes(at).into_iter().enumerate() {
        let mut checked = CheckedTerrain::new(ground(), 16);
        for brush in operations(shape, at) {
            let what = format!("shape {number}, {:?}", brush.operation);
            // A falloff about as wide as the depth; a much wider one gives the same result.
            for falloff in [3.0, 64.0] {
                checked.apply(&[brush.clone().with_falloff(falloff)], &what);
            }
        }
    }
}

#[test]
fn the_full_change_is_made_in_the_middle_of_a_soft_brush() {
    let at = |y: f32| Vec3::new(16.0, y, 16.0);
    let middle = IVec3::new(16, 10, 16);
    for (shape, outwards) in [
        // A falloff as wide as the radius, and as wide as half the height.
        (Shape::cylinder(at(4.0), Vec3::Y * 12.0, 5.0), IVec3::X),
        (Shape::cylinder(at(7.0), Vec3::Y * 6.0, 9.0), IVec3::Y),
        // A ball of radius 3 touches the base and the side of a cone whose section has sides of 6, 8 and 10.
        (Shape::cone(at(7.0), Vec3::Y * 8.0, 6.0), IVec3::X),
    ] {
        let ground = Ground::flat(32, 32, 10.0).expect("valid ground");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        terrain.apply([Brush::raise(shape, 2.0).with_falloff(64.0)]);
        let world = terrain.world();
        let change = |point: IVec3| world.samples().distance(point) - world.ground().distance(point);
        assert_eq!(change(middle), -512, "{shape:?}");
        let near = [outwards, -outwards].map(|way| change(middle + way));
        assert!(near.iter().all(|change| (-511..0).contains(change)), "{shape:?}: {near:?}");
    }
}
