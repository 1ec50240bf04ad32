//! Messages between client and server.
//!
//! ```text
//! client                                   server
//!   Greeting                          ->
//!                                     <-   Stream: what follows in this lane answers that greeting (in both lanes)
//!                                     <-   Welcome: the number n that it starts from, and what comes in the bulk lane
//!                                     <-   Piece ...      (bulk) regions or old entries, up to n
//!                                     <-   Entries ...    (main) everything that is ordered after n
//!   Ack                               ->                  what has arrived
//!   Edits, Undo                       ->
//!                                     <-   Entries with these, or Refused
//!                                     <-   Hashes after a hash check
//!   Fetch, where hashes differ        ->
//!                                     <-   Piece ...      (bulk) these regions at a later number
//!   Images, where edits hold others   ->
//!                                     <-   Piece ...      (bulk) these images
//! ```
//!
//! A session can start again at any moment, over the same connection or a new one. Each greeting names a new
//! **stream**; messages that arrive in a lane before the [start](ToClient::Stream) of that stream belong to an earlier
//! one and are dropped. A client repeats its greeting until it is answered, and a server that does not know a connected
//! client asks it to [greet](ToClient::Greet).
//!
//! The **log** is a sequence of [entries](Entry) with consecutive numbers from 1. The world *at number n* is the
//! pristine world after the entries 1 to n. All clients that have applied them in order have the same world.

use std::sync::Arc;

use glam::IVec3;

use super::ContentId;
use crate::brush::{Edit, Prefab};
use crate::format::WorldId;
use crate::ground::GreyImage;
use crate::lattice::{BrickPos, ChunkPos, RegionPos};
use crate::terrain::{EditSettings, Order, Patch};
use crate::volume::{Brick, Fields};

/// See [`Server::PROTOCOL`](super::Server::PROTOCOL).
pub(crate) const PROTOCOL: u32 = 6;

/// The maximum size in bytes of a message to a server.
pub const MAX_TO_SERVER: usize = 64 << 10;
/// The maximum size in bytes of a message to a client, in either lane.
pub const MAX_TO_CLIENT: usize = 8 << 20;
/// The maximum number of edits in a message.
pub const MAX_EDITS: usize = 256;
/// The maximum number of regions that a message names.
pub const MAX_REGIONS: usize = 4096;
/// The maximum number of images that a message asks for.
pub const MAX_IMAGES: usize = 64;
/// The most by which the sequence number of a client's edit may exceed the previous one. Larger jumps are invalid, so
/// no client can use up the numbers of a player.
pub const MAX_SEQUENCE_JUMP: u64 = 1 << 16;

/// Identifies a player. The caller assigns these numbers: a client that reconnects with the same number is the same
/// player. Small numbers take fewer bytes. Limits, undo and administrators depend on them, so the caller has to
/// authenticate clients: a client with another player's number acts as that player.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ClientId(pub u64);

impl ClientId {
    /// The author of the server's own edits.
    pub const SERVER: Self = Self(u64::MAX);
}

/// A channel for messages. The transport delivers each lane completely and in order; between lanes there is no order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lane {
    /// Urgent messages.
    Main,
    /// Large data, at a rate that the server limits.
    Bulk,
}

/// One step of the log.
#[derive(Clone, Debug)]
#[non_exhaustive]
#[expect(clippy::large_enum_variant, reason = "nearly all entries are orders")]
pub enum Entry {
    /// An order to the world: an edit, other rules or settings of loose pieces, or parts that replace others.
    Order {
        /// The client that asked for it, and its sequence number there. `None` for the game's server; an edit of the
        /// game's server has [`ClientId::SERVER`] here.
        by: Option<(ClientId, u64)>,
        /// The order. The tag of an edit is 0 and it has no stroke: these concern its author and the server.
        order: Order,
    },
    /// Changes nothing. The hashes of regions that were touched since the previous hash check are compared here.
    HashCheck,
}

impl Entry {
    /// An order of a client.
    pub fn of(author: ClientId, sequence: u64, order: Order) -> Self {
        Self::Order { by: Some((author, sequence)), order }
    }

    /// An order of the game's server.
    pub fn of_server(order: Order) -> Self {
        Self::Order { by: None, order }
    }

    /// The order to a terrain; `None` for a hash check.
    pub fn order(&self) -> Option<&Order> {
        if let Self::Order { order, .. } = self { Some(order) } else { None }
    }

    /// The edit, if it is one.
    pub fn edit(&self) -> Option<&Edit> {
        self.order().and_then(Order::edit)
    }

    /// The parts that replace others.
    pub fn parts(&self) -> Option<&Arc<Patch>> {
        if let Some(Order::Parts { change, .. }) = self.order() { Some(change) } else { None }
    }

