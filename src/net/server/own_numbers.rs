//! The last numbers of players' own edits: what a client sends again after a gap is not done twice.

use std::collections::{BTreeMap, BTreeSet};

use crate::net::message::ClientId;
use crate::store::Store;

/// The beginning of keys under which a store keeps the number of the last edit of a player that its world holds.
const KEY: &str = "net/own/";

/// Players whose numbers are remembered, at most, beside those that are connected.
const MOST_SEEN: usize = 1 << 16;

/// Players whose numbers are saved, at most: those who dug last.
const MOST_SAVED: usize = 1024;

/// The last edit of a player that the world holds.
#[derive(Clone, Copy)]
struct Applied {
    /// Its number at the player.
    own: u64,
    /// That in the order.
    number: u64,
}

/// The last numbers of all players' edits.
#[derive(Default)]
pub struct OwnNumbers {
    seen: BTreeMap<ClientId, u64>,
    applied: BTreeMap<ClientId, Applied>,
    /// Players whose last edit that is applied is another than the one that is saved.
    changed: BTreeSet<ClientId>,
}

impl OwnNumbers {
    /// The last number that was seen.
    pub fn last(&self, client: ClientId) -> u64 {
        self.seen.get(&client).copied().unwrap_or_default()
    }

    /// Notes a number that came. Was it not seen before?
    pub fn is_new(&mut self, client: ClientId, own: u64) -> bool {
        let last = self.seen.entry(client).or_default();
        let is_new = own > *last;
        *last = own.max(*last);
        is_new
    }

    /// Forgets most players, where there are too many; `is_kept` tells which ones stay.
    pub fn trim(&mut self, is_kept: impl Fn(ClientId) -> bool) {
        if self.seen.len() > MOST_SEEN {
            self.seen.retain(|client, _| is_kept(*client));
        }
    }

    /// Notes that an edit of a player's is applied.
    pub fn apply(&mut self, client: ClientId, own: u64, number: u64) {
        if client == ClientId::SERVER {
            return;
        }
        let last = self.applied.entry(client).or_insert(Applied { own, number });
        *last = Applied { own: own.max(last.own), number };
        self.changed.insert(client);
        if self.applied.len() > MOST_SAVED
            && let Some((&oldest, _)) = self.applied.iter().min_by_key(|(_, last)| last.number)
        {
            self.applied.remove(&oldest);
            self.changed.insert(oldest);
        }
    }

    /// Hands over to a store what it does not have yet.
    pub fn save(&mut self, store: &mut Store) {
        for client in std::mem::take(&mut self.changed) {
            let key = format!("{KEY}{}", client.0);
            match self.applied.get(&client) {
                Some(Applied { own, number }) => {
                    store.put(key, [own.to_le_bytes(), number.to_le_bytes()].concat());
                }
                None => store.remove(key),
            }
        }
    }

    /// What a store has.
    pub fn open(store: &Store) -> Self {
        let mut numbers = Self::default();
        for (key, bytes) in store.game_data().range(KEY.to_owned()..) {
            let Some(id) = key.strip_prefix(KEY) else { break };
            if let Ok(id) = id.parse()
                && let Some((own, number)) = bytes.split_first_chunk()
                && let Ok(number) = number.try_into()
            {
                let [own, number] = [*own, number].map(u64::from_le_bytes);
                numbers.seen.insert(ClientId(id), own);
                numbers.applied.insert(ClientId(id), Applied { own, number });
            }
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::ground::Ground;
    use crate::store::{SimulatedDisk, StoreOptions};
    use crate::terrain::{Terrain, TerrainSettings};

    #[test]
    fn a_store_keeps_the_numbers_of_those_who_dug_last() {
        let ground = Ground::flat(16, 16, 8.0).expect("a valid ground");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        let disk = Arc::new(SimulatedDisk::new());
        let mut store = Store::create_in(disk, &mut terrain, StoreOptions::default()).expect("a new world");
        let mut numbers = OwnNumbers::default();
        let most = MOST_SAVED as u64;
        (1..=most).for_each(|id| numbers.apply(ClientId(id), 10 * id, id));
        numbers.save(&mut store);
        assert!(numbers.changed.is_empty());
        numbers.apply(ClientId(1), 77, most + 1);
        numbers.apply(ClientId(5000), 3, most + 2);
        numbers.apply(ClientId::SERVER, 4, most + 3);
        numbers.save(&mut store);
        store.put("net/owner", [0; 16]);
        store.put("net/own/nobody", [0; 16]);
        store.put("net/own/6000", [0; 15]);
        store.put("net/own/6001", [0; 17]);
        let again = OwnNumbers::open(&store);
        assert_eq!(again.seen.len(), MOST_SAVED);
        for (id, own) in [(1, 77), (2, 0), (3, 30), (most, 10 * most), (5000, 3), (6000, 0), (u64::MAX, 0)] {
            assert_eq!(again.last(ClientId(id)), own, "{id}");
        }
    }

    #[test]
    fn what_came_is_not_new_again() {
        let mut numbers = OwnNumbers::default();
        let came = [(1, 1), (1, 1), (2, 1), (1, 5), (1, 3), (1, 6)];
        let is_new = came.map(|(id, own)| numbers.is_new(ClientId(id), own));
        assert_eq!(is_new, [true, false, true, true, false, true]);
        assert_eq!([1, 2, 3].map(|id| numbers.last(ClientId(id))), [6, 1, 0]);
    }
}
