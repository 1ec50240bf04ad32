//! Strokes: aiming, the preview of the brush, and mouse and key bindings.

#[path = "../shared/gizmos.rs"]
mod gizmos;

use std::time::Duration;

use bevy::camera_controller::free_camera::FreeCameraState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_burrow::debug::draw_shape;
use bevy_burrow::panel::{
    BrushTool, BurrowPanel, PanelAction, PanelInput, ToolOperation, keyboard_is_free, pointer_is_free,
};
use bevy_burrow::prelude::*;

/// The reach of the brush in metres.
const REACH: f32 = 400.0;

/// Where the pointer hits the ground, if it does.
#[derive(Resource, Default)]
pub struct Aim(pub Option<TerrainHit>);

/// The number of strokes so far.
#[derive(Resource, Default)]
struct Strokes {
    count: u64,
    rest: Timer,
}

/// The brush's preview.
pub struct StrokePlugin;

impl Plugin for StrokePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Aim>()
            .add_systems(Startup, gizmos::show_through_ground)
            .add_systems(Update, preview);
    }
}

/// Strokes by mouse and keys.
pub struct MousePlugin;

impl Plugin for MousePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Strokes>()
            .add_systems(PreUpdate, hold_camera.after(bevy::input::InputSystems))
            .add_systems(
                Update,
                (
                    (aim, stroke.run_if(pointer_is_free))
                        .chain()
                        .before(BurrowSystems::Collect)
                        .before(preview),
                    resize.run_if(pointer_is_free),
                    keys.run_if(keyboard_is_free),
                    step,
                ),
            );
    }
}

fn aim(
    window: Single<&Window, With<PrimaryWindow>>,
    camera: Single<(&Camera, &GlobalTransform), With<Camera3d>>,
    terrains: Terrains,
    panel: Option<Res<PanelInput>>,
    mut aim: ResMut<Aim>,
) {
    let (camera, place) = *camera;
    let cursor = window.cursor_position().filter(|_| pointer_is_free(panel));
    let ray = cursor.and_then(|cursor| camera.viewport_to_world(place, cursor).ok());
    aim.0 = ray.and_then(|ray| terrains.raycast(ray, REACH));
}

/// Applies a brush at the first press, then at the tool's rate.
fn stroke(
    time: Res<Time>,
    mouse: Res<ButtonInput<MouseButton>>,
    tool: Res<BrushTool>,
    aim: Res<Aim>,
    mut strokes: ResMut<Strokes>,
    mut brushes: MessageWriter<Brush>,
) {
    strokes.rest.tick(time.delta());
    let is_first = mouse.just_pressed(MouseButton::Left);
    if !(is_first || mouse.pressed(MouseButton::Left) && strokes.rest.is_finished()) {
        return;
    }
    let Some(hit) = &aim.0 else { return };
    strokes.count += 1;
    brushes.write(tool.brush_at(hit).with_tag(strokes.count));
    strokes.rest = Timer::new(Duration::from_secs_f32(1.0 / tool.rate.max(0.1)), TimerMode::Once);
}

fn resize(
    wheel: Res<AccumulatedMouseScroll>,
    mut tool: ResMut<BrushTool>,
    terrain: Option<Single<&Terrain>>,
) {
    let lines = match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
    };
    if let (true, Some(terrain)) = (lines != 0.0, terrain) {
        tool.grow(1.1f32.powf(lines), terrain.voxel_size());
    }
}

fn keys(
    keys: Res<ButtonInput<KeyCode>>,
    aim: Res<Aim>,
    terrain: Option<Single<&Terrain>>,
    mut tool: ResMut<BrushTool>,
    mut panel: ResMut<BurrowPanel>,
    mut actions: MessageWriter<PanelAction>,
    mut exit: MessageWriter<AppExit>,
) {
    for (key, factor) in [(KeyCode::BracketRight, 1.25), (KeyCode::BracketLeft, 0.8)] {
        if let (true, Some(terrain)) = (keys.just_pressed(key), &terrain) {
            tool.grow(factor, terrain.voxel_size());
        }
    }
    if keys.just_pressed(KeyCode::Tab) {
        let all: Vec<ToolOperation> = ToolOperation::all().collect();
        let next = all.iter().position(|&operation| operation == tool.operation).map_or(0, |at| at + 1);
        tool.operation = all.get(next).copied().unwrap_or_default();
    }
    if let (true, Some(hit)) = (keys.just_pressed(KeyCode::KeyH), &aim.0) {
        tool.level = hit.position.y;
    }
    if keys.just_pressed(KeyCode::F1) {
        panel.is_open = !panel.is_open;
    }
    if keys.just_pressed(KeyCode::F12) {
        actions.write(PanelAction::SavePicture);
    }
    if keys.just_pressed(KeyCode::Escape) {
        exit.write(AppExit::Success);
    }
}

