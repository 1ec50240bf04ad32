//! Reconnects players automatically: an app without a connection keeps trying to connect.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_burrow::net::KickReason;
use bevy_burrow::together::{SharingError, SharingErrorFound};
use bevy_replicon::prelude::ClientState;

/// Makes a connection. A token is good for one, so each try asks for a new one.
type Connect = Box<dyn FnMut(&mut World) -> Result + Send + Sync>;

/// Keeps an app connected while this is there.
#[derive(Resource)]
pub struct StayConnected {
    connect: Connect,
    /// The time between two tries.
    pause: Duration,
    last: Option<Instant>,
}

impl StayConnected {
    pub fn new(pause: Duration, connect: impl FnMut(&mut World) -> Result + Send + Sync + 'static) -> Self {
        Self { connect: Box::new(connect), pause, last: None }
    }
}

pub struct ReconnectPlugin;

impl Plugin for ReconnectPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(
            Update,
            (
                stop,
                reconnect
                    .run_if(in_state(ClientState::Disconnected))
                    .run_if(resource_exists::<StayConnected>),
            )
                .chain(),
        );
    }
}

/// Stops reconnecting once the player has connected from another device, as a connection from here would end that one.
fn stop(mut errors: MessageReader<SharingErrorFound>, mut commands: Commands) {
    let plays_elsewhere = SharingError::Kicked(KickReason::ConnectedAgain);
    if errors.read().any(|found| found.error == plays_elsewhere) {
        commands.remove_resource::<StayConnected>();
    }
}

/// Tries to connect.
fn reconnect(world: &mut World) {
    world.resource_scope(|world, mut stay: Mut<StayConnected>| {
        if stay.last.is_some_and(|last| last.elapsed() < stay.pause) {
            return;
        }
        stay.last = Some(Instant::now());
        if let Err(why) = (stay.connect)(world) {
            warn!("there is no way to the server: {why}");
        }
    });
}
