//! The costs of edits and undos, used on both sides: servers refuse edits beyond the budget, and clients do not send
//! them.

use crate::brush::Edit;
use crate::edits::reach;
use crate::lattice::{BrickPos, ChunkGrid};

/// What every edit costs.
const EDIT: u64 = 20;
/// How many times as much a brick costs for an edit that sculpts.
const SCULPTED: u64 = 4;

/// What an undo costs. What it restores is charged once it is known.
pub const UNDO: u64 = 200;
/// Bytes of what an undo restores that cost 1.
pub const UNDO_BYTES: u64 = 256;
/// Most bytes of what an undo restores: it goes to all clients in one message.
pub const MOST_UNDO_BYTES: usize = 1 << 20;

/// What an edit costs: see [`ServerSettings::cost`](super::ServerSettings::cost). `None` for one that reaches nothing of the world.
pub fn cost(grid: ChunkGrid, edit: &Edit) -> Option<u64> {
    let weight = if edit.blend().is_some() { SCULPTED } else { 1 };
    let bricks = BrickPos::range(reach(grid, edit)?).volume();
    Some(EDIT + weight * bricks)
}
