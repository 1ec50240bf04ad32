//! How far ground drawn in levels differs from the same ground in full detail: FLIP by distance.

use bevy::prelude::*;
use bevy_burrow::ground::NoiseSource;
use bevy_burrow::prelude::*;
use image::RgbImage;
use image::imageops::{FilterType, resize};

use crate::album::{flip_anywhere, keep};
use crate::lod::settle;
use crate::studio::{SIZE, Studio};

/// Cells along a side of the world: it is drawn in full detail too.
const SIDE: u32 = 1024;

/// How many times as wide and high the picture in full detail is drawn.
const SAMPLES: u32 = 4;

/// Mountains with strata.
fn mountains() -> Ground {
    let heights = NoiseHeights {
        seed: 7,
        kind: NoiseKind::Ridged,
        octaves: 7,
        scale: 700.0,
        amplitude: 200.0,
        base: 0.0,
    };
    let ground = Ground::from_source(SIDE, SIDE, NoiseSource::new(&heights).expect("valid noise"));
    ground.and_then(|ground| ground.with_strata(&Strata::alpine())).expect("a valid ground")
}

/// A view from a distance of the world's middle, from above the ground.
fn look(studio: &mut Studio, distance: f32) {
    let middle = SIDE as f32 / 2.0;
    let at = Vec3::new(middle, studio.height(middle, middle), middle);
    let out = Vec3::new(0.6, 0.0, 0.8) * distance;
    let over = if distance < 600.0 { studio.height(middle + out.x, middle + out.z) + 30.0 } else { 0.0 };
    studio.look((at + out).with_y((at.y + 0.25 * distance).max(over)), at);
}

/// A picture of some times the usual size, averaged.
fn supersampled(studio: &mut Studio, samples: u32) -> RgbImage {
    studio.resize((SIZE.0 * samples, SIZE.1 * samples));
    let large = studio.picture();
    studio.resize(SIZE);
    resize(&large, SIZE.0, SIZE.1, FilterType::Triangle)
}

/// Prints the FLIP of ground at several distances, averaged over the pixels that show ground.
pub fn measure(studio: &mut Studio) -> Vec<(f32, f32)> {
    studio.terrain(mountains(), GroundLook::default());
    let camera = studio.camera;
    let far = Projection::from(PerspectiveProjection { far: 20_000.0, ..default() });
    studio.app.world_mut().entity_mut(camera).insert(far).remove::<DistanceFog>();
    let distances = [300.0, 1000.0, 3000.0, 8000.0];
    let whole = distances.map(|distance| {
        look(studio, distance);
        supersampled(studio, SAMPLES)
    });
    let world = studio.app.world_mut();
    let source = DetailSource { picture_height: SIZE.1 as f32, ..default() };
    world.spawn((ChildOf(camera), source));
    let terrain = world.query_filtered::<Entity, With<Terrain>>().single(world).expect("one terrain");
    world.entity_mut(terrain).insert(LevelsOfDetail { view_distance: 12_000.0, ..default() });
    studio.until("levels", |app| {
        let world = app.world_mut();
        world.query::<&ShownLevels>().iter(world).any(|shown| shown.progress() > 0.0)
    });
    let mut found = Vec::new();
    for (distance, whole) in distances.into_iter().zip(whole) {
        look(studio, distance);
        settle(studio);
        let plain = studio.picture();
        let fine = supersampled(studio, SAMPLES);
        let sky = *whole.get_pixel(2, 2);
        let pixels: Vec<bevy::math::UVec2> = whole
            .enumerate_pixels()
            .filter(|(.., pixel)| **pixel != sky)
            .map(|(x, y, _)| bevy::math::UVec2::new(x, y))
            .collect();
        let [own, filtered] = [&plain, &fine].map(|picture| flip_anywhere(&whole, picture)(&pixels));
        println!(
            "{distance} m: FLIP {own:.4}, with as many samples {filtered:.4}, over {} pixels",
            pixels.len()
        );
        for (name, picture) in [("whole", &whole), ("levels", &plain), ("levels_fine", &fine)] {
            keep(&format!("far_{distance}"), name, picture);
        }
        found.push((own, filtered));
    }
    studio.close_terrain();
    found
}
