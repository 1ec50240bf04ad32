//! Inside a tunnel: strata on the walls show the depth. And the mouth of one from outside, which fades into the dark.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::album::Album;
use crate::studio::Studio;

/// Digs a cutting, and from it a gallery into the ground; returns its mouth, bend and end.
pub fn dig(studio: &mut Studio) -> [Vec3; 3] {
    let noise = NoiseHeights { seed: 3, scale: 90.0, amplitude: 10.0, octaves: 4, ..default() };
    let ground = Ground::from_noise(128, 128, &noise)
        .and_then(|ground| ground.with_strata(&Strata::mine()))
        .expect("valid ground");
    studio.terrain(ground, GroundLook::default());
    let top = studio.height(64.0, 30.0);
    let mouth = Vec3::new(64.0, top + 1.0, 30.0);
    let deep = Vec3::new(64.0, top - 16.0, 74.0);
    let end = Vec3::new(84.0, top - 22.0, 104.0);
    studio.apply([
        Brush::dig(Shape::capsule(mouth, deep, 5.0)),
        Brush::dig(Shape::capsule(deep, end, 5.0)),
        Brush::dig(Shape::sphere(end, 8.0)),
    ]);
    [mouth, deep, end]
}

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    let [mouth, deep, end] = dig(studio);
    studio.look(mouth + Vec3::new(-7.0, 6.0, -10.0), mouth + Vec3::new(2.0, -7.0, 14.0));
    album.compare("cutting", &studio.picture());
    let lamp = PointLight { intensity: 3_000_000.0, range: 60.0, shadow_maps_enabled: false, ..default() };
    let lamp = studio.app.world_mut().spawn((lamp, Transform::from_translation(deep + Vec3::Y * 2.0))).id();
    studio.sky(40.0);
    studio.look(mouth.lerp(deep, 0.55) - Vec3::Y * 0.5, deep + (end - deep) * 0.25);
    album.compare("tunnel", &studio.picture());
    studio.app.world_mut().despawn(lamp);
    studio.sky(900.0);
    shoot_mouth(studio, album);
}

/// A tunnel that runs level into a hillside, and a trench with upright walls in front of it. At the tunnel's end the
/// sun shines in below the rim of the small world, which has no wall there.
fn shoot_mouth(studio: &mut Studio, album: &mut Album) {
    let hillside = |x: i32, z: i32| {
        let along = (f64::from(x) - 40.0 + 2.0 * (f64::from(z) / 7.0).sin()) / 24.0;
        20.0 + 22.0 * along.clamp(0.0, 1.0)
    };
    studio.terrain(Ground::from_fn(96, 96, hillside).expect("valid ground"), GroundLook::default());
    let (from, to) = (Vec3::new(44.0, 22.5, 48.0), Vec3::new(80.0, 22.5, 52.0));
    studio.apply([
        Brush::dig(Shape::capsule(from, to, 3.5)),
        Brush::dig(Shape::cuboid(Vec3::new(30.0, 18.0, 56.0), Vec3::new(5.0, 5.0, 3.0))),
    ]);
    studio.look(Vec3::new(24.0, 27.0, 44.0), Vec3::new(46.0, 21.0, 50.0));
    album.compare("mouth", &studio.picture());
}
