//! What other players look like: a figure with a helmet, a tool, and its name over its head.

use std::f32::consts::FRAC_PI_2;

use bevy::prelude::*;
use bevy::render::renderer::RenderDevice;
use bevy_burrow::prelude::*;

use super::connection::OwnNumber;
use super::players::{PlayerInfo, Pose, cleaned};
use crate::player::camera::PlayerCamera;
use crate::player::game_state::GameState;
use crate::ui::widgets;

/// Metres up to which names are shown.
const NAME_DISTANCE: f32 = 120.0;
/// Where a name is, above the feet.
const NAME_HEIGHT: f32 = 2.15;
/// How fast figures follow what is known of their players, per second.
const FOLLOW_RATE: f32 = 14.0;
/// A figure at least this far from its position is moved there at once.
const JUMP_DISTANCE: f32 = 8.0;
/// Luminous power of the lamp of a figure, in lumens.
const LAMP: f32 = 4_000_000.0;

/// Overalls, by the player's number.
const COLORS: [Color; 6] = [
    Color::srgb(0.20, 0.36, 0.62),
    Color::srgb(0.62, 0.24, 0.18),
    Color::srgb(0.22, 0.48, 0.26),
    Color::srgb(0.56, 0.40, 0.14),
    Color::srgb(0.42, 0.24, 0.52),
    Color::srgb(0.16, 0.46, 0.50),
];

/// The head of a figure, of this player.
#[derive(Component)]
struct Head(Entity);

/// The lamp on a head, of this player.
#[derive(Component)]
struct Lamp(Entity);

/// The name of this player, on the screen.
#[derive(Component)]
struct NameTag(Entity);

/// Shows other players.
pub struct FiguresPlugin;

impl Plugin for FiguresPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(spawn_figure).add_observer(remove_name).add_systems(
            Update,
            ((follow, turn_heads, switch_lamps), show_names).chain().after(BurrowSystems::Propagate),
        );
    }
}

/// Gives another player its figure.
fn spawn_figure(
    new: On<Add, Pose>,
    mut commands: Commands,
    players: Query<(&PlayerInfo, &Pose)>,
    own: Res<OwnNumber>,
    meshes: Option<ResMut<Assets<Mesh>>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
    renderer: Option<Res<RenderDevice>>,
) {
    // Without a renderer nobody looks, and Bevy can't remove lights.
    let (Some(mut meshes), Some(mut materials), Some(_)) = (meshes, materials, renderer) else { return };
    let Ok((player, pose)) = players.get(new.entity) else { return };
    if player.number == own.0 {
        return;
    }
    let mut part = |mesh: Mesh, color: Color, place: Transform| {
        let color = StandardMaterial { perceptual_roughness: 0.8, ..color.into() };
        (Mesh3d(meshes.add(mesh)), MeshMaterial3d(materials.add(color)), place)
    };
    let color = COLORS[(player.number % COLORS.len() as u64) as usize];
    let (skin, yellow) = (Color::srgb(0.72, 0.52, 0.40), Color::srgb(0.85, 0.66, 0.12));
    let (dark, steel) = (Color::srgb(0.10, 0.09, 0.09), Color::srgb(0.45, 0.46, 0.48));
    let leg = |x: f32| Transform::from_xyz(x, 0.35, 0.0);
    let arm = |x: f32| Transform::from_xyz(x, 1.12, -0.16).with_rotation(Quat::from_rotation_x(0.7));
    let body = [
        part(Capsule3d::new(0.26, 0.42).into(), color, Transform::from_xyz(0.0, 1.02, 0.0)),
        part(Capsule3d::new(0.11, 0.5).into(), dark, leg(-0.13)),
        part(Capsule3d::new(0.11, 0.5).into(), dark, leg(0.13)),
        part(Capsule3d::new(0.08, 0.42).into(), color, arm(-0.33)),
        part(Capsule3d::new(0.08, 0.42).into(), color, arm(0.33)),
    ];
    let tool = [
        part(
            Cylinder::new(0.025, 0.8).into(),
            Color::srgb(0.36, 0.24, 0.14),
            Transform::from_xyz(0.33, 1.1, -0.42),
        ),
        part(
            Capsule3d::new(0.035, 0.5).into(),
            steel,
            Transform::from_xyz(0.33, 1.47, -0.42).with_rotation(Quat::from_rotation_x(FRAC_PI_2)),
        ),
    ];
    let face = part(Sphere::new(0.19).into(), skin, Transform::default());
    let helmet = part(
        Sphere::new(0.22).into(),
        yellow,
        Transform::from_xyz(0.0, 0.07, 0.02).with_scale(Vec3::new(1.0, 0.8, 1.05)),
    );
    let lamp = part(Sphere::new(0.05).into(), Color::WHITE, Transform::from_xyz(0.0, 0.12, -0.21));
    let light = SpotLight {
        color: Color::srgb(1.0, 0.93, 0.80),
        intensity: 0.0,
        range: 50.0,
        inner_angle: 0.1,
        outer_angle: 0.8,
        ..default()
    };
    let of = new.entity;
    let place = Transform::from_translation(pose.feet).with_rotation(Quat::from_rotation_y(pose.yaw));
    commands.entity(of).insert((place, Visibility::default())).with_children(|figure| {
        for part in body.into_iter().chain(tool) {
            figure.spawn(part);
        }
        let head = Transform::from_xyz(0.0, 1.62, 0.0);
        figure.spawn((Head(of), head, Visibility::default())).with_children(|head| {
            head.spawn(face);
            head.spawn(helmet);
            head.spawn((Lamp(of), lamp, children![light]));
        });
    });
    let padding = UiRect::axes(px(6), px(1));
    let node = Node { position_type: PositionType::Absolute, padding, ..default() };
    commands.spawn((
        NameTag(of),
        widgets::panel(node),
        Visibility::Hidden,
        children![widgets::text(cleaned(&player.name), 16.0, widgets::WHITE)],
    ));
}

