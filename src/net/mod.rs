//! Multiplayer: one server owns the order of all edits, and clients show their own edits at once. Without Bevy and
//! without a transport: bytes in, bytes out, and a clock that the caller provides.
//!
//! Edits are integers and their results are equal on every machine, so the order of edits is all that has to be sent.
//! The [`Server`] numbers the edits of clients and sends them on before it has applied them itself.
//!
//! | file | what it holds |
//! | --- | --- |
//! | `message` | messages between client and server |
//! | `encoding` | the binary encoding of messages |
//! | `bulk` | the bulk lane: regions and old entries, as one stream that is cut into pieces |
//! | `regions` | regions as they are compared and sent |
//! | `price`, `bucket` | the costs of edits, and their budget |
//! | `client` | the client: prediction, joins, repair |
//! | `replica` | the confirmed world and the shown world |
//! | `server` | the server: log, validation, undo, joins |
//!
//! A server that lets one client in and orders its dig:
//!
//! ```
//! use bevy_burrow::net::{ClientId, Hello, Server, ServerSettings, ContentTable, ToClient, ToServer};
//! use bevy_burrow::prelude::*;
//! use glam::{IVec3, Vec3};
//! use std::sync::Arc;
//! use std::time::Duration;
//!
//! let ground = Arc::new(Ground::flat(64, 64, 10.0)?);
//! let terrain = Terrain::new(Arc::clone(&ground), &TerrainSettings::default())?;
//! let mut server = Server::new(terrain, ServerSettings::default());
//! let (client, now) = (ClientId(1), Duration::ZERO);
//!
//! // What a client sends, as bytes.
//! let hello = Hello {
//!     protocol: Server::PROTOCOL,
//!     simulation: Terrain::SIMULATION,
//!     ground: ground.hash(),
//!     chunk_size: 32,
//!     epoch: None,
//!     position: IVec3::new(32, 10, 32),
//! };
//! let dig = Edit::quantize(&Brush::dig(Shape::sphere(Vec3::new(32.0, 10.0, 32.0), 4.0)))?;
//! server.connect(client, now);
//! server.receive(client, &ToServer::Hello(hello).to_bytes(), now);
//! server.advance(now);
//! server.receive(client, &ToServer::Edits { first: 1, edits: vec![dig] }.to_bytes(), now);
//!
//! let sent: Vec<ToClient> = server
//!     .take_outgoing()
//!     .iter()
//!     .map(|(_, _, bytes)| ToClient::from_bytes(bytes, &ground, &ContentTable::default()))
//!     .collect::<Result<_, _>>()?;
//! assert!(matches!(&sent[..], [ToClient::Welcome(_), ToClient::Entries(_)]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bucket;
mod bulk;
mod client;
mod encoding;
#[doc(hidden)]
pub mod message;
mod price;
mod regions;
mod replica;
pub mod server;

#[doc(inline)]
pub use crate::format::contents::ContentTable;
#[doc(inline)]
pub use crate::format::ids::ContentId;
use crate::terrain::{Meshing, Terrain, WorkLimits};
pub use bucket::Rate;
#[doc(hidden)]
pub use bulk::BulkReader;
pub use client::{Client, ClientEvent, ClientFigures};
#[doc(hidden)]
pub use message::MAX_TO_SERVER;
pub use message::{ClientId, KickReason, Lane, Refusal};
#[doc(hidden)]
pub use message::{
    Entries, Entry, Epoch, Hello, Join, MAX_SEQUENCE_JUMP, RegionContent, RegionHashes, RuleState, ToClient,
    ToServer, Welcome,
};
#[doc(hidden)]
pub use regions::{region_hash, touched_regions};
#[doc(hidden)]
pub use server::{
    Admission, OrderError, Outgoing, Permission, Reach, Server, ServerEvent, ServerFigures, ServerSettings,
    UndoPolicy,
};

/// Prepares a terrain that is never shown: it builds no meshes, keeps no history, and accepts all work.
fn never_shown(terrain: &mut Terrain) {
    terrain.set_meshing(Meshing::Never);
    terrain.set_undo_budget(0);
    terrain.set_work_limits(WorkLimits::UNBOUNDED);
}
