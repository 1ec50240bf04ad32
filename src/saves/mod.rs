//! Saved worlds in Bevy: a component names the folder, everything else is automatic.
//!
//! Add a [`SavedWorld`] to the entity of a [`Terrain`](crate::terrain::Terrain). The world in its folder, if there is
//! one, replaces that terrain; otherwise it is created. Then each commit is sent to the store's thread, and is durable
//! after the [loss window](SavedWorld::loss_window) at the latest. Until the world is read, the terrain is
//! [`Held`](crate::plugin::Held): brushes that are sent meanwhile wait, and apply to the world that was read.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! fn continue_game(mut commands: Commands) -> Result {
//!     let ground = Ground::from_noise(512, 512, &NoiseHeights::default())?;
//!     let terrain = Terrain::new(ground, &TerrainSettings::default())?;
//!     commands.spawn((terrain, SavedWorld::new("saves/first")));
//!     Ok(())
//! }
//! # let _ = continue_game;
//! ```

#[cfg_attr(not(feature = "replicon"), allow(dead_code, reason = "servers abandon stores"))]
mod abandoned;
mod closing;
mod components;
mod follow;
mod holding;
pub mod level;
mod making;
mod messages;
mod opening;
mod reading;
mod saving;

#[cfg(feature = "replicon")]
pub(crate) use abandoned::AbandonedStores;
pub(crate) use closing::ClosingWorlds;
#[cfg(feature = "replicon")]
pub(crate) use closing::detach;
#[cfg(feature = "replicon")]
pub(crate) use components::EXIT_WAIT;
pub use components::{SavedWorld, WorldStore};
#[doc(hidden)]
pub use level::{BurrowLevel, LevelError, LevelLoader, LevelSaver, StartLevel};
pub use messages::{ClosedBecause, SaveNow, StoreWarningFound, WorldClosed, WorldOpened, WorldSaved};
pub use reading::OpeningWorld;
#[cfg(feature = "replicon")]
pub(crate) use reading::{ReadWorld, WorldReader};

use bevy::prelude::*;
use bevy::window::ExitSystems;

use crate::plugin::{BeforeLoad, BurrowSystems, Phase, register_loader};

/// Commits are handed to the store, in `Update`. What a game [puts](WorldStore::put) before this is saved with the
/// commits of this frame.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SaveSystems;

/// Opens and saves the worlds of terrains with a [`SavedWorld`]; part of [`BurrowPlugins`](crate::BurrowPlugins).
#[derive(Default)]
pub struct SavePlugin;

impl Plugin for SavePlugin {
    fn build(&self, app: &mut App) {
        let save = Phase::Save.system(app).in_set(SaveSystems);
        app.add_message::<SaveNow>()
            .add_message::<WorldOpened>()
            .add_message::<WorldSaved>()
            .add_message::<WorldClosed>()
            .add_message::<StoreWarningFound>()
            .init_resource::<ClosingWorlds>()
            .insert_resource(components::SavesWorlds)
            .add_observer(opening::begin_anew)
            .add_observer(opening::give_up)
            .add_observer(opening::read_anew)
            .add_observer(opening::wait_for_terrain)
            .add_observer(making::give_up)
            .add_observer(making::make_anew)
            .add_observer(closing::close)
            .add_observer(closing::close_with_component)
            .add_observer(closing::follow_discarded)
            .configure_sets(Update, SaveSystems.after(BurrowSystems::Begin).before(BurrowSystems::Propagate))
            .add_systems(Update, save)
            .add_systems(
                Phase::Worlds,
                (
                    opening::follow_changed,
                    making::start_levels,
                    opening::finish_opening,
                    opening::start_opening,
                    opening::warn_of_no_terrain,
                )
                    .chain()
                    .in_set(BeforeLoad::Worlds),
            )
            .add_systems(
                Phase::Save,
                (saving::save_commits, saving::save_now, saving::report, closing::report_closed).chain(),
            )
            .add_systems(Last, saving::finish_at_exit.after(ExitSystems).run_if(on_message::<AppExit>));
        register_loader::<LevelLoader>(app);
    }

    // Once all plugins are there, the asset server is, in any order.
    fn finish(&self, app: &mut App) {
        register_loader::<LevelLoader>(app);
    }
}
