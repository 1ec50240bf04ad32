//! Light: the sun, and the sky's light, of which the ground shows as much as reaches it.

use bevy::prelude::*;

/// The direction to the sun on a late afternoon, of length 1: from the south-west.
pub const SUN: Vec3 = Vec3::new(-0.58, 0.64, 0.504);

/// The light of the sun, or of the moon at night.
#[derive(Component)]
pub struct Sun;

/// Spawns the sun. `day.rs` sets the colours of sun and sky; the terrain's sky light darkens pits and caves.
pub struct LightPlugin;

impl Plugin for LightPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(GlobalAmbientLight { brightness: 1000.0, ..default() })
            .add_systems(Startup, spawn_sun);
    }
}

fn spawn_sun(mut commands: Commands) {
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    commands.spawn((Name::new("sun"), Sun, light, Transform::IDENTITY.looking_to(-SUN, Vec3::Y)));
}
