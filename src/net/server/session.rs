//! What a server knows of a client that is connected.

use std::sync::Arc;
use std::time::Duration;

use glam::IVec3;

use super::bucket::Bucket;
use super::sender::BulkSender;
use super::settings::ServerSettings;
use crate::net::message::Hello;
use crate::terrain::World;

/// How far a client has come.
pub enum Stage {
    /// It has said nothing yet.
    Connected,
    /// It waits for its welcome.
    Greeted(Hello),
    /// It gets entries as they are ordered.
    Joined,
}

/// A client that is connected.
pub struct Session {
    pub stage: Stage,
    pub cost: Bucket,
    pub flood: Bucket,
    pub malformed: Bucket,
    pub place: Option<IVec3>,
    pub is_administrator: bool,
    /// The number that its world is at, as it says.
    pub acknowledged: u64,
    pub bulk: BulkSender,
    /// The world that it compares its own with, and that one's number.
    pub compared: Option<(u64, Arc<World>)>,
}

impl Session {
    pub fn new(settings: &ServerSettings, now: Duration) -> Self {
        Self {
            stage: Stage::Connected,
            cost: Bucket::new(settings.cost, now),
            flood: Bucket::new(settings.cost.times(settings.flood), now),
            malformed: Bucket::new(settings.malformed, now),
            place: None,
            is_administrator: false,
            acknowledged: 0,
            bulk: BulkSender::new(settings, now),
            compared: None,
        }
    }

    pub fn has_joined(&self) -> bool {
        matches!(self.stage, Stage::Joined)
    }
}
