//! Finds the server of an app: servers invite clients, and each app tracks whether it has been invited.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::messages::{BulkLane, Invitation, MainLane, Served};
use super::replicon::{Connection, Peers, ToPlayers};
use super::server::GroundServer;

/// The server of the ground that is shared in this app.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Service {
    /// There is no connection, and no server in this app.
    #[default]
    Apart,
    /// There is a connection, and the server has not said yet that it serves a ground.
    Silent,
    /// No ground is served any more, by the server of this connection or by the one that was in this app.
    Unserved,
    /// A ground is served. The number is that of the invitation: each is greeted once.
    Served(Served, u64),
}

/// The state of [`find_service`].
#[derive(Default)]
pub(super) struct Seen {
    /// The number of invitations.
    count: u64,
    /// Whether a server was in this app in the last frame, and what it served.
    local: Option<Option<Served>>,
}

impl Seen {
    fn next(&mut self, served: Option<Served>) -> Service {
        let Some(served) = served else { return Service::Unserved };
        self.count += 1;
        Service::Served(served, self.count)
    }
}

/// Finds the server of the ground: in this app, or the one that this app is connected to.
pub(super) fn find_service(
    mut service: ResMut<Service>,
    ground: Option<Res<GroundServer>>,
    connection: Connection,
    mut messages: MessageReader<Invitation>,
    mut seen: Local<Seen>,
) {
    let local = ground.map(|ground| ground.served());
    let before = std::mem::replace(&mut seen.local, local);
    if let Some(served) = local {
        if before != local {
            *service = seen.next(served);
        }
        messages.clear();
        return;
    }
    let is_connected = connection.is_open();
    if before.is_some() {
        *service = Service::Unserved;
    } else if is_connected && *service == Service::Apart {
        *service = Service::Silent;
    }
    if is_connected {
        for Invitation(served) in messages.read() {
            *service = seen.next(*served);
        }
    }
}

/// Drops messages of a connection that has ended.
pub(super) fn forget_connection(
    mut service: ResMut<Service>,
    mut invitations: ResMut<Messages<Invitation>>,
    mut order: ResMut<Messages<MainLane>>,
    mut bulk: ResMut<Messages<BulkLane>>,
) {
    *service = Service::Apart;
    invitations.clear();
    order.clear();
    bulk.clear();
}

/// Invites clients that take part to the served ground, and notifies invited clients when it is no longer served.
pub(super) fn invite(
    ground: Option<Res<GroundServer>>,
    peers: Peers,
    mut invited: Local<HashMap<Entity, Served>>,
    mut to_players: ToPlayers,
) {
    let served = ground.and_then(|ground| ground.served());
    invited.retain(|client, _| peers.is_connected(*client));
    for (client, is_authorised) in peers.iter() {
        let now = served.filter(|_| is_authorised);
        let before = match now {
            Some(now) => invited.insert(client, now),
            None => invited.remove(&client),
        };
        if now != before {
            to_players.invite(client, now);
        }
    }
}
