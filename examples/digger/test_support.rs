//! What several tests need: presses of keys and buttons, states, and a small world.

use std::time::Duration;

use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::mouse::{MouseButtonInput, MouseScrollUnit, MouseWheel};
use bevy::input::touch::TouchPhase;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy::state::state::FreelyMutableState;
use bevy_burrow::prelude::*;

use crate::player::input::{Action, Actions, InputPlugin};
use crate::ui::hud::Hint;
use crate::ui::settings::Settings;

/// An app with input devices, states, actions and default settings.
pub fn app_with_input() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, StatesPlugin, bevy::input::InputPlugin, InputPlugin))
        .add_message::<bevy::window::WindowFocused>()
        .init_resource::<Settings>();
    app
}

/// Presses or releases a key, without a frame.
pub fn send_key(app: &mut App, key_code: KeyCode, state: ButtonState) {
    app.world_mut().write_message(KeyboardInput {
        key_code,
        logical_key: Key::Escape,
        state,
        text: None,
        repeat: false,
        window: Entity::PLACEHOLDER,
    });
}

/// Presses a key for a frame.
pub fn tap_key(app: &mut App, key: KeyCode) {
    for state in [ButtonState::Pressed, ButtonState::Released] {
        send_key(app, key, state);
        app.update();
    }
}

/// Presses or releases a mouse button, without a frame.
pub fn send_button(app: &mut App, button: MouseButton, state: ButtonState) {
    app.world_mut().write_message(MouseButtonInput { button, state, window: Entity::PLACEHOLDER });
}

/// Turns the wheel in a frame.
pub fn scroll(app: &mut App, unit: MouseScrollUnit, y: f32) {
    let (phase, window) = (TouchPhase::Moved, Entity::PLACEHOLDER);
    app.world_mut().write_message(MouseWheel { unit, x: 0.0, y, window, phase });
    app.update();
}

/// Holds actions down from now on, as a script does, and runs a frame.
pub fn hold(app: &mut App, actions: &[Action]) {
    app.world_mut().resource_mut::<Actions>().scripted = actions.to_vec();
    app.update();
}

/// Changes a state, and runs the frames that it takes.
pub fn go_to(app: &mut App, state: impl FreelyMutableState) {
    app.world_mut().resource_mut::<NextState<_>>().set(state);
    app.update();
    app.update();
}

/// Takes all messages of a type.
pub fn drain<M: Message>(app: &mut App) -> Vec<M> {
    app.world_mut().resource_mut::<Messages<M>>().drain().collect()
}

/// Takes all hints.
pub fn drain_hints(app: &mut App) -> Vec<String> {
    drain(app).into_iter().map(|Hint(text)| text).collect()
}

/// Flat ground of 64 x 64 voxels, 20 high.
pub fn flat_terrain() -> Terrain {
    let ground = Ground::flat(64, 64, 20.0).expect("a small world");
    Terrain::new(ground, &TerrainSettings::default()).expect("default settings")
}

/// Finishes the app's plugins and spawns a flat terrain.
pub fn spawn_flat_terrain(app: &mut App) -> Entity {
    app.finish();
    app.cleanup();
    app.world_mut().spawn(flat_terrain()).id()
}

/// Runs frames until something is so.
pub fn update_until(app: &mut App, what: &str, mut is_so: impl FnMut(&mut App) -> bool) {
    for _ in 0..60_000 {
        app.update();
        if is_so(app) {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("this did not happen: {what}");
}
