//! The transport: connections and messages of bevy_replicon. No other file names it, so another transport is another
//! file with the same items.

use bevy::ecs::message::MessageCursor;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::system::{ScheduleSystem, SystemParam};
use bevy::prelude::*;
use bevy_replicon::bytes::Bytes;
use bevy_replicon::postcard_utils;
pub(super) use bevy_replicon::prelude::ClientId as Peer;
use bevy_replicon::prelude::*;
pub(super) use bevy_replicon::shared::backend::connected_client::NetworkId;
use bevy_replicon::shared::message::ctx::{ClientSendCtx, ServerReceiveCtx};

use super::messages::{BulkLane, FromPlayer, Invitation, MainLane, Served};
use crate::net::{self, Lane, MAX_TO_SERVER};

/// The most bytes of a [`FromPlayer`] in addition to its content.
const OVERHEAD: usize = 16;

/// The error if plugins are missing.
const NEEDS_REPLICON: &str = "TogetherPlugin does nothing: it needs RepliconPlugins before it, and these need StatesPlugin, which \
    DefaultPlugins have and MinimalPlugins have not: add_plugins((MinimalPlugins, StatesPlugin, RepliconPlugins, BurrowPlugins, \
    TogetherPlugin)), and a transport such as RepliconRenetPlugins";

/// Registers the messages; `forget_connection` runs when a client's connection ends. Returns `false` if replicon's
/// plugins are missing.
pub(super) fn build<M>(
    app: &mut App,
    forget_connection: impl IntoScheduleConfigs<ScheduleSystem, M>,
) -> bool {
    if !app.is_plugin_added::<RepliconSharedPlugin>() {
        error!("{NEEDS_REPLICON}");
        return false;
    }
    app.add_client_message_with::<FromPlayer>(Channel::Ordered, write, read)
        .add_server_message::<MainLane>(Channel::Ordered)
        .add_server_message::<BulkLane>(Channel::Ordered)
        .add_server_message::<Invitation>(Channel::Ordered)
        // They contain their own version numbers, and do not depend on replicated types.
        .make_message_independent::<MainLane>()
        .make_message_independent::<BulkLane>()
        .make_message_independent::<Invitation>()
        .add_observer(drop_messages)
        .add_systems(OnExit(ClientState::Connected), forget_connection);
    true
}

fn write(_: &mut ClientSendCtx, message: &FromPlayer, bytes: &mut Vec<u8>) -> Result<()> {
    Ok(postcard_utils::to_extend_mut(message, bytes)?)
}

fn read(_: &mut ServerReceiveCtx, bytes: &mut Bytes) -> Result<FromPlayer> {
    if bytes.len() > MAX_TO_SERVER + OVERHEAD {
        return Ok(FromPlayer::TooLong);
    }
    Ok(postcard_utils::from_buf(bytes)?)
}

/// The number of a player, from the transport's; `None` if it has none.
pub(super) fn number(client: Peer, id: Option<&NetworkId>) -> Option<net::ClientId> {
    let number = match (client.entity(), id) {
        (None, _) => 0,
        (_, Some(id)) => id.get().checked_add(1)?,
        (Some(entity), None) => entity.to_bits(),
    };
    Some(net::ClientId(number)).filter(|number| *number != net::ClientId::SERVER)
}

/// The clients of this app's server. A client takes part in the game once replicon has authorised it.
#[derive(SystemParam)]
pub(super) struct Peers<'w, 's> {
    clients:
        Query<'w, 's, (Entity, Option<&'static NetworkId>, Has<AuthorizedClient>), With<ConnectedClient>>,
}

impl Peers<'_, '_> {
    /// The number of a peer that takes part.
    pub fn number(&self, peer: Peer) -> Option<net::ClientId> {
        let Some(entity) = peer.entity() else { return number(peer, None) };
        let (_, id, is_authorised) = self.clients.get(entity).ok()?;
        number(peer, id).filter(|_| is_authorised)
    }

    /// Whether a client takes part.
    pub fn has(&self, client: Entity) -> bool {
        self.clients.get(client).is_ok_and(|(_, _, is_authorised)| is_authorised)
    }

