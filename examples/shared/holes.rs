//! Counts holes in the ground: pixels that show what lies behind it. Shared by examples, benchmarks and tests, which
//! include this file by path.
//!
//! Where ground must be is known from rays that are cast into the model, not from what is drawn.

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use image::{Rgb, RgbImage};
use rayon::prelude::*;

/// Pixels of a picture in which ground must be seen, and those of them that show what lies behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Holes {
    pub ground: usize,
    pub holes: usize,
}

/// Counts the holes of a picture that `camera` took in the last frame. Only ground within `reach` metres counts, and
/// only pixels that have ground on all sides, so that outlines do not. `is_background` says whether a pixel shows what
/// lies behind the ground.
pub fn count(
    app: &App,
    camera: Entity,
    picture: &RgbImage,
    reach: f32,
    is_background: impl Fn(u32, u32, &Rgb<u8>) -> bool + Sync,
) -> Holes {
    let (width, height) = picture.dimensions();
    let is_ground = silhouette(app, camera, (width, height), reach);
    let is_inside = |x: u32, y: u32| {
        let around = (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (x as i32 + dx, y as i32 + dy)));
        around.into_iter().all(|(x, y)| {
            let is_in = (0..width as i32).contains(&x) && (0..height as i32).contains(&y);
            !is_in || is_ground[(y as u32 * width + x as u32) as usize]
        })
    };
    let mut found = Holes::default();
    for (x, y, pixel) in picture.enumerate_pixels().filter(|&(x, y, _)| is_inside(x, y)) {
        found.ground += 1;
        found.holes += usize::from(is_background(x, y, pixel));
    }
    found
}

/// The ground within `reach` metres that a picture lacks because of the camera's depth prepass: it is compared with one
/// that was taken from the same place without the prepass, where nothing can be missing.
#[allow(dead_code, reason = "for those whose background is not a single colour")]
pub fn count_against(app: &App, camera: Entity, picture: &RgbImage, whole: &RgbImage, reach: f32) -> Holes {
    let differs = |a: u8, b: u8| a.abs_diff(b) > 24;
    count(app, camera, picture, reach, |x, y, pixel| {
        pixel.0.iter().zip(whole.get_pixel(x, y).0).any(|(&a, b)| differs(a, b))
    })
}

/// Whether a pixel is the same in two pictures, but for what a renderer rounds.
#[allow(dead_code, reason = "for those whose background is one colour")]
pub fn is_same(a: &Rgb<u8>, b: &Rgb<u8>) -> bool {
    a.0.iter().zip(b.0).all(|(a, b)| a.abs_diff(b) <= 2)
}

/// For each pixel, whether a terrain lies there within `reach` metres.
fn silhouette(app: &App, camera: Entity, (width, height): (u32, u32), reach: f32) -> Vec<bool> {
    let world = app.world();
    let eye = world.get::<Camera>(camera).zip(world.get::<GlobalTransform>(camera));
    let Some(((eye, place), size)) = eye.and_then(|eye| Some((eye, eye.0.logical_viewport_size()?))) else {
        return vec![false; (width * height) as usize];
    };
    let per_pixel = size / Vec2::new(width as f32, height as f32);
    let terrains: Vec<_> = world
        .try_query::<(&Terrain, &GlobalTransform)>()
        .map(|mut query| {
            query.iter(world).map(|(terrain, place)| (terrain, place.affine().inverse())).collect()
        })
        .unwrap_or_default();
    (0..width * height)
        .into_par_iter()
        .map(|at| {
            let pixel = Vec2::new((at % width) as f32 + 0.5, (at / width) as f32 + 0.5) * per_pixel;
            let Ok(ray) = eye.viewport_to_world(place, pixel) else { return false };
            terrains.iter().any(|(terrain, local_from_world)| {
                let origin = local_from_world.transform_point3(ray.origin).as_dvec3();
                let direction = local_from_world.transform_vector3(*ray.direction);
                let reach = f64::from(reach * direction.length());
                let hit = terrain.world().raycast(origin, direction.as_dvec3(), reach);
                hit.is_some_and(|hit| !hit.from_inside)
            })
        })
        .collect()
}
