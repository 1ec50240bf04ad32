//! Messages to the store's thread.

use std::sync::Arc;
use std::sync::mpsc::Sender;

use super::shared::{GameChange, SavePoint};
use crate::ground::Ground;
use crate::store::error::StoreError;
use crate::terrain::{CommitRecord, WorldParts};

/// The channel for the answer to a request: the durable revision.
pub(in crate::store) type Answer = Sender<Result<u64, StoreError>>;

/// A message to the thread.
pub(in crate::store) enum Message {
    /// Saves this.
    Save(Given),
    /// Makes all earlier messages durable.
    Flush(Answer),
    /// Makes a checkpoint of all earlier messages.
    Checkpoint(Answer),
    /// Makes a checkpoint, and makes the database as small as possible.
    Compact(Answer),
}

/// Data that has to be saved together.
pub(in crate::store) struct Given {
    /// The point that it leads to.
    pub point: SavePoint,
    pub content: Content,
    /// The game's data for it.
    pub game: Vec<GameChange>,
}

/// The given content of the world.
pub(in crate::store) enum Content {
    Commits(Vec<CommitRecord>),
    /// The whole world, because records are missing, its ground, and its hash.
    Whole(Box<WorldParts>, Arc<Ground>, u64),
}

impl Given {
    /// Whether it is all of a world.
    pub fn is_whole(&self) -> bool {
        matches!(self.content, Content::Whole(..))
    }

    /// About how many bytes of memory it takes.
    pub fn bytes(&self) -> usize {
        let world = match &self.content {
            Content::Commits(records) => records.iter().map(record_bytes).sum(),
            Content::Whole(parts, ..) => parts.change.bricks.len() * 1024,
        };
        64 + world + self.game.iter().map(game_bytes).sum::<usize>()
    }
}

pub(super) fn record_bytes(record: &CommitRecord) -> usize {
    64 + record.orders.len() * 64 + record.change.bricks.len() * 1024
}

pub(super) fn game_bytes((key, value): &GameChange) -> usize {
    key.len() + value.as_ref().map_or(0, Vec::len)
}
