//! Lamps: they stand on floors, walls and ceilings until the ground under them is dug away.

use std::collections::VecDeque;
use std::time::Duration;

use bevy::ecs::system::SystemParam;
use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy::time::common_conditions::on_timer;
use bevy_burrow::prelude::*;
use bevy_burrow::together::SharedTerrain;
use serde::{Deserialize, Serialize};

use crate::player::{Player, headlamp};
use crate::tools::{Tool, ToolUsed};
use crate::ui::hud::Hint;
use crate::ui::texts;
use crate::world::landscape::DespawnOnNewGame;

/// The oldest lamp is removed if there would be more.
const MAX_LAMPS: usize = 24;
/// Luminous power in lumens, much higher than a real lamp's.
const POWER: f32 = 2_200_000.0;
/// The middle of the bulb, seen from the foot.
const BULB: Vec3 = Vec3::new(0.0, 0.38, 0.0);
/// Where its light is.
const LIGHT: Vec3 = Vec3::new(0.0, 0.55, 0.0);
/// With ground this many metres away on all sides, a lamp has its full power. In a tunnel, that would burn out to white.
const FULL_POWER_DISTANCE: f32 = 12.0;

#[derive(Component, Clone, Copy, Debug)]
#[require(Transform, Visibility, DespawnOnNewGame)]
struct Lamp {
    /// A point in the ground below it.
    root: Vec3,
}

/// A lamp as it is saved. Triggering it puts a lamp there.
#[derive(Event, Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedLamp {
    pub foot: Vec3,
    pub normal: Vec3,
}

/// What is saved of the lamps.
#[derive(SystemParam)]
pub struct SavedLamps<'w, 's> {
    order: Option<Res<'w, Lamps>>,
    lamps: Query<'w, 's, &'static Transform, With<Lamp>>,
}

impl SavedLamps<'_, '_> {
    /// All lamps, the oldest first.
    pub fn all(&self) -> Vec<SavedLamp> {
        let order = self.order.iter().flat_map(|lamps| &lamps.0);
        let places = order.filter_map(|lamp| self.lamps.get(*lamp).ok());
        places.map(|place| SavedLamp { foot: place.translation, normal: *place.up() }).collect()
    }
}

/// All lamps, the oldest first.
#[derive(Resource, Default, Debug)]
pub struct Lamps(VecDeque<Entity>);

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
            .add_systems(
                Update,
                // Without a player, the ground may not have loaded.
                (remove_loose_lamps.after(BurrowSystems::Begin), dim_lamps)
                    .run_if(any_with_component::<Player>)
                    .run_if(on_timer(Duration::from_millis(200))),
            )
            .add_observer(use_lamp)
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

fn use_lamp(used: On<ToolUsed>, mut commands: Commands) {
    if let Some(aim) = used.aim.filter(|_| used.tool == Tool::Lamp) {
        commands.trigger(SavedLamp { foot: aim.point, normal: aim.normal });
    }
}

fn place(
    new: On<SavedLamp>,
    mut commands: Commands,
    assets: Res<LampAssets>,
    mut lamps: ResMut<Lamps>,
    mut hints: MessageWriter<Hint>,
) {
    let SavedLamp { foot, normal } = *new.event();
    if !foot.is_finite() || !normal.is_finite() {
        return;
    }
    if lamps.0.len() >= MAX_LAMPS
        && let Some(oldest) = lamps.0.pop_front()
    {
        hints.write(Hint(texts::lamps_used_up(MAX_LAMPS)));
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
        intensity: 0.0,
        range: 26.0,
        radius: 0.1,
        ..default()
    };
    let normal = normal.normalize_or(Vec3::Y);
    let rotation = Quat::from_rotation_arc(Vec3::Y, normal);
    let lamp = commands.spawn((
        Name::new("lamp"),
        Lamp { root: foot - normal * 0.4 },
        Transform::from_translation(foot).with_rotation(rotation),
        children![
            part(&assets.post, &assets.iron, 0.12),
            part(&assets.bulb, &assets.glow, BULB.y),
            part(&assets.cap, &assets.iron, 0.50),
            (light, Transform::from_translation(LIGHT)),
        ],
    ));
    lamps.0.push_back(lamp.id());
}

/// Removes lamps whose ground was dug away, and buried lamps, whose light would shine through the hill. While a shared
/// world arrives, its tunnels are not dug yet.
fn remove_loose_lamps(
    mut commands: Commands,
    terrains: Terrains,
    grounds: Query<(&Terrain, Option<&SharedTerrain>)>,
    lamps: Query<(Entity, &Lamp, &Transform)>,
) {
    let arrives = |(terrain, shared): (&Terrain, Option<&SharedTerrain>)| {
        terrain.is_busy() || terrain.queued() > 0 || shared.is_some_and(|shared| !shared.has_joined())
    };
    if grounds.iter().any(arrives) {
        return;
    }
    for (entity, lamp, place) in &lamps {
        if !terrains.is_solid(lamp.root) || terrains.is_solid(place.transform_point(BULB)) {
            commands.entity(entity).despawn();
        }
    }
}

/// Adapts the power of lamps to the distance of the ground around them.
fn dim_lamps(
    terrains: Terrains,
    lamps: Query<(&Transform, &Children), With<Lamp>>,
    mut lights: Query<&mut PointLight>,
) {
    for (place, children) in &lamps {
        let origin = place.transform_point(LIGHT);
        let directions =
            [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z, Vec3::Y].map(|direction| place.rotation * direction);
        let power = POWER * headlamp::share_of_power(&terrains, origin, directions, FULL_POWER_DISTANCE);
        let mut own = lights.iter_many_mut(children.iter());
        while let Some(mut light) = own.fetch_next() {
            light.intensity = power;
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
    fn a_lamp_near_walls_is_dimmed() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins));
        let terrain = spawn_flat_terrain(&mut app);
        app.update();
        let pit = Brush::dig(Shape::cylinder(Vec3::new(30.0, 12.0, 30.0), Vec3::Y * 20.0, 2.0));
        app.world_mut().get_mut::<Terrain>(terrain).expect("it is there").apply([pit]);
        let power = |app: &mut App, foot: Vec3| {
            let lamp =
                (Lamp { root: foot }, Transform::from_translation(foot), children![PointLight::default()]);
            let lamp = app.world_mut().spawn(lamp).id();
            app.world_mut().run_system_cached(dim_lamps).expect("a system");
            let light = app.world().get::<Children>(lamp).expect("a light")[0];
            app.world().get::<PointLight>(light).expect("a light").intensity
        };
        let [open, narrow] =
            [Vec3::new(10.0, 20.0, 10.0), Vec3::new(30.0, 12.0, 30.0)].map(|foot| power(&mut app, foot));
        assert!(open > 0.9 * POWER && narrow < 0.2 * POWER, "{open} {narrow}");
    }

    #[test]
    fn lamps_in_the_air_or_in_the_ground_are_removed_but_not_while_the_ground_arrives() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins)).init_resource::<Lamps>().add_observer(forget);
        let terrain = spawn_flat_terrain(&mut app);
        app.update();
        for (height, arrives, stays) in
            [(20.0, false, true), (25.0, false, false), (12.0, true, true), (12.0, false, false)]
        {
            if arrives {
                app.world_mut().entity_mut(terrain).insert(SharedTerrain::default());
            } else {
                app.world_mut().entity_mut(terrain).remove::<SharedTerrain>();
            }
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
