//! The session of a connected client.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use super::sender::{BulkSender, EntrySender};
use super::settings::ServerSettings;
use crate::lattice::RegionPos;
use crate::net::ContentId;
use crate::net::message::Hello;
use crate::terrain::World;

/// If a client for which a world is kept acknowledges nothing for this time, its session starts again.
const STUCK: Duration = Duration::from_secs(5);

/// The progress of a client.
pub enum Stage {
    /// The client has not greeted yet.
    Connected,
    /// The client had joined and has to begin again. What it asks for meanwhile is done, and its welcome says so.
    Stale,
    /// The client waits for its welcome.
    Greeted(Hello),
    /// The client gets entries as they are ordered.
    Joined,
}

/// Regions that a client asked for.
pub struct Fetch {
    /// The number that its world is at.
    pub number: u64,
    pub regions: Vec<RegionPos>,
}

/// A connected client. Everything except the time belongs to its [stream](crate::net::ToServer::Greeting).
pub struct Session {
    pub stage: Stage,
    /// The stream that it began last; `None` if it began none.
    pub stream: Option<u64>,
    /// When it connected, or was last asked to greet.
    pub asked: Duration,
    /// The number that its world is at, as it has acknowledged.
    pub acknowledged: u64,
    pub order: EntrySender,
    pub bulk: BulkSender,
    pub fetches: VecDeque<Fetch>,
    /// Images that it was sent.
    pub images: BTreeSet<ContentId>,
    /// The world that it compares its own with, and that one's number.
    pub compared: Option<(u64, Arc<World>)>,
    /// The time of its last progress with data for which a world is kept.
    went_on: Duration,
}

impl Session {
    pub fn new(settings: &ServerSettings, now: Duration) -> Self {
        Self {
            stage: Stage::Connected,
            stream: None,
            asked: now,
            acknowledged: 0,
            order: EntrySender::new(settings, 0),
            bulk: BulkSender::new(settings),
            fetches: VecDeque::new(),
            images: BTreeSet::new(),
            compared: None,
            went_on: now,
        }
    }

    /// Begins a new stream with a greeting, and resets the state of an earlier one.
    pub fn begin(&mut self, stream: Option<u64>, hello: Hello, settings: &ServerSettings) {
        let new = Self::new(settings, self.asked);
        *self = Self { stage: Stage::Greeted(hello), stream, ..new };
    }

    pub fn has_joined(&self) -> bool {
        matches!(self.stage, Stage::Joined)
    }

    /// Whether it has to be asked to greet.
    pub fn has_to_greet(&self) -> bool {
        matches!(self.stage, Stage::Connected | Stage::Stale)
    }

    /// Whether edits of its player are taken.
    pub fn takes_edits(&self) -> bool {
        matches!(self.stage, Stage::Joined | Stage::Stale)
    }

    /// Lets it begin again: nothing of its stream counts.
    pub fn begin_again(&mut self, settings: &ServerSettings, now: Duration) {
        let new = Self::new(settings, now);
        let stage = if self.takes_edits() { Stage::Stale } else { Stage::Connected };
        *self = Self { stage, ..new };
    }

    /// Whether an outdated world is kept for it and it has acknowledged nothing for too long. `applied` is the present
    /// number of the world.
    pub fn is_stuck(&mut self, now: Duration, applied: u64) -> bool {
        let compared = self.compared.as_ref().map(|(number, _)| *number);
        let is_kept = self.bulk.number().into_iter().chain(compared).any(|number| number < applied);
        if self.bulk.goes_on() || !is_kept {
            self.went_on = now;
        }
        now.saturating_sub(self.went_on) >= STUCK
    }

    /// How many regions it waits for, with one more for each message in which it asked.
    pub fn regions_waiting(&self) -> usize {
        let fetches = self.fetches.iter().map(|fetch| fetch.regions.len() + 1);
        fetches.sum::<usize>() + self.bulk.waiting()
    }
}
