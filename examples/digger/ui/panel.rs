//! The plugin's own panel over the game: figures, plots, seam check, debug views. While it is open the mouse is its own.

use bevy::prelude::*;
use bevy_burrow::debug::BurrowDebugPlugin;
use bevy_burrow::panel::{BurrowPanel, BurrowPanelPlugin};

use crate::player::game_state::{self, Phase};
use crate::player::input::{Action, Actions};
use crate::player::{self, Playing};
use crate::tools;

/// Opens and closes the panel.
pub struct PanelPlugin;

impl Plugin for PanelPlugin {
    fn build(&self, app: &mut App) {
        let mut panel = BurrowPanel::default();
        // The hand has its own tools; the figures are what is missing.
        (panel.is_open, panel.shows_brush) = (false, false);
        app.insert_resource(panel).add_plugins((BurrowPanelPlugin, BurrowDebugPlugin));
        share_input(app);
    }
}

/// Mouse and keys are the panel's while it is open, and the player's otherwise.
fn share_input(app: &mut App) {
    app.configure_sets(Update, Playing.run_if(panel_is_closed))
        .add_systems(
            Update,
            (
                toggle.run_if(in_state(Phase::Playing)),
                (game_state::leave_mouse, game_state::listen, player::stand_still, tools::put_down)
                    .run_if(panel_opened),
                (game_state::take_mouse, game_state::listen)
                    .run_if(panel_closed.and_then(in_state(Phase::Playing))),
            )
                .chain()
                .before(Playing),
        )
        .add_systems(OnExit(Phase::Playing), close);
}

fn panel_is_closed(panel: Res<BurrowPanel>) -> bool {
    !panel.is_open
}

fn panel_opened(panel: Res<BurrowPanel>, mut was_open: Local<bool>) -> bool {
    !std::mem::replace(&mut *was_open, panel.is_open) && panel.is_open
}

fn panel_closed(panel: Res<BurrowPanel>, mut was_open: Local<bool>) -> bool {
    std::mem::replace(&mut *was_open, panel.is_open) && !panel.is_open
}

fn toggle(actions: Res<Actions>, mut panel: ResMut<BurrowPanel>) {
    if actions.just_pressed(Action::Panel) {
        panel.is_open = !panel.is_open;
    }
}

fn close(mut panel: ResMut<BurrowPanel>) {
    panel.is_open = false;
}

#[cfg(test)]
#[path = "panel_tests.rs"]
mod tests;
