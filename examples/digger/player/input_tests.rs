//! Tests of devices and actions.

use bevy::input::ButtonState;
use bevy::input::gamepad::{
    GamepadConnection, GamepadConnectionEvent, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent,
    RawGamepadEvent,
};

use super::*;
use crate::test_support::{app_with_input, scroll, send_button, send_key};

fn app() -> App {
    let mut app = app_with_input();
    app.update();
    app
}

fn key(app: &mut App, key: KeyCode, state: ButtonState) {
    send_key(app, key, state);
    app.update();
}

fn actions(app: &App) -> &Actions {
    app.world().resource::<Actions>()
}

#[test]
fn a_press_is_new_for_one_frame_and_held_until_its_end() {
    let mut app = app();
    key(&mut app, KeyCode::Space, ButtonState::Pressed);
    assert!(actions(&app).pressed(Action::Jump) && actions(&app).just_pressed(Action::Jump));
    app.update();
    assert!(actions(&app).pressed(Action::Jump) && !actions(&app).just_pressed(Action::Jump));
    key(&mut app, KeyCode::Space, ButtonState::Released);
    assert!(!actions(&app).pressed(Action::Jump));
}

#[test]
fn a_click_shorter_than_a_frame_is_held_for_one() {
    let mut app = app();
    let click = |app: &mut App| {
        for state in [ButtonState::Pressed, ButtonState::Released] {
            send_button(app, MouseButton::Left, state);
        }
        app.update();
    };
    for _ in 0..2 {
        click(&mut app);
        assert!(actions(&app).pressed(Action::Use) && actions(&app).just_pressed(Action::Use));
        app.update();
        assert!(!actions(&app).pressed(Action::Use) && !actions(&app).just_pressed(Action::Use));
    }
    // A click that is over is not ignored any longer.
    click(&mut app);
    app.world_mut().resource_mut::<Actions>().release_all();
    assert!(!actions(&app).pressed(Action::Use));
    click(&mut app);
    assert!(actions(&app).pressed(Action::Use));
}

#[test]
fn what_is_held_when_the_game_begins_counts_once_it_is_pressed_again() {
    let mut app = app();
    key(&mut app, KeyCode::Space, ButtonState::Pressed);
    app.world_mut().resource_mut::<Actions>().release_all();
    app.update();
    assert!(!actions(&app).pressed(Action::Jump));
    key(&mut app, KeyCode::Space, ButtonState::Released);
    key(&mut app, KeyCode::Space, ButtonState::Pressed);
    assert!(actions(&app).just_pressed(Action::Jump));
}

#[test]
fn keys_do_what_they_are_bound_to() {
    let mut app = app();
    app.world_mut().resource_mut::<Settings>().bindings.rebind(Action::Forward, Binding::Key(KeyCode::KeyP));
    key(&mut app, KeyCode::KeyW, ButtonState::Pressed);
    assert_eq!(actions(&app).walk, Vec2::ZERO);
    key(&mut app, KeyCode::KeyP, ButtonState::Pressed);
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

#[test]
fn the_wheel_counts_in_steps_and_a_touchpad_in_fractions_of_them() {
    let mut app = app();
    let mut growth = |unit: MouseScrollUnit, y: f32| {
        scroll(&mut app, unit, y);
        actions(&app).growth
    };
    assert_eq!(growth(MouseScrollUnit::Line, 1.0), 1);
    assert_eq!(growth(MouseScrollUnit::Line, -3.0), -3);
    for (unit, by) in [(MouseScrollUnit::Line, 0.1), (MouseScrollUnit::Pixel, 4.0)] {
        assert_eq!((0..50).map(|_| growth(unit, by)).sum::<i32>(), 5, "{unit:?}");
        // The other direction starts from zero.
        growth(unit, 0.5 * by);
        assert_eq!((0..20).map(|_| growth(unit, -by)).sum::<i32>(), -2, "{unit:?}");
    }
    assert_eq!(growth(MouseScrollUnit::Line, 0.0), 0);
}
