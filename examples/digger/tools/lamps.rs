//! Lamps: they stand on floors, walls and ceilings until the ground under them is dug away.

use std::collections::VecDeque;
use std::time::Duration;

use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy::time::common_conditions::on_timer;
use bevy_burrow::prelude::*;

use crate::tools::{Tool, ToolUsed};
use crate::ui::hud::Hint;
use crate::world::landscape::DespawnOnNewGame;

/// The oldest lamp is removed if there would be more.
const MAX_LAMPS: usize = 24;
/// Luminous power in lumens, much higher than a real lamp's.
const POWER: f32 = 2_200_000.0;
/// The middle of the bulb, seen from the foot.
const BULB: Vec3 = Vec3::new(0.0, 0.38, 0.0);

#[derive(Component, Clone, Copy, Debug)]
#[require(Transform, Visibility, DespawnOnNewGame)]
struct Lamp {
    /// A point in the ground below it.
    root: Vec3,
}

/// All lamps, the oldest first.
#[derive(Resource, Default, Debug)]
struct Lamps(VecDeque<Entity>);

#[derive(Resource)]
struct LampAssets {
    post: Handle<Mesh>,
    bulb: Handle<Mesh>,
    cap: Handle<Mesh>,
    iron: Handle<StandardMaterial>,
    glow: Handle<StandardMaterial>,
}

/// Lets the player place lamps.
pub struct LampsPlugin;

impl Plugin for LampsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Lamps>()
            .add_systems(Startup, create_assets)
            .add_systems(Update, remove_loose_lamps.run_if(on_timer(Duration::from_millis(200))))
            .add_observer(place)
            .add_observer(forget);
    }
}

fn create_assets(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let iron = StandardMaterial {
        base_color: Color::srgb(0.16, 0.15, 0.14),
        perceptual_roughness: 0.6,
        ..default()
    };
    let glow = StandardMaterial { base_color: Color::linear_rgb(3.2, 2.2, 0.9), unlit: true, ..default() };
    commands.insert_resource(LampAssets {
        post: meshes.add(Cylinder::new(0.035, 0.36)),
        bulb: meshes.add(Sphere::new(0.10)),
        cap: meshes.add(Cylinder::new(0.13, 0.04)),
        iron: materials.add(iron),
        glow: materials.add(glow),
    });
}

fn place(
    used: On<ToolUsed>,
    mut commands: Commands,
    assets: Res<LampAssets>,
    mut lamps: ResMut<Lamps>,
    mut hints: MessageWriter<Hint>,
) {
    let Some(aim) = used.aim.filter(|_| used.tool == Tool::Lamp) else { return };
    if lamps.0.len() >= MAX_LAMPS
        && let Some(oldest) = lamps.0.pop_front()
    {
        hints.write(Hint(format!("there are only {MAX_LAMPS} lamps: the oldest one was moved here")));
        commands.entity(oldest).despawn();
    }
    let part = |mesh: &Handle<Mesh>, material: &Handle<StandardMaterial>, y: f32| {
        (
            Mesh3d(mesh.clone()),
            MeshMaterial3d(material.clone()),
            Transform::from_xyz(0.0, y, 0.0),
            NotShadowCaster,
        )
    };
    let light = PointLight {
        color: Color::srgb(1.0, 0.80, 0.52),
        intensity: POWER,
        range: 26.0,
        radius: 0.1,
        ..default()
    };
    let rotation = Quat::from_rotation_arc(Vec3::Y, aim.normal.normalize_or(Vec3::Y));
    let lamp = commands.spawn((
        Name::new("lamp"),
        Lamp { root: aim.point - aim.normal * 0.4 },
        Transform::from_translation(aim.point).with_rotation(rotation),
        children![
            part(&assets.post, &assets.iron, 0.12),
            part(&assets.bulb, &assets.glow, BULB.y),
            part(&assets.cap, &assets.iron, 0.50),
            (light, Transform::from_xyz(0.0, 0.55, 0.0)),
        ],
    ));
    lamps.0.push_back(lamp.id());
}

/// Removes lamps whose ground was dug away, and buried lamps, whose light would shine through the hill.
fn remove_loose_lamps(mut commands: Commands, terrains: Terrains, lamps: Query<(Entity, &Lamp, &Transform)>) {
    for (entity, lamp, place) in &lamps {
        if !terrains.is_solid(lamp.root) || terrains.is_solid(place.transform_point(BULB)) {
            commands.entity(entity).despawn();
        }
    }
}

fn forget(removed: On<Remove, Lamp>, mut lamps: ResMut<Lamps>) {
    lamps.0.retain(|lamp| *lamp != removed.entity);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::spawn_flat_terrain;

    #[test]
    fn lamps_in_the_air_or_in_the_ground_are_removed() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins)).init_resource::<Lamps>().add_observer(forget);
        spawn_flat_terrain(&mut app);
        app.update();
        for (height, stays) in [(20.0, true), (25.0, false), (12.0, false)] {
            let foot = Vec3::new(30.0, height, 30.0);
            let lamp = (Lamp { root: foot - Vec3::Y * 0.4 }, Transform::from_translation(foot));
            let lamp = app.world_mut().spawn(lamp).id();
            app.world_mut().resource_mut::<Lamps>().0.push_back(lamp);
            app.world_mut().run_system_cached(remove_loose_lamps).expect("a system");
            assert_eq!(app.world().get_entity(lamp).is_ok(), stays, "at {height}");
            assert_eq!(app.world().resource::<Lamps>().0.contains(&lamp), stays);
        }
    }
}
