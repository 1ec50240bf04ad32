//! Facts about devices and what is made of them.

use std::collections::HashSet;

use bevy::input::gamepad::{
    GamepadConnection, GamepadConnectionEvent, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent,
    RawGamepadEvent,
};
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::mouse::{MouseButtonInput, MouseWheel};
use bevy::input::touch::TouchPhase;
use bevy::input::{ButtonState, InputPlugin as DevicePlugin};

use super::*;
use crate::ui::settings::Settings;

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, DevicePlugin, InputPlugin)).init_resource::<Settings>();
    app.update();
    app
}

fn type_key(app: &mut App, key_code: KeyCode, state: ButtonState) {
    app.world_mut().write_message(KeyboardInput {
        key_code,
        logical_key: Key::Space,
        state,
        text: None,
        repeat: false,
        window: Entity::PLACEHOLDER,
    });
    app.update();
}

fn actions(app: &App) -> &Actions {
    app.world().resource::<Actions>()
}

#[test]
fn no_action_is_another_one() {
    let bits: HashSet<u64> = Action::ALL.iter().map(|(action, _)| action.bit()).collect();
    assert_eq!(bits.len(), Action::ALL.len());
}

#[test]
fn a_press_is_fresh_for_one_frame_and_held_until_its_end() {
    let mut app = app();
    type_key(&mut app, KeyCode::Space, ButtonState::Pressed);
    assert!(actions(&app).pressed(Action::Jump) && actions(&app).just_pressed(Action::Jump));
    app.update();
    assert!(actions(&app).pressed(Action::Jump) && !actions(&app).just_pressed(Action::Jump));
    type_key(&mut app, KeyCode::Space, ButtonState::Released);
    assert!(!actions(&app).pressed(Action::Jump));
}

#[test]
fn a_click_shorter_than_a_frame_is_held_for_one() {
    let mut app = app();
    let click = |app: &mut App| {
        for state in [ButtonState::Pressed, ButtonState::Released] {
            let (button, window) = (MouseButton::Left, Entity::PLACEHOLDER);
            app.world_mut().write_message(MouseButtonInput { button, state, window });
        }
        app.update();
    };
    for _ in 0..2 {
        click(&mut app);
        assert!(actions(&app).pressed(Action::Use) && actions(&app).just_pressed(Action::Use));
        app.update();
        assert!(!actions(&app).pressed(Action::Use) && !actions(&app).just_pressed(Action::Use));
    }
    // Nobody waits for the end of a click that is over.
    click(&mut app);
    app.world_mut().resource_mut::<Actions>().forget();
    assert!(!actions(&app).pressed(Action::Use));
    click(&mut app);
    assert!(actions(&app).pressed(Action::Use));
}

#[test]
fn what_is_held_when_the_game_begins_counts_once_it_is_pressed_again() {
    let mut app = app();
    type_key(&mut app, KeyCode::Space, ButtonState::Pressed);
    app.world_mut().resource_mut::<Actions>().forget();
    app.update();
    assert!(!actions(&app).pressed(Action::Jump));
    type_key(&mut app, KeyCode::Space, ButtonState::Released);
    type_key(&mut app, KeyCode::Space, ButtonState::Pressed);
    assert!(actions(&app).just_pressed(Action::Jump));
}

#[test]
fn keys_do_what_they_are_bound_to() {
    let mut app = app();
    app.world_mut().resource_mut::<Settings>().bindings.rebind(Action::Forward, Binding::Key(KeyCode::KeyP));
    type_key(&mut app, KeyCode::KeyW, ButtonState::Pressed);
    assert_eq!(actions(&app).walk, Vec2::ZERO);
    type_key(&mut app, KeyCode::KeyP, ButtonState::Pressed);
    assert_eq!(actions(&app).walk, Vec2::Y);
}

#[test]
fn a_gamepad_walks_looks_and_digs() {
    let mut app = app();
    let pad = app.world_mut().spawn_empty().id();
    let connection = GamepadConnection::Connected { name: "pad".into(), vendor_id: None, product_id: None };
    app.world_mut().write_message(GamepadConnectionEvent::new(pad, connection));
    app.update();
    let events = [
        RawGamepadEvent::Button(RawGamepadButtonChangedEvent::new(pad, GamepadButton::RightTrigger2, 1.0)),
        RawGamepadEvent::Axis(RawGamepadAxisChangedEvent::new(pad, GamepadAxis::LeftStickY, 1.0)),
        RawGamepadEvent::Axis(RawGamepadAxisChangedEvent::new(pad, GamepadAxis::RightStickX, 1.0)),
    ];
    app.world_mut().resource_mut::<Messages<RawGamepadEvent>>().write_batch(events);
    app.update();
    assert!(actions(&app).just_pressed(Action::Use));
    assert_eq!(actions(&app).walk, Vec2::Y);
    std::thread::sleep(std::time::Duration::from_millis(2));
    app.update();
    assert!(actions(&app).pressed(Action::Use) && !actions(&app).just_pressed(Action::Use));
    assert!(actions(&app).look.x > 0.0 && actions(&app).look.y == 0.0);
}

fn scroll(app: &mut App, unit: MouseScrollUnit, y: f32) -> i32 {
    let (phase, window) = (TouchPhase::Moved, Entity::PLACEHOLDER);
    app.world_mut().write_message(MouseWheel { unit, x: 0.0, y, window, phase });
    app.update();
    actions(app).growth
}

#[test]
fn a_notch_of_the_wheel_is_a_step_and_a_touchpad_scrolls_for_one() {
    let mut app = app();
    assert_eq!(scroll(&mut app, MouseScrollUnit::Line, 1.0), 1);
    assert_eq!(scroll(&mut app, MouseScrollUnit::Line, -3.0), -3);
    for (unit, by) in [(MouseScrollUnit::Line, 0.1), (MouseScrollUnit::Pixel, 4.0)] {
        let steps: i32 = (0..50).map(|_| scroll(&mut app, unit, by)).sum();
        assert_eq!(steps, 5, "{unit:?}");
        // The other way round counts from its own begin.
        scroll(&mut app, unit, 0.5 * by);
        let steps: i32 = (0..20).map(|_| scroll(&mut app, unit, -by)).sum();
        assert_eq!(steps, -2, "{unit:?}");
    }
    app.update();
    assert_eq!(actions(&app).growth, 0);
}
