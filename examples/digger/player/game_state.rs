//! Where the game stands: title, play, pause, and which page of a menu is open.

use bevy::prelude::*;
use bevy::window::{CursorGrabMode, CursorOptions, PrimaryWindow, WindowFocused};
use bevy_burrow::panel::BurrowPanel;

use crate::player::input::{Action, Actions, ReadsDevices};

/// What goes on.
#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Phase {
    /// The landscape turns behind the menu; a game that was left stands still.
    #[default]
    Title,
    /// The player digs.
    Playing,
    /// Time stands still.
    Paused,
}

/// Which menu is open.
#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Page {
    /// None: the player plays.
    None,
    /// The title's menu, or that of the pause.
    #[default]
    Menu,
    Settings,
    Controls,
    Help,
}

/// Goes from phase to phase; time and the mouse follow.
pub struct PhasePlugin;

impl Plugin for PhasePlugin {
    fn build(&self, app: &mut App) {
        app.init_state::<Phase>()
            .init_state::<Page>()
            .add_systems(OnEnter(Phase::Playing), (close_menus, run_time, take_mouse, listen))
            .add_systems(OnEnter(Phase::Paused), (stop_time, leave_mouse))
            // Behind the title, time goes on as it did: it runs before the first game, and a game that was left waits.
            .add_systems(OnEnter(Phase::Title), leave_mouse)
            .add_systems(PreUpdate, pause.after(ReadsDevices).run_if(in_state(Phase::Playing)));
    }
}

fn close_menus(mut page: ResMut<NextState<Page>>) {
    page.set(Page::None);
}

/// The click that chose "dig" digs nothing, and neither does one on the panel once it is closed.
pub fn listen(mut actions: ResMut<Actions>) {
    actions.forget();
}

fn run_time(mut time: ResMut<Time<Virtual>>) {
    time.unpause();
}

fn stop_time(mut time: ResMut<Time<Virtual>>) {
    time.pause();
}

pub fn take_mouse(mut cursors: Query<&mut CursorOptions, With<PrimaryWindow>>) {
    for mut cursor in &mut cursors {
        (cursor.visible, cursor.grab_mode) = (false, CursorGrabMode::Locked);
    }
}

pub fn leave_mouse(mut cursors: Query<&mut CursorOptions, With<PrimaryWindow>>) {
    for mut cursor in &mut cursors {
        (cursor.visible, cursor.grab_mode) = (true, CursorGrabMode::None);
    }
}

/// The pause key, Escape whatever it is, the help key, and whatever takes the window away. While the panel is open,
/// letters are typed into it. It looks before the states change, as menus do: the key that leads back to the game does
/// not pause it again.
fn pause(
    actions: Res<Actions>,
    keys: Res<ButtonInput<KeyCode>>,
    panel: Option<Res<BurrowPanel>>,
    mut focus: MessageReader<WindowFocused>,
    mut phase: ResMut<NextState<Phase>>,
    mut page: ResMut<NextState<Page>>,
) {
    let lost = focus.read().any(|event| !event.focused);
    let plays = panel.is_none_or(|panel| !panel.is_open);
    let help = actions.just_pressed(Action::Help) && plays;
    let pause = actions.just_pressed(Action::Pause) && plays || keys.just_pressed(KeyCode::Escape);
    if pause || help || lost {
        phase.set(Phase::Paused);
        page.set(if help { Page::Help } else { Page::Menu });
    }
}

#[cfg(test)]
#[path = "game_state_tests.rs"]
mod tests;
