//! The menu of the pause.

use bevy::prelude::*;

use super::go_to;
use crate::input::{Action, Actions, ReadsDevices};
use crate::phase::{Page, Phase};
use crate::ui::{self, Chosen, Deaf};

/// The pause's page, and the key that leads back from every page.
pub struct PausePlugin;

impl Plugin for PausePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(Page::Menu), open.run_if(in_state(Phase::Paused))).add_systems(
            PreUpdate,
            go_back
                .after(ReadsDevices)
                .run_if(not(in_state(Page::None)))
                .run_if(not(resource_exists::<Deaf>)),
        );
    }
}

fn open(mut commands: Commands) {
    super::open(&mut commands, Page::Menu, "Pause", 330.0, |column| {
        column.spawn(ui::button(0, "Go on", 276.0)).observe(go_on);
        column.spawn(ui::button(1, "Settings", 276.0)).observe(go_to(Page::Settings));
        column.spawn(ui::button(2, "Controls", 276.0)).observe(go_to(Page::Controls));
        column.spawn(ui::button(3, "Help", 276.0)).observe(go_to(Page::Help));
        column.spawn(ui::button(4, "To the title", 276.0)).observe(leave);
        column.spawn(ui::button(5, "Quit", 276.0)).observe(quit);
    });
}

fn go_on(_: On<Chosen>, mut phase: ResMut<NextState<Phase>>) {
    phase.set(Phase::Playing);
}

fn leave(_: On<Chosen>, mut phase: ResMut<NextState<Phase>>) {
    phase.set(Phase::Title);
}

fn quit(_: On<Chosen>, mut exit: MessageWriter<AppExit>) {
    exit.write(AppExit::Success);
}

/// From a page to the menu, and from the pause's menu to the game.
fn go_back(
    keys: Res<ButtonInput<KeyCode>>,
    pads: Query<&Gamepad>,
    actions: Res<Actions>,
    now: (Res<State<Phase>>, Res<State<Page>>),
    mut phase: ResMut<NextState<Phase>>,
    mut page: ResMut<NextState<Page>>,
) {
    let back = keys.just_pressed(KeyCode::Escape)
        || actions.just_pressed(Action::Pause)
        || pads.iter().any(|pad| pad.just_pressed(GamepadButton::East));
    let help = actions.just_pressed(Action::Help) && *now.1 == Page::Help;
    match (**now.0, **now.1) {
        (Phase::Paused, Page::Menu) if back => phase.set(Phase::Playing),
        (Phase::Paused, Page::Help) if help => phase.set(Phase::Playing),
        (_, Page::Settings | Page::Controls | Page::Help) if back => page.set(Page::Menu),
        _ => {}
    }
}
