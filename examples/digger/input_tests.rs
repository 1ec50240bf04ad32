//! Facts about keys, buttons and what they mean.

use std::collections::HashSet;

use bevy::input::gamepad::{
    GamepadConnection, GamepadConnectionEvent, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent,
    RawGamepadEvent,
};
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::{ButtonState, InputPlugin as DevicePlugin};

use super::*;
use crate::settings::Settings;

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
fn every_action_has_a_key_and_no_key_has_two_actions() {
    let bindings = Bindings::default();
    let mut seen = HashSet::new();
    for (action, label) in Action::ALL {
        assert!(!bindings.of(action).is_empty(), "{label}");
        assert!(bindings.of(action).iter().all(|binding| seen.insert(*binding)), "{label}");
    }
    let bits: HashSet<u64> = Action::ALL.iter().map(|(action, _)| action.bit()).collect();
    assert_eq!(bits.len(), Action::ALL.len());
}

#[test]
fn bindings_are_written_as_words_and_read_again() {
    for binding in Action::ALL.iter().flat_map(|(action, _)| Bindings::default().of(*action).to_vec()) {
        assert_eq!(Binding::try_from(String::from(binding)), Ok(binding));
    }
    for (text, reads) in [
        ("KeyW", true),
        ("Mouse Left", true),
        ("Pad South", true),
        ("Wheel Up", true),
        ("KeyÄ", false),
        ("Mouse Other", false),
        ("Unidentified", false),
        ("Pad", false),
        ("", false),
    ] {
        assert_eq!(Binding::try_from(text.to_string()).is_ok(), reads, "{text}");
    }
}

#[test]
fn who_loses_a_key_is_told_and_a_gamepad_keeps_its_own() {
    let mut bindings = Bindings::default();
    let space = Binding::Key(KeyCode::Space);
    assert_eq!(bindings.rebind(Action::Headlamp, space), Some(Action::Jump));
    assert_eq!(bindings.of(Action::Headlamp), [space, Binding::Pad(GamepadButton::North)]);
    assert_eq!(bindings.of(Action::Jump), [Binding::Pad(GamepadButton::South)]);
    // The same again changes nothing.
    let before = bindings.clone();
    assert_eq!(bindings.rebind(Action::Headlamp, space), None);
    assert_eq!(bindings, before);
    assert_eq!(bindings.rebind(Action::Form, Binding::Pad(GamepadButton::North)), Some(Action::Headlamp));
    assert_eq!(bindings.of(Action::Headlamp), [space]);
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

#[test]
fn bindings_of_another_version_cost_nobody_the_others() {
    let text = r#"{ "jump": ["KeyJ", "KeyNone"], "fly": ["KeyF"], "undo": ["KeyW"] }"#;
    let mut bindings: Bindings = serde_json::from_str(text).expect("unknown names are left out");
    bindings.complete();
    assert_eq!(bindings.of(Action::Jump), [Binding::Key(KeyCode::KeyJ)]);
    assert_eq!(bindings.of(Action::Headlamp), Bindings::default().of(Action::Headlamp));
    // W undoes here, so it can't walk as well.
    assert_eq!(bindings.of(Action::Forward), [Binding::Key(KeyCode::ArrowUp)]);
}
