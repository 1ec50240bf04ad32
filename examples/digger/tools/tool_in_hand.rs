//! The tool that the player sees in hand: simple shapes, close to the eyes, swung as the hand swings.

use std::f32::consts::{FRAC_PI_2, TAU};

use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_burrow::physics::Character;
use bevy_burrow::prelude::*;

use crate::player::Drone;
use crate::player::body::Body;
use crate::player::game_state::Phase;
use crate::tools::{Hand, Swing, Tool};
use crate::world::light::Eyes;

/// The hand itself; each tool is a child of it.
#[derive(Component)]
pub struct Held;

/// One of the tools in the hand; only the chosen one is seen.
#[derive(Component)]
struct Model(Tool);

/// What turns while the drill works.
#[derive(Component)]
struct Bit;

/// Has the colour of the chosen material.
#[derive(Component)]
struct Sample;

/// Is the hand shown at all? Not on pictures of the landscape.
#[derive(Resource)]
pub struct ShowHand(pub bool);

/// Shows the tool in hand.
pub struct HeldPlugin;

impl Plugin for HeldPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(ShowHand(true))
            .add_systems(PostStartup, grip)
            .add_systems(Update, (show, carry, tint).after(BurrowSystems::Propagate));
    }
}

/// Where the hand rests, seen from the eyes: so near that no wall comes between.
const REST: Vec3 = Vec3::new(0.155, -0.165, -0.30);

/// Plates of the drill's thread.
const THREAD: usize = 16;

