//! Tests of pausing.

use std::time::Duration;

use bevy::input::ButtonState;
use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::player::bindings::Binding;
use crate::test_support::{app_with_input, go_to, hold, send_key};
use crate::ui::settings::Settings;

fn app() -> App {
    let mut app = app_with_input();
    app.add_plugins(GameStatePlugin)
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)));
    go_to(&mut app, GameState::Playing);
    app
}

fn state(app: &App) -> (GameState, MenuPage) {
    (**app.world().resource::<State<GameState>>(), **app.world().resource::<State<MenuPage>>())
}

/// Seconds of game time that pass in ten frames.
fn time_in_ten_frames(app: &mut App) -> f32 {
    let time = |app: &App| app.world().resource::<Time<Virtual>>().elapsed_secs();
    let before = time(app);
    (0..10).for_each(|_| app.update());
    time(app) - before
}

fn press(app: &mut App, action: Action) {
    hold(app, &[action]);
    hold(app, &[]);
}

#[test]
fn time_stands_still_while_the_game_is_paused_or_left_for_the_title() {
    let mut app = app();
    assert!(time_in_ten_frames(&mut app) > 0.5);
    press(&mut app, Action::Pause);
    assert_eq!(state(&app), (GameState::Paused, MenuPage::Menu));
    assert_eq!(time_in_ten_frames(&mut app), 0.0);
    go_to(&mut app, GameState::Title);
    assert_eq!(time_in_ten_frames(&mut app), 0.0);
    go_to(&mut app, GameState::Playing);
    assert_eq!(state(&app), (GameState::Playing, MenuPage::None));
    assert!(time_in_ten_frames(&mut app) > 0.5);
}

#[test]
fn time_runs_before_the_first_game() {
    let mut app = app_with_input();
    app.add_plugins(GameStatePlugin);
    app.update();
    assert_eq!(state(&app).0, GameState::Title);
    assert!(!app.world().resource::<Time<Virtual>>().is_paused());
}

#[test]
fn help_and_a_lost_focus_pause_too() {
    let mut app = app();
    press(&mut app, Action::Help);
    assert_eq!(state(&app), (GameState::Paused, MenuPage::Help));
    go_to(&mut app, GameState::Playing);
    app.world_mut().write_message(WindowFocused { window: Entity::PLACEHOLDER, focused: false });
    app.update();
    app.update();
    assert_eq!(state(&app), (GameState::Paused, MenuPage::Menu));
}

#[test]
fn escape_pauses_however_it_is_bound() {
    let mut app = app();
    let mut settings = app.world_mut().resource_mut::<Settings>();
    settings.bindings.rebind(Action::Pause, Binding::Key(KeyCode::KeyP));
    settings.bindings.rebind(Action::Jump, Binding::Key(KeyCode::KeyP));
    send_key(&mut app, KeyCode::Escape, ButtonState::Pressed);
    app.update();
    app.update();
    assert_eq!(state(&app), (GameState::Paused, MenuPage::Menu));
}

#[test]
fn letters_typed_into_the_panel_open_no_help() {
    let mut app = app();
    // It is open by default.
    app.init_resource::<BurrowPanel>();
    press(&mut app, Action::Help);
    assert_eq!(state(&app), (GameState::Playing, MenuPage::None));
    app.world_mut().resource_mut::<BurrowPanel>().is_open = false;
    press(&mut app, Action::Help);
    assert_eq!(state(&app), (GameState::Paused, MenuPage::Help));
}
