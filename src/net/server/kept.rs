//! Worlds that are kept as they were, for clients to get them bit by bit.
//!
//! Once the server's world changes, each that is kept takes as much memory as its index and what has changed since. So clients that come
//! at about the same time share one, and those that do not go on lose theirs: however many clients take nothing, few worlds are kept.

use std::time::Duration;

use super::Server;
use super::sender::Snapshot;
use crate::net::message::{Hello, Lane, Terms, ToClient};

/// Clients get a world that is so old, and entries after it.
const SHARED: Duration = Duration::from_secs(1);

/// The world that clients get who come now.
pub struct Kept {
    pub world: Snapshot,
    pub terms: Terms,
    since: Duration,
}

impl Server {
    /// Forgets the world that clients share, once it is too old, or not all that came after it can be sent.
    pub(super) fn forget_kept(&mut self, now: Duration) {
        let (first, voids) = (self.log.first(), &self.voids);
        self.kept.take_if(|Kept { world: (number, _), since, .. }| {
            let is_void = voids.range(number.saturating_add(1)..).next().is_some();
            now.saturating_sub(*since) >= SHARED || first > number.saturating_add(1) || is_void
        });
    }

    /// The world that clients get now, with its number, and what holds there.
    pub(super) fn keep(&mut self) -> (Snapshot, Terms) {
        let (now, number) = (self.now, self.applied);
        let kept = self.kept.get_or_insert_with(|| {
            let terms = Terms {
                rules: self.terrain.rules().cloned(),
                loose: self.terrain.loose().copied(),
                next_field: self.terrain.world().next_field(),
            };
            Kept { world: (number, self.terrain.snapshot()), terms, since: now }
        });
        (kept.world.clone(), kept.terms.clone())
    }

    /// Lets clients begin again that keep a world and have not gone on for long.
    pub(super) fn drop_stuck(&mut self, now: Duration) {
        for (client, session) in &mut self.sessions {
            if session.is_stuck(now, self.applied) {
                session.begin_again(&self.settings, now);
                self.figures.stuck += 1;
                self.outgoing.retain(|(to, ..)| to != client);
                self.outgoing.push((*client, Lane::Order, ToClient::Greet.to_bytes()));
            }
        }
    }
}

impl Kept {
    /// Whether a client that has been here before may get it: it holds all that the client did and has seen.
    pub fn is_for(&self, hello: &Hello, run: u64, last_own: u64) -> bool {
        let number = self.world.0;
        // One that has a part of a world tells no number.
        let has_more = |number_there: u64| number_there > number && number_there != u64::MAX;
        hello.epoch.is_none_or(|epoch| last_own <= number && !(epoch.run == run && has_more(epoch.number)))
    }
}
