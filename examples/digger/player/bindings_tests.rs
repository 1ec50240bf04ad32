//! Tests of bindings and how they are stored.

use bevy::input::keyboard::NativeKeyCode;

use super::*;

fn key(key: KeyCode) -> Binding {
    Binding::Key(key)
}

#[test]
fn every_action_has_a_binding_and_no_binding_has_two_actions() {
    // Those of a settings file that leaves much open are completed.
    let text =
        r#"{ "pause": [], "forward": ["FutureKey"], "undo": ["KeyS"], "build_shape": ["KeyS", "Escape"] }"#;
    let bindings: Bindings = serde_json::from_str(text).expect("unknown keys are ignored");
    for bindings in [&Bindings::default(), &bindings] {
        let mut seen = HashSet::new();
        for (action, label) in Action::ALL.map(|(action, _)| (action, action.label())) {
            assert!(!bindings.of(action).is_empty(), "{label}");
            assert!(bindings.of(action).iter().all(|binding| seen.insert(*binding)), "{label}");
        }
    }
    let default = Bindings::default();
    assert_eq!(bindings.of(Action::Pause), default.of(Action::Pause));
    assert_eq!(bindings.of(Action::Forward), default.of(Action::Forward));
    // The first action keeps S, and the others get their own free defaults.
    assert_eq!(bindings.of(Action::BuildShape), [key(KeyCode::KeyS)]);
    assert_eq!(bindings.of(Action::Undo), default.of(Action::Undo));
    assert_eq!(bindings.of(Action::Back), [key(KeyCode::ArrowDown)]);
}

#[test]
fn bindings_are_stored_as_texts() {
    for binding in Action::ALL.iter().flat_map(|(_, bindings)| *bindings) {
        assert_eq!(Binding::try_from(String::from(*binding)), Ok(*binding));
    }
    for (text, is_known) in [
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
        assert_eq!(Binding::try_from(text.to_string()).is_ok(), is_known, "{text}");
    }
}

#[test]
fn rebinding_names_the_action_that_loses_the_binding_and_leaves_other_devices_alone() {
    let mut bindings = Bindings::default();
    let space = key(KeyCode::Space);
    assert_eq!(bindings.rebind(Action::Headlamp, space), Some(Action::Jump));
    assert_eq!(bindings.of(Action::Headlamp), [space, Binding::Pad(GamepadButton::North)]);
    assert_eq!(bindings.of(Action::Jump), [Binding::Pad(GamepadButton::South)]);
    // Repeating it changes nothing.
    let before = bindings.clone();
    assert_eq!(bindings.rebind(Action::Headlamp, space), None);
    assert_eq!(bindings, before);
    let north = Binding::Pad(GamepadButton::North);
    assert_eq!(bindings.rebind(Action::BuildShape, north), Some(Action::Headlamp));
    assert_eq!(bindings.of(Action::Headlamp), [space]);
    bindings.rebind(Action::Grow, key(KeyCode::KeyG));
    assert_eq!(bindings.of(Action::Grow)[..2], [key(KeyCode::KeyG), Binding::WheelUp]);
    bindings.rebind(Action::Grow, Binding::Mouse(MouseButton::Forward));
    assert!(bindings.of(Action::Grow).contains(&key(KeyCode::KeyG)));
    assert!(!bindings.of(Action::Grow).contains(&Binding::WheelUp));
}

#[test]
fn unknown_actions_and_keys_are_ignored() {
    let text = r#"{
        "fly": ["KeyF"],
        "undo": ["KeyW"],
        "headlamp": ["Pad North"],
        "use": ["Mouse Thumb", "Pad RightTrigger2"],
        "build": ["FutureKey", "KeyB"]
    }"#;
    let bindings: Bindings = serde_json::from_str(text).expect("unknown names are ignored");
    // W is bound to undo, so it does not walk.
    assert_eq!(bindings.of(Action::Forward), [key(KeyCode::ArrowUp)]);
    assert_eq!(bindings.of(Action::Headlamp), [Binding::Pad(GamepadButton::North)]);
    // An action that lost a binding gets its defaults back, in addition to bindings that could be read.
    let left = Binding::Mouse(MouseButton::Left);
    assert_eq!(bindings.of(Action::Use), [Binding::Pad(GamepadButton::RightTrigger2), left]);
    assert_eq!(bindings.of(Action::Build)[0], key(KeyCode::KeyB));
    let stored = serde_json::to_string(&bindings).expect("plain data");
    assert_eq!(serde_json::from_str::<Bindings>(&stored).expect("what was stored"), bindings);
}

#[test]
fn keys_without_a_name_cannot_be_saved() {
    for (binding, is_saved) in [
        (Binding::Mouse(MouseButton::Other(9)), true),
        (Binding::Pad(GamepadButton::Other(3)), true),
        (Binding::WheelDown, true),
        (key(KeyCode::KeyW), true),
        (key(KeyCode::Unidentified(NativeKeyCode::Xkb(170))), false),
        (key(KeyCode::Unidentified(NativeKeyCode::Unidentified)), false),
    ] {
        assert_eq!(binding.can_be_saved(), is_saved, "{binding}");
    }
}
