//! The messages that carry the bytes of clients and server. Replicon sends each kind in a channel of its own, reliably and in order.

use bevy::prelude::*;
use bevy_replicon::prelude::*;
use serde::{Deserialize, Serialize};

/// From a client to the server.
#[derive(Message, Clone, Debug, Serialize, Deserialize)]
pub(super) struct FromPlayer(pub Vec<u8>);

/// From the server to a client, in the lane of what has to come soon.
#[derive(Message, Clone, Debug, Serialize, Deserialize)]
pub(super) struct OrderLane(pub Vec<u8>);

/// From the server to a client, in the lane of what takes long.
#[derive(Message, Clone, Debug, Serialize, Deserialize)]
pub(super) struct BulkLane(pub Vec<u8>);

pub(super) fn register(app: &mut App) {
    app.add_client_message::<FromPlayer>(Channel::Ordered)
        .add_server_message::<OrderLane>(Channel::Ordered)
        .add_server_message::<BulkLane>(Channel::Ordered)
        // They say themselves what they depend on, and nothing that is replicated is part of it.
        .make_message_independent::<OrderLane>()
        .make_message_independent::<BulkLane>();
}
