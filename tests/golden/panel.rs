//! The panel on a small screen.
//!
//! Figures that differ from run to run are covered: what is compared is how the panel is laid out and drawn, by its left
//! column and by all of the right one that says the same each time.

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
    studio.resize((1280, 720));
    (0..4).for_each(|_| studio.app.update());
    let mut picture = studio.picture();
    let places = studio.app.world().resource::<PanelPlaces>().clone();
    for button in ["Undo", "Redo", "Check seams", "Save picture", "Raise", "Cylinder", "Radius", "Falloff"] {
        album.check(places.0.contains_key(button), || format!("{button} is not seen"));
    }
    let first_figure = places.0.get("Save picture").map_or(0.0, |place| place.max.y + 60.0);
    cover(&mut picture, first_figure as u32);
    album.compare("panel", &picture);
}

/// Covers the right column from a height on.
fn cover(picture: &mut RgbImage, from: u32) {
    let (width, height) = picture.dimensions();
    for (x, y) in (from..height).flat_map(|y| (width - 290..width).map(move |x| (x, y))) {
        picture.put_pixel(x, y, Rgb([0; 3]));
    }
}
