//! Sections through the presets of strata.

use bevy_burrow::lattice::{Column, ONE};
use bevy_burrow::prelude::*;
use glam::{IVec3, Vec2};

use crate::canvas::Canvas;

/// Voxels along the section, and from the highest ground to its lower end.
const LENGTH: i32 = 96;
const DEPTH: i32 = 44;

/// Name and colour of each material of the default `GroundLook`.
const MATERIALS: [(&str, &str); 14] = [
    ("rock", "#8d8a86"),
    ("grass", "#6f9a4a"),
    ("sand", "#dcc48e"),
    ("snow", "#f2f5f8"),
    ("clay", "#b5714f"),
    ("concrete", "#c3c0ba"),
    ("coal", "#2b2b2e"),
    ("gold", "#e3b62b"),
    ("soil", "#6a4c33"),
    ("sandstone", "#cfa06a"),
    ("shale", "#5d6672"),
    ("gravel", "#a9a498"),
    ("iron", "#a04a2c"),
    ("copper", "#3f9c86"),
];

/// A section along x through a hill with these strata, and a legend of what is in it.
pub fn section(strata: &Strata, base: f64) -> String {
    let noise =
        NoiseHeights { amplitude: 22.0, base, scale: 90.0, octaves: 3, seed: 8, ..NoiseHeights::default() };
    let ground = Ground::from_noise(LENGTH as u32, 32, &noise).expect("valid noise");
    let ground = ground.with_strata(strata).expect("valid strata");
    let height = |x: i32| ground.height(Column::new(x, 16));
    let top = (0..LENGTH).map(height).max().unwrap_or_default() / ONE + 2;
    let low = top - DEPTH;
    let (min, max) = (Vec2::new(0.0, low as f32 - 4.0), Vec2::new(LENGTH as f32, top as f32));
    let mut canvas = Canvas::new(min, max, 8.0);
    let mut shown = [false; MATERIALS.len()];
    for y in low..top {
        let material = |x: i32| {
            let material = || usize::from(ground.material(IVec3::new(x, y, 16)).0);
            (y * ONE < height(x)).then(material)
        };
        let mut x = 0;
        while x < LENGTH {
            let (from, own) = (x, material(x));
            while x < LENGTH && material(x) == own {
                x += 1;
            }
            if let Some(own) = own.filter(|&own| own < MATERIALS.len()) {
                shown[own] = true;
                canvas.rectangle(
                    Vec2::new(from as f32, y as f32),
                    Vec2::new(x as f32, y as f32 + 1.0),
                    MATERIALS[own].1,
                );
            }
        }
    }
    let mut at = Vec2::new(0.5, low as f32 - 3.0);
    for ((name, color), _) in MATERIALS.iter().zip(shown).filter(|(_, is_shown)| *is_shown) {
        canvas.rectangle(at, at + Vec2::splat(1.6), color);
        canvas.label(at + Vec2::new(2.2, 0.1), name, "#333333");
        at.x += 3.6 + name.len() as f32;
    }
    canvas.finish()
}