fn remove_name(gone: On<Remove, Pose>, mut commands: Commands, names: Query<(Entity, &NameTag)>) {
    for (entity, _) in names.iter().filter(|(_, name)| name.0 == gone.entity) {
        commands.entity(entity).try_despawn();
    }
}

/// Figures follow their players smoothly.
fn follow(time: Res<Time<Real>>, mut figures: Query<(&Pose, &mut Transform)>) {
    let part = 1.0 - (-FOLLOW_RATE * time.delta_secs()).exp();
    for (pose, mut place) in &mut figures {
        if !pose.feet.is_finite() || !pose.yaw.is_finite() {
            continue;
        }
        let is_far = place.translation.distance(pose.feet) > JUMP_DISTANCE;
        let part = if is_far { 1.0 } else { part };
        place.translation = place.translation.lerp(pose.feet, part);
        place.rotation = place.rotation.slerp(Quat::from_rotation_y(pose.yaw), part);
    }
}

fn turn_heads(poses: Query<&Pose>, mut heads: Query<(&Head, &mut Transform)>) {
    for (head, mut place) in &mut heads {
        if let Some(pose) = poses.get(head.0).ok().filter(|pose| pose.pitch.is_finite()) {
            place.rotation = Quat::from_rotation_x(pose.pitch.clamp(-1.2, 1.2));
        }
    }
}

fn switch_lamps(
    poses: Query<&Pose, Changed<Pose>>,
    lamps: Query<(&Lamp, &Children)>,
    mut lights: Query<&mut SpotLight>,
) {
    for (lamp, children) in &lamps {
        let Ok(pose) = poses.get(lamp.0) else { continue };
        let mut lights = lights.iter_many_mut(children);
        while let Some(mut light) = lights.fetch_next() {
            light.intensity = if pose.has_light { LAMP } else { 0.0 };
        }
    }
}

/// Puts names over heads, but not over menus.
fn show_names(
    state: Res<State<GameState>>,
    scale: Res<UiScale>,
    camera: Single<(&Camera, &Transform), With<PlayerCamera>>,
    figures: Query<&Transform, (With<Pose>, Without<PlayerCamera>)>,
    mut names: Query<(&NameTag, &mut Node, &mut Visibility, &ComputedNode)>,
) {
    let (camera, eye) = *camera;
    let view = GlobalTransform::from(*eye);
    for (name, mut node, mut shown, size) in &mut names {
        let place = figures.get(name.0).ok().map(|place| place.translation + Vec3::Y * NAME_HEIGHT);
        let place = place.filter(|place| place.distance(eye.translation) < NAME_DISTANCE);
        let place = place.filter(|_| *state.get() == GameState::Playing);
        let on_screen = place.and_then(|place| camera.world_to_viewport(&view, place).ok());
        let visibility = if on_screen.is_some() { Visibility::Visible } else { Visibility::Hidden };
        shown.set_if_neq(visibility);
        if let Some(at) = on_screen {
            let at = at / scale.0;
            let half = 0.5 * size.size() * size.inverse_scale_factor();
            let (left, top) = (px(at.x - half.x), px(at.y - 2.0 * half.y));
            if node.left != left || node.top != top {
                (node.left, node.top) = (left, top);
            }
        }
    }
}
