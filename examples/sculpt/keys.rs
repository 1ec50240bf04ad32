//! Keys and the wheel: operations, sizes, paths, files, copies.

use bevy::camera_controller::free_camera::{FreeCamera, FreeCameraState};
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::WindowCloseRequested;
use bevy_burrow::panel::{
    BrushTool, BurrowPanel, PanelAction, PanelInput, ToolOperation, keyboard_is_free, pointer_is_free,
};
use bevy_burrow::prelude::*;

use crate::stamps;
use crate::stroke::{Aim, aim};

/// Keys, and the wheel.
pub struct KeysPlugin;

impl Plugin for KeysPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, name_keys)
            .add_systems(PreUpdate, hold_camera.after(bevy::input::InputSystems))
            .add_systems(
                Update,
                (
                    turn_wheel.run_if(pointer_is_free),
                    keys.run_if(keyboard_is_free),
                    command,
                    copy.after(aim),
                    ask_to_close,
                ),
            );
    }
}

/// The keys of the operations, in the panel's order.
const OPERATION_KEYS: [(KeyCode, &str); 17] = [
    (KeyCode::Digit1, "1"),
    (KeyCode::Digit2, "2"),
    (KeyCode::Digit3, "3"),
    (KeyCode::Digit4, "4"),
    (KeyCode::Digit5, "5"),
    (KeyCode::Digit6, "6"),
    (KeyCode::Digit7, "7"),
    (KeyCode::Digit8, "8"),
    (KeyCode::Digit9, "9"),
    (KeyCode::Digit0, "0"),
    (KeyCode::Minus, "-"),
    (KeyCode::Equal, "="),
    (KeyCode::KeyP, "P"),
    (KeyCode::KeyR, "R"),
    (KeyCode::KeyX, "X"),
    (KeyCode::KeyU, "U"),
    (KeyCode::KeyV, "V"),
];

/// Keys of the panel's buttons.
const BUTTON_KEYS: [(&str, &str); 11] = [
    ("New", "Ctrl+N"),
    ("Open", "Ctrl+O"),
    ("Save", "Ctrl+S"),
    ("Save as", "Ctrl+Shift+S"),
    ("Undo", "Ctrl+Z"),
    ("Redo", "Ctrl+Y"),
    ("Save picture", "F12"),
    ("Place", "G"),
    ("Apply", "Enter"),
    ("Snap", "End"),
    ("Release", "Esc"),
];

/// Tells the panel the keys that it shows.
fn name_keys(mut panel: ResMut<BurrowPanel>) {
    let operations =
        ToolOperation::all().zip(OPERATION_KEYS).map(|(operation, (_, key))| (operation.name(), key));
    panel.keys = operations.chain(BUTTON_KEYS).map(|(name, key)| (name.into(), key.into())).collect();
}

/// The wheel changes the size of the brush, or, while the right button is held, how fast the camera flies.
fn turn_wheel(
    wheel: Res<AccumulatedMouseScroll>,
    mouse: Res<ButtonInput<MouseButton>>,
    mut tool: ResMut<BrushTool>,
    terrain: Option<Single<&Terrain>>,
    mut cameras: Query<&mut FreeCamera>,
) {
    let lines = match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
    };
    if lines == 0.0 {
        return;
    }
    if mouse.pressed(MouseButton::Right) {
        for mut camera in &mut cameras {
            let factor = 1.2f32.powf(lines);
            camera.walk_speed = (camera.walk_speed * factor).clamp(2.0, 200.0);
            camera.run_speed = (camera.run_speed * factor).clamp(6.0, 600.0);
        }
    } else if let Some(terrain) = terrain {
        tool.grow(1.1f32.powf(lines), terrain.voxel_size());
    }
}

