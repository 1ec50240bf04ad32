//! The server of a ground in a Bevy app: bytes go through replicon, and edits run on the plugin's threads.

use std::time::Duration;

use bevy::platform::collections::HashMap;
use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy_replicon::prelude::*;
use bevy_replicon::shared::backend::connected_client::NetworkId;

use super::messages::{BulkLane, FromPlayer, OrderLane};
use crate::net::{self, Lane, Server, ServerEvent};
use crate::plugin::{ThreadTask, Threads};
use crate::store::Store;

/// The ground that players dig together: insert it in the app that is the server. Its [`Server`] owns a terrain that nobody looks
/// at; a player on the same machine has a [`SharedTerrain`](super::SharedTerrain) like everybody else.
#[derive(Resource)]
pub struct GroundServer {
    /// What is not under way.
    parts: Option<Parts>,
    under_way: Option<ThreadTask<Parts>>,
    waiting: Vec<Request>,
    start: Instant,
    /// Players that are connected, by their numbers.
    players: HashMap<net::ClientId, ClientId>,
}

/// What goes to a thread and comes back.
struct Parts {
    server: Server,
    store: Option<Store>,
}

/// What waits for the server to come back.
type Request = Box<dyn FnOnce(&mut Server, Duration) + Send + Sync>;

/// Something happened on the ground's server.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct GroundServerEvent(pub ServerEvent);

impl GroundServer {
    /// Serves a world that is not saved.
    pub fn new(server: Server) -> Self {
        Self { parts: Some(Parts { server, store: None }), ..Self::empty() }
    }

    fn empty() -> Self {
        Self {
            parts: None,
            under_way: None,
            waiting: Vec::new(),
            start: Instant::now(),
            players: HashMap::default(),
        }
    }

    /// Serves a world that is saved in this store: [`Server::open`] made the server of it.
    pub fn with_store(server: Server, store: Store) -> Self {
        Self { parts: Some(Parts { server, store: Some(store) }), ..Self::empty() }
    }

    /// Does something with the server as soon as it is not at work, in the order of these calls: sets where a player is, changes
    /// the rules.
    pub fn with(&mut self, work: impl FnOnce(&mut Server) + Send + Sync + 'static) {
        self.waiting.push(Box::new(move |server, _| work(server)));
    }

    /// The number of a player on the server: one more than the transport's, so it stays over connections. A player on the
    /// server's own machine has the number 0.
    pub fn player(client: ClientId, ids: &Query<&NetworkId>) -> net::ClientId {
        let known =
            client.entity().and_then(|entity| ids.get(entity).ok()).map(|id| id.get().saturating_add(1));
        let unknown = client.entity().map_or(0, Entity::to_bits);
        // The greatest number is the server's own.
        net::ClientId(known.unwrap_or(unknown).min(u64::MAX - 1))
    }

    /// Waits until all that was asked for is done and saved: before the app ends.
    pub fn finish(&mut self) {
        let deadline = Instant::now() + Duration::from_secs(10);
        while self.parts.is_none() && Instant::now() < deadline {
            self.parts = self.under_way.as_mut().and_then(ThreadTask::finish);
            std::thread::sleep(Duration::from_millis(1));
        }
        let now = self.start.elapsed();
        if let Some(parts) = &mut self.parts {
            self.waiting.drain(..).for_each(|request| request(&mut parts.server, now));
            parts.advance(now);
            if let Some(Err(why)) = parts.store.as_mut().map(Store::flush) {
                error!("the last edits are not saved: {why}");
            }
        }
    }
}

impl Parts {
    fn advance(&mut self, now: Duration) {
        self.server.advance(now);
        if let Some(store) = &mut self.store
            && let Err(why) = self.server.save(store)
        {
            error_once!("nothing is saved any more: {why}");
        }
    }
}

/// Hands messages of players to the server, and sends what it has for them.
pub(super) fn serve(
    mut ground: ResMut<GroundServer>,
    mut messages: MessageReader<FromClient<FromPlayer>>,
    ids: Query<&NetworkId>,
    mut order: MessageWriter<ToClients<OrderLane>>,
    mut bulk: MessageWriter<ToClients<BulkLane>>,
    mut events: MessageWriter<GroundServerEvent>,
    mut leave: MessageWriter<DisconnectRequest>,
) {
    let ground = &mut *ground;
    for FromClient { client_id, message } in messages.read() {
        let player = GroundServer::player(*client_id, &ids);
        if ground.players.insert(player, *client_id) != Some(*client_id) {
            ground.waiting.push(Box::new(move |server, now| server.connect(player, now)));
        }
        let bytes = message.0.clone();
        ground.waiting.push(Box::new(move |server, now| server.receive(player, &bytes, now)));
    }
    if let Some(parts) = ground.under_way.as_mut().and_then(ThreadTask::finish) {
        (ground.parts, ground.under_way) = (Some(parts), None);
    }
    let Some(mut parts) = ground.parts.take() else { return };
    let now = ground.start.elapsed();
    ground.waiting.drain(..).for_each(|request| request(&mut parts.server, now));
    let mut kicked = Vec::new();
    for event in parts.server.take_events() {
        if let ServerEvent::Kicked(player, _) = event {
            kicked.push(player);
        }
        events.write(GroundServerEvent(event));
    }
    for (player, lane, bytes) in parts.server.take_outgoing() {
        let Some(&client) = ground.players.get(&player) else { continue };
        let targets = SendTargets::Single(client);
        match lane {
            Lane::Order => drop(order.write(ToClients { targets, message: OrderLane(bytes) })),
            Lane::Bulk => drop(bulk.write(ToClients { targets, message: BulkLane(bytes) })),
        }
    }
    for player in kicked {
        if let Some(client) = ground.players.remove(&player).and_then(ClientId::entity) {
            leave.write(DisconnectRequest { client });
        }
    }
    ground.under_way = Some(ThreadTask::start(Threads::Transactions, move || {
        parts.advance(now);
        parts
    }));
}

/// Tells the server that a player is gone.
pub(super) fn forget_player(gone: On<Remove, ConnectedClient>, ground: Option<ResMut<GroundServer>>) {
    let Some(mut ground) = ground else { return };
    let left: Vec<net::ClientId> = ground
        .players
        .extract_if(|_, client| client.entity() == Some(gone.entity))
        .map(|(id, _)| id)
        .collect();
    for player in left {
        ground.waiting.push(Box::new(move |server, _| server.disconnect(player)));
    }
}

/// Saves everything before the app ends.
pub(super) fn finish_at_exit(mut exits: MessageReader<AppExit>, mut ground: ResMut<GroundServer>) {
    if exits.read().next().is_some() {
        ground.finish();
    }
}
