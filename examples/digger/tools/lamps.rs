//! Lamps that stay where they are put: on floors, walls and ceilings, until the ground under them is dug away.

use std::collections::VecDeque;
use std::time::Duration;

use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy::time::common_conditions::on_timer;
use bevy_burrow::prelude::*;

use crate::tools::{Strike, Tool};
use crate::ui::hud::Hint;
use crate::world::landscape::NewGame;

/// As many as can be up at once; the oldest makes way for one more.
pub const LAMPS: usize = 24;
/// Luminous power in lumens, as a game needs it and not as a shop sells it.
const POWER: f32 = 2_200_000.0;

/// The bulb's middle, from the foot.
const BULB: Vec3 = Vec3::new(0.0, 0.38, 0.0);

/// A lamp, and the ground it holds on to.
#[derive(Component, Clone, Copy, Debug)]
#[require(Transform, Visibility)]
pub struct Lamp {
    /// A place in the ground below it.
    pub root: Vec3,
}

/// All lamps, the oldest first.
#[derive(Resource, Default, Debug)]
pub struct Lamps(pub VecDeque<Entity>);

/// What lamps are made of.
#[derive(Resource)]
struct Workshop {
    post: (Handle<Mesh>, Handle<StandardMaterial>),
    bulb: (Handle<Mesh>, Handle<StandardMaterial>),
    cap: Handle<Mesh>,
}

/// Puts lamps up.
pub struct LampsPlugin;

impl Plugin for LampsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Lamps>()
            .add_systems(Startup, open_workshop)
            .add_systems(Update, fall.run_if(on_timer(Duration::from_millis(200))))
            .add_observer(place)
            .add_observer(take_down)
            .add_observer(forget);
    }
}

fn open_workshop(
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
    commands.insert_resource(Workshop {
        post: (meshes.add(Cylinder::new(0.035, 0.36)), materials.add(iron)),
        bulb: (meshes.add(Sphere::new(0.10)), materials.add(glow)),
        cap: meshes.add(Cylinder::new(0.13, 0.04)),
    });
}

fn place(
    strike: On<Strike>,
    mut commands: Commands,
    workshop: Res<Workshop>,
    mut lamps: ResMut<Lamps>,
    mut hints: MessageWriter<Hint>,
) {
    let Some(aim) = strike.aim.filter(|_| strike.tool == Tool::Lamp) else { return };
    if lamps.0.len() >= LAMPS
        && let Some(oldest) = lamps.0.pop_front()
    {
        hints.write(Hint::new(format!("{LAMPS} lamps are all there are: the first one is put up here")));
        commands.entity(oldest).despawn();
    }
    let lamp = commands.spawn(lamp(&workshop, aim.place, aim.normal)).id();
    lamps.0.push_back(lamp);
}

/// Everything of a lamp on the ground.
fn lamp(workshop: &Workshop, place: Vec3, normal: Vec3) -> impl Bundle {
    let upright = Quat::from_rotation_arc(Vec3::Y, normal.normalize_or(Vec3::Y));
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
    (
        Name::new("lamp"),
        Lamp { root: place - normal * 0.4 },
        Transform::from_translation(place).with_rotation(upright),
        children![
            part(&workshop.post.0, &workshop.post.1, 0.12),
            part(&workshop.bulb.0, &workshop.bulb.1, BULB.y),
            part(&workshop.cap, &workshop.post.1, 0.50),
            (light, Transform::from_xyz(0.0, 0.55, 0.0)),
        ],
    )
}

/// What lost its ground is gone, and so is what is buried: a light in a hill would shine through it.
fn fall(mut commands: Commands, terrains: Terrains, lamps: Query<(Entity, &Lamp, &Transform)>) {
    for (entity, lamp, place) in &lamps {
        if !terrains.is_solid(lamp.root) || terrains.is_solid(place.transform_point(BULB)) {
            commands.entity(entity).despawn();
        }
    }
}

/// A new game begins in the dark.
fn take_down(_: On<NewGame>, mut commands: Commands, lamps: Query<Entity, With<Lamp>>) {
    for lamp in &lamps {
        commands.entity(lamp).despawn();
    }
}

fn forget(gone: On<Remove, Lamp>, mut lamps: ResMut<Lamps>) {
    lamps.0.retain(|lamp| *lamp != gone.entity);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lamp_goes_with_its_ground_and_when_it_is_buried() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins)).init_resource::<Lamps>().add_observer(forget);
        app.finish();
        app.cleanup();
        let ground = Ground::from_fn(64, 64, |_, _| 20.0).expect("a small world");
        app.world_mut().spawn(Terrain::new(ground, &TerrainSettings::default()).expect("default settings"));
        app.update();
        let mut stands = |foot: Vec3| {
            let lamp = (Lamp { root: foot - Vec3::Y * 0.4 }, Transform::from_translation(foot));
            let lamp = app.world_mut().spawn(lamp).id();
            app.world_mut().resource_mut::<Lamps>().0.push_back(lamp);
            app.world_mut().run_system_cached(fall).expect("a system");
            let stands = app.world().get_entity(lamp).is_ok();
            assert_eq!(app.world().resource::<Lamps>().0.contains(&lamp), stands);
            stands
        };
        assert!(stands(Vec3::new(30.0, 20.0, 30.0)));
        assert!(!stands(Vec3::new(30.0, 25.0, 30.0)), "in the air");
        assert!(!stands(Vec3::new(30.0, 12.0, 30.0)), "in the ground");
    }
}
