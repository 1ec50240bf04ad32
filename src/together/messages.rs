//! The messages that carry the bytes of clients and server. Each type is sent in a separate channel, reliably and in
//! order.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::net::Server;
use crate::terrain::World;

/// From a client to the server.
#[derive(Message, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum FromPlayer {
    /// A message of the client to the server of this [run](Served::run).
    Bytes(u32, Vec<u8>),
    /// The player, who was invited in this run, has left.
    Left(u32),
    /// The message was longer than any may be, and was not kept.
    #[serde(skip)]
    TooLong,
}

/// From the server to a client, in the main lane.
#[derive(Message, Clone, Debug, Serialize, Deserialize)]
pub(super) struct MainLane(pub Vec<u8>);

/// From the server to a client, in the bulk lane.
#[derive(Message, Clone, Debug, Serialize, Deserialize)]
pub(super) struct BulkLane(pub Vec<u8>);

/// Invites an authorised client to greet; `None` if no ground is served any more.
#[derive(Message, Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Invitation(pub Option<Served>);

/// The served ground, and the run of its server.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Served {
    pub run: u32,
    pub ground: GroundId,
}

/// Clients and server have to agree on this.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct GroundId {
    pub hash: u64,
    pub chunk_size: i32,
}

impl Served {
    pub fn by(server: &Server) -> Self {
        Self { run: server.epoch().run as u32, ground: GroundId::of(server.terrain().world()) }
    }
}

impl FromPlayer {
    /// Whether it is for the server of another run than this one. Such a message may arrive after a server was
    /// replaced.
    pub fn is_for_another(&self, run: u32) -> bool {
        matches!(self, Self::Bytes(own, _) | Self::Left(own) if *own != run)
    }
}

impl GroundId {
    pub fn of(world: &World) -> Self {
        Self { hash: world.ground().hash(), chunk_size: world.grid().size() }
    }
}