fn grip(
    mut commands: Commands,
    eyes: Single<Entity, With<Eyes>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let mut dye = |color: Color, roughness: f32, metallic: f32| {
        materials.add(StandardMaterial {
            base_color: color,
            perceptual_roughness: roughness,
            metallic,
            ..default()
        })
    };
    let wood = dye(Color::srgb(0.45, 0.29, 0.16), 0.85, 0.0);
    let steel = dye(Color::srgb(0.52, 0.55, 0.58), 0.42, 0.55);
    // So near to the wall that the lamp would burn anything brighter.
    let gunmetal = dye(Color::srgb(0.27, 0.28, 0.30), 0.55, 0.4);
    let dark = dye(Color::srgb(0.10, 0.10, 0.11), 0.5, 0.3);
    let red = dye(Color::srgb(0.66, 0.16, 0.10), 0.6, 0.0);
    let bristle = dye(Color::srgb(0.80, 0.72, 0.52), 0.95, 0.0);
    let rubber = dye(Color::hsl(8.0, 0.75, 0.45), 0.55, 0.0);
    let sample = dye(Color::WHITE, 0.95, 0.0);
    let glow = materials.add(StandardMaterial {
        base_color: Color::linear_rgb(2.6, 1.7, 0.6),
        unlit: true,
        ..default()
    });

    let rod = meshes.add(Cylinder::new(0.010, 0.34));
    let spike = meshes.add(Cone::new(0.017, 0.13));
    let block = meshes.add(Cuboid::from_length(1.0));
    let ball = meshes.add(Sphere::new(1.0).mesh().ico(3).unwrap_or_else(|_| Sphere::new(1.0).mesh().build()));
    let tube = meshes.add(Cylinder::new(1.0, 1.0));
    let cone = meshes.add(Cone::new(1.0, 1.0));

    let at = Transform::from_xyz;
    let pitch = |by: f32| Quat::from_rotation_x(by);
    type Part = (Handle<Mesh>, Handle<StandardMaterial>, Transform);
    let part = |mesh: &Handle<Mesh>, material: &Handle<StandardMaterial>, place: Transform| -> Part {
        (mesh.clone(), material.clone(), place)
    };
    // A drum on the drill's axis, which points ahead.
    let along = |material: &Handle<StandardMaterial>, radius: f32, length: f32, z: f32| -> Part {
        let place = at(0.0, 0.05, z).with_rotation(pitch(FRAC_PI_2));
        part(&tube, material, place.with_scale(Vec3::new(radius, length, radius)))
    };
    let models: [(Tool, Vec<Part>); 8] = [
        (
            Tool::Pickaxe,
            vec![
                part(&rod, &wood, at(0.0, 0.0, 0.0)),
                part(&block, &steel, at(0.0, 0.155, 0.0).with_scale(Vec3::new(0.026, 0.030, 0.052))),
                part(&spike, &steel, at(0.0, 0.146, -0.085).with_rotation(pitch(-FRAC_PI_2 - 0.16))),
                part(&spike, &steel, at(0.0, 0.146, 0.085).with_rotation(pitch(FRAC_PI_2 + 0.16))),
            ],
        ),
        (
            Tool::Shovel,
            vec![
                part(&rod, &wood, at(0.0, -0.01, 0.0)),
                part(&block, &steel, at(0.0, 0.19, 0.0).with_scale(Vec3::new(0.095, 0.12, 0.008))),
                part(&cone, &steel, at(0.0, 0.275, 0.0).with_scale(Vec3::new(0.0475, 0.05, 0.004))),
            ],
        ),
        (
            Tool::Drill,
            vec![
                // Motor, its bands and vents, the gearbox, and the chuck.
                along(&red, 0.032, 0.120, 0.020),
                along(&dark, 0.029, 0.016, 0.086),
                along(&steel, 0.0332, 0.006, 0.062),
                along(&steel, 0.0332, 0.006, -0.030),
                along(&dark, 0.026, 0.030, -0.055),
                along(&steel, 0.019, 0.028, -0.084),
                part(&block, &dark, at(0.0, 0.081, 0.016).with_scale(Vec3::new(0.022, 0.006, 0.060))),
                part(&block, &dark, at(-0.031, 0.058, 0.016).with_scale(Vec3::new(0.006, 0.018, 0.060))),
                // The grip with its trigger, and the handle for the other hand.
                part(
                    &block,
                    &dark,
                    at(0.0, -0.018, 0.052)
                        .with_rotation(pitch(0.25))
                        .with_scale(Vec3::new(0.028, 0.105, 0.036)),
                ),
                part(&block, &red, at(0.0, 0.002, 0.026).with_scale(Vec3::new(0.012, 0.024, 0.012))),
                part(
                    &tube,
                    &dark,
                    at(-0.060, 0.050, -0.052)
                        .with_rotation(Quat::from_rotation_z(FRAC_PI_2))
                        .with_scale(Vec3::new(0.011, 0.075, 0.011)),
                ),
            ],
        ),
        (Tool::Builder, vec![]),
        (
            Tool::Painter,
            vec![
                part(&rod, &wood, at(0.0, -0.03, 0.0)),
                part(&block, &steel, at(0.0, 0.15, 0.0).with_scale(Vec3::new(0.075, 0.03, 0.024))),
                part(&block, &bristle, at(0.0, 0.185, 0.0).with_scale(Vec3::new(0.072, 0.05, 0.020))),
            ],
        ),
        (
            Tool::Bomb,
            vec![
                part(&ball, &dark, at(0.0, 0.03, 0.0).with_scale(Vec3::splat(0.042))),
                part(&tube, &dark, at(0.0, 0.072, 0.0).with_scale(Vec3::new(0.012, 0.014, 0.012))),
                part(&ball, &glow, at(0.0, 0.088, 0.0).with_scale(Vec3::splat(0.008))),
            ],
        ),
        (
            Tool::Lamp,
            vec![
                part(&rod, &dark, at(0.0, -0.06, 0.0).with_scale(Vec3::new(0.8, 0.6, 0.8))),
                part(&ball, &glow, at(0.0, 0.085, 0.0).with_scale(Vec3::splat(0.038))),
                part(&tube, &dark, at(0.0, 0.13, 0.0).with_scale(Vec3::new(0.046, 0.012, 0.046))),
            ],
        ),
        (Tool::Ball, vec![part(&ball, &rubber, at(0.0, 0.03, 0.0).with_scale(Vec3::splat(0.040)))]),
    ];
    let piece =
        |(mesh, material, place): Part| (Mesh3d(mesh), MeshMaterial3d(material), place, NotShadowCaster);
    commands.entity(*eyes).with_children(|eyes| {
        eyes.spawn((Name::new("hand"), Held, Transform::from_translation(REST), Visibility::Hidden))
            .with_children(|hand| {
                for (tool, parts) in models {
                    let mut model = hand.spawn((Model(tool), Transform::IDENTITY, Visibility::Hidden));
                    model.with_children(|model| {
                        for part in parts {
                            model.spawn(piece(part));
                        }
                        if tool == Tool::Drill {
                            // Upright as it is made: a core, a tip, and a thread of plates around it.
                            let place = at(0.0, 0.05, -0.165).with_rotation(pitch(-FRAC_PI_2));
                            let mut bit = model.spawn((Bit, place, Visibility::Inherited));
                            bit.with_children(|bit| {
                                let core = Vec3::new(0.011, 0.14, 0.011);
                                bit.spawn(piece(part(&tube, &dark, Transform::from_scale(core))));
                                let tip = Vec3::new(0.020, 0.050, 0.020);
                                bit.spawn(piece(part(&cone, &gunmetal, at(0.0, 0.085, 0.0).with_scale(tip))));
                                for step in 0..THREAD {
                                    let turn = Quat::from_rotation_y(step as f32 * 0.55);
                                    let y = -0.058 + 0.128 * step as f32 / THREAD as f32;
                                    let plate = at(0.0, y, 0.0)
                                        .with_rotation(turn * Quat::from_rotation_x(0.35))
                                        .with_scale(Vec3::new(0.048, 0.0035, 0.012));
                                    bit.spawn(piece(part(&block, &gunmetal, plate)));
                                }
                            });
                        }
                        if matches!(tool, Tool::Builder | Tool::Painter) {
                            let place = match tool {
                                Tool::Builder => at(0.0, 0.07, 0.0)
                                    .with_scale(Vec3::splat(0.10))
                                    .with_rotation(Quat::from_rotation_y(0.6)),
                                _ => at(0.0, 0.21, 0.0).with_scale(Vec3::new(0.070, 0.018, 0.020)),
                            };
                            model.spawn((Sample, piece(part(&block, &sample, place))));
                        }
                    });
                }
            });
    });
}