    /// The entry's sequence number at a client, if that client sent it.
    pub(crate) fn number_of(&self, client: Option<ClientId>) -> Option<u64> {
        match self {
            Self::Order { by: Some((author, sequence)), .. } if Some(*author) == client => Some(*sequence),
            _ => None,
        }
    }
}

/// Entries with consecutive numbers.
#[derive(Clone, Debug)]
pub struct Entries {
    /// The number of the first.
    pub first: u64,
    /// All of the entries.
    pub entries: Vec<Entry>,
}

/// A position in the log of one run of a server. After a restart, entries may differ from those that were sent
/// before, because unsaved entries are lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Epoch {
    /// The world.
    pub world: WorldId,
    /// The server's run, a random number.
    pub run: u64,
    /// The number up to which all entries are applied.
    pub number: u64,
}

/// The greeting of a client that joins, or joins again after a gap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hello {
    /// [`Server::PROTOCOL`](super::Server::PROTOCOL).
    pub protocol: u32,
    /// [`Terrain::SIMULATION`](crate::terrain::Terrain::SIMULATION).
    pub simulation: u32,
    /// [`Ground::hash`](crate::ground::Ground::hash).
    pub ground: u64,
    /// Cells along the side of a chunk.
    pub chunk_size: u32,
    /// The position that it has reached, if it has joined before.
    pub epoch: Option<Epoch>,
    /// Where the client's player is, in voxels: regions come from there outwards.
    pub position: IVec3,
}

/// A message to the server.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ToServer {
    /// Starts the only session of this connection: the answer has no [`ToClient::Stream`].
    Hello(Hello),
    /// Starts a session, or starts it again. Both lanes of the answer begin with a [`ToClient::Stream`] of this number.
    Greeting {
        /// The stream that the client wants to begin, with a number that it has not used before. A repeated number is a
        /// repeated greeting, which is ignored if it was answered already.
        stream: u64,
        /// The state of the client.
        hello: Hello,
    },
    /// Edits, numbered consecutively from `first`. A client numbers its edits and undos together, from 1.
    Edits {
        /// The number of the first.
        first: u64,
        /// At most [`MAX_EDITS`].
        edits: Vec<Edit>,
    },
    /// Undoes the last stroke of a client before this position among its edits.
    Undo {
        /// The undo's sequence number among the client's edits and undos.
        sequence: u64,
        /// The player whose stroke is undone.
        of: ClientId,
    },
    /// Asks for regions, because they differ.
    Fetch {
        /// The number that the client's world is at.
        number: u64,
        /// At most [`MAX_REGIONS`].
        regions: Vec<RegionPos>,
    },
    /// Acknowledges received data.
    Ack {
        /// Bytes of the bulk lane's stream, since it began.
        bulk: u64,
        /// The number that the client's world is at.
        number: u64,
    },
    /// Asks for images of stamps, and for prefabs, that the client does not have.
    Images {
        /// At most [`MAX_IMAGES`].
        images: Vec<ContentId>,
    },
}

/// How a client gets from its present state to the number that it [starts](Welcome::epoch) from.
#[derive(Clone, Debug, PartialEq)]
pub enum Join {
    /// [Entries](ToClient::Entries) follow in the bulk lane, from its own number or an earlier one up to the start. A
    /// client without an [epoch](Hello::epoch) has the number 0: the pristine world, without rules.
    Log {
        /// The numbers of entries among them that the server could not apply: they do nothing.
        failed: Vec<u64>,
    },
    /// All stored regions follow in the bulk lane. All others are pristine.
    Regions {
        /// How many.
        regions: u32,
        /// Rules, settings, names at the start.
        state: Box<RuleState>,
    },
    /// The [table](ToClient::Table) of all regions follows in the bulk lane. The client fetches those that differ;
    /// regions that the table lacks are pristine.
    Compare {
        /// Rules, settings, names at the start.
        state: Box<RuleState>,
    },
}

/// The state at a number in addition to bricks and fields.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RuleState {
    /// The rules and the search for loose pieces that later edits obey.
    pub edit_settings: EditSettings,
    /// The greatest name that a field has had.
    pub next_field: u64,
}

/// The server's answer to a [`Hello`].
#[derive(Clone, Debug, PartialEq)]
pub struct Welcome {
    /// Who the client is.
    pub client: ClientId,
    /// The world, the server's run, and the number n that the client starts from: entries after it follow in the main
    /// lane.
    pub epoch: Epoch,
    /// The client's last sequence number that the server has seen. Edits up to it have an entry, or were refused.
    pub sequence: u64,
    /// How far from its player a client may dig, in voxels; `None` if that is not checked.
    pub reach: Option<u32>,
    /// The client's cost bucket: its refill each second, and the most that it holds. An edit costs 20, and 1 for
    /// each brick that it reaches, or 4 if it sculpts.
    pub cost: [u64; 2],
    /// The present content of that bucket.
    pub left: u64,
    /// The data that follows in the bulk lane.
    pub join: Join,
}

