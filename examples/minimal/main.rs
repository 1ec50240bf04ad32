//! Ground to dig in, and nothing else: the program of the README.
//!
//! ```text
//! cargo run --release --features examples --example minimal
//! ```
//!
//! | control | does |
//! | --- | --- |
//! | left mouse button | digs where the cursor points |
//! | right mouse button, held | looks around |
//! | W A S D, Q, E | moves, down, up; with the left Shift key faster |
//! | M | looks around without a button, until it is pressed again |

use bevy::camera_controller::free_camera::{FreeCamera, FreeCameraPlugin};
use bevy::prelude::*;
use bevy_burrow::prelude::*;

fn main() -> AppExit {
    App::new().add_plugins((DefaultPlugins, game)).run()
}

fn game(app: &mut App) {
    app.add_plugins((BurrowPlugins, FreeCameraPlugin))
        .insert_resource(ClearColor(Color::srgb(0.6, 0.75, 0.95)))
        .insert_resource(GlobalAmbientLight { brightness: 600.0, ..default() })
        .add_systems(Startup, landscape)
        .add_systems(Update, dig.before(BurrowSystems::Collect));
}

fn landscape(mut commands: Commands) -> Result {
    let grass_on_rock = ColumnMaterial { base: MaterialId(0), overlay: MaterialId(1), blend: 255 };
    let ground = Ground::from_noise(512, 512, &NoiseHeights { amplitude: 40.0, scale: 300.0, ..default() })?
        .with_materials(&MaterialControl::Uniform(grass_on_rock))?;
    let terrain = Terrain::new(ground, &TerrainSettings::default())?;
    commands.spawn((terrain, GroundLook::default())); // or a MeshMaterial3d of your own
    commands.spawn((
        DirectionalLight { shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(1.0, 0.8, 0.3).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        // W, A, S, D, Q and E move; the right mouse button, held, looks around.
        FreeCamera { walk_speed: 20.0, run_speed: 60.0, ..default() },
        Transform::from_xyz(256.0, 40.0, 400.0).looking_at(Vec3::new(256.0, 0.0, 256.0), Vec3::Y),
    ));
    Ok(())
}

fn dig(
    mouse: Res<ButtonInput<MouseButton>>,
    window: Single<&Window>,
    camera: Single<(&Camera, &GlobalTransform)>,
    terrains: Terrains,
    mut brushes: MessageWriter<Brush>,
) {
    let (camera, place) = *camera;
    if mouse.just_pressed(MouseButton::Left)
        && let Some(cursor) = window.cursor_position()
        && let Ok(ray) = camera.viewport_to_world(place, cursor)
        && let Some(hit) = terrains.raycast(ray, 500.0)
    {
        brushes.write(Brush::dig(Shape::sphere(hit.position, 6.0)));
    }
}

#[cfg(test)]
mod tests;
