//! Tests of the controls page.

use bevy::input::ButtonState;
use bevy::input::keyboard::NativeKeyCode;
use bevy::input::mouse::MouseScrollUnit;

use super::*;
use crate::test_support::{scroll, send_button, tap_key};
use crate::ui::menu::click;

const LEFT: Binding = Binding::Mouse(MouseButton::Left);

fn app() -> App {
    crate::ui::menu::app_with(ControlsPlugin, MenuPage::Controls)
}

fn click_action(app: &mut App, action: Action) {
    let position = Action::ALL.iter().position(|(other, ..)| *other == action).expect("an action");
    click(app, position);
}

fn bindings_of(app: &App, action: Action) -> Vec<Binding> {
    app.world().resource::<Settings>().bindings.of(action).to_vec()
}

fn waiting(app: &App) -> Option<Action> {
    app.world().get_resource::<Waiting>().map(|waiting| waiting.0)
}

#[test]
fn a_click_on_back_cancels_and_goes_back() {
    let mut app = app();
    click_action(&mut app, Action::Undo);
    assert_eq!(waiting(&app), Some(Action::Undo));
    click(&mut app, Action::ALL.len() + 1);
    assert_eq!(app.world().resource::<Settings>().bindings, default());
    assert_eq!(waiting(&app), None);
    assert_eq!(**app.world().resource::<State<MenuPage>>(), MenuPage::Menu);
}

#[test]
fn a_click_on_another_row_chooses_that_action() {
    let mut app = app();
    click_action(&mut app, Action::Undo);
    click_action(&mut app, Action::Jump);
    assert_eq!(waiting(&app), Some(Action::Jump));
    tap_key(&mut app, KeyCode::KeyJ);
    assert_eq!(bindings_of(&app, Action::Jump)[0], Binding::Key(KeyCode::KeyJ));
    assert_eq!(bindings_of(&app, Action::Use)[0], LEFT);
    assert_eq!(waiting(&app), None);
}

#[test]
fn a_click_on_the_waiting_row_binds_the_left_button() {
    let mut app = app();
    click_action(&mut app, Action::Undo);
    click_action(&mut app, Action::Undo);
    assert!(bindings_of(&app, Action::Undo).contains(&LEFT));
    assert!(!bindings_of(&app, Action::Use).contains(&LEFT));
    assert_eq!(waiting(&app), None);
}

#[test]
fn escape_cancels_but_can_be_bound_to_the_pause() {
    let mut app = app();
    click_action(&mut app, Action::Undo);
    tap_key(&mut app, KeyCode::Escape);
    assert_eq!(app.world().resource::<Settings>().bindings, default());
    for key in [KeyCode::KeyP, KeyCode::Escape] {
        click_action(&mut app, Action::Pause);
        tap_key(&mut app, key);
        let expected = [Binding::Key(key), Binding::Pad(GamepadButton::Start)];
        assert_eq!(bindings_of(&app, Action::Pause), expected);
    }
}

#[test]
fn reset_asks_first() {
    let mut app = app();
    for answer in [0, 1] {
        click_action(&mut app, Action::Undo);
        tap_key(&mut app, KeyCode::KeyJ);
        assert_ne!(app.world().resource::<Settings>().bindings, default());
        click(&mut app, Action::ALL.len());
        assert_eq!(**app.world().resource::<State<MenuPage>>(), MenuPage::Question);
        click(&mut app, answer);
        assert_eq!(**app.world().resource::<State<MenuPage>>(), MenuPage::Controls);
        assert_eq!(app.world().resource::<Settings>().bindings == default(), answer == 1);
        // The text before the question is gone.
        assert!(crate::ui::menu::words(&mut app).contains(&texts::CHOOSE_ACTION.into()));
    }
}

#[test]
fn the_wheel_can_be_bound() {
    let mut app = app();
    click_action(&mut app, Action::NextTool);
    scroll(&mut app, MouseScrollUnit::Line, 1.0);
    assert!(bindings_of(&app, Action::NextTool).contains(&Binding::WheelUp));
    let grow = bindings_of(&app, Action::Grow);
    assert!(grow.contains(&Binding::Key(KeyCode::Equal)) && !grow.contains(&Binding::WheelUp), "{grow:?}");
}

#[test]
fn a_key_without_a_name_cannot_be_bound() {
    let mut app = app();
    click_action(&mut app, Action::Undo);
    tap_key(&mut app, KeyCode::Unidentified(NativeKeyCode::Xkb(170)));
    assert_eq!(app.world().resource::<Settings>().bindings, default());
    assert_eq!(waiting(&app), None);
    let mut notes = app.world_mut().query_filtered::<&Text, With<Note>>();
    let note = notes.single(app.world()).expect("one note").0.clone();
    assert!(note.contains("\"undo\" keeps its keys"), "{note}");
    // A button without a name has a number.
    click_action(&mut app, Action::Undo);
    send_button(&mut app, MouseButton::Other(9), ButtonState::Pressed);
    app.update();
    assert!(bindings_of(&app, Action::Undo).contains(&Binding::Mouse(MouseButton::Other(9))));
}
