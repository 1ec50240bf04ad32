//! The game's states: title, play or pause, and the menu page that is open.

use bevy::prelude::*;
use bevy::window::{CursorGrabMode, CursorOptions, PrimaryWindow, WindowFocused};
use bevy_burrow::panel::BurrowPanel;

use crate::party::connection::is_shared;
use crate::player::input::{Action, ActionSystems, Actions};

#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum GameState {
    /// The camera circles over the landscape behind the menu.
    #[default]
    Title,
    Playing,
    /// Time stands still.
    Paused,
}

/// The menu page that is open.
#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MenuPage {
    /// No page: the game is being played.
    None,
    /// The menu of the title or of the pause.
    #[default]
    Menu,
    /// The saved worlds.
    Worlds,
    /// One of them: its name, a copy, its end.
    World,
    NewWorld,
    /// Hosting and joining.
    Together,
    Settings,
    Controls,
    Help,
    /// A question before something is lost.
    Question,
}

impl MenuPage {
    /// The page that this one leads back to. A question leads back to where it was asked.
    pub const fn parent(self) -> Option<Self> {
        match self {
            Self::None | Self::Menu | Self::Question => None,
            Self::World => Some(Self::Worlds),
            Self::Worlds | Self::NewWorld | Self::Together | Self::Settings | Self::Controls | Self::Help => {
                Some(Self::Menu)
            }
        }
    }
}

/// Changes the states. Time and the mouse cursor follow them.
pub struct GameStatePlugin;

impl Plugin for GameStatePlugin {
    fn build(&self, app: &mut App) {
        app.init_state::<GameState>()
            .init_state::<MenuPage>()
            .add_systems(
                OnEnter(GameState::Playing),
                (close_menu, resume_time, capture_mouse, release_actions),
            )
            // Where others play on, time does too.
            .add_systems(OnEnter(GameState::Paused), (pause_time.run_if(not(is_shared)), release_mouse))
            // The title leaves time as it is: running before the first game, and paused after it.
            .add_systems(OnEnter(GameState::Title), release_mouse)
            .add_systems(PreUpdate, pause.after(ActionSystems).run_if(in_state(GameState::Playing)));
    }
}

fn close_menu(mut page: ResMut<NextState<MenuPage>>) {
    page.set(MenuPage::None);
}

/// Ignores what is held down: the click that chose a menu item or closed the panel is not meant for the game.
pub fn release_actions(mut actions: ResMut<Actions>) {
    actions.release_all();
}

fn resume_time(mut time: ResMut<Time<Virtual>>) {
    time.unpause();
}

fn pause_time(mut time: ResMut<Time<Virtual>>) {
    time.pause();
}

pub fn capture_mouse(mut cursors: Query<&mut CursorOptions, With<PrimaryWindow>>) {
    for mut cursor in &mut cursors {
        (cursor.visible, cursor.grab_mode) = (false, CursorGrabMode::Locked);
    }
}

pub fn release_mouse(mut cursors: Query<&mut CursorOptions, With<PrimaryWindow>>) {
    for mut cursor in &mut cursors {
        (cursor.visible, cursor.grab_mode) = (true, CursorGrabMode::None);
    }
}

/// Pauses on the pause key, on Escape however it is bound, on the help key, and when the window loses the focus. While
/// the panel is open, letters are typed into it. This runs before states change, as menus do: the key that ends the
/// pause does not begin another one.
fn pause(
    actions: Res<Actions>,
    keys: Res<ButtonInput<KeyCode>>,
    panel: Option<Res<BurrowPanel>>,
    mut focus: MessageReader<WindowFocused>,
    mut state: ResMut<NextState<GameState>>,
    mut page: ResMut<NextState<MenuPage>>,
) {
    let lost_focus = focus.read().any(|event| !event.focused);
    let no_panel = panel.is_none_or(|panel| !panel.is_open);
    let help = actions.just_pressed(Action::Help) && no_panel;
    let pause = actions.just_pressed(Action::Pause) && no_panel || keys.just_pressed(KeyCode::Escape);
    if pause || help || lost_focus {
        state.set(GameState::Paused);
        page.set(if help { MenuPage::Help } else { MenuPage::Menu });
    }
}

#[cfg(test)]
#[path = "game_state_tests.rs"]
mod tests;
