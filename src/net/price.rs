//! The costs of edits and undos, used on both sides: servers refuse edits beyond the budget, and clients do not send
//! them.

/// The cost of an edit: see [`ServerSettings::cost`](super::ServerSettings::cost). `None` for one that reaches nothing
/// of the world.
pub(crate) use crate::edits::edit_work as cost;

/// The cost of an undo. The restored parts are charged once they are known.
pub const UNDO: u64 = 200;
/// Restored bytes of an undo that cost 1.
pub const UNDO_BYTES: u64 = 256;
/// The maximum number of bytes that an undo may restore, because they are sent to all clients in one message.
pub const MAX_UNDO_BYTES: usize = 1 << 20;
