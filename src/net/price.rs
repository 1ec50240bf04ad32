//! The costs of edits and undos, used on both sides: servers refuse edits beyond the budget, and clients do not send
//! them.

use crate::brush::Edit;
use crate::edits::most_bricks;
use crate::lattice::ChunkGrid;

/// The fixed cost of every edit.
const EDIT: u64 = 20;
/// The factor of a brick's cost for an edit that sculpts.
const SCULPTED: u64 = 4;

/// The cost of an undo. The restored parts are charged once they are known.
pub const UNDO: u64 = 200;
/// Restored bytes of an undo that cost 1.
pub const UNDO_BYTES: u64 = 256;
/// The maximum number of bytes that an undo may restore, because they are sent to all clients in one message.
pub const MAX_UNDO_BYTES: usize = 1 << 20;

/// The cost of an edit: see [`ServerSettings::cost`](super::ServerSettings::cost). `None` for one that reaches nothing
/// of the world.
pub fn cost(grid: ChunkGrid, edit: &Edit) -> Option<u64> {
    let weight = if edit.blend().is_some() { SCULPTED } else { 1 };
    Some(EDIT + weight * most_bricks(grid, edit)?)
}