/// Keys without Control, with which they are commands.
fn keys(
    keys: Res<ButtonInput<KeyCode>>,
    aim: Res<Aim>,
    terrain: Option<Single<&Terrain>>,
    mut camera: Single<&mut Transform, With<FreeCamera>>,
    mut tool: ResMut<BrushTool>,
    mut panel: ResMut<BurrowPanel>,
    mut actions: MessageWriter<PanelAction>,
) {
    if keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]) {
        return;
    }
    for (key, factor) in [(KeyCode::BracketRight, 1.25), (KeyCode::BracketLeft, 0.8)] {
        if let (true, Some(terrain)) = (keys.just_pressed(key), &terrain) {
            tool.grow(factor, terrain.voxel_size());
        }
    }
    for (operation, (key, _)) in ToolOperation::all().zip(OPERATION_KEYS) {
        if keys.just_pressed(key) {
            tool.operation = operation;
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
    if let (true, Some(hit)) = (keys.just_pressed(KeyCode::KeyF), &aim.0) {
        camera.translation = hit.position - camera.forward() * (15.0 + 3.0 * tool.width());
    }
    if keys.just_pressed(KeyCode::F1) {
        panel.is_open = !panel.is_open;
    }
    if keys.just_pressed(KeyCode::F12) {
        actions.write(PanelAction::SavePicture);
    }
    if keys.just_pressed(KeyCode::Backspace) && tool.has_path() {
        tool.points.pop();
    }
    if keys.just_pressed(KeyCode::Escape) {
        let is_held = tool.placed.is_some() || tool.has_path();
        actions.write(if is_held { PanelAction::ReleaseBrush } else { PanelAction::Quit });
    }
    if keys.just_pressed(KeyCode::KeyG) {
        actions.write(PanelAction::PlaceBrush);
    }
    if keys.any_just_pressed([KeyCode::Enter, KeyCode::NumpadEnter]) {
        actions.write(PanelAction::ApplyBrush);
    }
    if keys.just_pressed(KeyCode::End) {
        actions.write(PanelAction::SnapBrush);
    }
}

/// The window's close button asks as Escape does.
fn ask_to_close(mut requests: MessageReader<WindowCloseRequested>, mut actions: MessageWriter<PanelAction>) {
    if requests.read().next().is_some() {
        actions.write(PanelAction::Quit);
    }
}

/// Undo, redo and files. Reads keyboard messages, because `ButtonInput<Key>` never releases a `Z` that comes up as `z`
/// after Shift was released.
fn command(
    mut presses: MessageReader<KeyboardInput>,
    keys: Res<ButtonInput<KeyCode>>,
    panel: Option<Res<PanelInput>>,
    mut tool: ResMut<BrushTool>,
    mut actions: MessageWriter<PanelAction>,
) {
    let is_shift = keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]);
    let is_command = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    let is_free = keyboard_is_free(panel);
    for press in presses.read().filter(|press| is_command && press.state.is_pressed() && !press.repeat) {
        let action = match letter(press) {
            // Text has an undo of its own.
            Some('z' | 'y') if !is_free => continue,
            // The last point of a path was set after all edits.
            Some('z') if !is_shift && tool.has_path() => {
                tool.points.pop();
                continue;
            }
            Some('z') if !is_shift => PanelAction::Undo,
            Some('z' | 'y') => PanelAction::Redo,
            Some('s') if is_shift => PanelAction::SaveLevelAs,
            Some('s') => PanelAction::SaveLevel,
            Some('o') => PanelAction::LoadLevel,
            Some('n') => PanelAction::NewLevel,
            _ => continue,
        };
        actions.write(action);
    }
}

/// `Ctrl+C` copies what lies in the brush, placed or under the pointer; with Shift, into a file too.
fn copy(
    mut presses: MessageReader<KeyboardInput>,
    keys: Res<ButtonInput<KeyCode>>,
    input: Option<Res<PanelInput>>,
    aim: Res<Aim>,
    terrains: Query<(&Terrain, &GlobalTransform)>,
    mut tool: ResMut<BrushTool>,
    mut panel: ResMut<BurrowPanel>,
) {
    let is_due = keyboard_is_free(input) && keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    let is_pressed =
        |press: &KeyboardInput| press.state.is_pressed() && !press.repeat && letter(press) == Some('c');
    if !presses.read().any(is_pressed) || !is_due {
        return;
    }
    let Some(hit) = tool.placed.or(aim.0) else { return };
    let Ok((terrain, place)) = terrains.get(hit.terrain) else { return };
    let copied = tool.copy(terrain, place, &hit).map_err(|why| why.to_string());
    let is_kept = keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]);
    let keep = || stamps::keep(&tool.prefab, &panel.pictures);
    let copied = copied.and_then(|()| if is_kept { keep() } else { Ok("Copied".into()) });
    panel.report(copied);
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
        (_, KeyCode::KeyS) => Some('s'),
        (_, KeyCode::KeyO) => Some('o'),
        (_, KeyCode::KeyN) => Some('n'),
        (_, KeyCode::KeyC) => Some('c'),
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

#[cfg(test)]
mod tests {
    use bevy::input::ButtonState;
    use bevy_burrow::panel::ToolShape;

    use super::*;

    #[test]
    fn each_operation_has_a_key() {
        assert_eq!(OPERATION_KEYS.len(), ToolOperation::all().count());
    }

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
        app.init_resource::<BrushTool>().add_message::<KeyboardInput>().add_message::<PanelAction>();
        app.add_systems(Update, command);
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

    #[test]
    fn ctrl_z_takes_back_the_points_of_a_path_before_edits() {
        let mut app = App::new();
        app.add_message::<KeyboardInput>().add_message::<PanelAction>().add_systems(Update, command);
        let points = vec![Vec3::ZERO, Vec3::X];
        app.insert_resource(BrushTool { shape: ToolShape::Path, points, ..BrushTool::default() });
        let mut keys = ButtonInput::<KeyCode>::default();
        keys.press(KeyCode::ControlLeft);
        app.insert_resource(keys);
        let mut undo = || {
            app.world_mut().write_message(KeyboardInput {
                key_code: KeyCode::KeyZ,
                logical_key: Key::Character("z".into()),
                state: ButtonState::Pressed,
                text: None,
                repeat: false,
                window: Entity::PLACEHOLDER,
            });
            app.update();
            (
                app.world().resource::<BrushTool>().points.len(),
                app.world().resource::<Messages<PanelAction>>().len(),
            )
        };
        assert_eq!([undo(), undo(), undo()], [(1, 0), (0, 0), (0, 1)]);
    }
}
