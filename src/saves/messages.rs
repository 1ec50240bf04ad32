//! Messages about saved worlds.

use std::sync::Arc;

use bevy::prelude::*;

use crate::store::{StoreError, StoreTrouble};

/// Saves at once, and makes a checkpoint: say when a level ends, or before a menu closes the game. Without it, everything is
/// saved too, within the loss window. A [`WorldSaved`] follows.
#[derive(Message, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SaveNow {
    /// The terrain's entity; `None` for every saved world.
    pub terrain: Option<Entity>,
}

/// A saved world was read, or created; or why it could not be. Then the terrain stays as it is, and nothing of it is saved.
#[derive(Message, Clone, Debug)]
pub struct WorldOpened {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The revision that the world is at; 0 for a new one.
    pub outcome: Result<u64, Arc<StoreError>>,
}

/// Everything up to a revision would survive a crash.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorldSaved {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The last revision that is durable.
    pub revision: u64,
}

/// Something that the player or operator should be told of a saved world: the disk is full, a region was damaged. Play goes on,
/// and saving is tried again.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct StoreTroubleFound {
    /// The terrain's entity.
    pub terrain: Entity,
    /// What it is.
    pub trouble: StoreTrouble,
}
