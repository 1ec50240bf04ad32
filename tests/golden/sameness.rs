//! The seam from close by: ground that was handed to marching cubes looks as it did before, wherever the sun stands.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::album::{Album, flip, keep};
use crate::landscape::hills;
use crate::studio::Studio;

/// Mean FLIP that counts as noise: a third of what it is when the camera moves by a quarter of a pixel (0.022), and less
/// than half of what a spot of another material gives (0.018). The test prints and checks both.
const NOISE: f32 = 0.007;

/// Sun directions all around, low, middle and high.
fn suns() -> impl Iterator<Item = Vec3> {
    (0..12).map(|hour| {
        let turn = hour as f32 * std::f32::consts::TAU / 12.0;
        let height = [0.35, 0.8, 1.7][hour % 3];
        Vec3::new(turn.cos(), height, turn.sin())
    })
}

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    studio.terrain(hills(160), GroundLook::default());
    let middle = Vec3::new(100.0, studio.height(100.0, 120.0), 120.0);
    let from = Vec3::new(9.0, 8.0, 11.0);
    studio.look(middle + from, middle);
    let photograph = |studio: &mut Studio| -> Vec<_> {
        suns()
            .map(|sun| {
                studio.sun(sun);
                studio.picture()
            })
            .collect()
    };
    let before = photograph(studio);
    album.compare("seam", &before[1]);
    // What a quarter of a pixel does; a pixel is 37 mm wide at this distance.
    studio.sun(suns().nth(1).unwrap_or(Vec3::Y));
    let aside = Vec3::new(11.0, 0.0, -9.0).normalize() * 0.037 / 4.0;
    studio.look(middle + from + aside, middle + aside);
    let (moved, _) = flip(&before[1], &studio.picture());
    studio.look(middle + from, middle);
    println!("the camera moved by a quarter of a pixel: FLIP {moved:.5}");
    album.check(moved > 2.0 * NOISE, || format!("the measure is too coarse: FLIP {moved:.5}"));
    // Painting with the ground's own material changes nothing, but hands the cells over to marching cubes.
    studio.apply([Brush::paint(Shape::sphere(middle, 6.0), MaterialId::GROUND)]);
    let cells = studio.one::<Terrain>().world().mask().len();
    album.check(cells > 80, || format!("only {cells} cells were handed over"));
    let after = photograph(studio);
    for (hour, (before, after)) in before.iter().zip(&after).enumerate() {
        let (mean, map) = flip(before, after);
        let apart = before.iter().zip(after.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
        println!("sun {hour}: FLIP {mean:.5} with and without the field, largest difference {apart} of 255");
        if mean > NOISE {
            keep(&format!("seam_{hour}"), "without", before);
            keep(&format!("seam_{hour}"), "with", after);
            keep(&format!("seam_{hour}"), "difference", &map);
        }
        album.check(mean <= NOISE, || format!("sun {hour}: FLIP {mean:.5} with and without the field"));
    }
    // The same measure sees faults.
    studio.sun(suns().nth(1).unwrap_or(Vec3::Y));
    studio.apply([Brush::paint(Shape::sphere(middle, 2.0), MaterialId(5))]);
    let (painted, _) = flip(&before[1], &studio.picture());
    studio.apply([Brush::dig(Shape::sphere(middle, 1.0))]);
    let (dug, _) = flip(&before[1], &studio.picture());
    println!("a spot of another material: FLIP {painted:.5}; a small hole in it: {dug:.5}");
    album.check(painted > 2.0 * NOISE, || format!("a painted spot went unnoticed: FLIP {painted:.5}"));
    studio.sun(Vec3::new(1.0, 0.9, 0.4));
}
