//! Balls: they bounce and roll, and show where a hole leads.

use avian3d::prelude::*;
use bevy::prelude::*;

use crate::tools::thrown::thrown;
use crate::tools::{Tool, ToolUsed};

/// Metres per second.
const SPEED: f32 = 12.0;
const RADIUS: f32 = 0.22;
/// The oldest ball is removed if there would be more.
const MAX_BALLS: usize = 24;

/// A rubber ball.
#[derive(Component, Clone, Copy, Debug)]
#[require(
    Visibility,
    RigidBody::Dynamic,
    Collider::sphere(RADIUS),
    ColliderDensity(0.3),
    Restitution::new(0.72),
    Friction::new(0.8),
    AngularDamping(0.3),
    TransformInterpolation
)]
pub struct Ball {
    number: usize,
}

#[derive(Resource)]
struct BallAssets {
    mesh: Handle<Mesh>,
    /// Balls take turns with these.
    materials: Vec<Handle<StandardMaterial>>,
    thrown: usize,
}

/// Lets the player throw balls.
pub struct BallsPlugin;

impl Plugin for BallsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, create_assets).add_observer(throw);
    }
}

fn create_assets(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let rubber = |hue: f32| StandardMaterial {
        base_color: Color::hsl(hue, 0.75, 0.45),
        perceptual_roughness: 0.55,
        ..default()
    };
    let materials = [8.0, 45.0, 130.0, 200.0, 280.0].map(|hue| materials.add(rubber(hue))).to_vec();
    commands.insert_resource(BallAssets { mesh: meshes.add(Sphere::new(RADIUS)), materials, thrown: 0 });
}

fn throw(
    used: On<ToolUsed>,
    mut commands: Commands,
    mut assets: ResMut<BallAssets>,
    balls: Query<(Entity, &Ball)>,
) {
    if used.tool != Tool::Ball {
        return;
    }
    if balls.count() >= MAX_BALLS
        && let Some((oldest, _)) = balls.iter().min_by_key(|(_, ball)| ball.number)
    {
        commands.entity(oldest).despawn();
    }
    // Within the player's own body, so that it never starts in a wall.
    let place = used.eye - Vec3::Y * 0.1 + used.direction * 0.15;
    commands.spawn((
        Name::new("ball"),
        Ball { number: assets.thrown },
        thrown(place, used.direction * SPEED + Vec3::Y * 1.5, 0.3),
        Mesh3d(assets.mesh.clone()),
        MeshMaterial3d(assets.materials[assets.thrown % assets.materials.len()].clone()),
    ));
    assets.thrown += 1;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_balls_make_room_for_new_ones() {
        let mut app = App::new();
        app.init_resource::<Assets<Mesh>>()
            .init_resource::<Assets<StandardMaterial>>()
            .add_plugins(BallsPlugin);
        app.update();
        let used = |tool| ToolUsed { tool, aim: None, eye: Vec3::ZERO, direction: Vec3::X };
        for _ in 0..MAX_BALLS + 3 {
            app.world_mut().trigger(used(Tool::Ball));
            app.world_mut().flush();
        }
        app.world_mut().trigger(used(Tool::Bomb));
        let mut balls = app.world_mut().query::<(&Ball, &LinearVelocity, &Visibility)>();
        let mut left: Vec<usize> = balls.iter(app.world()).map(|(ball, ..)| ball.number).collect();
        left.sort_unstable();
        assert_eq!(left, Vec::from_iter(3..MAX_BALLS + 3));
        assert!(balls.iter(app.world()).all(|(_, velocity, _)| velocity.x > 10.0));
        assert!(balls.iter(app.world()).all(|(.., visibility)| *visibility == Visibility::Hidden));
    }
}
