//! Bombs: they bounce and roll until the fuse has burnt down, and blast a room into the hill.

use avian3d::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_burrow::physics::{Character, CharacterMotion};
use bevy_burrow::prelude::*;

use crate::player::camera::CameraShake;
use crate::tools::digging::{PendingHit, PendingHits};
use crate::tools::inventory::Inventory;
use crate::tools::thrown::thrown;
use crate::tools::{Tool, ToolUsed};
use crate::world::particles::{Burst, ParticleKind};

/// Seconds from the throw to the explosion.
const FUSE: f32 = 2.4;
/// Metres per second.
const SPEED: f32 = 14.0;
const RADIUS: f32 = 0.16;

/// An iron ball that explodes.
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
    /// Seconds until it explodes.
    pub fuse: f32,
}

/// A bomb exploded.
#[derive(Event, Clone, Copy, Debug)]
pub struct Explosion {
    pub place: Vec3,
}

/// The light of an explosion, from 1 down to 0.
#[derive(Component)]
struct Flash(f32);

#[derive(Resource)]
struct BombAssets {
    shell: (Mesh3d, MeshMaterial3d<StandardMaterial>),
    spark: (Mesh3d, MeshMaterial3d<StandardMaterial>),
}

/// Lets the player throw bombs.
pub struct BombsPlugin;

impl Plugin for BombsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, create_assets)
            .add_systems(Update, (burn_fuses.before(BurrowSystems::Collect), fade_flashes))
            .add_observer(throw)
            .add_observer(explode)
            .add_observer(push_player);
    }
}

fn create_assets(
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
    commands.insert_resource(BombAssets {
        shell: (Mesh3d(meshes.add(Sphere::new(RADIUS))), MeshMaterial3d(materials.add(iron))),
        spark: (Mesh3d(meshes.add(Sphere::new(0.045))), MeshMaterial3d(materials.add(glow))),
    });
}

fn throw(used: On<ToolUsed>, mut commands: Commands, assets: Res<BombAssets>) {
    if used.tool != Tool::Bomb {
        return;
    }
    let right = used.direction.cross(Vec3::Y).normalize_or_zero();
    // Within the player's own body, so that it never starts in a wall.
    let place = used.eye + right * 0.12 - Vec3::Y * 0.1 + used.direction * 0.2;
    commands.spawn((
        Name::new("bomb"),
        Bomb { fuse: FUSE },
        thrown(place, used.direction * SPEED + Vec3::Y * 2.5, 0.4),
        assets.shell.clone(),
        children![(assets.spark.clone(), Transform::from_xyz(0.0, RADIUS + 0.06, 0.0), NotShadowCaster)],
    ));
}

fn burn_fuses(mut commands: Commands, time: Res<Time>, mut bombs: Query<(Entity, &mut Bomb, &Transform)>) {
    for (entity, mut bomb, place) in &mut bombs {
        bomb.fuse -= time.delta_secs();
        if bomb.fuse <= 0.0 {
            commands.entity(entity).despawn();
            commands.trigger(Explosion { place: place.translation });
        }
    }
}

/// Digs the crater, with fire and light. Other bombs nearby explode soon after.
fn explode(
    explosion: On<Explosion>,
    mut commands: Commands,
    mut inventory: ResMut<Inventory>,
    mut hits: ResMut<PendingHits>,
    mut brushes: MessageWriter<Brush>,
    mut bursts: MessageWriter<Burst>,
    mut bombs: Query<(&mut Bomb, &mut LinearVelocity, &Transform)>,
) {
    let (place, (_, radius)) = (explosion.place, Tool::Bomb.radii());
    let tag = inventory.next_tag();
    let crater = Brush::dig(Shape::sphere(place, radius)).with_roughness(Roughness::new(1.5, 3.6, 77));
    brushes.write(crater.with_power(Tool::Bomb.power()).with_tag(tag));
    hits.push(PendingHit { tag, point: place, direction: Vec3::Y, chips: 0.3 });
    bursts.write(Burst { place, direction: Vec3::ZERO, count: 22, speed: 9.0, kind: ParticleKind::Fire });
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

/// Shakes the camera and pushes the player, depending on the distance.
fn push_player(
    explosion: On<Explosion>,
    mut shake: ResMut<CameraShake>,
    mut bodies: Query<(&Transform, &mut CharacterMotion), With<Character>>,
) {
    let (_, radius) = Tool::Bomb.radii();
    for (place, mut motion) in &mut bodies {
        let away = place.translation - explosion.place;
        shake.add(1.6 * (1.0 - away.length() / 40.0).max(0.0));
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