/// The chosen tool, while someone plays and looks through his own eyes.
fn show(
    hand: Res<Hand>,
    swing: Res<Swing>,
    shown: Res<ShowHand>,
    phase: Res<State<Phase>>,
    eyes: Single<Has<Drone>, With<Eyes>>,
    mut held: Single<&mut Visibility, (With<Held>, Without<Model>)>,
    mut models: Query<(&Model, &mut Visibility), Without<Held>>,
) {
    let in_hand = shown.0 && !*eyes && *phase.get() != Phase::Title;
    held.set_if_neq(if in_hand { Visibility::Inherited } else { Visibility::Hidden });
    let tool = if swing.phase().is_some() { swing.tool } else { hand.tool };
    for (model, mut visibility) in &mut models {
        visibility.set_if_neq(if model.0 == tool { Visibility::Inherited } else { Visibility::Hidden });
    }
}

/// Swings, bobs with the steps, and sways behind the look.
fn carry(
    time: Res<Time>,
    hand: Res<Hand>,
    swing: Res<Swing>,
    bodies: Query<Body, With<Character>>,
    mut held: Single<&mut Transform, (With<Held>, Without<Bit>, Without<Character>)>,
    mut bits: Query<&mut Transform, (With<Bit>, Without<Character>)>,
    mut steps: Local<f32>,
    mut sink: Local<(f32, Option<Tool>)>,
) {
    let dt = time.delta_secs();
    let speed: f32 = bodies
        .iter()
        .filter(|body| body.motion.grounded)
        .map(|body| body.motion.velocity.xz().length())
        .sum();
    *steps += dt * speed * 1.35;
    let stride = (speed / 6.0).min(1.0);
    let bob = Vec3::new((*steps).sin() * 0.006, -(2.0 * *steps).sin().abs() * 0.006, 0.0) * stride;
    // A tool that was just chosen comes up from below.
    if sink.1 != Some(hand.tool) {
        *sink = (1.0, Some(hand.tool));
    }
    sink.0 *= (-9.0 * dt).exp();
    let (turn, shift) = pose(if swing.phase().is_some() { swing.tool } else { hand.tool }, swing.phase());
    **held = Transform::from_translation(REST + bob + shift - Vec3::Y * 0.25 * sink.0).with_rotation(turn);
    if swing.phase().is_some() && swing.tool == Tool::Drill {
        for mut bit in &mut bits {
            bit.rotate_local_y(TAU * 5.0 * dt);
        }
    }
}

/// How a tool is held at a moment of its swing: turned and shifted.
fn pose(tool: Tool, phase: Option<f32>) -> (Quat, Vec3) {
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    // Pulled back before the hit, through after it, and home again.
    let (back, through) = match phase {
        None => (0.0, 0.0),
        Some(t) if t < -0.35 => (ease((t + 1.0) / 0.65), 0.0),
        Some(t) if t < 0.0 => {
            let strike = (t + 0.35) / 0.35;
            (1.0 - strike * strike, strike * strike)
        }
        Some(t) => (0.0, 1.0 - ease(t)),
    };
    let lean = Quat::from_rotation_z(0.16) * Quat::from_rotation_y(0.22);
    match tool {
        Tool::Pickaxe => (
            Quat::from_rotation_y(0.18 * through)
                * lean
                * Quat::from_rotation_x(-0.22 + 0.75 * back - 1.05 * through),
            Vec3::new(-0.05 * through, 0.06 * back - 0.01 * through, 0.03 * back - 0.05 * through),
        ),
        Tool::Shovel | Tool::Painter => (
            lean * Quat::from_rotation_x(-0.75 + 0.35 * back - 0.35 * through),
            Vec3::new(-0.02 * through, -0.02 + 0.02 * back, 0.04 * back - 0.07 * through),
        ),
        Tool::Drill => {
            let shake = phase.map_or(0.0, |t| (t * 19.0).sin() * 0.004);
            // Its bit leads to the middle of the view, or nobody would see it behind the motor.
            let turn = Quat::from_rotation_y(0.26) * Quat::from_rotation_x(0.10);
            (turn, Vec3::new(shake - 0.005, shake * 0.7 - 0.012, -0.07 - 0.02 * through))
        }
        Tool::Builder | Tool::Bomb | Tool::Lamp | Tool::Ball => (
            lean * Quat::from_rotation_x(0.5 * back - 0.5 * through),
            Vec3::new(-0.02 * through, 0.05 * back + 0.02 * through, 0.05 * back - 0.10 * through),
        ),
    }
}

/// Builder and painter show what they work with.
fn tint(
    hand: Res<Hand>,
    samples: Query<&MeshMaterial3d<StandardMaterial>, With<Sample>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut last: Local<Option<MaterialId>>,
) {
    if *last == Some(hand.material) {
        return;
    }
    for handle in &samples {
        if let Some(mut material) = materials.get_mut(&handle.0) {
            material.base_color = crate::world::landscape::colour(hand.material).into();
            *last = Some(hand.material);
        }
    }
}
