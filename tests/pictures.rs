//! Rendered pictures: ground that was handed to marching cubes looks as it did before.
//!
//! Needs a Vulkan driver; a software one (lavapipe) will do.
#![cfg(feature = "examples")]

use std::sync::{Arc, Mutex};
use std::time::Duration;

use bevy::app::PluginsState;
use bevy::camera::RenderTarget;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::TextureFormat;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::time::TimeUpdateStrategy;
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_burrow::prelude::*;

const SIZE: (u32, u32) = (640, 400);
const MIDDLE: Vec3 = Vec3::new(64.0, 0.0, 64.0);

/// An app that renders one terrain into an image, from close by.
struct Studio {
    app: App,
    target: Handle<Image>,
}

impl Studio {
    fn new(ground: Ground) -> Self {
        let mut app = App::new();
        app.add_plugins(
            DefaultPlugins
                .set(WindowPlugin {
                    primary_window: None,
                    exit_condition: ExitCondition::DontExit,
                    ..default()
                })
                .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
                .disable::<WinitPlugin>(),
        )
        .add_plugins(BurrowPlugins)
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)));
        while app.plugins_state() == PluginsState::Adding {
            bevy::tasks::tick_global_task_pools_on_main_thread();
        }
        app.finish();
        app.cleanup();
        let image = Image::new_target_texture(SIZE.0, SIZE.1, TextureFormat::Rgba8UnormSrgb, None);
        let target = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        let material = app
            .world_mut()
            .resource_mut::<Assets<StandardMaterial>>()
            .add(StandardMaterial { perceptual_roughness: 0.9, ..default() });
        let height = ground.height(bevy_burrow::lattice::Column::new(64, 64)) as f32 / 256.0;
        let middle = MIDDLE + Vec3::Y * height;
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        app.world_mut().spawn((terrain, MeshMaterial3d(material)));
        app.world_mut().spawn((
            Camera3d::default(),
            RenderTarget::from(target.clone()),
            Transform::from_translation(middle + Vec3::new(14.0, 12.0, 18.0)).looking_at(middle, Vec3::Y),
        ));
        app.world_mut().spawn((
            DirectionalLight { illuminance: 9000.0, shadow_maps_enabled: true, ..default() },
            CascadeShadowConfigBuilder { maximum_distance: 120.0, ..default() }.build(),
            Transform::from_xyz(1.0, 0.8, 0.3).looking_at(Vec3::ZERO, Vec3::Y),
        ));
        let mut studio = Self { app, target };
        studio.until(|app| {
            let mut tiles = app.world_mut().query_filtered::<(), (With<Tile>, With<Mesh3d>)>();
            tiles.iter(app.world()).count() == 16
        });
        studio
    }

    fn until(&mut self, mut done: impl FnMut(&mut App) -> bool) {
        for _ in 0..2000 {
            self.app.update();
            if done(&mut self.app) {
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        panic!("nothing came of it in 2000 frames");
    }

    fn sun(&mut self, from: Vec3) {
        let mut suns = self.app.world_mut().query_filtered::<&mut Transform, With<DirectionalLight>>();
        for mut sun in suns.iter_mut(self.app.world_mut()) {
            *sun = Transform::from_translation(from).looking_at(Vec3::ZERO, Vec3::Y);
        }
    }

    fn picture(&mut self) -> Vec<u8> {
        for _ in 0..12 {
            self.app.update();
        }
        let taken = Arc::new(Mutex::new(None));
        let place = Arc::clone(&taken);
        let shot = Screenshot::image(self.target.clone());
        self.app.world_mut().spawn(shot).observe(move |shot: On<ScreenshotCaptured>| {
            *place.lock().expect("not poisoned") = shot.image.data.clone();
        });
        self.until(|_| taken.lock().expect("not poisoned").is_some());
        taken.lock().expect("not poisoned").take().expect("just checked")
    }

    fn apply(&mut self, brush: Brush) {
        let commits = self.app.world().resource::<BurrowFigures>().commits;
        self.app.world_mut().write_message(brush);
        self.until(|app| app.world().resource::<BurrowFigures>().commits > commits);
    }
}

/// Mean and largest difference of two pictures in levels of 255, and the share of pixels that differ by more than 8.
fn difference(a: &[u8], b: &[u8]) -> (f64, u8, f64) {
    let pixels = a.chunks_exact(4).zip(b.chunks_exact(4));
    let apart = pixels.map(|(a, b)| (0..3).map(|i| a[i].abs_diff(b[i])).max().unwrap_or(0));
    let apart: Vec<u8> = apart.collect();
    let count = apart.len() as f64;
    (
        apart.iter().map(|&d| f64::from(d)).sum::<f64>() / count,
        apart.iter().copied().max().unwrap_or(0),
        apart.iter().filter(|&&d| d > 8).count() as f64 / count,
    )
}

/// Leaves a picture where one can look at it.
fn keep(name: &str, pixels: &[u8]) {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    image::save_buffer(&path, pixels, SIZE.0, SIZE.1, image::ColorType::Rgba8)
        .expect("a picture can be written");
}

#[test]
fn freshly_converted_ground_looks_untouched() {
    let noise = NoiseHeights { seed: 7, scale: 60.0, amplitude: 24.0, octaves: 5, ..default() };
    let rules = MaterialControl::Rules {
        base: MaterialId(0),
        rules: vec![MaterialRule { overlay: MaterialId(1), slope: (0.0, 0.8), slope_fade: 0.4, ..default() }],
    };
    let ground = Ground::from_noise(128, 128, &noise).and_then(|ground| ground.with_materials(&rules));
    let ground = ground.expect("valid ground");
    let middle = MIDDLE.with_y(ground.height(bevy_burrow::lattice::Column::new(64, 64)) as f32 / 256.0);
    let mut studio = Studio::new(ground);
    let suns = [Vec3::new(1.0, 0.8, 0.3), Vec3::new(-0.4, 0.5, 1.0), Vec3::new(0.2, 2.0, -0.6)];
    let photograph = |studio: &mut Studio| {
        suns.map(|sun| {
            studio.sun(sun);
            studio.picture()
        })
    };
    let before = photograph(&mut studio);
    // Painting with the ground's own material changes nothing, but hands the cells over to marching cubes.
    studio.apply(Brush::paint(Shape::sphere(middle, 9.0), MaterialId::GROUND));
    let cells: usize = {
        let mut terrains = studio.app.world_mut().query::<&Terrain>();
        terrains.iter(studio.app.world()).map(|terrain| terrain.world().mask().len()).sum()
    };
    assert!(cells > 150, "only {cells} cells were handed over");
    let after = photograph(&mut studio);
    for (number, (sun, (before, after))) in suns.iter().zip(before.iter().zip(&after)).enumerate() {
        keep(&format!("untouched_{number}.png"), before);
        keep(&format!("converted_{number}.png"), after);
        let (mean, most, share) = difference(before, after);
        println!("sun {sun}: mean {mean:.4}, largest {most} of 255, {:.3} % of pixels over 8", share * 100.0);
        assert!(mean < 0.3 && share < 0.005, "the seam shows: mean {mean}, largest {most}, share {share}");
    }
    // The same measure sees a real dig.
    studio.apply(Brush::dig(Shape::sphere(middle, 3.0)));
    studio.sun(suns[0]);
    let (mean, _, share) = difference(&before[0], &studio.picture());
    assert!(mean > 0.5 && share > 0.01, "a dig went unnoticed: mean {mean}, share {share}");
}
