//! What a checkpoint holds, and the store's view of the world that it is made from.

mod checkpoint;
pub(super) mod checkpoint_copy;
mod ground_size;
mod mirror;

pub(super) use checkpoint::Checkpoint;
pub(super) use ground_size::GroundSize;
pub(super) use mirror::Mirror;
