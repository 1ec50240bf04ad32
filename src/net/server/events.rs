//! Events and statistics of a server.

use crate::lattice::RegionPos;

use crate::net::message::{ClientId, KickReason};

/// An event for a game or an operator.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ServerEvent {
    /// A client has joined, or has come back after a gap.
    Joined(ClientId),
    /// A client was kicked: its connection should be closed once what waits for it is sent.
    Kicked(ClientId, KickReason),
    /// A client's world differed, and it fetched these regions. This indicates a bug in the plugin or the client, or
    /// faulty hardware.
    Repaired(ClientId, Vec<RegionPos>),
    /// An entry could not be applied. This indicates a bug in the plugin.
    EntryFailed(u64),
}

/// Statistics of a server since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServerFigures {
    /// Received messages.
    pub messages: u64,
    /// Messages of clients that are not connected.
    pub strays: u64,
    /// Invalid messages.
    pub malformed: u64,
    /// Received edits.
    pub edits: u64,
    /// Edits and undos that were refused.
    pub refused: u64,
    /// Entries that were ordered.
    pub ordered: u64,
    /// Entries that could not be applied.
    pub failed: u64,
    /// Clients that were kicked.
    pub kicked: u64,
    /// Clients whose session was restarted, because a world was kept for them and they acknowledged nothing.
    pub stuck: u64,
    /// Regions that clients fetched because they differed.
    pub repairs: u64,
    /// Bytes of the main lane to all clients.
    pub main_bytes: u64,
    /// Bytes of the bulk lane to all clients.
    pub bulk_bytes: u64,
}
