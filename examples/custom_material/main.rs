//! `custom_material`: draws the ground as a map with contour lines, and dug ground in warm colours by its depth.
//!
//! ```text
//! cargo run --release --features examples --example custom_material
//! cargo run --release --features examples --example custom_material -- --headless --out out/custom_material
//! ```
//!
//! | control | does |
//! | --- | --- |
//! | left mouse button | digs where the cursor points |
//! | middle mouse button | builds there |
//! | right mouse button, held | looks around |
//! | `W` `A` `S` `D`, `Q`, `E` | moves, down, up; with the left `Shift` faster |
//!
//! Any `Material` will do: put it on the terrain's entity and add `TerrainMaterialPlugin` for its type. This one is all
//! its own, with a shader in `map.wgsl` that reads the colours of the terrain's `MaterialColors` and the depth of each
//! vertex below the ground as it was.
//!
//! | file | subject |
//! | --- | --- |
//! | `map.rs`, `map.wgsl` | the material |
//! | `headless.rs` | the app without a window, and its pictures |

#[path = "../shared/display.rs"]
mod display;
#[path = "../shared/flight.rs"]
mod flight;
mod headless;
mod map;
#[path = "../shared/offscreen.rs"]
mod offscreen;
#[path = "../shared/photo.rs"]
mod photo;

use std::path::PathBuf;
use std::process::{ExitCode, Termination};

use bevy::camera_controller::free_camera::FreeCameraPlugin;
use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use clap::Parser;
use map::{MapMaterial, MapPlugin};

/// The ground as a map that is dug.
#[derive(Parser)]
struct Options {
    /// Dig by a script and write pictures, without a window.
    #[arg(long)]
    headless: bool,
    /// Folder for the pictures.
    #[arg(long, value_name = "DIR", default_value = "out/custom_material")]
    out: PathBuf,
}

fn main() -> ExitCode {
    let options = Options::parse();
    if options.headless || !display::has_display() {
        return match headless::run(&options.out) {
            Ok(()) => ExitCode::SUCCESS,
            Err(reason) => {
                eprintln!("{reason}");
                ExitCode::FAILURE
            }
        };
    }
    App::new()
        .add_plugins((DefaultPlugins, FreeCameraPlugin))
        .add_plugins(table)
        .add_systems(Startup, open_eyes)
        .add_systems(Update, dig.before(BurrowSystems::Collect))
        .run()
        .report()
}

/// Everything but the window: the map on its table.
fn table(app: &mut App) {
    app.add_plugins((BurrowPlugins, MapPlugin))
        .insert_resource(ClearColor(Color::srgb(0.10, 0.12, 0.14)))
        .add_systems(Startup, unroll);
}

fn unroll(mut commands: Commands, mut materials: ResMut<Assets<MapMaterial>>) -> Result {
    let heights = NoiseHeights { seed: 4, amplitude: 34.0, scale: 170.0, octaves: 5, ..default() };
    let rock =
        MaterialRule { overlay: MaterialId(0), slope: (0.8, f64::INFINITY), slope_fade: 0.3, ..default() };
    let rules = MaterialControl::Rules { base: MaterialId(1), rules: vec![rock] };
    let ground = Ground::from_noise(256, 256, &heights)?.with_materials(&rules)?;
    let paper = [(0.74, 0.66, 0.52), (0.78, 0.82, 0.62), (0.92, 0.88, 0.72), (0.95, 0.95, 0.95)];
    let paper = paper.map(|(r, g, b)| LinearRgba::from(Color::srgb(r, g, b)));
    commands.spawn((
        Terrain::new(ground, &TerrainSettings::default())?,
        MaterialColors(paper.to_vec()),
        MeshMaterial3d(materials.add(MapMaterial::default())),
    ));
    Ok(())
}

/// Where one looks from at first, and what at.
const VIEW: (Vec3, Vec3) = (Vec3::new(128.0, 120.0, 300.0), Vec3::new(128.0, -20.0, 120.0));

fn open_eyes(mut commands: Commands) {
    commands.spawn((
        Camera3d::default(),
        DepthPrepass,
        flight::free_camera(20.0, 60.0),
        Transform::from_translation(VIEW.0).looking_at(VIEW.1, Vec3::Y),
    ));
}

fn dig(
    mouse: Res<ButtonInput<MouseButton>>,
    window: Single<&Window>,
    camera: Single<(&Camera, &GlobalTransform)>,
    terrains: Terrains,
    mut brushes: MessageWriter<Brush>,
) {
    let (camera, place) = *camera;
    let shape = || {
        let ray = camera.viewport_to_world(place, window.cursor_position()?).ok()?;
        Some(Shape::sphere(terrains.raycast(ray, 1000.0)?.position, 7.0))
    };
    if mouse.just_pressed(MouseButton::Left) {
        brushes.write_batch(shape().map(Brush::dig));
    } else if mouse.just_pressed(MouseButton::Middle) {
        brushes.write_batch(shape().map(|shape| Brush::add(shape, MaterialId(2))));
    }
}
