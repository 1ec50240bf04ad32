//! A landscape: grass, rock, sand and snow over hills, with a quarry in the foreground.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::album::Album;
use crate::studio::Studio;

/// The camera's position, as x, metres above the ground and z, and its target relative to the pit.
const EYE: Vec3 = Vec3::new(128.0, 22.0, 60.0);
const AT: Vec3 = Vec3::new(-8.0, 2.0, 22.0);

/// Grass, with snow on the tops, sand in the valleys and rock on slopes.
pub fn materials() -> MaterialControl {
    let snow = MaterialRule {
        overlay: MaterialId(3),
        height: (22.0, f64::INFINITY),
        height_fade: 8.0,
        slope: (0.0, 1.0),
        slope_fade: 0.5,
    };
    let sand = MaterialRule {
        overlay: MaterialId(2),
        height: (f64::NEG_INFINITY, -20.0),
        height_fade: 5.0,
        slope: (0.0, 0.5),
        slope_fade: 0.4,
    };
    let grass = MaterialRule { overlay: MaterialId(1), slope: (0.0, 0.85), slope_fade: 0.4, ..default() };
    MaterialControl::Rules { base: MaterialId(0), rules: vec![snow, sand, grass] }
}

/// Hills with these materials.
pub fn hills(side: u32) -> Ground {
    let noise = NoiseHeights { seed: 5, scale: 130.0, amplitude: 46.0, octaves: 6, ..default() };
    Ground::from_noise(side, side, &noise)
        .and_then(|ground| ground.with_materials(&materials()))
        .expect("valid ground")
}

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    studio.terrain(hills(256), GroundLook::default());
    let place = |studio: &mut Studio, x: f32, z: f32, up: f32| Vec3::new(x, studio.height(x, z) + up, z);
    let pit = place(studio, 128.0, 128.0, 0.0);
    studio.apply([
        Brush::dig(Shape::sphere(pit, 11.0)),
        Brush::dig(Shape::sphere(pit - Vec3::Y * 5.0, 9.0)),
        Brush::add(Shape::sphere(pit + Vec3::new(15.0, 1.0, 4.0), 4.0), MaterialId(11)),
    ]);
    let eye = place(studio, EYE.x, EYE.z, EYE.y);
    studio.look(eye, pit + AT);
    album.compare("landscape", &studio.picture());
    // The landscape with the low quality settings.
    studio.one::<GroundLook>().quality = GroundQuality::Low;
    album.compare("landscape_low", &studio.picture());
}
