//! Digging together: one server owns the order of all edits, and clients see their own at once. Without Bevy and without
//! transport: bytes in, bytes out, and a clock that the caller gives.
//!
//! Edits are integers and their results are equal on every machine, so the order of edits is all that has to be sent. The
//! [`Server`] numbers what clients ask for and sends it on before it has applied it itself.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`message`] | what client and server tell each other |
//! | `encoding` | these in bytes |
//! | `stamps` | images of stamps, which are named and not sent |
//! | `bulk` | the lane of what takes long: regions and old entries, as one stream that is cut into pieces |
//! | `client` | the client: prediction, joins, repair |
//! | `replica` | the world of the order, and what is shown of it |
//! | `server` | the server: order, validation, undo, joins |

mod bulk;
mod client;
mod encoding;
pub mod message;
mod replica;
mod server;
mod stamps;

pub use bulk::BulkReader;
pub use client::{Client, ClientEvent, ClientFigures};
pub use message::{
    ClientId, Entries, Entry, Epoch, Hello, Join, Kick, Lane, PROTOCOL, Refusal, RegionContent, RegionHashes,
    Terms, ToClient, ToServer, Welcome,
};
pub use replica::ShownChange;
pub use server::{
    Outgoing, Permission, Rate, Reach, Server, ServerEvent, ServerFigures, ServerSettings, UndoPolicy,
};
pub use stamps::{StampId, Stamps};
