//! Balls: thrown, they bounce and roll about, and show where a hole leads to.

use avian3d::prelude::*;
use bevy::prelude::*;

use crate::tools::thrown::just_thrown;
use crate::tools::{Strike, Tool};
use crate::world::landscape::NewGame;

/// Metres per second, along the look.
const THROW: f32 = 12.0;
const RADIUS: f32 = 0.22;
/// At once; whoever throws more loses the oldest.
const BALLS: usize = 24;

/// A ball of rubber.
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

/// What balls are made of, one colour after the other, and how many there were.
#[derive(Resource)]
struct Supply {
    mesh: Handle<Mesh>,
    colours: Vec<Handle<StandardMaterial>>,
    thrown: usize,
}

/// Throws balls.
pub struct BallsPlugin;

impl Plugin for BallsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, fill_box).add_observer(throw).add_observer(pick_up);
    }
}

fn fill_box(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let rubber = |hue: f32| StandardMaterial {
        base_color: Color::hsl(hue, 0.75, 0.45),
        perceptual_roughness: 0.55,
        ..default()
    };
    let colours = [8.0, 45.0, 130.0, 200.0, 280.0].map(|hue| materials.add(rubber(hue))).to_vec();
    commands.insert_resource(Supply { mesh: meshes.add(Sphere::new(RADIUS)), colours, thrown: 0 });
}

fn throw(
    strike: On<Strike>,
    mut commands: Commands,
    mut supply: ResMut<Supply>,
    balls: Query<(Entity, &Ball)>,
) {
    if strike.tool != Tool::Ball {
        return;
    }
    if balls.count() >= BALLS
        && let Some((oldest, _)) = balls.iter().min_by_key(|(_, ball)| ball.number)
    {
        commands.entity(oldest).despawn();
    }
    let velocity = strike.along * THROW + Vec3::Y * 1.5;
    commands.spawn((
        Name::new("ball"),
        Ball { number: supply.thrown },
        just_thrown(),
        LinearVelocity(velocity),
        AngularVelocity(velocity.cross(Vec3::Y) * -0.3),
        Mesh3d(supply.mesh.clone()),
        MeshMaterial3d(supply.colours[supply.thrown % supply.colours.len()].clone()),
        // Within the thrower's own skin, so that it is never thrown into a wall.
        Transform::from_translation(strike.eye - Vec3::Y * 0.1 + strike.along * 0.15),
    ));
    supply.thrown += 1;
}

fn pick_up(_: On<NewGame>, mut commands: Commands, balls: Query<Entity, With<Ball>>) {
    for ball in &balls {
        commands.entity(ball).despawn();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_balls_lie_about_as_there_may_and_the_oldest_go_first() {
        let mut app = App::new();
        app.init_resource::<Assets<Mesh>>()
            .init_resource::<Assets<StandardMaterial>>()
            .add_plugins(BallsPlugin);
        app.update();
        let strike = |tool| Strike { tool, aim: None, eye: Vec3::ZERO, along: Vec3::X };
        for _ in 0..BALLS + 3 {
            app.world_mut().trigger(strike(Tool::Ball));
            app.world_mut().flush();
        }
        app.world_mut().trigger(strike(Tool::Bomb));
        let mut balls = app.world_mut().query::<(&Ball, &LinearVelocity, &Visibility)>();
        let mut left: Vec<usize> = balls.iter(app.world()).map(|(ball, ..)| ball.number).collect();
        left.sort_unstable();
        assert_eq!(left, Vec::from_iter(3..BALLS + 3));
        assert!(balls.iter(app.world()).all(|(_, velocity, _)| velocity.x > 10.0));
        // They come from between the eyes.
        assert!(balls.iter(app.world()).all(|(.., visibility)| *visibility == Visibility::Hidden));
        app.world_mut().trigger(NewGame);
        app.world_mut().flush();
        assert_eq!(balls.iter(app.world()).count(), 0);
    }
}
