//! Plants on pictures: they are drawn, and gone in the first picture with the hole.

use std::time::{Duration, Instant};

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;
use bevy_burrow::plants::{PlantDrawingPlugin, PlantLook, PlantLooks, Plants, PlantsPlugin, ShownPlants};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{ScatterRules, Species, ViewDistances};
use image::RgbImage;

#[path = "../../examples/shared/capture.rs"]
mod capture;
#[path = "../../examples/shared/offscreen.rs"]
mod offscreen;

const SIZE: u32 = 128;
const TIMEOUT: Duration = Duration::from_secs(300);

/// Unlit, so that colours are exact.
fn unlit(color: Color) -> StandardMaterial {
    StandardMaterial { base_color: color, unlit: true, cull_mode: None, ..default() }
}

/// Shares of red pixels, of plants, in the middle of a picture and at its border.
fn red(picture: &RgbImage) -> [f32; 2] {
    let mut counts = [(0, 0); 2];
    for (x, y, pixel) in picture.enumerate_pixels() {
        let off = [x, y].map(|at| (f64::from(at) - f64::from(SIZE) / 2.0).abs());
        let is_outside = off[0].max(off[1]) > f64::from(SIZE) / 4.0;
        let [red, green, _] = pixel.0;
        let (all, found) = &mut counts[usize::from(is_outside)];
        *all += 1;
        *found += u32::from(red > 150 && green < 90);
    }
    counts.map(|(all, found)| found as f32 / all as f32)
}

#[test]
fn plants_are_drawn_and_gone_with_their_ground() {
    let Some(renderer) = offscreen::find_renderer() else { return };
    let mut app = offscreen::build(Some(renderer), |app| {
        app.add_plugins((BurrowPlugins, PlantsPlugin, PlantDrawingPlugin));
    });
    let world = app.world_mut();
    world.resource_mut::<BurrowSettings>().same_frame = Duration::from_secs(60);
    let film = Image::new_target_texture(SIZE, SIZE, TextureFormat::Rgba8UnormSrgb, None);
    let film = world.resource_mut::<Assets<Image>>().add(film);
    world.spawn((
        Camera3d::default(),
        RenderTarget::from(film.clone()),
        // From above: 24 m of ground fill the picture.
        Projection::from(PerspectiveProjection { fov: 0.4, ..default() }),
        Transform::from_xyz(32.0, 70.0, 32.0).looking_at(Vec3::new(32.0, 10.0, 32.0), Vec3::Z),
    ));
    let ground = world.resource_mut::<Assets<StandardMaterial>>().add(unlit(Color::srgb(0.0, 0.0, 1.0)));
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.5, 0.5, 0.5));
    let view = ViewDistances { detail: 200.0, end: 200.0, shadows: 0.0 };
    let rules = ScatterRules { seed: 1, species: vec![Species { view, ..Species::named("cube") }] };
    let material = unlit(Color::srgb(1.0, 0.0, 0.0));
    let looks = vec![PlantLook { species: "cube".into(), mesh, material, tint: 0.0, ..default() }];
    let model = Terrain::new(Ground::flat(64, 64, 10.0).expect("flat"), &TerrainSettings::default());
    let terrain = model.expect("valid settings");
    let terrain = world.spawn((terrain, MeshMaterial3d(ground), Plants(rules), PlantLooks(looks))).id();
    let start = Instant::now();
    let mut before = [0.0; 2];
    // Until they are loaded and drawn.
    while before[0] < 0.1 || before[1] < 0.1 {
        assert!(start.elapsed() < TIMEOUT, "no plants are drawn: {before:?}");
        let shown = app.world().get::<ShownPlants>(terrain).is_some_and(|shown| !shown.is_loading());
        app.update();
        if shown {
            before = red(&capture::capture(&mut app, &film, TIMEOUT).expect("a picture"));
        }
    }
    app.world_mut()
        .write_message(Brush::dig(Shape::sphere(Vec3::new(32.0, 10.0, 32.0), 7.0)))
        .expect("the plugin added it");
    // The first picture after the brush.
    let after = red(&capture::capture(&mut app, &film, TIMEOUT).expect("a picture"));
    assert!(after[0] < before[0] / 3.0, "{before:?}, then {after:?}");
    assert!(after[1] > before[1] * 0.8, "{before:?}, then {after:?}");
    app.world_mut().write_message(Undo::default()).expect("the plugin added it");
    app.update();
    let back = red(&capture::capture(&mut app, &film, TIMEOUT).expect("a picture"));
    assert!((back[0] - before[0]).abs() < 0.02, "{before:?}, then {back:?}");
    // Without looks nothing is drawn; with them again, everything is.
    let looks = app.world_mut().entity_mut(terrain).take::<PlantLooks>().expect("looks");
    app.update();
    let bare = red(&capture::capture(&mut app, &film, TIMEOUT).expect("a picture"));
    assert_eq!(bare, [0.0; 2]);
    app.world_mut().entity_mut(terrain).insert(looks);
    app.update();
    let again = red(&capture::capture(&mut app, &film, TIMEOUT).expect("a picture"));
    assert!((again[0] - before[0]).abs() < 0.02, "{before:?}, then {again:?}");
    // Nor is anything drawn without ground.
    assert!(app.world_mut().entity_mut(terrain).take::<Terrain>().is_some());
    (0..3).for_each(|_| app.update());
    let gone = red(&capture::capture(&mut app, &film, TIMEOUT).expect("a picture"));
    assert_eq!(gone, [0.0; 2]);
}
