//! The model of the tool in the player's hand: simple shapes close to the camera, animated with the swing.

use std::f32::consts::{FRAC_PI_2, TAU};

use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_burrow::physics::Character;
use bevy_burrow::prelude::*;

use self::PartMaterial as M;
use self::PartMesh as P;
use crate::player::body::Body;
use crate::player::camera::{DetachedCamera, PlayerCamera};
use crate::player::game_state::GameState;
use crate::tools::{Hand, Swing, Tool};
use crate::world::landscape;

/// The parent of all models.
#[derive(Component)]
pub struct ToolRoot;

/// The model of a tool. Only the selected tool's is visible.
#[derive(Component)]
struct Model(Tool);

/// The part of the drill that rotates.
#[derive(Component)]
struct DrillBit;

/// Has the colour of the selected material.
#[derive(Component)]
struct MaterialSample;

/// Whether the tool is shown. Scripts hide it for pictures of the landscape.
#[derive(Resource)]
pub struct ShowTool(pub bool);

/// Shows the tool in hand.
pub struct ToolInHandPlugin;

impl Plugin for ToolInHandPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(ShowTool(true))
            .add_systems(PostStartup, spawn_models)
            .add_systems(Update, (show, animate, color_sample).after(BurrowSystems::Propagate));
    }
}

/// The position at rest, relative to the camera. It is so close that no wall comes in between.
const REST: Vec3 = Vec3::new(0.155, -0.165, -0.30);

/// Meshes of about unit size, except for the rod and the spike.
#[derive(Clone, Copy)]
enum PartMesh {
    Rod,
    Spike,
    Block,
    Ball,
    Tube,
    Cone,
}

#[derive(Clone, Copy)]
enum PartMaterial {
    Wood,
    Steel,
    Gunmetal,
    Dark,
    Red,
    Bristle,
    Rubber,
    Sample,
    Glow,
}

/// A part of a model: its mesh and material, its position, its rotation around x, y and z, and its scale.
type Part = (PartMesh, PartMaterial, [f32; 3], [f32; 3], [f32; 3]);

const NO_TURN: [f32; 3] = [0.0; 3];
const FULL_SIZE: [f32; 3] = [1.0; 3];

/// A cylinder along the drill's axis, which points forward.
const fn drill_part(material: PartMaterial, radius: f32, length: f32, z: f32) -> Part {
    (P::Tube, material, [0.0, 0.05, z], [FRAC_PI_2, 0.0, 0.0], [radius, length, radius])
}

const fn ball(material: PartMaterial, y: f32, radius: f32) -> Part {
    (P::Ball, material, [0.0, y, 0.0], NO_TURN, [radius; 3])
}

const fn block(material: PartMaterial, place: [f32; 3], size: [f32; 3]) -> Part {
    (P::Block, material, place, NO_TURN, size)
}

const fn rod(material: PartMaterial, y: f32) -> Part {
    (P::Rod, material, [0.0, y, 0.0], NO_TURN, FULL_SIZE)
}

const MODELS: [(Tool, &[Part]); 8] = [
    (
        Tool::Pickaxe,
        &[
            rod(M::Wood, 0.0),
            block(M::Steel, [0.0, 0.155, 0.0], [0.026, 0.030, 0.052]),
            (P::Spike, M::Steel, [0.0, 0.146, -0.085], [-FRAC_PI_2 - 0.16, 0.0, 0.0], FULL_SIZE),
            (P::Spike, M::Steel, [0.0, 0.146, 0.085], [FRAC_PI_2 + 0.16, 0.0, 0.0], FULL_SIZE),
        ],
    ),
    (
        Tool::Shovel,
        &[
            rod(M::Wood, -0.01),
            block(M::Steel, [0.0, 0.19, 0.0], [0.095, 0.12, 0.008]),
            (P::Cone, M::Steel, [0.0, 0.275, 0.0], NO_TURN, [0.0475, 0.05, 0.004]),
        ],
    ),
    (
        Tool::Drill,
        &[
            // Motor with its bands, gearbox and chuck.
            drill_part(M::Red, 0.032, 0.120, 0.020),
            drill_part(M::Dark, 0.029, 0.016, 0.086),
            drill_part(M::Steel, 0.0332, 0.006, 0.062),
            drill_part(M::Steel, 0.0332, 0.006, -0.030),
            drill_part(M::Dark, 0.026, 0.030, -0.055),
            drill_part(M::Steel, 0.019, 0.028, -0.084),
            block(M::Dark, [0.0, 0.081, 0.016], [0.022, 0.006, 0.060]),
            block(M::Dark, [-0.031, 0.058, 0.016], [0.006, 0.018, 0.060]),
            // The grip with its trigger, and the handle for the other hand.
            (P::Block, M::Dark, [0.0, -0.018, 0.052], [0.25, 0.0, 0.0], [0.028, 0.105, 0.036]),
            block(M::Red, [0.0, 0.002, 0.026], [0.012, 0.024, 0.012]),
            (P::Tube, M::Dark, [-0.060, 0.050, -0.052], [0.0, 0.0, FRAC_PI_2], [0.011, 0.075, 0.011]),
        ],
    ),
    (Tool::Builder, &[(P::Block, M::Sample, [0.0, 0.07, 0.0], [0.0, 0.6, 0.0], [0.10; 3])]),
    (
        Tool::Painter,
        &[
            rod(M::Wood, -0.03),
            block(M::Steel, [0.0, 0.15, 0.0], [0.075, 0.03, 0.024]),
            block(M::Bristle, [0.0, 0.185, 0.0], [0.072, 0.05, 0.020]),
            block(M::Sample, [0.0, 0.21, 0.0], [0.070, 0.018, 0.020]),
        ],
    ),
    (
        Tool::Bomb,
        &[
            ball(M::Dark, 0.03, 0.042),
            (P::Tube, M::Dark, [0.0, 0.072, 0.0], NO_TURN, [0.012, 0.014, 0.012]),
            ball(M::Glow, 0.088, 0.008),
        ],
    ),
    (
        Tool::Lamp,
        &[
            (P::Rod, M::Dark, [0.0, -0.06, 0.0], NO_TURN, [0.8, 0.6, 0.8]),
            ball(M::Glow, 0.085, 0.038),
            (P::Tube, M::Dark, [0.0, 0.13, 0.0], NO_TURN, [0.046, 0.012, 0.046]),
        ],
    ),
    (Tool::Ball, &[ball(M::Rubber, 0.03, 0.040)]),
];

