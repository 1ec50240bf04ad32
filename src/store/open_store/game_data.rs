//! Data of the game, which becomes durable together with the commits that follow it.

use std::collections::BTreeMap;

use super::Store;
use crate::store::store_thread::{GameChange, apply_game};

impl Store {
    /// Stores data of the game under a key, such as an inventory or the time of day. It becomes durable together with
    /// the commits of the next [`append`](Self::append) or [`follow`](Self::follow): after a crash both are there, or
    /// neither.
    pub fn put(&mut self, key: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        let (key, bytes) = (key.into(), bytes.into());
        // An unchanged value takes no room in the log.
        if self.get(&key) != Some(&bytes[..]) {
            self.change_game((key, Some(bytes)));
        }
    }

    /// Removes data of the game.
    pub fn remove(&mut self, key: impl Into<String>) {
        self.change_game((key.into(), None));
    }

    fn change_game(&mut self, change: GameChange) {
        apply_game(&mut self.game, std::slice::from_ref(&change));
        self.unsent.insert(change.0, change.1);
    }

    /// Data of the game.
    pub fn get(&self, key: &str) -> Option<&[u8]> {
        self.game.get(key).map(Vec::as_slice)
    }

    /// All data of the game, by key.
    pub fn game_data(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.game
    }
}
