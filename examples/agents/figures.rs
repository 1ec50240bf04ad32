//! The walking agents: capsules that landmass steers over the ground. (The figures of the guide are in `examples/figures`.)

use bevy::prelude::*;
use bevy_burrow::paths::bevy_landmass::prelude::*;
use bevy_burrow::prelude::*;

use crate::scene::{AGENT, PASS, PLAIN, Paths};

/// The number of agents.
pub const COUNT: usize = 12;
/// How many of them start ahead of the others, and walk faster.
const FIRST: usize = 4;

/// An agent's start and destination.
#[derive(Component, Clone, Copy)]
pub struct Figure {
    pub home: Vec3,
    pub goal: Vec3,
}

/// Spawns all figures on the plain before the ridge.
pub fn spawn(
    mut commands: Commands,
    paths: Res<Paths>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let body = meshes.add(Capsule3d::new(AGENT.radius, AGENT.height - 2.0 * AGENT.radius));
    for number in 0..COUNT {
        let row = |number: usize| number as f32;
        let home = match number {
            0..FIRST => Vec3::new(PASS.x - 4.5 + 3.0 * row(number), PLAIN, 24.0),
            _ => Vec3::new(PASS.x - 4.0 + 3.0 * row(number % 4), PLAIN, 4.0 + 3.0 * row(number / 4)),
        };
        // The first ones are through the pass before the others come near.
        let speed = if number < FIRST { 5.0 } else { 3.0 };
        let goal = Vec3::new(34.0 + 3.0 * row(number), PLAIN, 80.0);
        let color = Color::hsl(360.0 * number as f32 / COUNT as f32, 0.85, 0.5);
        let figure = commands
            .spawn((
                Figure { home, goal },
                Transform::from_translation(home),
                Visibility::default(),
                Agent3dBundle {
                    agent: default(),
                    settings: AgentSettings { radius: AGENT.radius, desired_speed: speed, max_speed: 6.0 },
                    archipelago_ref: ArchipelagoRef3d::new(paths.0),
                },
                AgentTarget3d::Point(goal),
            ))
            .id();
        commands.spawn((
            Mesh3d(body.clone()),
            MeshMaterial3d(materials.add(color)),
            Transform::from_xyz(0.0, AGENT.height / 2.0, 0.0),
            ChildOf(figure),
        ));
    }
}

/// Walks as far as a figure wants to, on the ground that is nearest to its feet.
pub fn walk(
    mut figures: Query<(&mut Transform, &mut Velocity3d, &AgentDesiredVelocity3d), With<Figure>>,
    terrain: Single<&Terrain>,
    time: Res<Time>,
) {
    let world = terrain.world();
    for (mut place, mut velocity, wanted) in &mut figures {
        let wanted = wanted.velocity().with_y(0.0);
        let before = place.translation;
        let mut at = before + wanted * time.delta_secs();
        let spans = world.spans(f64::from(at.x), f64::from(at.z)).into_iter();
        let floors = spans.map(|span| span.floor as f32);
        if let Some(floor) = floors.min_by(|a, b| (a - at.y).abs().total_cmp(&(b - at.y).abs())) {
            at.y = floor;
        }
        place.translation = at;
        velocity.velocity = wanted;
    }
}