    /// Whether a client is connected.
    pub fn is_connected(&self, client: Entity) -> bool {
        self.clients.contains(client)
    }

    /// All connected clients, and whether they take part.
    pub fn iter(&self) -> impl Iterator<Item = (Entity, bool)> {
        self.clients.iter().map(|(entity, _, is_authorised)| (entity, is_authorised))
    }
}

/// How far messages of players were read.
pub(super) type ReadMessages = MessageCursor<FromClient<FromPlayer>>;

/// Messages of players to this app's server.
#[derive(SystemParam)]
pub(super) struct FromPlayers<'w> {
    messages: Res<'w, Messages<FromClient<FromPlayer>>>,
}

impl FromPlayers<'_> {
    /// The messages that were not read yet.
    pub fn read<'a>(&'a self, read: &'a mut ReadMessages) -> impl Iterator<Item = (Peer, &'a FromPlayer)> {
        read.read(&self.messages).map(|FromClient { client_id, message }| (*client_id, message))
    }
}

/// Messages of this app's server to players.
#[derive(SystemParam)]
pub(super) struct ToPlayers<'w> {
    order: MessageWriter<'w, ToClients<MainLane>>,
    bulk: MessageWriter<'w, ToClients<BulkLane>>,
    invitations: MessageWriter<'w, ToClients<Invitation>>,
    leave: MessageWriter<'w, DisconnectRequest>,
}

impl ToPlayers<'_> {
    /// Sends bytes in a lane.
    pub fn send(&mut self, to: Peer, lane: Lane, bytes: Vec<u8>) {
        let targets = SendTargets::Single(to);
        match lane {
            Lane::Main => drop(self.order.write(ToClients { targets, message: MainLane(bytes) })),
            Lane::Bulk => drop(self.bulk.write(ToClients { targets, message: BulkLane(bytes) })),
        }
    }

    /// Says which ground is served.
    pub fn invite(&mut self, client: Entity, served: Option<Served>) {
        let targets = SendTargets::Single(Peer::Client(client));
        self.invitations.write(ToClients { targets, message: Invitation(served) });
    }

    /// Closes a client's connection.
    pub fn disconnect(&mut self, client: Entity) {
        self.leave.write(DisconnectRequest { client });
    }
}

/// Messages of this app's own player to the server in the same app, past the transport.
#[derive(SystemParam)]
pub(super) struct ToOwnServer<'w> {
    messages: MessageWriter<'w, FromClient<FromPlayer>>,
}

impl ToOwnServer<'_> {
    pub fn send(&mut self, messages: impl IntoIterator<Item = FromPlayer>) {
        let messages = messages.into_iter().map(|message| FromClient { client_id: Peer::Server, message });
        self.messages.write_batch(messages);
    }
}

/// The connection of this app to a server in another one.
#[derive(SystemParam)]
pub(super) struct Connection<'w> {
    state: Res<'w, State<ClientState>>,
}

impl Connection<'_> {
    pub fn is_open(&self) -> bool {
        *self.state.get() == ClientState::Connected
    }
}

/// Drops messages to a client that is gone or no longer authorised. A backend may panic otherwise.
fn drop_messages(
    gone: On<Remove, AuthorizedClient>,
    mut invitations: ResMut<Messages<ToClients<Invitation>>>,
    mut order: ResMut<Messages<ToClients<MainLane>>>,
    mut bulk: ResMut<Messages<ToClients<BulkLane>>>,
) {
    drop_for(gone.entity, &mut invitations);
    drop_for(gone.entity, &mut order);
    drop_for(gone.entity, &mut bulk);
}

fn drop_for<M: Message>(gone: Entity, messages: &mut Messages<ToClients<M>>)
where
    ToClients<M>: Message,
{
    let is_for = |targets: &SendTargets| matches!(targets, SendTargets::Single(Peer::Client(client)) if *client == gone);
    if messages.get_cursor().read(messages).any(|message| is_for(&message.targets)) {
        let others: Vec<_> = messages.drain().filter(|message| !is_for(&message.targets)).collect();
        messages.write_batch(others);
    }
}
