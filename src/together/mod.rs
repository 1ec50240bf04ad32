//! Multiplayer in Bevy: [`net`](crate::net) over [bevy_replicon], which provides clients, transport and replication.
//!
//! The server inserts a [`GroundServer`]. Each player has a terrain with a [`SharedTerrain`], made from the same
//! ground; a player who is the host has one too. Write `Brush` messages as in single-player: edits show at once, are
//! sent to the server, and are [confirmed](GroundEdited) once it has ordered them. [`Undo`](crate::plugin::Undo) asks
//! the server to undo the player's last stroke, if `UndoPolicy` allows it.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! use bevy_burrow::net::{Server, ServerSettings};
//! use bevy_burrow::together::{GroundServer, SharedTerrain, TogetherPlugin};
//! # fn ground() -> Result<Ground> {
//! #     Ok(Ground::from_noise(512, 512, &NoiseHeights::default())?)
//! # }
//!
//! fn serve(mut commands: Commands) -> Result {
//!     let terrain = Terrain::new(ground()?, &TerrainSettings::default())?;
//!     commands.insert_resource(GroundServer::new(Server::new(terrain, ServerSettings::default())));
//!     Ok(())
//! }
//!
//! fn join(mut commands: Commands) -> Result {
//!     let terrain = Terrain::new(ground()?, &TerrainSettings::default())?;
//!     commands.spawn((terrain, SharedTerrain::default()));
//!     Ok(())
//! }
//! # let _ = (serve, join);
//! ```
//!
//! [bevy_replicon]: https://docs.rs/bevy_replicon

mod client;
mod error;
mod link;
mod messages;
mod players;
mod replicon;
mod saved_or_shared;
mod server;
mod service;
mod shared;
mod sharing;

pub use error::{SharingError, SharingErrorFound};
pub use server::{GroundServer, GroundServerEvent};
pub use shared::{EditOutcome, GroundEdited, GroundJoined, SharedTerrain};

use bevy::prelude::*;
use bevy::window::ExitSystems;

use crate::plugin::{
    BrushApplied, BurrowSystems, FollowCommits, HistoryMoved, LoosePieceFound, LoosePieceReturned,
    TerrainPlugin,
};

/// The multiplayer plugin. Add it after `RepliconPlugins` and [`BurrowPlugins`](crate::BurrowPlugins), on the
/// server and on all clients, in the same position among all plugins that register something with replicon.
///
/// A server of `MinimalPlugins` needs `StatesPlugin` for `RepliconPlugins`, and a transport:
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy::state::app::StatesPlugin;
/// # use bevy_burrow::prelude::*;
/// # use bevy_burrow::together::TogetherPlugin;
/// # use bevy_replicon::prelude::*;
/// # let mut app = App::new();
/// app.add_plugins((MinimalPlugins, StatesPlugin, RepliconPlugins, BurrowPlugins, TogetherPlugin));
/// ```
#[derive(Default)]
pub struct TogetherPlugin;

impl Plugin for TogetherPlugin {
    fn build(&self, app: &mut App) {
        if !replicon::build(app, service::forget_connection) {
            return;
        }
        app.init_resource::<sharing::Sharing>()
            .init_resource::<service::Service>()
            .add_message::<GroundServerEvent>()
            .add_message::<GroundEdited>()
            .add_message::<GroundJoined>()
            .add_message::<SharingErrorFound>()
            // Those of the terrains, if BurrowPlugins come later.
            .add_message::<BrushApplied>()
            .add_message::<HistoryMoved>()
            .add_message::<LoosePieceFound>()
            .add_message::<LoosePieceReturned>()
            .add_observer(shared::begin)
            .add_observer(shared::end)
            .add_observer(client::close)
            .add_observer(saved_or_shared::close_own_world)
            .add_observer(saved_or_shared::refuse_own_world)
            .add_systems(
                Update,
                (
                    (service::find_service, client::receive).chain().before(BurrowSystems::Collect),
                    client::release_pieces.in_set(FollowCommits),
                    (client::send, client::show)
                        .chain()
                        .after(BurrowSystems::Commit)
                        .before(BurrowSystems::Begin),
                    (server::serve.run_if(resource_exists::<GroundServer>), service::invite).chain(),
                ),
            )
            .add_systems(
                Last,
                (client::send_last, server::finish_at_exit)
                    .chain()
                    .after(ExitSystems)
                    .run_if(on_message::<AppExit>)
                    .run_if(resource_exists::<GroundServer>),
            );
    }

    fn finish(&self, app: &mut App) {
        if !app.is_plugin_added::<TerrainPlugin>() {
            error!("TogetherPlugin shares no terrain without BurrowPlugins");
        }
    }
}
