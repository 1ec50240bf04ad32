//! What the store's thread tells, and data of the game's.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use super::error::StoreTrouble;

/// What the game put into a world, by key.
pub(super) type GameData = BTreeMap<String, Vec<u8>>;

/// A value of the game's that changes; `None` removes it.
pub(super) type GameChange = (String, Option<Vec<u8>>);

/// What the game has put, changed by these.
pub(super) fn apply_game(data: &mut GameData, changes: &[GameChange]) {
    for (key, value) in changes {
        match value {
            Some(value) => drop(data.insert(key.clone(), value.clone())),
            None => drop(data.remove(key)),
        }
    }
}

/// What the thread tells.
#[derive(Debug, Default)]
pub(super) struct Shared {
    durable: AtomicU64,
    troubles: Mutex<VecDeque<StoreTrouble>>,
}

/// Troubles that are kept until they are taken.
const MOST_TROUBLES: usize = 256;

impl Shared {
    /// The revision up to which everything is durable.
    pub fn durable(&self) -> u64 {
        self.durable.load(Ordering::Acquire)
    }

    /// Says that everything up to a revision is durable.
    pub fn set_durable(&self, revision: u64) {
        self.durable.store(revision, Ordering::Release);
    }

    pub fn tell(&self, trouble: StoreTrouble) {
        let mut troubles = self.troubles.lock().unwrap_or_else(PoisonError::into_inner);
        if troubles.len() == MOST_TROUBLES {
            troubles.pop_front();
        }
        troubles.push_back(trouble);
    }

    pub fn take_troubles(&self) -> Vec<StoreTrouble> {
        std::mem::take(&mut *self.troubles.lock().unwrap_or_else(PoisonError::into_inner)).into()
    }
}
