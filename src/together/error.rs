//! Problems of a shared terrain: why it is not in sync with a server, or why it refuses a request.

use bevy::prelude::*;

use crate::net::{KickReason, Refusal};

/// The reason why a [`SharedTerrain`](super::SharedTerrain) is not in sync with a server, or refuses a request. The
/// text says what to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SharingError {
    /// The connection is lost. Players can keep digging, and their edits are sent over the next connection.
    #[error("the connection to the server is lost; connect again, and edits made until then are sent")]
    ConnectionLost,
    /// The server's `GroundServer` was removed. Digs are refused until there is another one.
    #[error(
        "the server has stopped serving its ground; digs are refused until it inserts a GroundServer again"
    )]
    NotServed,
    /// The server has another ground or chunk size than the terrain. Digs are refused until they are the same.
    #[error(
        "the server has ground {theirs:#018x} in chunks of {their_chunks}, and this terrain has {ours:#018x} in chunks of \
         {our_chunks}; insert a Terrain of the server's ground, digs are refused until then"
    )]
    OtherGround {
        /// The hash of the terrain's ground.
        ours: u64,
        /// The terrain's chunk size.
        our_chunks: i32,
        /// The hash of the server's ground.
        theirs: u64,
        /// The server's chunk size.
        their_chunks: i32,
    },
    /// The server has removed the player. Digs are refused until there is another connection. Do not connect again
    /// after [`KickReason::ConnectedAgain`], because that would end the later connection of the same player.
    #[error("the server has sent this player away: {0}")]
    Kicked(KickReason),
    /// Another terrain of this app is shared already, and a connection carries one ground. Digs on this one are refused
    /// until that one is despawned or no longer shared.
    #[error(
        "{0} is shared already, and an app shares one terrain at a time; remove SharedTerrain from one of them"
    )]
    AnotherIsShared(Entity),
    /// The entity of the `SharedTerrain` has no `Terrain`. Sharing begins once there is one.
    #[error("a SharedTerrain needs a Terrain on the same entity; sharing begins once it is inserted")]
    NoTerrain,
    /// The rules of the terrain were changed, which has no effect: rules come from the server.
    #[error(
        "rules that are set on a shared terrain do nothing; set them on the server: call \
         `server.submit(Order::rules(rules))` in `GroundServer::with`"
    )]
    RulesIgnored,
    /// The server does not undo the player's last stroke.
    #[error("the server does not undo the last stroke: {0}")]
    UndoRefused(Refusal),
    /// The limit of edits that wait for the server is reached; further edits are refused.
    #[error("the server has not answered {0} edits; further ones are refused until it does")]
    TooManyPending(usize),
}

/// Reports that a [`SharedTerrain`](super::SharedTerrain) is not in sync with a server, or refuses a request. The
/// problem is also logged as a warning.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct SharingErrorFound {
    /// The terrain.
    pub terrain: Entity,
    /// The problem.
    pub error: SharingError,
}
