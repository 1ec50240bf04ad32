//! The last sequence numbers of players' edits, so that edits which a client sends again are not applied twice.

use std::collections::{BTreeMap, BTreeSet};

use super::recent::Recent;
use crate::net::message::{ClientId, MAX_SEQUENCE_JUMP};

/// The most players whose numbers are remembered, in addition to those that are connected.
const MAX_SEEN: usize = 1 << 16;

/// No player has numbers beyond this one, so that counting on can never overflow.
pub(super) const MAX_SEQUENCE: u64 = u64::MAX / 2;

/// The most players whose numbers are saved: the most recent ones.
pub(super) const MAX_SAVED: usize = 1024;

/// The last edit of a player that the world holds.
#[derive(Clone, Copy)]
pub(super) struct Applied {
    /// The edit's sequence number.
    pub sequence: u64,
    /// The edit's number in the log.
    pub number: u64,
}

/// How a sequence number relates to earlier ones of its player.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SequenceCheck {
    New,
    /// The number was seen before.
    Old,
    /// No honest client sends this number.
    Impossible,
}

/// The last sequence numbers of all players' edits.
#[derive(Default)]
pub struct Sequences {
    /// The last sequence number of each player that was seen.
    seen: Recent<u64>,
    pub(super) applied: BTreeMap<ClientId, Applied>,
    /// Players whose last edit that is applied is another than the one that is saved.
    pub(super) changed: BTreeSet<ClientId>,
}

impl Sequences {
    /// How many players' numbers are known.
    #[cfg(all(test, feature = "store"))]
    pub fn players(&self) -> usize {
        self.seen.len()
    }

    /// The last number that was seen.
    pub fn last(&self, client: ClientId) -> u64 {
        self.seen.get(client).copied().unwrap_or_default()
    }

    /// Classifies a received number.
    pub fn judge(&self, client: ClientId, sequence: u64) -> SequenceCheck {
        let last = self.last(client);
        if sequence == 0 || sequence > last.saturating_add(MAX_SEQUENCE_JUMP).min(MAX_SEQUENCE) {
            SequenceCheck::Impossible
        } else if sequence > last {
            SequenceCheck::New
        } else {
            SequenceCheck::Old
        }
    }

    /// Records that a number was seen.
    pub fn note(&mut self, client: ClientId, sequence: u64) {
        let seen = self.seen.get_or_insert_with(client, || 0);
        *seen = sequence.max(*seen);
    }

    /// Forgets the players that have been silent for the longest time, if there are too many; `is_kept` selects players
    /// that stay in any case.
    pub fn trim(&mut self, is_kept: impl Fn(ClientId) -> bool) {
        self.seen.trim(MAX_SEEN, |client, _| is_kept(client));
    }

    /// Records that an edit of a player was applied.
    pub fn apply(&mut self, client: ClientId, sequence: u64, number: u64) {
        if client == ClientId::SERVER {
            return;
        }
        let last = self.applied.entry(client).or_insert(Applied { sequence, number });
        *last = Applied { sequence: sequence.max(last.sequence), number };
        self.changed.insert(client);
        if self.applied.len() > MAX_SAVED
            && let Some((&oldest, _)) = self.applied.iter().min_by_key(|(_, last)| last.number)
        {
            self.applied.remove(&oldest);
            self.changed.insert(oldest);
        }
    }

    /// The number in the log of a player's last edit that is applied; 0 where it is not known.
    pub fn last_applied(&self, client: ClientId) -> u64 {
        self.applied.get(&client).map_or(0, |last| last.number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_came_is_not_new_again_and_nothing_jumps_far() {
        use SequenceCheck::{Impossible, New, Old};
        let mut numbers = Sequences::default();
        let far = 6 + MAX_SEQUENCE_JUMP;
        for (id, sequence, expected) in [
            (1, 0, Impossible),
            (1, 1, New),
            (1, 1, Old),
            (2, 1, New),
            (1, 5, New),
            (1, 3, Old),
            (1, 6, New),
            (1, far + 1, Impossible),
            (1, u64::MAX, Impossible),
            (1, far, New),
            (3, MAX_SEQUENCE_JUMP + 1, Impossible),
        ] {
            assert_eq!(numbers.judge(ClientId(id), sequence), expected, "{id} {sequence}");
            if expected == New {
                numbers.note(ClientId(id), sequence);
            }
        }
        assert_eq!([1, 2, 3].map(|id| numbers.last(ClientId(id))), [far, 1, 0]);
        numbers.note(ClientId(4), MAX_SEQUENCE);
        assert_eq!(numbers.judge(ClientId(4), MAX_SEQUENCE + 1), Impossible);
    }

    #[test]
    fn the_table_is_bounded_and_keeps_who_was_there_last() {
        let mut numbers = Sequences::default();
        let most = 2 * MAX_SEEN as u64;
        for id in 1..=most {
            numbers.note(ClientId(id), 9);
            if id % 1024 == 0 {
                numbers.trim(|client| client == ClientId(1));
            }
        }
        assert!(numbers.seen.len() <= MAX_SEEN + 1024);
        assert_eq!([1, 2, most].map(|id| numbers.last(ClientId(id))), [9, 0, 9]);
    }
}
