//! The store's thread, which writes frames and checkpoints: its messages, and the state that the store shares with it.

mod checkpointing;
mod closing;
mod message;
mod shared;
mod writer;

pub use closing::ClosingStore;
pub(super) use closing::StoreThread;
pub(super) use message::{Answer, Content, Given, Message};
pub use shared::SavePoint;
pub(super) use shared::{GameChange, GameData, Shared, apply_game};
pub(super) use writer::Writer;
