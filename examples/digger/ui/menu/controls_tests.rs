//! Facts about the page of controls, as a mouse and keys see it.

use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput, NativeKeyCode};
use bevy::input::mouse::{MouseButtonInput, MouseScrollUnit, MouseWheel};
use bevy::input::touch::TouchPhase;

use super::*;

const LEFT: Binding = Binding::Mouse(MouseButton::Left);

/// The page, with nothing chosen.
fn app() -> App {
    crate::ui::menu::app_with(ControlsPlugin, Page::Controls)
}

fn row(app: &mut App, action: Action) -> Entity {
    let mut rows = app.world_mut().query::<(Entity, &Row)>();
    rows.iter(app.world()).find(|(_, row)| row.0 == action).map(|(entity, _)| entity).expect("a row")
}

/// The last item is the one that leads back.
fn back(app: &mut App) -> Entity {
    let mut items = app.world_mut().query::<(Entity, &Item)>();
    items.iter(app.world()).max_by_key(|(_, item)| item.0).map(|(entity, _)| entity).expect("items")
}

fn mouse(app: &mut App, state: ButtonState) {
    let button = MouseButton::Left;
    app.world_mut().write_message(MouseButtonInput { button, state, window: Entity::PLACEHOLDER });
}

/// What Bevy makes of a click: the item is pressed in the frame in which the button goes down.
fn click(app: &mut App, item: Entity) {
    mouse(app, ButtonState::Pressed);
    app.world_mut().entity_mut(item).insert(Interaction::Pressed);
    app.update();
    mouse(app, ButtonState::Released);
    if let Ok(mut item) = app.world_mut().get_entity_mut(item) {
        item.insert(Interaction::Hovered);
    }
    app.update();
    app.update();
}

fn type_key(app: &mut App, key_code: KeyCode) {
    for state in [ButtonState::Pressed, ButtonState::Released] {
        let window = Entity::PLACEHOLDER;
        let logical_key = Key::Escape;
        let key = KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window };
        app.world_mut().write_message(key);
        app.update();
    }
}

fn of(app: &App, action: Action) -> Vec<Binding> {
    app.world().resource::<Settings>().bindings.of(action).to_vec()
}

fn waits_for(app: &App) -> Option<Action> {
    app.world().get_resource::<Waiting>().map(|waiting| waiting.0)
}

#[test]
fn a_click_on_back_leaves_the_waiting_action_its_keys_and_goes_back() {
    let mut app = app();
    let (undo, back) = (row(&mut app, Action::Undo), back(&mut app));
    click(&mut app, undo);
    assert_eq!(waits_for(&app), Some(Action::Undo));
    click(&mut app, back);
    assert_eq!(app.world().resource::<Settings>().bindings, default());
    assert_eq!(waits_for(&app), None);
    assert_eq!(**app.world().resource::<State<Page>>(), Page::Menu);
}

#[test]
fn a_click_on_another_row_waits_for_that_one() {
    let mut app = app();
    let (undo, jump) = (row(&mut app, Action::Undo), row(&mut app, Action::Jump));
    click(&mut app, undo);
    click(&mut app, jump);
    assert_eq!(waits_for(&app), Some(Action::Jump));
    type_key(&mut app, KeyCode::KeyJ);
    assert_eq!(of(&app, Action::Jump)[0], Binding::Key(KeyCode::KeyJ));
    assert_eq!(of(&app, Action::Use)[0], LEFT);
    assert_eq!(waits_for(&app), None);
}

#[test]
fn a_click_on_the_waiting_row_is_its_button_and_is_asked_for_once() {
    let mut app = app();
    let undo = row(&mut app, Action::Undo);
    click(&mut app, undo);
    click(&mut app, undo);
    assert!(of(&app, Action::Undo).contains(&LEFT) && !of(&app, Action::Use).contains(&LEFT));
    assert_eq!(waits_for(&app), None);
}

#[test]
fn escape_keeps_all_keys_but_is_given_back_to_the_pause() {
    let mut app = app();
    let (undo, pause) = (row(&mut app, Action::Undo), row(&mut app, Action::Pause));
    click(&mut app, undo);
    type_key(&mut app, KeyCode::Escape);
    assert_eq!(app.world().resource::<Settings>().bindings, default());
    for key in [KeyCode::KeyP, KeyCode::Escape] {
        click(&mut app, pause);
        type_key(&mut app, key);
        assert_eq!(of(&app, Action::Pause), [Binding::Key(key), Binding::Pad(GamepadButton::Start)]);
    }
}

#[test]
fn the_wheel_can_be_bound_and_leaves_the_keys_alone() {
    let mut app = app();
    let next = row(&mut app, Action::NextTool);
    click(&mut app, next);
    let (unit, phase, window) = (MouseScrollUnit::Line, TouchPhase::Moved, Entity::PLACEHOLDER);
    app.world_mut().write_message(MouseWheel { unit, x: 0.0, y: 1.0, window, phase });
    app.update();
    assert!(of(&app, Action::NextTool).contains(&Binding::WheelUp));
    let grow = of(&app, Action::Grow);
    assert!(grow.contains(&Binding::Key(KeyCode::Equal)) && !grow.contains(&Binding::WheelUp), "{grow:?}");
}

#[test]
fn a_key_without_a_name_is_refused_and_a_button_with_a_number_is_not() {
    let mut app = app();
    let undo = row(&mut app, Action::Undo);
    click(&mut app, undo);
    type_key(&mut app, KeyCode::Unidentified(NativeKeyCode::Xkb(170)));
    assert_eq!(app.world().resource::<Settings>().bindings, default());
    assert_eq!(waits_for(&app), None);
    let mut notes = app.world_mut().query_filtered::<&Text, With<Note>>();
    let note = notes.single(app.world()).expect("one note").0.clone();
    assert!(note.contains("undo keeps its keys"), "{note}");
    click(&mut app, undo);
    let (button, window) = (MouseButton::Other(9), Entity::PLACEHOLDER);
    app.world_mut().write_message(MouseButtonInput { button, state: ButtonState::Pressed, window });
    app.update();
    assert!(of(&app, Action::Undo).contains(&Binding::Mouse(button)));
}
