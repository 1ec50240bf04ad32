//! The rain of balls, and the machine that digs under it.

use std::collections::VecDeque;

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::scene::{MIDDLE, SIDE};

/// Balls per step of physics.
const DROPS: usize = 1;

/// Edits a second.
const EDITS: f32 = 10.0;

/// A ball of the rain.
#[derive(Component, Clone, Copy)]
pub struct Ball;

/// The weather.
#[derive(Resource)]
pub struct Rain {
    /// Whether the machine digs.
    pub digs: bool,
    /// How many brushes it sent.
    pub edits: usize,
    most: usize,
    balls: VecDeque<Entity>,
    rng: Rng,
    looks: Vec<(Handle<Mesh>, Handle<StandardMaterial>)>,
}

impl Rain {
    /// A rain of at most `most` balls.
    pub fn new(most: usize) -> Self {
        Self { digs: true, edits: 0, most, balls: VecDeque::new(), rng: Rng::with_seed(1), looks: Vec::new() }
    }

    /// One ball more, fallen or thrown; the oldest one goes when there are too many.
    pub fn add(&mut self, commands: &mut Commands, place: Vec3, velocity: Vec3) {
        let ball = commands.spawn((self.ball(place), LinearVelocity(velocity))).id();
        self.balls.push_back(ball);
        if self.balls.len() > self.most
            && let Some(oldest) = self.balls.pop_front()
        {
            commands.entity(oldest).try_despawn();
        }
    }

    fn ball(&mut self, place: Vec3) -> impl Bundle + use<> {
        let number = self.rng.usize(0..RADII.len());
        let (mesh, material) = self.looks.get(number).cloned().unwrap_or_default();
        (
            Ball,
            RigidBody::Dynamic,
            Collider::sphere(RADII[number]),
            // Else they would roll forever.
            AngularDamping(0.4),
            Mesh3d(mesh),
            MeshMaterial3d(material),
            Transform::from_translation(place),
        )
    }
}

/// How large the balls are.
const RADII: [f32; 3] = [0.4, 0.6, 0.9];

/// Balls of some sizes and colours.
pub fn prepare(
    mut rain: ResMut<Rain>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for (radius, color) in RADII.into_iter().zip([
        Color::srgb(0.95, 0.35, 0.15),
        Color::srgb(0.95, 0.8, 0.2),
        Color::srgb(0.2, 0.45, 0.95),
    ]) {
        let mesh = Sphere::new(radius).mesh().ico(3).map(|mesh| meshes.add(mesh)).unwrap_or_default();
        let look = StandardMaterial { base_color: color, perceptual_roughness: 0.5, ..default() };
        rain.looks.push((mesh, materials.add(look)));
    }
}

/// Drops balls.
pub fn fall(mut commands: Commands, mut rain: ResMut<Rain>, terrains: Terrains) {
    // Not before there is ground to fall on.
    if !terrains.is_ready(MIDDLE, MIDDLE) {
        return;
    }
    for _ in 0..DROPS {
        let side = SIDE as f32;
        let along = |rng: &mut Rng| 4.0 + rng.f32() * (side - 8.0);
        let (x, z) = (along(&mut rain.rng), along(&mut rain.rng));
        let floor = terrains.height(x, z).unwrap_or(0.0);
        let place = Vec3::new(x, floor + 10.0 + 10.0 * rain.rng.f32(), z);
        rain.add(&mut commands, place, Vec3::ZERO);
    }
}

/// The machine: ten brushes a second, most of them digs.
pub fn dig(
    time: Res<Time>,
    terrains: Terrains,
    mut rain: ResMut<Rain>,
    mut rest: Local<f32>,
    mut brushes: MessageWriter<Brush>,
) {
    if !rain.digs {
        return;
    }
    *rest += time.delta_secs() * EDITS;
    while *rest >= 1.0 {
        *rest -= 1.0;
        let side = SIDE as f32;
        let mut along = || 8.0 + rain.rng.f32() * (side - 16.0);
        let (x, z) = (along(), along());
        let Some(floor) = terrains.height(x, z) else { continue };
        let radius = 2.0 + 3.0 * rain.rng.f32();
        let shape = Shape::sphere(Vec3::new(x, floor - 1.0, z), radius);
        let builds = rain.rng.u8(0..5) == 0;
        brushes.write(if builds { Brush::add(shape, MaterialId(2)) } else { Brush::dig(shape) });
        rain.edits += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_never_more_balls_than_were_allowed() {
        let (mut world, mut rain) = (World::new(), Rain::new(3));
        for number in 0..5 {
            rain.add(&mut world.commands(), Vec3::ZERO, Vec3::X * number as f32);
        }
        world.flush();
        let mut balls = world.query_filtered::<&LinearVelocity, With<Ball>>();
        let mut speeds: Vec<f32> = balls.iter(&world).map(|velocity| velocity.x).collect();
        speeds.sort_by(f32::total_cmp);
        assert_eq!(speeds, [2.0, 3.0, 4.0]);
    }
}
