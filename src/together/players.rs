//! The players of a ground server: their numbers and their clients.

use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;

use super::messages::FromPlayer;
use super::replicon::{Peer, Peers};
use crate::net;

/// The most bytes of a player's messages that wait while the server is busy. A player that sends more is kicked.
const MAX_WAITING_BYTES: usize = 1 << 20;

/// The approximate overhead of a message in bytes.
const MESSAGE_BYTES: usize = 128;

/// The players of a ground server.
#[derive(Default)]
pub(super) struct Players {
    /// Clients that have sent a message.
    clients: HashMap<net::ClientId, Peer>,
    /// Removed clients: messages from them on the same connection are ignored.
    kicked: HashSet<Entity>,
    /// Removed clients that were not notified, as their player has used another connection since.
    replaced: Vec<Entity>,
    /// Bytes that wait for the server.
    waiting: HashMap<net::ClientId, usize>,
}

/// The meaning of a message.
pub(super) enum PlayerMessage {
    /// A message of the client, the first one if it `begins`.
    Bytes {
        begins: bool,
        bytes: Vec<u8>,
    },
    /// The player has left.
    Leaves,
    /// The player has sent more than the server could handle.
    Flood,
    Nothing,
}

impl Players {
    /// The number of a client that takes part and was not kicked.
    pub fn find(&self, client: Peer, peers: &Peers) -> Option<net::ClientId> {
        let is_kicked = client.entity().is_some_and(|entity| self.kicked.contains(&entity));
        peers.number(client).filter(|_| !is_kicked)
    }

    /// Handles a message of a player.
    pub fn receive(&mut self, player: net::ClientId, client: Peer, message: &FromPlayer) -> PlayerMessage {
        let said = match message {
            FromPlayer::Left(_) if self.clients.remove(&player).is_some() => PlayerMessage::Leaves,
            FromPlayer::Left(_) => return PlayerMessage::Nothing,
            // One that was too long is counted as an invalid message.
            FromPlayer::Bytes(..) | FromPlayer::TooLong => {
                let earlier = self.clients.insert(player, client);
                let begins = earlier != Some(client);
                if let Some(earlier) = earlier.filter(|_| begins).and_then(|earlier| earlier.entity()) {
                    // Otherwise the two would take the place of each other for ever.
                    self.kicked.insert(earlier);
                    self.replaced.push(earlier);
                }
                let bytes =
                    if let FromPlayer::Bytes(_, bytes) = message { bytes.clone() } else { Vec::new() };
                PlayerMessage::Bytes { begins, bytes }
            }
        };
        let length = if let PlayerMessage::Bytes { bytes, .. } = &said { bytes.len() } else { 0 };
        let waiting = self.waiting.entry(player).or_default();
        let before = *waiting;
        *waiting = waiting.saturating_add(length + MESSAGE_BYTES);
        match (before <= MAX_WAITING_BYTES, *waiting <= MAX_WAITING_BYTES) {
            (_, true) => said,
            (true, false) => PlayerMessage::Flood,
            (false, false) => PlayerMessage::Nothing,
        }
    }

    /// Records that the server has taken all waiting messages.
    pub fn forget_waiting(&mut self) {
        self.waiting.clear();
    }

    /// The client to which messages for a player are sent.
    pub fn client(&self, player: net::ClientId) -> Option<Peer> {
        self.clients.get(&player).copied()
    }

    /// Forgets a player that was kicked; returns the client whose connection has to be closed.
    pub fn kick(&mut self, player: net::ClientId) -> Option<Entity> {
        let client = self.clients.remove(&player)?.entity()?;
        self.kicked.insert(client);
        Some(client)
    }

    /// Returns the clients that are still connected, and whose player has used another connection since.
    pub fn take_replaced(&mut self, peers: &Peers) -> Vec<Entity> {
        self.replaced.drain(..).filter(|client| peers.has(*client)).collect()
    }

    /// Forgets players whose clients are gone, or are no longer authorised; returns their numbers.
    pub fn take_gone(&mut self, peers: &Peers) -> Vec<net::ClientId> {
        self.kicked.retain(|client| peers.has(*client));
        let is_gone = |client: &Peer| client.entity().is_some_and(|entity| !peers.has(entity));
        self.clients.extract_if(|_, client| is_gone(client)).map(|(player, _)| player).collect()
    }
}