/// [Hashes](super::region_hash) of regions; 0 is a pristine one.
pub type RegionHashes = Vec<(RegionPos, u64)>;

/// A region at a number. Bricks and fields that it does not name are pristine.
#[derive(Clone, Debug)]
pub struct RegionContent {
    /// The number that the world is at.
    pub number: u64,
    /// The region.
    pub pos: RegionPos,
    /// Regions that follow for the same number.
    pub left: u32,
    /// The greatest name that a field has had.
    pub next_field: u64,
    /// The region's bricks.
    pub bricks: Vec<(BrickPos, Arc<Brick>)>,
    /// The fields of all chunks that have a sample in it; chunks that are not named have none.
    pub fields: Vec<(ChunkPos, Fields)>,
}

/// A message to a client.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum ToClient {
    /// The client is admitted.
    Welcome(Welcome),
    /// The server has removed the client.
    Kicked(KickReason),
    /// Entries of the log.
    Entries(Entries),
    /// The server could not apply this entry: the regions that it reaches may differ.
    Failed {
        /// The entry's number.
        number: u64,
    },
    /// The server refused an edit or undo of the client.
    Refused {
        /// The sequence number of the edit or undo.
        sequence: u64,
        /// Why.
        why: Refusal,
    },
    /// The hashes at this hash check of regions that were touched since the previous one.
    Hashes {
        /// The number of the hash check.
        number: u64,
        /// In order.
        regions: RegionHashes,
    },
    /// All regions of the world at this number, by region.
    Table {
        /// The number.
        number: u64,
        /// In order.
        regions: RegionHashes,
    },
    /// A region.
    Region(RegionContent),
    /// Everything up to this number is saved.
    Durable {
        /// The number.
        number: u64,
    },
    /// Bytes of the bulk lane's stream: see [`BulkReader`](super::BulkReader).
    Piece(Vec<u8>),
    /// Further messages in this lane answer the [greeting](ToServer::Greeting) with this number.
    Stream {
        /// The number.
        stream: u64,
    },
    /// The server has no session for the connected client, which has to greet. A client that has greeted already waits
    /// for the answer.
    Greet,
    /// An image that the client asked for.
    Image(Arc<GreyImage>),
    /// A prefab that the client asked for.
    Prefab(Arc<Prefab>),
}

/// The reason why an edit or an undo was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The player is too far away, or the server does not know where it is.
    #[error("too far away")]
    TooFar,
    /// The client's cost bucket is empty.
    #[error("too much at once")]
    Cost,
    /// The game forbids the edit.
    #[error("not allowed")]
    Forbidden,
    /// The edit lies outside the world.
    #[error("outside the world")]
    OutsideWorld,
    /// The server has too much to do.
    #[error("too much work waits")]
    Overloaded,
    /// There is nothing to undo.
    #[error("nothing to undo")]
    Nothing,
    /// Other players have changed the same parts since.
    #[error("others have dug there since")]
    Touched,
    /// The edit is larger than edits may be, or than a message may be.
    #[error("too large")]
    TooLarge,
    /// The edit arrived before the client had joined.
    #[error("the client has not joined yet")]
    NotJoined,
    /// The server does not have an image, grid or prefab that the edit holds.
    #[error("the server does not have an image, grid or prefab of the edit")]
    UnknownContent,
}

/// The reason why a server removes a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KickReason {
    /// The client speaks another [`Server::PROTOCOL`](super::Server::PROTOCOL).
    #[error("client and server have different versions of the protocol")]
    Protocol,
    /// The client has another [`Terrain::SIMULATION`](crate::terrain::Terrain::SIMULATION).
    #[error("client and server have different versions of the simulation")]
    Simulation,
    /// The client has another ground.
    #[error("client and server have different grounds")]
    Ground,
    /// The client has another chunk size.
    #[error("client and server have different chunk sizes")]
    ChunkSize,
    /// The client sent too many invalid messages.
    #[error("too many invalid messages")]
    Malformed,
    /// The client sent far more than its budget.
    #[error("flooding")]
    Flood,
    /// The game removed the client.
    #[error("kicked")]
    ByGame,
    /// The player has connected again, and plays over the new connection.
    #[error("the player has connected again")]
    ConnectedAgain,
    /// The game [does not admit](super::Server::set_admission) the player. The number has a meaning for the game only,
    /// for example which text it shows.
    #[error("refused by the game, reason {0}")]
    Refused(u32),
}
