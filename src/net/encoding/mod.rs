//! The encoding of messages: a tag, then integers of [variable length](crate::format::bytes), edits as
//! differences from the previous one in the message, bricks as in saves.
//!
//! Reading any bytes gives a message or a [`FormatError`](crate::format::FormatError): nothing panics, and memory is
//! bounded by the length of the input, which has its own limits.
//!
//! | file | what it encodes |
//! | --- | --- |
//! | `to_server`, `to_client` | messages of a client, and of a server |
//! | `edits` | a client's edits |
//! | `entries` | entries of the log |
//! | `joins` | the greeting of a client, and its answer |
//! | `packed` | compressed messages |
//! | `parts` | numbers, reasons, regions, rules |

mod edits;
mod entries;
mod joins;
mod packed;
mod parts;
mod to_client;
mod to_server;

pub(super) use edits::EditWriter;
pub(super) use entries::{EntryWriter, entry_bytes};
pub(super) use packed::pack;
pub(super) use to_client::PIECE;
