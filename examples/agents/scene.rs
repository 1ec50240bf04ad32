//! A ridge with a pass, a sun and a camera; mouse and keys.

#[path = "../shared/flight.rs"]
mod flight;

use bevy::prelude::*;
use bevy_burrow::debug::BurrowDebug;
use bevy_burrow::navigation::WalkSettings;
use bevy_burrow::paths::bevy_landmass::debug::EnableLandmassDebug;
use bevy_burrow::paths::bevy_landmass::prelude::*;
use bevy_burrow::paths::{Navigation, NavigationArea};
use bevy_burrow::prelude::*;

use crate::figures::Figure;

/// Cells along a side of the landscape.
pub const SIDE: u32 = 96;
/// The middle of the pass along x, and of the ridge along z.
pub const PASS: Vec2 = Vec2::new(30.0, 48.0);
/// Height of the plains.
pub const PLAIN: f32 = 10.0;

/// A figure's size, in metres, and what it climbs.
pub const AGENT: WalkSettings = WalkSettings {
    radius: 0.4,
    height: 1.8,
    step: 0.4,
    slope: 1.0,
    precision: 0.3,
    jump_down: 0.0,
    climb_up: 0.0,
    leap: 1.0,
};

const EYE: Vec3 = Vec3::new(62.0, 52.0, -6.0);
const MIDDLE: Vec3 = Vec3::new(50.0, 8.0, 46.0);

/// The archipelago of the figures.
#[derive(Resource)]
pub struct Paths(pub Entity);

/// Heights of plains with a ridge across them, and a pass through it.
fn height(x: i32, z: i32) -> f64 {
    let (x, z) = (f64::from(x), f64::from(z));
    let waves = 0.6 * ((x * 0.23).sin() + (z * 0.31 + x * 0.1).cos());
    let ridge = (14.0 - (z - f64::from(PASS.y)).abs()).clamp(0.0, 6.0) * 2.5;
    let pass = ((x - f64::from(PASS.x)).abs() - 4.0).clamp(0.0, 5.0) / 5.0;
    f64::from(PLAIN) + waves + ridge * pass
}

pub fn set_up(mut commands: Commands, mut materials: ResMut<Assets<StandardMaterial>>) -> Result {
    let grass_on_rock = ColumnMaterial { base: MaterialId(0), overlay: MaterialId(1), blend: 200 };
    let ground =
        Ground::from_fn(SIDE, SIDE, height)?.with_materials(&MaterialControl::Uniform(grass_on_rock))?;
    let material = materials.add(StandardMaterial { perceptual_roughness: 1.0, ..default() });
    let terrain = Terrain::new(ground, &TerrainSettings { chunk_size: 16, ..default() })?;
    let terrain = commands.spawn((terrain, MeshMaterial3d(material))).id();
    let archipelago = commands.spawn(Archipelago3d::new(AGENT.archipelago_options(1.0))).id();
    commands.spawn(Navigation { terrain, archipelago, agent: AGENT, area: NavigationArea::Everywhere });
    commands.insert_resource(Paths(archipelago));
    commands.spawn((
        DirectionalLight { shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(1.0, 1.2, -0.6).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() });
    commands.insert_resource(ClearColor(Color::srgb(0.62, 0.76, 0.95)));
    commands.spawn((
        Camera3d::default(),
        flight::free_camera(20.0, 60.0),
        Transform::from_translation(EYE).looking_at(MIDDLE, Vec3::Y),
    ));
    Ok(())
}

/// `G` shows or hides where figures can walk, `R` swaps the start and the goal of each.
pub fn press_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut shows: ResMut<EnableLandmassDebug>,
    mut debug: ResMut<BurrowDebug>,
    mut figures: Query<(&mut Figure, &mut AgentTarget3d)>,
) {
    if keys.just_pressed(KeyCode::KeyG) {
        shows.0 = !shows.0;
        debug.walkable = shows.0;
    }
    if keys.just_pressed(KeyCode::KeyR) {
        for (mut figure, mut target) in &mut figures {
            let Figure { home, goal } = *figure;
            *figure = Figure { home: goal, goal: home };
            *target = AgentTarget3d::Point(home);
        }
    }
}
