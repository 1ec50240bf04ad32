//! Facts about the pause.

use std::time::Duration;

use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::{ButtonState, InputPlugin as DevicePlugin};
use bevy::state::app::StatesPlugin;
use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::player::bindings::Binding;
use crate::player::input::InputPlugin;
use crate::ui::settings::Settings;
use crate::world::day::Clock;

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, StatesPlugin, DevicePlugin, InputPlugin, PhasePlugin))
        .add_message::<WindowFocused>()
        .init_resource::<Settings>()
        .init_resource::<Clock>()
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)))
        .add_systems(Update, crate::world::day::tick);
    app.world_mut().resource_mut::<NextState<Phase>>().set(Phase::Playing);
    app.update();
    app.update();
    app
}

fn phase(app: &App) -> (Phase, Page) {
    (**app.world().resource::<State<Phase>>(), **app.world().resource::<State<Page>>())
}

/// Holds an action for a frame, as a key would.
fn press(app: &mut App, action: Action) {
    app.world_mut().resource_mut::<Actions>().puppet.push(action);
    app.update();
    app.world_mut().resource_mut::<Actions>().puppet.clear();
    app.update();
}

#[test]
fn a_pause_stops_time_and_its_end_lets_it_run() {
    let mut app = app();
    let hour = |app: &App| app.world().resource::<Clock>().hour;
    let before = hour(&app);
    app.update();
    assert!(hour(&app) > before);
    press(&mut app, Action::Pause);
    assert_eq!(phase(&app), (Phase::Paused, Page::Menu));
    let stopped = hour(&app);
    for _ in 0..10 {
        app.update();
    }
    assert_eq!(hour(&app), stopped);
    app.world_mut().resource_mut::<NextState<Phase>>().set(Phase::Playing);
    app.update();
    app.update();
    assert!(hour(&app) > stopped);
    assert_eq!(phase(&app), (Phase::Playing, Page::None));
}

#[test]
fn a_game_that_was_left_for_the_title_stands_still_until_it_goes_on() {
    let mut app = app();
    let hour = |app: &App| app.world().resource::<Clock>().hour;
    let go = |app: &mut App, phase: Phase| {
        app.world_mut().resource_mut::<NextState<Phase>>().set(phase);
        app.update();
        app.update();
    };
    press(&mut app, Action::Pause);
    let stopped = hour(&app);
    go(&mut app, Phase::Title);
    for _ in 0..10 {
        app.update();
    }
    assert_eq!(hour(&app), stopped);
    go(&mut app, Phase::Playing);
    assert!(hour(&app) > stopped);
}

#[test]
fn time_runs_before_the_first_game() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, StatesPlugin, DevicePlugin, InputPlugin, PhasePlugin))
        .add_message::<WindowFocused>()
        .init_resource::<Settings>();
    app.update();
    assert_eq!(phase(&app).0, Phase::Title);
    assert!(!app.world().resource::<Time<Virtual>>().is_paused());
}

#[test]
fn help_and_a_lost_window_pause_too() {
    let mut app = app();
    press(&mut app, Action::Help);
    assert_eq!(phase(&app), (Phase::Paused, Page::Help));
    app.world_mut().resource_mut::<NextState<Phase>>().set(Phase::Playing);
    app.update();
    app.world_mut().write_message(WindowFocused { window: Entity::PLACEHOLDER, focused: false });
    app.update();
    app.update();
    assert_eq!(phase(&app), (Phase::Paused, Page::Menu));
}

#[test]
fn escape_pauses_whatever_else_does() {
    let mut app = app();
    let mut settings = app.world_mut().resource_mut::<Settings>();
    settings.bindings.rebind(Action::Pause, Binding::Key(KeyCode::KeyP));
    settings.bindings.rebind(Action::Jump, Binding::Key(KeyCode::KeyP));
    app.world_mut().write_message(KeyboardInput {
        key_code: KeyCode::Escape,
        logical_key: Key::Escape,
        state: ButtonState::Pressed,
        text: None,
        repeat: false,
        window: Entity::PLACEHOLDER,
    });
    app.update();
    app.update();
    assert_eq!(phase(&app), (Phase::Paused, Page::Menu));
}

#[test]
fn letters_that_are_typed_into_the_panel_open_no_help() {
    let mut app = app();
    // It is open unless told otherwise.
    app.init_resource::<BurrowPanel>();
    press(&mut app, Action::Help);
    assert_eq!(phase(&app), (Phase::Playing, Page::None));
    app.world_mut().resource_mut::<BurrowPanel>().is_open = false;
    press(&mut app, Action::Help);
    assert_eq!(phase(&app), (Phase::Paused, Page::Help));
}
