//! Hills with tunnels, a sun and a camera; mouse and keys.

#[path = "../shared/flight.rs"]
mod flight;

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::physics::ColliderSource;
use bevy_burrow::prelude::*;

use crate::rain::Rain;

/// Cells along a side of the landscape.
pub const SIDE: u32 = 160;

/// Where the camera starts, and what it looks at.
pub const EYE: Vec3 = Vec3::new(80.0, 52.0, 168.0);
/// The middle of the scene.
pub const MIDDLE: Vec3 = Vec3::new(80.0, 4.0, 84.0);

pub fn set_up(
    mut commands: Commands,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut brushes: MessageWriter<Brush>,
) -> Result {
    let grass_on_rock = ColumnMaterial { base: MaterialId(0), overlay: MaterialId(1), blend: 200 };
    let noise = NoiseHeights { seed: 3, amplitude: 20.0, scale: 70.0, base: 6.0, ..default() };
    let ground =
        Ground::from_noise(SIDE, SIDE, &noise)?.with_materials(&MaterialControl::Uniform(grass_on_rock))?;
    let material = materials.add(StandardMaterial { perceptual_roughness: 1.0, ..default() });
    let terrain = Terrain::new(ground, &TerrainSettings { chunk_size: 16, ..default() })?;
    commands.spawn((terrain, MeshMaterial3d(material)));
    commands.spawn((
        DirectionalLight { shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(1.0, 0.9, 0.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() });
    commands.insert_resource(ClearColor(Color::srgb(0.62, 0.76, 0.95)));
    commands.spawn((
        Camera3d::default(),
        flight::free_camera(20.0, 60.0),
        Transform::from_translation(EYE).looking_at(MIDDLE, Vec3::Y),
    ));
    // All of this small world is near.
    commands.spawn((Transform::from_translation(MIDDLE), ColliderSource { radius: SIDE as f32 }));
    let side = SIDE as f32;
    for (x, z, width, depth) in [
        (-1.0, side / 2.0, 2.0, side),
        (side + 1.0, side / 2.0, 2.0, side),
        (side / 2.0, -1.0, side, 2.0),
        (side / 2.0, side + 1.0, side, 2.0),
    ] {
        let place = Transform::from_xyz(x, 0.0, z);
        commands.spawn((RigidBody::Static, Collider::cuboid(width, 300.0, depth), place));
    }
    let tunnel = |from, to| Brush::dig(Shape::capsule(from, to, 3.5));
    brushes.write(tunnel(Vec3::new(20.0, 2.0, 110.0), Vec3::new(140.0, 0.0, 70.0)));
    brushes.write(tunnel(Vec3::new(60.0, 1.0, 140.0), Vec3::new(100.0, 3.0, 20.0)));
    Ok(())
}

/// Throws balls, and stops the machine.
pub fn press_keys(
    mut commands: Commands,
    keys: Res<ButtonInput<KeyCode>>,
    camera: Single<&GlobalTransform, With<Camera3d>>,
    mut rain: ResMut<Rain>,
) {
    if keys.just_pressed(KeyCode::KeyP) {
        rain.digs = !rain.digs;
    }
    if keys.just_pressed(KeyCode::Space) {
        let (place, ahead) = (camera.translation(), *camera.forward());
        rain.add(&mut commands, place + ahead * 2.0, ahead * 40.0);
    }
}
