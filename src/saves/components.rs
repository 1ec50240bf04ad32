//! The components of saved worlds.

use std::path::PathBuf;
use std::time::Duration;

use bevy::prelude::*;

use crate::store::{BaseChanged, Store, StoreOptions};
use crate::terrain::Version;

/// Saves the terrain of its entity in a folder, and continues the world that is there. Insert it with the terrain. Scenes may hold
/// it; the terrain itself they leave out.
///
/// Removing it, or the entity, saves what is not saved yet and closes the world.
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component)]
pub struct SavedWorld {
    /// The folder, for this world alone. It is made if it is missing, with those around it.
    pub path: PathBuf,
    /// What may be lost at most if the machine loses power: commits of this long, and a little more for the disk.
    pub loss_window: Duration,
    /// What to do with edits where the ground or the [level](super::StartLevel) is another one than they were made on.
    #[reflect(ignore)]
    pub base_changed: BaseChanged,
}

impl SavedWorld {
    /// A world in a folder, with a loss window of a second.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        let StoreOptions { loss_window, base_changed, .. } = StoreOptions::default();
        Self { path: path.into(), loss_window, base_changed }
    }

    pub(super) fn options(&self) -> StoreOptions {
        let Self { loss_window, base_changed, .. } = *self;
        StoreOptions { loss_window, base_changed, ..StoreOptions::default() }
    }
}

/// The open store of a terrain's world. The plugin inserts it once the world is read.
#[derive(Component)]
pub struct WorldStore {
    pub(super) store: Store,
    /// The world that is saved, as it was last.
    pub(super) version: Version,
    /// The revision that was told as durable last, and whether it is to be told anyway.
    pub(super) told: Option<u64>,
}

impl WorldStore {
    /// Everything up to this revision would survive a crash.
    pub fn durable(&self) -> u64 {
        self.store.durable()
    }

    /// Keeps data of the game beside the world: an inventory, the time of day. It is saved in one piece with the commits of this
    /// frame, so that after a crash nothing that was dug is missing in one and there in the other.
    pub fn put(&mut self, key: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.store.put(key, bytes);
    }

    /// Removes data of the game's.
    pub fn remove(&mut self, key: impl Into<String>) {
        self.store.remove(key);
    }

    /// Data of the game as it was put last.
    pub fn get(&self, key: &str) -> Option<&[u8]> {
        self.store.get(key)
    }
}
