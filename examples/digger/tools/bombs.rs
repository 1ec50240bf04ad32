//! Bombs: thrown, they bounce and roll until the fuse is down, and take a room out of the hill.

use avian3d::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_burrow::physics::{Character, CharacterMotion};
use bevy_burrow::prelude::*;

use crate::player::Tremor;
use crate::tools::digging::Blows;
use crate::tools::inventory::Inventory;
use crate::tools::thrown::just_thrown;
use crate::tools::{Strike, Tool};
use crate::world::landscape::NewGame;
use crate::world::particles::{Burst, Matter};

/// Seconds from the throw to the blast.
const FUSE: f32 = 2.4;
/// Metres per second, along the look.
const THROW: f32 = 14.0;
/// Of the bomb itself.
const RADIUS: f32 = 0.16;

/// A bomb on its way, and the seconds that are left to it: a ball of iron, as far as the physics are concerned.
#[derive(Component, Clone, Copy, Debug)]
#[require(
    Visibility,
    RigidBody::Dynamic,
    Collider::sphere(RADIUS),
    Restitution::new(0.42),
    Friction::new(0.7),
    AngularDamping(1.2),
    TransformInterpolation
)]
pub struct Bomb {
    pub fuse: f32,
}

/// A bomb went off.
#[derive(Event, Clone, Copy, Debug)]
pub struct Blast {
    pub place: Vec3,
}

/// The light of a blast.
#[derive(Component)]
struct Flash(f32);

/// What bombs are made of.
#[derive(Resource)]
struct Foundry {
    shell: (Handle<Mesh>, Handle<StandardMaterial>),
    spark: (Handle<Mesh>, Handle<StandardMaterial>),
}

/// Throws bombs and lets them go off.
pub struct BombsPlugin;

impl Plugin for BombsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, found)
            .add_systems(Update, burn_fuses.before(BurrowSystems::Collect))
            .add_systems(Update, fade_flashes)
            .add_observer(throw)
            .add_observer(defuse)
            .add_observer(explode)
            .add_observer(shake);
    }
}

fn found(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let iron = StandardMaterial {
        base_color: Color::srgb(0.07, 0.07, 0.08),
        perceptual_roughness: 0.45,
        metallic: 0.6,
        ..default()
    };
    let glow = StandardMaterial { base_color: Color::linear_rgb(4.0, 2.2, 0.6), unlit: true, ..default() };
    commands.insert_resource(Foundry {
        shell: (meshes.add(Sphere::new(RADIUS)), materials.add(iron)),
        spark: (meshes.add(Sphere::new(0.045)), materials.add(glow)),
    });
}

fn throw(strike: On<Strike>, mut commands: Commands, foundry: Res<Foundry>) {
    if strike.tool != Tool::Bomb {
        return;
    }
    let aside = strike.along.cross(Vec3::Y).normalize_or_zero();
    // No further ahead than the thrower's own skin, so that it is never thrown into a wall.
    let place = strike.eye + aside * 0.12 - Vec3::Y * 0.1 + strike.along * 0.2;
    let velocity = strike.along * THROW + Vec3::Y * 2.5;
    commands.spawn(bomb(&foundry, place, velocity));
}

/// Everything of a bomb in the air.
fn bomb(foundry: &Foundry, place: Vec3, velocity: Vec3) -> impl Bundle {
    let spark = (
        Mesh3d(foundry.spark.0.clone()),
        MeshMaterial3d(foundry.spark.1.clone()),
        Transform::from_xyz(0.0, RADIUS + 0.06, 0.0),
        NotShadowCaster,
    );
    (
        Name::new("bomb"),
        Bomb { fuse: FUSE },
        just_thrown(),
        LinearVelocity(velocity),
        AngularVelocity(velocity.cross(Vec3::Y) * -0.4),
        Mesh3d(foundry.shell.0.clone()),
        MeshMaterial3d(foundry.shell.1.clone()),
        Transform::from_translation(place),
        children![spark],
    )
}

fn burn_fuses(mut commands: Commands, time: Res<Time>, mut bombs: Query<(Entity, &mut Bomb, &Transform)>) {
    for (entity, mut bomb, place) in &mut bombs {
        bomb.fuse -= time.delta_secs();
        if bomb.fuse <= 0.0 {
            commands.entity(entity).despawn();
            commands.trigger(Blast { place: place.translation });
        }
    }
}

fn defuse(_: On<NewGame>, mut commands: Commands, bombs: Query<Entity, With<Bomb>>) {
    for bomb in &bombs {
        commands.entity(bomb).despawn();
    }
}

/// The hole, the fire and the light; other bombs near it go off soon.
fn explode(
    blast: On<Blast>,
    mut commands: Commands,
    mut inventory: ResMut<Inventory>,
    mut blows: ResMut<Blows>,
    mut brushes: MessageWriter<Brush>,
    mut bursts: MessageWriter<Burst>,
    mut bombs: Query<(&mut Bomb, &mut LinearVelocity, &Transform)>,
) {
    let (place, (_, radius)) = (blast.place, Tool::Bomb.radii());
    let tag = inventory.tag();
    let hole = Brush::dig(Shape::sphere(place, radius)).with_roughness(Roughness::new(1.5, 3.6, 77));
    brushes.write(hole.with_power(Tool::Bomb.power()).with_tag(tag));
    blows.await_receipt(tag, place, Vec3::Y, 0.3);
    let fire = Burst { place, out: Vec3::ZERO, count: 22, speed: 9.0, matter: Matter::Fire };
    bursts.write(fire);
    commands.spawn((
        Name::new("flash"),
        Flash(1.0),
        PointLight { color: Color::srgb(1.0, 0.72, 0.40), range: 60.0, intensity: 0.0, ..default() },
        Transform::from_translation(place + Vec3::Y),
    ));
    for (mut bomb, mut velocity, other) in &mut bombs {
        let away = other.translation - place;
        if away.length() < 1.5 * radius {
            bomb.fuse = bomb.fuse.min(0.15 + 0.03 * away.length());
            velocity.0 += away.normalize_or(Vec3::Y) * 6.0;
        }
    }
}

/// Who stands near is shaken and pushed.
fn shake(
    blast: On<Blast>,
    mut tremor: ResMut<Tremor>,
    mut bodies: Query<(&Transform, &mut CharacterMotion), With<Character>>,
) {
    let (_, radius) = Tool::Bomb.radii();
    for (place, mut motion) in &mut bodies {
        let away = place.translation - blast.place;
        let near = (1.0 - away.length() / 40.0).max(0.0);
        tremor.nudge(1.6 * near);
        let push = (1.0 - away.length() / (1.6 * radius)).max(0.0);
        if push > 0.0 {
            motion.velocity += away.normalize_or(Vec3::Y) * 11.0 * push;
            motion.grounded = false;
        }
    }
}

fn fade_flashes(
    mut commands: Commands,
    time: Res<Time>,
    mut flashes: Query<(Entity, &mut Flash, &mut PointLight)>,
) {
    for (entity, mut flash, mut light) in &mut flashes {
        flash.0 -= 2.4 * time.delta_secs();
        light.intensity = 60_000_000.0 * flash.0.max(0.0).powi(2);
        if flash.0 <= 0.0 {
            commands.entity(entity).despawn();
        }
    }
}

#[cfg(test)]
#[path = "bombs_tests.rs"]
mod tests;
