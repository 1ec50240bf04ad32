//! Digging together in Bevy: [`net`](crate::net) over [bevy_replicon], which brings players, transport and replication.
//!
//! The server inserts a [`GroundServer`]. Each player has a terrain with a [`SharedTerrain`], made from the same ground; a player who
//! is the host has one too. Brushes are sent as ever: they show at once, go to the server, and are [confirmed](GroundEdited) once it
//! has ordered them. [`Undo`](crate::plugin::Undo) asks the server to take back the player's last stroke, if it lets players do so.
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
mod messages;
mod saved_or_shared;
mod server;

pub use client::{GroundEdited, GroundJoined, SharedTerrain, WhatBecame};
pub use server::{GroundServer, GroundServerEvent};

use bevy::prelude::*;
use bevy_replicon::prelude::*;

use crate::plugin::BurrowSystems;

/// Digging together: add it after `RepliconPlugins` and [`BurrowPlugins`](crate::plugin::BurrowPlugins), on the server and on all
/// clients, in the same place among all that registers something with replicon.
#[derive(Default)]
pub struct TogetherPlugin;

impl Plugin for TogetherPlugin {
    fn build(&self, app: &mut App) {
        messages::register(app);
        app.add_message::<GroundServerEvent>()
            .add_message::<GroundEdited>()
            .add_message::<GroundJoined>()
            .add_observer(server::forget_player)
            .add_observer(client::begin)
            .add_observer(client::end)
            .add_observer(saved_or_shared::close_own_world)
            .add_observer(saved_or_shared::refuse_own_world)
            .add_systems(OnEnter(ClientState::Connected), client::connect)
            .add_systems(OnExit(ClientState::Connected), client::disconnect)
            .add_systems(
                Update,
                (
                    client::connect.run_if(resource_added::<GroundServer>).before(client::send),
                    client::receive.before(BurrowSystems::Collect),
                    (client::send, client::show)
                        .chain()
                        .after(BurrowSystems::Collect)
                        .before(BurrowSystems::Begin),
                    server::serve.run_if(resource_exists::<GroundServer>),
                ),
            )
            .add_systems(Last, server::finish_at_exit.run_if(resource_exists::<GroundServer>));
    }
}
