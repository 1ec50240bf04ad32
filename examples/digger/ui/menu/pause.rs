//! The menu of the pause.

use bevy::prelude::*;

use super::go_to;
use crate::player::game_state::{Page, Phase};
use crate::player::input::{Action, Actions, ReadsDevices};
use crate::ui::widgets::{self, Chosen, Deaf};

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
        column.spawn(widgets::button(0, "Go on", 276.0)).observe(go_on);
        column.spawn(widgets::button(1, "Settings", 276.0)).observe(go_to(Page::Settings));
        column.spawn(widgets::button(2, "Controls", 276.0)).observe(go_to(Page::Controls));
        column.spawn(widgets::button(3, "Help", 276.0)).observe(go_to(Page::Help));
        column.spawn(widgets::button(4, "To the title", 276.0)).observe(leave);
        column.spawn(widgets::button(5, "Quit", 276.0)).observe(quit);
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
    mouse: Res<ButtonInput<MouseButton>>,
    pads: Query<&Gamepad>,
    actions: Res<Actions>,
    now: (Res<State<Phase>>, Res<State<Page>>),
    mut phase: ResMut<NextState<Phase>>,
    mut page: ResMut<NextState<Page>>,
) {
    let presses = |button: GamepadButton| pads.iter().any(|pad| pad.just_pressed(button));
    // What chooses an item does nothing but that here, though it may be bound to the pause.
    let chooses = keys.any_just_pressed(widgets::CHOOSE)
        || presses(GamepadButton::South)
        || mouse.just_pressed(MouseButton::Left);
    let back = keys.just_pressed(KeyCode::Escape)
        || actions.just_pressed(Action::Pause) && !chooses
        || presses(GamepadButton::East);
    let help = actions.just_pressed(Action::Help) && *now.1 == Page::Help;
    match (**now.0, **now.1) {
        (Phase::Paused, Page::Menu) if back => phase.set(Phase::Playing),
        (Phase::Paused, Page::Help) if help => phase.set(Phase::Playing),
        (_, Page::Settings | Page::Controls | Page::Help) if back => page.set(Page::Menu),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use bevy::input::keyboard::{Key, KeyboardInput};
    use bevy::input::{ButtonState, InputPlugin as DevicePlugin};
    use bevy::state::app::StatesPlugin;
    use bevy::window::WindowFocused;

    use super::*;
    use crate::player::bindings::Binding;
    use crate::player::game_state::PhasePlugin;
    use crate::player::input::InputPlugin;
    use crate::ui::settings::Settings;

    /// Someone plays.
    fn app() -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, StatesPlugin, DevicePlugin, InputPlugin, PhasePlugin, PausePlugin))
            .add_message::<WindowFocused>()
            .init_resource::<Settings>();
        app.world_mut().resource_mut::<NextState<Phase>>().set(Phase::Playing);
        app.update();
        app.update();
        app
    }

    /// Presses a key for a frame.
    fn tap(app: &mut App, key_code: KeyCode) {
        for state in [ButtonState::Pressed, ButtonState::Released] {
            app.world_mut().write_message(KeyboardInput {
                key_code,
                logical_key: Key::Escape,
                state,
                text: None,
                repeat: false,
                window: Entity::PLACEHOLDER,
            });
            app.update();
        }
    }

    fn now(app: &App) -> (Phase, Page) {
        (**app.world().resource::<State<Phase>>(), **app.world().resource::<State<Page>>())
    }

    #[test]
    fn the_key_that_pauses_leads_back_to_the_game() {
        let mut app = app();
        for (key, page) in [(KeyCode::Escape, Page::Menu), (KeyCode::KeyH, Page::Help)] {
            for _ in 0..2 {
                for expected in [(Phase::Paused, page), (Phase::Playing, Page::None)] {
                    tap(&mut app, key);
                    assert_eq!(now(&app), expected, "{key:?}");
                }
            }
        }
    }

    #[test]
    fn who_pauses_with_the_key_that_chooses_can_choose_with_it() {
        let mut app = app();
        let space = Binding::Key(KeyCode::Space);
        app.world_mut().resource_mut::<Settings>().bindings.rebind(Action::Pause, space);
        for _ in 0..2 {
            tap(&mut app, KeyCode::Space);
            assert_eq!(now(&app), (Phase::Paused, Page::Menu));
        }
        tap(&mut app, KeyCode::Escape);
        assert_eq!(now(&app), (Phase::Playing, Page::None));
    }
}