/// The drill's bit, built upright: a core, a tip, and a helix of plates.
fn drill_bit() -> impl Iterator<Item = Part> {
    const PLATES: usize = 16;
    let core = (P::Tube, M::Dark, [0.0; 3], NO_TURN, [0.011, 0.14, 0.011]);
    let tip = (P::Cone, M::Gunmetal, [0.0, 0.085, 0.0], NO_TURN, [0.020, 0.050, 0.020]);
    let plate = |step: usize| {
        let y = -0.058 + 0.128 * step as f32 / PLATES as f32;
        (P::Block, M::Gunmetal, [0.0, y, 0.0], [0.35, step as f32 * 0.55, 0.0], [0.048, 0.0035, 0.012])
    };
    [core, tip].into_iter().chain((0..PLATES).map(plate))
}

fn spawn_models(
    mut commands: Commands,
    camera: Single<Entity, With<PlayerCamera>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) -> Result {
    // In the order of `PartMesh`.
    let meshes: [Handle<Mesh>; 6] = [
        meshes.add(Cylinder::new(0.010, 0.34)),
        meshes.add(Cone::new(0.017, 0.13)),
        meshes.add(Cuboid::from_length(1.0)),
        meshes.add(Sphere::new(1.0).mesh().ico(3)?),
        meshes.add(Cylinder::new(1.0, 1.0)),
        meshes.add(Cone::new(1.0, 1.0)),
    ];
    // In the order of `PartMaterial`: colour, roughness and metallic. The headlamp is so close that bright colours
    // would be overexposed.
    let materials = [
        (Color::srgb(0.45, 0.29, 0.16), 0.85, 0.0),
        (Color::srgb(0.52, 0.55, 0.58), 0.42, 0.55),
        (Color::srgb(0.27, 0.28, 0.30), 0.55, 0.4),
        (Color::srgb(0.10, 0.10, 0.11), 0.5, 0.3),
        (Color::srgb(0.66, 0.16, 0.10), 0.6, 0.0),
        (Color::srgb(0.80, 0.72, 0.52), 0.95, 0.0),
        (Color::hsl(8.0, 0.75, 0.45), 0.55, 0.0),
        (Color::WHITE, 0.95, 0.0),
        (Color::linear_rgb(2.6, 1.7, 0.6), 1.0, 0.0),
    ]
    .map(|(base_color, perceptual_roughness, metallic)| {
        let unlit = base_color.to_linear().red > 1.0;
        materials.add(StandardMaterial { base_color, perceptual_roughness, metallic, unlit, ..default() })
    });
    let spawn = |parent: &mut ChildSpawnerCommands, (mesh, material, place, turn, scale): Part| {
        let [x, y, z] = turn;
        let place = Transform::from_translation(place.into())
            .with_rotation(Quat::from_euler(EulerRot::YXZ, y, x, z))
            .with_scale(scale.into());
        let mut part = parent.spawn((
            Mesh3d(meshes[mesh as usize].clone()),
            MeshMaterial3d(materials[material as usize].clone()),
            place,
            NotShadowCaster,
        ));
        if matches!(material, M::Sample) {
            part.insert(MaterialSample);
        }
    };
    let root = (Name::new("tool in hand"), ToolRoot, Transform::from_translation(REST), Visibility::Hidden);
    commands.spawn((root, ChildOf(*camera))).with_children(|root| {
        for (tool, parts) in MODELS {
            root.spawn((Model(tool), Transform::IDENTITY, Visibility::Hidden)).with_children(|model| {
                parts.iter().for_each(|part| spawn(model, *part));
                if tool == Tool::Drill {
                    let forward = Quat::from_rotation_x(-FRAC_PI_2);
                    let place = Transform::from_xyz(0.0, 0.05, -0.165).with_rotation(forward);
                    model
                        .spawn((DrillBit, place, Visibility::Inherited))
                        .with_children(|bit| drill_bit().for_each(|part| spawn(bit, part)));
                }
            });
        }
    });
    Ok(())
}

