//! Players come back by themselves: an app that has no connection makes another one, again and again.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_replicon::prelude::ClientState;
use bevy_replicon_renet::netcode::ClientAuthentication;

use super::party;

/// What the player says to the server at the next try. A token is good for one connection, so each try asks for a new one.
type Authenticate = Box<dyn FnMut() -> Result<ClientAuthentication> + Send + Sync>;

/// Keeps an app connected while this is there.
#[derive(Resource)]
pub struct StayConnected {
    authenticate: Authenticate,
    /// The time between two tries.
    pause: Duration,
    last: Option<Instant>,
}

impl StayConnected {
    pub fn new(
        pause: Duration,
        authenticate: impl FnMut() -> Result<ClientAuthentication> + Send + Sync + 'static,
    ) -> Self {
        Self { authenticate: Box::new(authenticate), pause, last: None }
    }
}

pub struct ReconnectPlugin;

impl Plugin for ReconnectPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(
            Update,
            reconnect.run_if(in_state(ClientState::Disconnected)).run_if(resource_exists::<StayConnected>),
        );
    }
}

/// Tries to connect.
fn reconnect(world: &mut World) {
    world.resource_scope(|world, mut stay: Mut<StayConnected>| {
        if stay.last.is_some_and(|last| last.elapsed() < stay.pause) {
            return;
        }
        stay.last = Some(Instant::now());
        let done = (stay.authenticate)().and_then(|authentication| party::connect(world, authentication));
        if let Err(why) = done {
            warn!("there is no way to the server: {why}");
        }
    });
}
