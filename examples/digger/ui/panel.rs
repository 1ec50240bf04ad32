//! The plugin's own panel over the game: figures, plots, seam check and debug views. While it is open, it gets the
//! input.

use bevy::prelude::*;
use bevy_burrow::debug::BurrowDebugPlugin;
use bevy_burrow::panel::{BurrowPanel, BurrowPanelPlugin};

use crate::player::game_state::{self, GameState};
use crate::player::input::{Action, Actions};
use crate::player::{self, PlayerControlSystems};
use crate::tools;

/// Opens and closes the panel.
pub struct PanelPlugin;

impl Plugin for PanelPlugin {
    fn build(&self, app: &mut App) {
        let mut panel = BurrowPanel::default();
        // The game has tools of its own, and saves its worlds itself.
        (panel.is_open, panel.shows_brush, panel.shows_files) = (false, false, false);
        app.insert_resource(panel).add_plugins((BurrowPanelPlugin, BurrowDebugPlugin));
        add_systems(app);
    }
}

fn add_systems(app: &mut App) {
    app.configure_sets(Update, PlayerControlSystems.run_if(panel_is_closed))
        .add_systems(
            Update,
            (
                toggle.run_if(in_state(GameState::Playing)),
                (
                    game_state::release_mouse,
                    game_state::release_actions,
                    player::stop_walking,
                    tools::cancel_swing,
                )
                    .run_if(condition_changed_to(true, panel_is_open)),
                (game_state::capture_mouse, game_state::release_actions).run_if(
                    condition_changed_to(false, panel_is_open).and_then(in_state(GameState::Playing)),
                ),
            )
                .chain()
                .before(PlayerControlSystems),
        )
        .add_systems(OnExit(GameState::Playing), |mut panel: ResMut<BurrowPanel>| panel.is_open = false);
}

fn panel_is_open(panel: Res<BurrowPanel>) -> bool {
    panel.is_open
}

fn panel_is_closed(panel: Res<BurrowPanel>) -> bool {
    !panel.is_open
}

fn toggle(actions: Res<Actions>, mut panel: ResMut<BurrowPanel>) {
    if actions.just_pressed(Action::Panel) {
        panel.is_open = !panel.is_open;
    }
}

#[cfg(test)]
mod tests {
    use bevy_burrow::physics::CharacterSteering;

    use super::*;
    use crate::player::game_state::{GameStatePlugin, MenuPage};
    use crate::player::{Player, PlayerPlugin};
    use crate::test_support::{app_with_input, go_to, hold};
    use crate::tools::{Swing, Tool};

    #[test]
    fn while_the_panel_is_open_the_player_neither_walks_nor_swings_nor_gets_help() {
        let mut app = app_with_input();
        app.add_plugins((GameStatePlugin, PlayerPlugin))
            .init_resource::<Swing>()
            .init_resource::<BurrowPanel>();
        app.world_mut().resource_mut::<BurrowPanel>().is_open = false;
        add_systems(&mut app);
        go_to(&mut app, GameState::Playing);
        let player = app.world_mut().spawn((Player::default(), CharacterSteering::default())).id();
        // Whether the player walks and swings while these actions are held.
        let frame = |app: &mut App, held: &[Action]| {
            hold(app, held);
            let direction = app.world().get::<CharacterSteering>(player).expect("a player").direction;
            (direction != Vec2::ZERO, app.world().resource::<Swing>().phase().is_some())
        };
        app.world_mut().resource_mut::<Swing>().advance(Some(Tool::Drill), 0.1);
        assert_eq!(frame(&mut app, &[Action::Forward]), (true, true));
        assert_eq!(frame(&mut app, &[Action::Forward, Action::Panel]), (false, false));
        assert!(app.world().resource::<BurrowPanel>().is_open);
        assert_eq!(frame(&mut app, &[Action::Forward]), (false, false));
        assert_eq!(frame(&mut app, &[Action::Help]), (false, false));
        app.update();
        assert_eq!(**app.world().resource::<State<MenuPage>>(), MenuPage::None);
        // After it was closed, keys work again once they are pressed again.
        frame(&mut app, &[]);
        assert_eq!(frame(&mut app, &[Action::Panel]), (false, false));
        assert!(!app.world().resource::<BurrowPanel>().is_open);
        frame(&mut app, &[]);
        assert_eq!(frame(&mut app, &[Action::Forward]), (true, false));
    }
}