/// Undo and redo. Reads keyboard messages, because `ButtonInput<Key>` never releases a `Z` that comes up as `z` after
/// Shift was released.
fn step(
    mut presses: MessageReader<KeyboardInput>,
    keys: Res<ButtonInput<KeyCode>>,
    panel: Option<Res<PanelInput>>,
    mut actions: MessageWriter<PanelAction>,
) {
    let is_shift = keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]);
    let is_due = keyboard_is_free(panel) && keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    for press in presses.read().filter(|press| is_due && press.state.is_pressed() && !press.repeat) {
        match letter(press) {
            Some('z') if !is_shift => drop(actions.write(PanelAction::Undo)),
            Some('z' | 'y') => drop(actions.write(PanelAction::Redo)),
            _ => {}
        }
    }
}

/// The letter on a key, by the keyboard layout: QWERTZ and AZERTY have Z elsewhere than QWERTY. For layouts without
/// Latin letters, the key's position on QWERTY counts.
fn letter(press: &KeyboardInput) -> Option<char> {
    match (&press.logical_key, press.key_code) {
        (Key::Character(text), _) if text.bytes().all(|byte| byte.is_ascii_graphic()) => {
            text.chars().next().map(|letter| letter.to_ascii_lowercase())
        }
        (_, KeyCode::KeyZ) => Some('z'),
        (_, KeyCode::KeyY) => Some('y'),
        _ => None,
    }
}

/// The camera stands still while the panel uses pointer or keyboard, and while Control turns its keys into commands.
fn hold_camera(
    input: Res<PanelInput>,
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    mut cameras: Query<&mut FreeCameraState>,
) {
    for mut camera in &mut cameras {
        // A look around that began outside the panel continues over it.
        let goes_on =
            camera.enabled && mouse.pressed(MouseButton::Right) && !mouse.just_pressed(MouseButton::Right);
        let is_command = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
        camera.enabled = goes_on || !input.has_pointer && !input.has_keyboard && !is_command;
    }
}

fn preview(aim: Res<Aim>, tool: Res<BrushTool>, mut gizmos: Gizmos) {
    let Some(hit) = &aim.0 else { return };
    draw_shape(&mut gizmos, &tool.shape_at(hit), Color::srgb(1.0, 0.80, 0.30));
    let normal = hit.normal * f32::max(0.5 * tool.radius, 1.0);
    gizmos.line(hit.position, hit.position + normal, Color::srgb(1.0, 1.0, 1.0));
}

#[cfg(test)]
mod tests {
    use bevy::input::ButtonState;

    use super::*;

    #[test]
    fn undo_and_redo_follow_the_keyboard_layout() {
        let on = |key_code, text: &str| {
            let (logical_key, state, window) =
                (Key::Character(text.into()), ButtonState::Pressed, Entity::PLACEHOLDER);
            letter(&KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window })
        };
        assert_eq!((on(KeyCode::KeyZ, "z"), on(KeyCode::KeyZ, "Z")), (Some('z'), Some('z')));
        // QWERTZ and AZERTY.
        assert_eq!((on(KeyCode::KeyY, "z"), on(KeyCode::KeyZ, "y")), (Some('z'), Some('y')));
        assert_eq!((on(KeyCode::KeyW, "z"), on(KeyCode::KeyZ, "w")), (Some('z'), Some('w')));
        // Cyrillic letters.
        assert_eq!((on(KeyCode::KeyZ, "я"), on(KeyCode::KeyY, "н")), (Some('z'), Some('y')));
    }

    #[test]
    fn ctrl_shift_z_works_again_after_shift_was_released_first() {
        let mut app = App::new();
        app.add_message::<KeyboardInput>().add_message::<PanelAction>().add_systems(Update, step);
        let mut keys = ButtonInput::<KeyCode>::default();
        keys.press(KeyCode::ControlLeft);
        keys.press(KeyCode::ShiftLeft);
        app.insert_resource(keys);
        for (text, state) in [("Z", ButtonState::Pressed), ("z", ButtonState::Released)].repeat(2) {
            let (key_code, logical_key) = (KeyCode::KeyZ, Key::Character(text.into()));
            let window = Entity::PLACEHOLDER;
            let press = KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window };
            app.world_mut().write_message(press);
        }
        app.update();
        let actions = app.world().resource::<Messages<PanelAction>>();
        assert_eq!(actions.len(), 2);
    }
}
