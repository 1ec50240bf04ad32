//! The pause menu.

use bevy::prelude::*;

use super::question::Question;
use super::{go_to, quit, spawn_common_buttons};
use crate::player::game_state::{GameState, MenuPage};
use crate::player::input::{Action, ActionSystems, Actions};
use crate::ui::texts;
use crate::ui::widgets::{self, Activated, MenuInputDisabled};

/// The pause menu, and the keys that lead back from every page.
pub struct PausePlugin;

impl Plugin for PausePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(MenuPage::Menu), open.run_if(in_state(GameState::Paused))).add_systems(
            PreUpdate,
            go_back
                .after(ActionSystems)
                .run_if(not(in_state(MenuPage::None)))
                .run_if(not(resource_exists::<MenuInputDisabled>)),
        );
    }
}

fn open(mut commands: Commands) {
    const WIDTH: f32 = 276.0;
    super::spawn_page(&mut commands, MenuPage::Menu, texts::PAUSED, 330.0, |column| {
        column.spawn(widgets::button(0, texts::RESUME, WIDTH)).observe(change_to(GameState::Playing));
        spawn_common_buttons(column, 1, WIDTH);
        column.spawn(widgets::button(4, texts::MULTIPLAYER, WIDTH)).observe(go_to(MenuPage::Together));
        column.spawn(widgets::button(5, texts::MAIN_MENU, WIDTH)).observe(change_to(GameState::Title));
        column.spawn(widgets::button(6, texts::SAVE_AND_QUIT, WIDTH)).observe(quit);
    });
}

fn change_to(state: GameState) -> impl FnMut(On<Activated>, ResMut<NextState<GameState>>) {
    move |_, mut next| next.set(state)
}

/// Leads from a page to the menu, and from the pause menu to the game.
fn go_back(
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    pads: Query<&Gamepad>,
    actions: Res<Actions>,
    now: (Res<State<GameState>>, Res<State<MenuPage>>),
    question: Option<Res<Question>>,
    mut state: ResMut<NextState<GameState>>,
    mut page: ResMut<NextState<MenuPage>>,
) {
    let is_pressed = |button: GamepadButton| pads.iter().any(|pad| pad.just_pressed(button));
    // In menus, the keys that activate items do only that, even if they are bound to the pause.
    let activates = keys.any_just_pressed(widgets::ACTIVATE)
        || is_pressed(GamepadButton::South)
        || mouse.just_pressed(MouseButton::Left);
    let back = keys.just_pressed(KeyCode::Escape)
        || actions.just_pressed(Action::Pause) && !activates
        || is_pressed(GamepadButton::East);
    let help = actions.just_pressed(Action::Help);
    match (**now.0, **now.1) {
        (GameState::Paused, MenuPage::Menu) if back => state.set(GameState::Playing),
        (GameState::Paused, MenuPage::Help) if help => state.set(GameState::Playing),
        (_, MenuPage::Question) if back => {
            page.set(question.map_or(MenuPage::Menu, |question| question.back))
        }
        (_, page_now) if back => {
            if let Some(parent) = page_now.parent() {
                page.set(parent);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::player::bindings::Binding;
    use crate::player::game_state::GameStatePlugin;
    use crate::test_support::{app_with_input, go_to, tap_key};
    use crate::ui::settings::Settings;

    fn app() -> App {
        let mut app = app_with_input();
        app.add_plugins((GameStatePlugin, PausePlugin));
        go_to(&mut app, GameState::Playing);
        app
    }

    fn now(app: &App) -> (GameState, MenuPage) {
        (**app.world().resource::<State<GameState>>(), **app.world().resource::<State<MenuPage>>())
    }

    #[test]
    fn the_key_that_pauses_also_continues() {
        let mut app = app();
        for (key, page) in [(KeyCode::Escape, MenuPage::Menu), (KeyCode::KeyH, MenuPage::Help)] {
            for _ in 0..2 {
                for expected in [(GameState::Paused, page), (GameState::Playing, MenuPage::None)] {
                    tap_key(&mut app, key);
                    assert_eq!(now(&app), expected, "{key:?}");
                }
            }
        }
    }

    #[test]
    fn escape_leads_back_from_every_page_to_where_one_was() {
        use MenuPage as P;
        let mut app = app();
        app.add_plugins(widgets::UiPlugin).init_resource::<UiScale>();
        go_to(&mut app, GameState::Title);
        for page in
            [P::Worlds, P::World, P::NewWorld, P::Together, P::Settings, P::Controls, P::Help, P::Question]
        {
            let parent = page.parent().unwrap_or(P::Menu);
            go_to(&mut app, parent);
            app.world_mut().resource_mut::<widgets::FocusedItem>().0 = 2;
            if page == P::Question {
                crate::ui::menu::question::ask(&mut app.world_mut().commands(), parent, "?", "yes", |_| {});
                app.world_mut().flush();
                app.update();
            } else {
                go_to(&mut app, page);
            }
            let focus = app.world().resource::<widgets::FocusedItem>().0;
            assert_eq!(focus, 0, "{page:?} begins at its first item");
            tap_key(&mut app, KeyCode::Escape);
            assert_eq!(now(&app), (GameState::Title, parent), "{page:?}");
            assert_eq!(app.world().resource::<widgets::FocusedItem>().0, 2, "{page:?}");
        }
    }

    #[test]
    fn a_key_that_activates_items_does_not_continue_even_if_it_pauses() {
        let mut app = app();
        let space = Binding::Key(KeyCode::Space);
        app.world_mut().resource_mut::<Settings>().bindings.rebind(Action::Pause, space);
        for _ in 0..2 {
            tap_key(&mut app, KeyCode::Space);
            assert_eq!(now(&app), (GameState::Paused, MenuPage::Menu));
        }
        tap_key(&mut app, KeyCode::Escape);
        assert_eq!(now(&app), (GameState::Playing, MenuPage::None));
    }
}
