//! Who does the heavy work of a transaction: applying edits to bricks, and meshing blocks.

mod cpu;
#[cfg(feature = "cuda")]
mod cuda;
mod engine;

use cpu::Cpu;
pub(crate) use cpu::PARALLEL_BLOCKS;
pub use engine::Engine;

use crate::surface::block::{Block, Parts};
use crate::surface::vertex::WorldView;
use crate::volume::{EditWork, Ledger};

/// The heavy work of a transaction. Every backend gives the same bits, so a transaction need not know which one it has.
pub(crate) trait Backend: Send + Sync {
    /// Applies edits; `each` gets what they changed, brick by brick in order of their positions, as one ledger or as
    /// several.
    fn edit(&self, work: &EditWork, each: &mut dyn FnMut(Ledger));

    /// Meshes blocks. `then` is called once and gets their parts, in the order of the blocks, in one list or several;
    /// their memory is used again afterwards.
    fn mesh(&self, view: &WorldView, blocks: &[Block], then: &mut dyn FnMut(&[Parts]));
}