/// Shows the selected tool while the camera is the player's.
fn show(
    hand: Res<Hand>,
    swing: Res<Swing>,
    shown: Res<ShowTool>,
    state: Res<State<GameState>>,
    is_detached: Single<Has<DetachedCamera>, With<PlayerCamera>>,
    mut root: Single<&mut Visibility, (With<ToolRoot>, Without<Model>)>,
    mut models: Query<(&Model, &mut Visibility), Without<ToolRoot>>,
) {
    let is_shown = shown.0 && !*is_detached && *state.get() != GameState::Title;
    root.set_if_neq(if is_shown { Visibility::Inherited } else { Visibility::Hidden });
    let tool = if swing.phase().is_some() { swing.tool } else { hand.tool };
    for (model, mut visibility) in &mut models {
        visibility.set_if_neq(if model.0 == tool { Visibility::Inherited } else { Visibility::Hidden });
    }
}

/// Moves the tool with the swing and with the player's steps.
fn animate(
    time: Res<Time>,
    hand: Res<Hand>,
    swing: Res<Swing>,
    bodies: Query<Body, With<Character>>,
    mut root: Single<&mut Transform, (With<ToolRoot>, Without<DrillBit>, Without<Character>)>,
    mut bits: Query<&mut Transform, (With<DrillBit>, Without<Character>)>,
    mut steps: Local<f32>,
    mut lowered: Local<(f32, Option<Tool>)>,
) {
    let dt = time.delta_secs();
    let walking = bodies.iter().filter(|body| body.motion.grounded);
    let speed: f32 = walking.map(|body| body.motion.velocity.xz().length()).sum();
    *steps += dt * speed * 1.35;
    let stride = (speed / 6.0).min(1.0);
    let bob = Vec3::new((*steps).sin() * 0.006, -(2.0 * *steps).sin().abs() * 0.006, 0.0) * stride;
    // A newly selected tool comes up from below.
    if lowered.1 != Some(hand.tool) {
        *lowered = (1.0, Some(hand.tool));
    }
    lowered.0 *= (-9.0 * dt).exp();
    let tool = if swing.phase().is_some() { swing.tool } else { hand.tool };
    let (rotation, offset) = pose(tool, swing.phase());
    let place = REST + bob + offset - Vec3::Y * 0.25 * lowered.0;
    **root = Transform::from_translation(place).with_rotation(rotation);
    if swing.phase().is_some() && swing.tool == Tool::Drill {
        for mut bit in &mut bits {
            bit.rotate_local_y(TAU * 5.0 * dt);
        }
    }
}

/// The rotation and offset of a tool in a phase of its swing.
fn pose(tool: Tool, phase: Option<f32>) -> (Quat, Vec3) {
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    // The tool is pulled back before the hit, follows through after it, and returns.
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
            // The bit points to the middle of the view; otherwise the motor would hide it.
            let turn = Quat::from_rotation_y(0.26) * Quat::from_rotation_x(0.10);
            (turn, Vec3::new(shake - 0.005, shake * 0.7 - 0.012, -0.07 - 0.02 * through))
        }
        Tool::Builder | Tool::Bomb | Tool::Lamp | Tool::Ball => (
            lean * Quat::from_rotation_x(0.5 * back - 0.5 * through),
            Vec3::new(-0.02 * through, 0.05 * back + 0.02 * through, 0.05 * back - 0.10 * through),
        ),
    }
}

/// The builder and the painter show the selected material.
fn color_sample(
    hand: Res<Hand>,
    samples: Query<&MeshMaterial3d<StandardMaterial>, With<MaterialSample>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut last: Local<Option<MaterialId>>,
) {
    if *last == Some(hand.material) {
        return;
    }
    for handle in &samples {
        if let Some(mut material) = materials.get_mut(&handle.0) {
            material.base_color = landscape::colour(hand.material).into();
            *last = Some(hand.material);
        }
    }
}
