//! The headlamp: lights at the camera, dimmed when what they shine on is near.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::player::PlayerControlSystems;
use crate::player::camera::PlayerCamera;
use crate::player::game_state::GameState;
use crate::player::input::{Action, Actions};
use crate::world::landscape::NewGame;

// Luminous power in lumens. It is much higher than a real lamp's, so that it is visible in sunlight.
/// A narrow beam that reaches far.
const BEAM: f32 = 12_000_000.0;
/// A wide light around the beam. One light for both would overexpose near ground, or not reach far ground.
const FLOOD: f32 = 2_400_000.0;
/// A small light on the tool in hand.
const TOOL: f32 = 9_000.0;
/// From this distance in metres the lamp has its full power. Nearer, it is dimmed.
const FULL_POWER_DISTANCE: f32 = 13.0;

/// A light of the headlamp, and its full power. It is a child of the [`PlayerCamera`].
#[derive(Component)]
pub struct Headlamp(f32);

/// Whether the headlamp is on.
#[derive(Resource, Default)]
pub struct HeadlampSwitch(pub bool);

/// Switches and dims the headlamp.
pub struct HeadlampPlugin;

impl Plugin for HeadlampPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<HeadlampSwitch>()
            .add_observer(|_: On<NewGame>, mut switch: ResMut<HeadlampSwitch>| switch.0 = false)
            .add_systems(
                Update,
                (
                    toggle.in_set(PlayerControlSystems).run_if(in_state(GameState::Playing)),
                    switch_lights.run_if(resource_changed::<HeadlampSwitch>),
                    dim_lights.run_if(|switch: Res<HeadlampSwitch>| switch.0),
                )
                    .chain(),
            );
    }
}

/// The lights, as children of the camera.
pub fn lights() -> impl Bundle {
    let beam = SpotLight {
        color: Color::srgb(1.0, 0.93, 0.80),
        intensity: 0.0,
        range: 70.0,
        radius: 0.05,
        inner_angle: 0.05,
        outer_angle: 0.8,
        shadow_maps_enabled: true,
        ..default()
    };
    // The camera is so close to it that its shadows would not be seen.
    let flood =
        SpotLight { range: 24.0, inner_angle: 0.3, outer_angle: 1.3, shadow_maps_enabled: false, ..beam };
    let tool = PointLight { color: beam.color, intensity: 0.0, range: 1.6, ..default() };
    // Next to the camera, so that the beam's shadows are seen, and in front of the tool, which it would overexpose.
    let place = Transform::from_xyz(0.22, 0.12, -0.34);
    children![
        (Headlamp(BEAM), beam, place),
        (Headlamp(FLOOD), flood, place),
        (Headlamp(TOOL), tool, Transform::from_xyz(-0.05, 0.16, -0.12)),
    ]
}

fn toggle(actions: Res<Actions>, mut switch: ResMut<HeadlampSwitch>) {
    if actions.just_pressed(Action::Headlamp) {
        switch.0 = !switch.0;
    }
}

fn switch_lights(
    switch: Res<HeadlampSwitch>,
    mut spots: Query<&mut SpotLight, With<Headlamp>>,
    mut points: Query<(&Headlamp, &mut PointLight)>,
) {
    // `dim_lights` brightens the spot lights from here.
    for mut light in &mut spots {
        light.intensity = 0.0;
    }
    for (lamp, mut light) in &mut points {
        light.intensity = if switch.0 { lamp.0 } else { 0.0 };
    }
}

/// The share of its power that a light needs where ground in these directions is nearer than `full` metres.
pub fn share_of_power(terrains: &Terrains, origin: Vec3, directions: [Vec3; 5], full: f32) -> f32 {
    let distance = |direction: Vec3| {
        let ray = Ray3d::new(origin, Dir3::new(direction).unwrap_or(Dir3::NEG_Z));
        terrains.raycast(ray, full).map_or(full, |hit| hit.distance.max(0.5))
    };
    // The geometric mean.
    let logarithms = directions.map(|direction| distance(direction).ln());
    let metres = (logarithms.iter().sum::<f32>() / logarithms.len() as f32).exp();
    (metres / full).powf(1.6)
}

/// Adapts the power to the distance of the ground ahead, so that near rock is lit but not overexposed.
fn dim_lights(
    time: Res<Time>,
    terrains: Terrains,
    camera: Single<&GlobalTransform, With<PlayerCamera>>,
    mut lamps: Query<(&Headlamp, &mut SpotLight)>,
) {
    // Ahead, and around the beam's edge.
    let directions = [(0.0, 0.0), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25)]
        .map(|(right, up)| camera.rotation() * Vec3::new(right, up, -1.0));
    let power = share_of_power(&terrains, camera.translation(), directions, FULL_POWER_DISTANCE);
    for (lamp, mut light) in &mut lamps {
        light.intensity += (power * lamp.0 - light.intensity) * (1.0 - (-8.0 * time.delta_secs()).exp());
    }
}
