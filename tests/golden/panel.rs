//! The panel, with every section of figures; what differs from run to run, which is times, is covered.

use bevy::prelude::*;
use bevy_burrow::panel::{BrushTool, PanelPlaces, ToolOperation, ToolShape};
use bevy_burrow::prelude::*;
use image::{Rgb, RgbImage};

use crate::album::Album;
use crate::studio::Studio;

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    let noise = NoiseHeights { seed: 3, scale: 60.0, amplitude: 10.0, octaves: 4, ..default() };
    studio.terrain(Ground::from_noise(128, 128, &noise).expect("valid ground"), GroundLook::default());
    let middle = Vec3::new(64.0, studio.height(64.0, 64.0), 64.0);
    studio.apply([Brush::dig(Shape::sphere(middle, 7.0))]);
    studio.look(middle + Vec3::new(-14.0, 19.0, 22.0), middle);
    let world = studio.app.world_mut();
    let terrain = world.query_filtered::<Entity, With<Terrain>>().single(world).expect("one terrain");
    world.entity_mut(terrain).insert(Name::new("Hills"));
    *world.resource_mut::<BrushTool>() =
        BrushTool { operation: ToolOperation::Raise, shape: ToolShape::Cylinder, ..default() };
    studio.resize((1280, 1040));
    // Figures of terrain and engine are counted twice a second, of 16 ms a frame, in tasks.
    let mut frames = 0;
    studio.until("figures", |_| {
        frames += 1;
        frames > 100
    });
    let mut picture = studio.picture();
    let places = studio.app.world().resource::<PanelPlaces>().clone();
    for name in WIDGETS.into_iter().chain(TIMES) {
        album.check(places.0.contains_key(name), || format!("{name} is not seen"));
    }
    TIMES.iter().filter_map(|name| places.0.get(*name)).for_each(|place| cover(&mut picture, *place));
    album.compare("panel", &picture);
}

const WIDGETS: [&str; 12] = [
    "Undo",
    "Redo",
    "Check seams",
    "Save picture",
    "Raise",
    "Cylinder",
    "Radius",
    "Falloff",
    "Queue",
    "Fields, chunks",
    "Hash",
    "Backend",
];

/// What tells of times.
const TIMES: [&str; 6] = [
    "transaction",
    "p50, p95, p99",
    "meshes swapped per frame",
    "frame",
    "own work on the main thread",
    "Last",
];

fn cover(picture: &mut RgbImage, place: Rect) {
    let (from, to) = (place.min.as_uvec2(), place.max.ceil().as_uvec2().min(picture.dimensions().into()));
    for (x, y) in (from.y..to.y).flat_map(|y| (from.x..to.x).map(move |x| (x, y))) {
        picture.put_pixel(x, y, Rgb([0; 3]));
    }
}
