//! The panel with every section of figures and settings. Timings, which differ from run to run, are masked.

use bevy::prelude::*;
use bevy_burrow::panel::{BrushTool, PanelPlaces, ToolOperation, ToolShape};
use bevy_burrow::prelude::*;
use bevy_egui::EguiContext;
use bevy_egui::egui::Id;
use bevy_egui::egui::collapsing_header::CollapsingState;
use image::{Rgb, RgbImage};

use crate::album::{Album, flip_anywhere};
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
    studio.resize((1280, 1200));
    // The studio's own picture is so narrow that a column was folded.
    (0..2).for_each(|_| studio.app.update());
    let world = studio.app.world_mut();
    for mut context in world.query::<&mut EguiContext>().iter_mut(world) {
        context.get_mut().data_mut(|data| data.insert_temp(Id::new(("burrow world", "open")), true));
    }
    unfold(studio, &[("Diagnostics", true)]);
    // Terrain and engine figures are updated twice a second of app time (16 ms per frame), in tasks.
    let mut frames = 0;
    studio.until("figures", |_| {
        frames += 1;
        frames > 100
    });
    photograph(studio, album, "panel", &FIGURES);
    let closed = ["Terrain", "Diagnostics"].map(|name| (name, false));
    let open = ["Fill", "Digging rules", "Loose pieces", "Look", "Settings"].map(|name| (name, true));
    unfold(studio, &[&closed[..], &open[..]].concat());
    // Sections take a moment to open and to close. The ground need not be drawn meanwhile.
    studio.app.world_mut().entity_mut(terrain).insert(Visibility::Hidden);
    (0..60).for_each(|_| studio.app.update());
    studio.app.world_mut().entity_mut(terrain).insert(Visibility::Inherited);
    photograph(studio, album, "panel_settings", &SETTINGS);
}

/// Opens and closes sections.
fn unfold(studio: &mut Studio, sections: &[(&str, bool)]) {
    let world = studio.app.world_mut();
    for mut context in world.query::<&mut EguiContext>().iter_mut(world) {
        for (name, is_open) in sections {
            let id = Id::new(("burrow section", *name));
            let context = context.get_mut();
            let mut state = CollapsingState::load_with_default_open(context, id, !is_open);
            state.set_open(*is_open);
            state.store(context);
        }
    }
}

/// Takes a picture and compares each widget separately, so that differences in small ones are noticed as well.
fn photograph(studio: &mut Studio, album: &mut Album, name: &str, widgets: &[&str]) {
    let mut picture = studio.picture();
    let places = studio.app.world().resource::<PanelPlaces>().clone();
    for widget in widgets {
        album.check(places.0.contains_key(*widget), || format!("{name}: {widget} is not visible"));
    }
    TIMES.iter().filter_map(|name| places.0.get(*name)).for_each(|place| cover(&mut picture, *place));
    album.compare(name, &picture);
    let golden = album.golden(name).filter(|golden| golden.dimensions() == picture.dimensions());
    let Some(apart) = golden.map(|golden| flip_anywhere(&golden, &picture)) else { return };
    for (widget, place) in &places.0 {
        let apart = apart(&pixels(&picture, *place).collect::<Vec<_>>());
        album.check(apart < WIDGET, || format!("{name}: {widget} differs: FLIP {apart:.4}"));
    }
}

/// Mean FLIP above which a widget counts as different.
const WIDGET: f32 = 0.05;

const SETTINGS: [&str; 6] = ["Fill material", "Bedrock", "Find after digs", "Variety", "Scale to", "History"];

const FIGURES: [&str; 12] = [
    "Undo",
    "Redo",
    "Check seams",
    "Save picture",
    "Raise",
    "Cylinder",
    "Radius",
    "Falloff",
    "Queue",
    "Fields",
    "Hash",
    "Backend",
];

/// Widgets that show timings.
const TIMES: [&str; 6] =
    ["transaction", "p50, p95, p99", "meshes swapped per frame", "frame", "main-thread time", "Last stage"];

fn pixels(picture: &RgbImage, place: Rect) -> impl Iterator<Item = UVec2> + use<> {
    let (from, to) = (place.min.as_uvec2(), place.max.ceil().as_uvec2().min(picture.dimensions().into()));
    (from.y..to.y).flat_map(move |y| (from.x..to.x).map(move |x| UVec2::new(x, y)))
}

fn cover(picture: &mut RgbImage, place: Rect) {
    pixels(picture, place).for_each(|pixel| picture.put_pixel(pixel.x, pixel.y, Rgb([0; 3])));
}
