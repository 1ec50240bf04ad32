//! Older states of the world that are kept while clients download them.
//!
//! Once the server's world changes, each that is kept takes as much memory as its index and what has changed since. So
//! clients that come at about the same time share one, and clients that make no progress lose theirs, so few worlds are
//! kept for any number of clients.

use std::sync::Arc;
use std::time::Duration;

use super::Server;
use super::sender::Snapshot;
use crate::net::message::{Hello, Lane, RuleState, ToClient};

/// The greatest age of a world that new clients get, together with later entries.
const SHARED: Duration = Duration::from_secs(1);

/// The world that new clients get.
pub struct Kept {
    pub world: Snapshot,
    pub state: RuleState,
    /// The message with the hashes of its regions, once a client has needed it.
    pub table: Option<Arc<[u8]>>,
    since: Duration,
}

impl Server {
    /// Drops the shared world once it is too old, or the log no longer has all later entries.
    pub(super) fn forget_kept(&mut self, now: Duration) {
        let (first, failed) = (self.log.first(), &self.failed);
        self.kept.take_if(|Kept { world: (number, _), since, .. }| {
            let has_failed = failed.range(number.saturating_add(1)..).next().is_some();
            now.saturating_sub(*since) >= SHARED || first > number.saturating_add(1) || has_failed
        });
    }

    /// The world that clients get now, with its number and state.
    pub(super) fn keep(&mut self) -> (Snapshot, RuleState) {
        let (now, number) = (self.now, self.applied);
        let kept = self.kept.get_or_insert_with(|| {
            let state = RuleState {
                edit_settings: self.terrain.edit_settings().clone(),
                next_field: self.terrain.world().next_field(),
            };
            Kept { world: (number, self.terrain.snapshot()), state, table: None, since: now }
        });
        (kept.world.clone(), kept.state.clone())
    }

    /// Restarts sessions of clients for which a world is kept and that make no progress.
    pub(super) fn drop_stuck(&mut self, now: Duration) {
        for (client, session) in &mut self.sessions {
            if session.is_stuck(now, self.applied) {
                session.begin_again(&self.settings, now);
                self.figures.stuck += 1;
                self.outgoing.retain(|(to, ..)| to != client);
                self.outgoing.push((*client, Lane::Main, ToClient::Greet.to_bytes()));
            }
        }
    }
}

impl Kept {
    /// Whether a returning client may get it: it contains everything that the client has done and seen.
    pub fn is_for(&self, hello: &Hello, run: u64, last_applied: u64) -> bool {
        let number = self.world.0;
        // A client with a part of a world sends no number.
        let has_more = |number_there: u64| number_there > number && number_there != u64::MAX;
        hello
            .epoch
            .is_none_or(|epoch| last_applied <= number && !(epoch.run == run && has_more(epoch.number)))
    }
}
