//! Placing with handles: the brush stays where it is put, is moved, turned and sized, and then makes one edit.

use bevy::gizmos::transform_gizmo::{
    TransformGizmoFocus, TransformGizmoMode, TransformGizmoPlugin, TransformGizmoSettings,
};
use bevy::prelude::*;
use bevy_burrow::panel::{BrushTool, ToolShape, keyboard_is_free};
use bevy_burrow::prelude::*;

use crate::stroke::{Aim, REACH, Strokes, aim};

/// Handles for the brush, on `G`.
pub struct PlacingPlugin;

impl Plugin for PlacingPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(TransformGizmoPlugin)
            .add_systems(Update, place.run_if(keyboard_is_free).after(aim).before(BurrowSystems::Collect));
    }
}

/// Where the brush is placed; it has Bevy's handles.
#[derive(Component)]
#[require(Transform, TransformGizmoFocus)]
pub struct Placing;

/// `G` puts the brush down where the pointer is, then shows the next kind of handles. `B` drops it onto the ground, `Enter` makes
/// the edit, `Backspace` takes the brush back into the hand.
fn place(
    mut commands: Commands,
    keys: Res<ButtonInput<KeyCode>>,
    aim: Res<Aim>,
    tool: Res<BrushTool>,
    terrains: Terrains,
    terrain: Option<Single<&Terrain>>,
    placing: Option<Single<(Entity, &mut Transform), With<Placing>>>,
    mut handles: ResMut<TransformGizmoSettings>,
    mut strokes: ResMut<Strokes>,
    mut brushes: MessageWriter<Brush>,
) {
    let is_path = tool.fitting_shape() == ToolShape::Path;
    let Some(placing) = placing else {
        if let (true, false, Some(hit)) = (keys.just_pressed(KeyCode::KeyG), is_path, &aim.0) {
            // How the tool itself is turned about its axis comes on top.
            let upright = BrushTool { turn: 0.0, ..tool.clone() };
            let place = Transform::from_translation(hit.position).with_rotation(upright.rotation(hit));
            commands.spawn((Placing, place));
            handles.mode = TransformGizmoMode::Translate;
        }
        return;
    };
    let (entity, mut place) = placing.into_inner();
    if keys.just_pressed(KeyCode::KeyG) {
        handles.mode = match handles.mode {
            TransformGizmoMode::Translate => TransformGizmoMode::Rotate,
            TransformGizmoMode::Rotate => TransformGizmoMode::Scale,
            TransformGizmoMode::Scale => TransformGizmoMode::Translate,
        };
    }
    if keys.just_pressed(KeyCode::KeyB) {
        // In a cave, onto its floor; from within the ground, onto the surface.
        let from = |height: f32| Ray3d::new(place.translation + Vec3::Y * height, Dir3::NEG_Y);
        let below = terrains.raycast(from(0.0), REACH).filter(|hit| !hit.from_inside);
        if let Some(hit) = below.or_else(|| terrains.raycast(from(REACH), 2.0 * REACH)) {
            place.translation = hit.position;
        }
    }
    let is_done = keys.any_just_pressed([KeyCode::Enter, KeyCode::NumpadEnter]);
    if is_done && !is_path {
        let (tool, hit) = tool.placed(&place, terrain.map_or(1.0, |terrain| terrain.voxel_size()));
        brushes.write(strokes.only(tool.brush_at(&hit)));
    }
    if is_done || is_path || keys.just_pressed(KeyCode::Backspace) {
        commands.entity(entity).despawn();
    }
}
