//! Light: the sun, and the sky's light, which fades in caves.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::player::camera::PlayerCamera;

/// The direction to the sun on a late afternoon, of length 1: from the south-west.
pub const SUN: Vec3 = Vec3::new(-0.58, 0.64, 0.504);

/// Brightness of the ambient light deep in a cave.
const CAVE_BRIGHTNESS: f32 = 30.0;

/// The light of the sun, or of the moon at night.
#[derive(Component)]
pub struct Sun;

/// The sky's light outdoors.
#[derive(Resource, Clone, Copy, Debug)]
pub struct Skylight {
    pub color: Color,
    pub brightness: f32,
}

/// Spawns the sun, and darkens caves.
pub struct LightPlugin;

impl Plugin for LightPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Skylight { color: Color::WHITE, brightness: 1000.0 })
            .insert_resource(GlobalAmbientLight { brightness: 1000.0, ..default() })
            .add_systems(Startup, spawn_sun)
            .add_systems(Update, darken_caves);
    }
}

fn spawn_sun(mut commands: Commands) {
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    commands.spawn((Name::new("sun"), Sun, light, Transform::IDENTITY.looking_to(-SUN, Vec3::Y)));
}

/// Scales the ambient light by how much of the sky is open above points around the camera. The change takes some time,
/// as if eyes adapted. It uses real time, because the title may show another place while the game is paused.
fn darken_caves(
    time: Res<Time<Real>>,
    terrains: Terrains,
    camera: Single<&GlobalTransform, With<PlayerCamera>>,
    skylight: Res<Skylight>,
    mut ambient: ResMut<GlobalAmbientLight>,
) {
    let offsets = (-1..=1).flat_map(|x| (-1..=1).map(move |z| Vec3::new(x as f32, 0.0, z as f32) * 3.0));
    let is_open = |place: Vec3| {
        let spans = terrains.spans(place.x, place.z);
        let air = spans.iter().find(|span| span.ceiling.is_none_or(|top| f64::from(place.y) < top));
        air.is_none_or(|span| span.ceiling.is_none())
    };
    let open = offsets.filter(|&offset| is_open(camera.translation() + offset)).count() as f32 / 9.0;
    let dark = CAVE_BRIGHTNESS.min(skylight.brightness);
    let brightness = dark + (skylight.brightness - dark) * open * open;
    ambient.color = skylight.color;
    ambient.brightness += (brightness - ambient.brightness) * (1.0 - (-4.0 * time.delta_secs()).exp());
}
