//! What a server knows of a client that is connected.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use super::sender::{BulkSender, OrderSender};
use super::settings::ServerSettings;
use crate::lattice::RegionPos;
use crate::net::message::Hello;
use crate::net::stamps::StampId;
use crate::terrain::World;

/// How far a client has come.
pub enum Stage {
    /// It has said nothing yet, or has to begin again.
    Connected,
    /// It waits for its welcome.
    Greeted(Hello),
    /// It gets entries as they are ordered.
    Joined,
}

/// Regions that a client asked for.
pub struct Fetch {
    /// The number that its world is at.
    pub number: u64,
    pub regions: Vec<RegionPos>,
}

/// A client that is connected. All but the time belongs to its [stream](crate::net::ToServer::Greeting).
pub struct Session {
    pub stage: Stage,
    /// The stream that it began last; `None` for one without marks.
    pub stream: Option<u64>,
    /// When it connected, or was last asked to greet.
    pub asked: Duration,
    /// The number that its world is at, as it says.
    pub acknowledged: u64,
    pub order: OrderSender,
    pub bulk: BulkSender,
    pub fetches: VecDeque<Fetch>,
    /// Images that it was sent.
    pub images: BTreeSet<StampId>,
    /// The world that it compares its own with, and that one's number.
    pub compared: Option<(u64, Arc<World>)>,
}

impl Session {
    pub fn new(settings: &ServerSettings, now: Duration) -> Self {
        Self {
            stage: Stage::Connected,
            stream: None,
            asked: now,
            acknowledged: 0,
            order: OrderSender::new(settings, 0),
            bulk: BulkSender::new(settings),
            fetches: VecDeque::new(),
            images: BTreeSet::new(),
            compared: None,
        }
    }

    /// Begins a new stream with a greeting: nothing of an earlier one counts.
    pub fn begin(&mut self, stream: Option<u64>, hello: Hello, settings: &ServerSettings) {
        let new = Self::new(settings, self.asked);
        *self = Self { stage: Stage::Greeted(hello), stream, ..new };
    }

    pub fn has_joined(&self) -> bool {
        matches!(self.stage, Stage::Joined)
    }

    /// How many regions it waits for, with one more for each message in which it asked.
    pub fn regions_waiting(&self) -> usize {
        let fetches = self.fetches.iter().map(|fetch| fetch.regions.len() + 1);
        fetches.sum::<usize>() + self.bulk.waiting()
    }
}
