//! A table of clients that forgets those it has not heard of for the longest time.

use std::collections::BTreeMap;

use crate::net::message::ClientId;

/// Values by client.
pub(super) struct Recent<T> {
    /// Each value, and its last use.
    values: BTreeMap<ClientId, (T, u64)>,
    /// Counts all uses.
    uses: u64,
}

impl<T> Default for Recent<T> {
    fn default() -> Self {
        Self { values: BTreeMap::new(), uses: 0 }
    }
}

impl<T> Recent<T> {
    /// The value of a client, if there is one.
    pub fn get(&self, client: ClientId) -> Option<&T> {
        self.values.get(&client).map(|(value, _)| value)
    }

    /// The value of a client, which counts as used now; a new one where there is none.
    pub fn get_or_insert_with(&mut self, client: ClientId, new: impl FnOnce() -> T) -> &mut T {
        self.uses += 1;
        let (value, used) = self.values.entry(client).or_insert_with(|| (new(), 0));
        *used = self.uses;
        value
    }

    /// Number of values.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Forgets the values that have not been used for the longest time, if there are more than `limit`; those that
    /// `is_kept` selects stay in any case.
    pub fn trim(&mut self, limit: usize, is_kept: impl Fn(ClientId, &T) -> bool) {
        if self.values.len() <= limit {
            return;
        }
        let others = self.values.iter().filter(|(client, (value, _))| !is_kept(**client, value));
        let mut uses: Vec<u64> = others.map(|(_, (_, used))| *used).collect();
        uses.sort_unstable();
        // Half of them at once, so that this is rare.
        let Some(&oldest) = uses.get(uses.len() / 2) else { return };
        self.values.retain(|client, (value, used)| *used >= oldest || is_kept(*client, value));
    }
}
