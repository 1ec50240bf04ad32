//! Facts about keys, buttons and what they mean.

use super::*;

#[test]
fn every_action_has_a_key_and_no_key_has_two_actions() {
    let bindings = Bindings::default();
    let mut seen = HashSet::new();
    for (action, label) in Action::ALL {
        assert!(!bindings.of(action).is_empty(), "{label}");
        assert!(bindings.of(action).iter().all(|binding| seen.insert(*binding)), "{label}");
    }
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
        ("Mouse Other(9)", true),
        ("Pad Other(3)", true),
        ("Mouse Other", false),
        ("Mouse Other(x)", false),
        ("Mouse Other(70000)", false),
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
fn bindings_of_another_version_cost_nobody_the_others() {
    let text = r#"{ "jump": ["KeyJ", "KeyNone"], "fly": ["KeyF"], "undo": ["KeyW"], "redo": "KeyR" }"#;
    let mut bindings: Bindings = serde_json::from_str(text).expect("unknown names are left out");
    bindings.complete();
    assert_eq!(bindings.of(Action::Jump), [Binding::Key(KeyCode::KeyJ)]);
    assert_eq!(bindings.of(Action::Headlamp), Bindings::default().of(Action::Headlamp));
    // W undoes here, so it can't walk as well.
    assert_eq!(bindings.of(Action::Forward), [Binding::Key(KeyCode::ArrowUp)]);
}

#[test]
fn a_new_key_leaves_the_mouse_and_a_new_button_the_keys() {
    let mut bindings = Bindings::default();
    bindings.rebind(Action::Grow, Binding::Key(KeyCode::KeyG));
    assert_eq!(bindings.of(Action::Grow)[..2], [Binding::Key(KeyCode::KeyG), Binding::WheelUp]);
    bindings.rebind(Action::Grow, Binding::Mouse(MouseButton::Forward));
    assert!(bindings.of(Action::Grow).contains(&Binding::Key(KeyCode::KeyG)));
    assert!(!bindings.of(Action::Grow).contains(&Binding::WheelUp));
}

#[test]
fn no_action_of_a_file_is_left_without_a_key_that_is_free() {
    let text = r#"{ "pause": [], "forward": ["FutureKey"], "undo": ["KeyS"], "form": ["KeyS", "Escape"] }"#;
    let mut bindings: Bindings = serde_json::from_str(text).expect("unknown keys are left out");
    bindings.complete();
    let default = Bindings::default();
    assert_eq!(bindings.of(Action::Pause), default.of(Action::Pause));
    assert_eq!(bindings.of(Action::Forward), default.of(Action::Forward));
    // S has one action, and whoever shares it gets what is free of his own.
    assert_eq!(bindings.of(Action::Form), [Binding::Key(KeyCode::KeyS)]);
    assert_eq!(bindings.of(Action::Undo), default.of(Action::Undo));
    assert_eq!(bindings.of(Action::Back), [Binding::Key(KeyCode::ArrowDown)]);
    let mut seen = HashSet::new();
    for (action, label) in Action::ALL {
        assert!(!bindings.of(action).is_empty(), "{label}");
        assert!(bindings.of(action).iter().all(|binding| seen.insert(*binding)), "{label}");
    }
}

#[test]
fn what_has_no_name_is_not_kept_and_what_has_a_number_is() {
    use bevy::input::keyboard::NativeKeyCode;
    for (binding, is_kept) in [
        (Binding::Mouse(MouseButton::Other(9)), true),
        (Binding::Pad(GamepadButton::Other(3)), true),
        (Binding::WheelDown, true),
        (Binding::Key(KeyCode::KeyW), true),
        (Binding::Key(KeyCode::Unidentified(NativeKeyCode::Xkb(170))), false),
        (Binding::Key(KeyCode::Unidentified(NativeKeyCode::Unidentified)), false),
    ] {
        assert_eq!(binding.can_be_kept(), is_kept, "{binding}");
    }
}

#[test]
fn who_lost_what_could_not_be_read_gets_it_back_and_is_named() {
    let text = r#"{
        "use": ["Mouse Thumb", "Pad RightTrigger2"],
        "grow": ["Unidentified(Xkb(170))", "Wheel Up"],
        "jump": ["Mouse Thumb", "Pad South"],
        "undo": ["Unidentified(Xkb(171))"],
        "build": ["FutureKey", "KeyB"],
        "headlamp": ["Pad North"],
        "form": ["Pad Paddle", "KeyC"]
    }"#;
    let mut bindings: Bindings = serde_json::from_str(text).expect("unknown keys are left out");
    let mended = bindings.complete();
    assert_eq!(mended, [Action::Jump, Action::Use, Action::Grow, Action::Form, Action::Undo]);
    let has = |action: Action, binding: Binding| bindings.of(action).contains(&binding);
    assert!(has(Action::Use, Binding::Mouse(MouseButton::Left)));
    assert!(has(Action::Grow, Binding::Key(KeyCode::Equal)));
    // There was no button of the mouse to begin with, but a key.
    assert!(has(Action::Jump, Binding::Key(KeyCode::Space)));
    assert!(has(Action::Form, Binding::Pad(GamepadButton::West)));
    assert_eq!(bindings.of(Action::Undo), Bindings::default().of(Action::Undo));
    // What can be read was meant like that.
    assert_eq!(bindings.of(Action::Build), [Binding::Key(KeyCode::KeyB)]);
    assert_eq!(bindings.of(Action::Headlamp), [Binding::Pad(GamepadButton::North)]);
    // Nothing is left to be mended.
    let before = bindings.clone();
    assert!(bindings.complete().is_empty());
    assert_eq!(bindings, before);
}
