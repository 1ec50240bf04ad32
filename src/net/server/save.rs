//! Saves a server's world, so that a restarted server continues from it.

use super::keys::{NUMBER, RESERVED, prefix};
use super::own_numbers::OwnNumbers;
use super::{Server, ServerSettings, ToClient};
use crate::store::{Store, StoreError};
use crate::terrain::Terrain;

impl Server {
    /// A server of a world that is saved: the [terrain](crate::store::Opened::terrain) of a store that was opened, or one that a store
    /// was created of. What its clients send again that the world holds already is not done twice: the last numbers of the 1024
    /// players who dug last are saved with it.
    pub fn open(terrain: Terrain, store: &Store, settings: ServerSettings) -> Self {
        let number = store
            .get(&format!("{}{NUMBER}", prefix(store)))
            .and_then(|bytes| bytes.try_into().ok())
            .map(u64::from_le_bytes);
        // Numbers near the end of their range were never given.
        let number = number.filter(|number| *number < u64::MAX / 2).unwrap_or_default();
        let server = Self::at(terrain, store.world_id(), number, settings);
        let own_numbers = OwnNumbers::open(store);
        Self { saved_revision: store.revision(), own_numbers, ..server }
    }

    /// Passes new commits to the store, and reports to clients what has become durable. Call it after each
    /// [`advance`](Self::advance); it takes microseconds. Entries without a commit, such as rules, are reported as
    /// durable with the commit after them.
    ///
    /// # Errors
    /// When the store's thread has ended.
    pub fn save(&mut self, store: &mut Store) -> Result<(), StoreError> {
        if self.saved_number != self.applied {
            store.put(format!("{RESERVED}{NUMBER}"), self.applied.to_le_bytes());
            self.own_numbers.save(store);
            store.follow(&mut self.terrain)?;
            self.saved_number = self.applied;
            // Without a commit among the records, they are certainly saved once the next commit is.
            let revision = store.revision();
            let is_later = revision > self.saved_revision;
            self.saved.push_back((revision.saturating_add((!is_later).into()), self.applied));
            self.saved_revision = revision;
        }
        while let Some((_, number)) = self.saved.pop_front_if(|(revision, _)| *revision <= store.durable()) {
            self.set_durable(number);
        }
        Ok(())
    }

    /// Enters that everything up to this number is saved, and tells clients so: for those who save in another way.
    pub fn set_durable(&mut self, number: u64) {
        if number > self.durable && number <= self.applied {
            self.durable = number;
            self.send_to_all(&ToClient::Durable { number });
        }
    }
}
