//! Saves a server's world, so that a restarted server continues from it.

use std::collections::VecDeque;

use super::keys::{NUMBER, RESERVED, prefix};
use super::saved_log::{FoundLog, SavedLog};
use super::sequences::{Applied, MAX_SEQUENCE, Sequences};
use super::{Server, ServerSettings};
use crate::net::message::ClientId;
use crate::store::{Store, StoreError};
use crate::terrain::Terrain;

/// Below [`RESERVED`], the beginning of keys under which a store keeps the number of the last edit of a player that its
/// world holds.
const KEY: &str = "own/";

/// What a server has passed to its store.
pub(super) struct Saving {
    /// Revisions that are not yet durable, each with the number of the last entry up to it.
    waiting: VecDeque<(u64, u64)>,
    /// The revision of the last commit.
    revision: u64,
    /// The number of the last entry.
    number: u64,
}

impl Saving {
    /// Everything up to a revision and a number has been passed on.
    pub fn at(revision: u64, number: u64) -> Self {
        Self { waiting: VecDeque::new(), revision, number }
    }
}

impl Server {
    /// A server of a world that is saved: the [terrain](crate::store::Opened::terrain) of a store that was opened, or
    /// one that a store was created of. Edits that clients send again are not applied twice if the world already
    /// contains them: the last sequence numbers of the 1024 players who dug last are saved with it. The latest entries
    /// are saved too, so that clients that return after a restart get the entries that they lack; for older changes
    /// they get the regions that differ.
    pub fn open(terrain: Terrain, store: &Store, settings: ServerSettings) -> Self {
        let number = store
            .get(&format!("{}{NUMBER}", prefix(store)))
            .and_then(|bytes| bytes.try_into().ok())
            .map(u64::from_le_bytes);
        // Numbers near the end of their range were never given.
        let number = number.filter(|number| *number < u64::MAX / 2).unwrap_or_default();
        let mut server = Self::at(terrain, store.world_id(), number, settings);
        server.sequences = Sequences::open(store);
        server.saving = Saving::at(store.revision(), number);
        let (run, log_bytes) = (server.epoch.run, server.settings.log_bytes);
        let FoundLog { pieces, is_whole, mut saved } =
            SavedLog::open(store, &server.terrain, run, number, log_bytes);
        let has_entries = !pieces.is_empty();
        for piece in pieces.into_iter().rev() {
            server.log.push_front(piece.first, piece.message, piece.names);
        }
        server.is_whole |= is_whole && has_entries;
        saved.set_whole(server.is_whole);
        // Those that say what holds at first.
        (number + 1..).zip(&server.waiting).for_each(|(number, ordered)| saved.push(number, &ordered.entry));
        server.saved_log = Some(saved);
        server
    }

    /// Passes new commits to the store, and reports to clients what has become durable. Call it after each
    /// [`advance`](Self::advance); it takes microseconds. Entries without a commit, such as rules, are reported as
    /// durable with the commit after them.
    ///
    /// # Errors
    /// When the store's thread has ended.
    pub fn save(&mut self, store: &mut Store) -> Result<(), StoreError> {
        let has_new = self.saving.number != self.applied;
        if has_new {
            match &mut self.saved_log {
                Some(saved) => saved.save(store, self.applied, &self.terrain),
                None => store.put(format!("{RESERVED}{NUMBER}"), self.applied.to_le_bytes()),
            }
            self.sequences.save(store);
            self.saving.number = self.applied;
        }
        // Also without new entries: while too much waited for the disk, nothing was taken.
        store.follow(&mut self.terrain)?;
        let revision = store.revision();
        let is_later = revision > self.saving.revision;
        if has_new || is_later {
            // Without a commit among the records, they are certainly saved once the next commit is.
            self.saving.waiting.push_back((revision.saturating_add((!is_later).into()), self.applied));
            self.saving.revision = revision;
        }
        while let Some((_, number)) =
            self.saving.waiting.pop_front_if(|(revision, _)| *revision <= store.durable())
        {
            self.set_durable(number);
        }
        Ok(())
    }
}

impl Sequences {
    /// Sends changed numbers to a store.
    pub fn save(&mut self, store: &mut Store) {
        for client in std::mem::take(&mut self.changed) {
            let key = format!("{RESERVED}{KEY}{}", client.0);
            match self.applied.get(&client) {
                Some(Applied { sequence, number }) => {
                    store.put(key, [sequence.to_le_bytes(), number.to_le_bytes()].concat());
                }
                None => store.remove(key),
            }
        }
    }

    /// The numbers in a store.
    pub fn open(store: &Store) -> Self {
        let mut numbers = Self::default();
        let prefix = format!("{}{KEY}", prefix(store));
        for (key, bytes) in store.game_data().range(prefix.clone()..) {
            let Some(id) = key.strip_prefix(&prefix) else { break };
            if let Ok(id) = id.parse()
                && let Some((sequence, number)) = bytes.split_first_chunk()
                && let Ok(number) = number.try_into()
            {
                let [sequence, number] = [*sequence, number].map(u64::from_le_bytes);
                // One beyond the limit was never an honest player's.
                if sequence <= MAX_SEQUENCE {
                    numbers.note(ClientId(id), sequence);
                    numbers.applied.insert(ClientId(id), Applied { sequence, number });
                }
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
    use crate::net::server::sequences::MAX_SAVED;
    use crate::store::{SimulatedDisk, StoreOptions};
    use crate::terrain::TerrainSettings;

    #[test]
    fn a_store_keeps_the_numbers_of_those_who_dug_last() {
        let ground = Ground::flat(16, 16, 8.0).expect("a valid ground");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        let disk = Arc::new(SimulatedDisk::new());
        let mut store = Store::create_in(disk, &mut terrain, StoreOptions::default()).expect("a new world");
        let mut numbers = Sequences::default();
        let most = MAX_SAVED as u64;
        (1..=most).for_each(|id| numbers.apply(ClientId(id), 10 * id, id));
        numbers.save(&mut store);
        assert!(numbers.changed.is_empty());
        numbers.apply(ClientId(1), 77, most + 1);
        numbers.apply(ClientId(5000), 3, most + 2);
        numbers.apply(ClientId::SERVER, 4, most + 3);
        numbers.save(&mut store);
        let key = |id: &str| format!("{RESERVED}own{id}");
        store.put(key("er"), [0; 16]);
        store.put(key("/nobody"), [0; 16]);
        store.put(key("/6000"), [0; 15]);
        store.put(key("/6001"), [0; 17]);
        store.put(key("/6002"), [255; 16]);
        store.put(format!("{RESERVED}number"), [0; 8]);
        let again = Sequences::open(&store);
        assert_eq!(again.players(), MAX_SAVED);
        for (id, sequence) in
            [(1, 77), (2, 0), (3, 30), (most, 10 * most), (5000, 3), (6000, 0), (u64::MAX, 0)]
        {
            assert_eq!(again.last(ClientId(id)), sequence, "{id}");
        }
    }
}
