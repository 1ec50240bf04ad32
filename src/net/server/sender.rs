//! The bulk lane of a client: so many bytes a second, and never more on their way than the window.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use super::bucket::Bucket;
use super::settings::ServerSettings;
use crate::lattice::RegionPos;
use crate::net::bulk::put_message;
use crate::net::message::{RegionContent, ToClient};
use crate::net::regions::chunks_of;
use crate::terrain::World;

/// What is to be sent.
pub enum Job {
    /// A message in bytes.
    Message(Arc<[u8]>),
    /// A region of a world at a number, with so many others to follow. It is made into bytes when its turn comes.
    Region { world: Arc<World>, number: u64, pos: RegionPos, left: u32 },
}

impl Job {
    pub fn to_bytes(&self) -> Arc<[u8]> {
        match self {
            Self::Message(bytes) => Arc::clone(bytes),
            Self::Region { world, number, pos, left } => {
                let content = content(world, *number, *pos, *left);
                ToClient::Region(content).to_bytes().into()
            }
        }
    }
}

/// A region of a world.
fn content(world: &World, number: u64, pos: RegionPos, left: u32) -> RegionContent {
    let bricks = world.bricks_in(pos).map(|(at, brick)| (at, Arc::clone(brick))).collect();
    let chunks = chunks_of(world.grid(), pos);
    let fields = chunks.filter_map(|chunk| Some((chunk, world.fields_of(chunk)?.clone()))).collect();
    RegionContent { number, pos, left, next_field: world.next_field(), bricks, fields }
}

/// What waits for one client.
pub struct BulkSender {
    jobs: VecDeque<Job>,
    /// Bytes of the stream that were not sent yet, from `at` on.
    stream: Vec<u8>,
    at: usize,
    sent: u64,
    acknowledged: u64,
    bucket: Bucket,
    window: u64,
    piece: usize,
}

impl BulkSender {
    pub fn new(settings: &ServerSettings, now: Duration) -> Self {
        Self {
            jobs: VecDeque::new(),
            stream: Vec::new(),
            at: 0,
            sent: 0,
            acknowledged: 0,
            bucket: Bucket::new(settings.bulk, now),
            window: settings.window,
            piece: (settings.piece as u64).min(settings.bulk.burst).min(settings.window).max(1) as usize,
        }
    }

    pub fn push(&mut self, job: Job) {
        self.jobs.push_back(job);
    }

    /// Jobs that wait.
    pub fn waiting(&self) -> usize {
        self.jobs.len()
    }

    /// Forgets what was not begun.
    pub fn cancel(&mut self) {
        self.jobs.clear();
    }

    /// Notes that so many bytes have come. Is that possible?
    pub fn acknowledge(&mut self, bytes: u64) -> bool {
        self.acknowledged = self.acknowledged.max(bytes.min(self.sent));
        bytes <= self.sent
    }

    /// The next piece that may be sent.
    pub fn next_piece(&mut self, now: Duration) -> Option<Vec<u8>> {
        if self.at == self.stream.len() {
            self.stream.clear();
            self.at = 0;
            put_message(&mut self.stream, &self.jobs.pop_front()?.to_bytes());
        }
        let rest = self.stream.get(self.at..)?;
        let on_the_way = self.sent - self.acknowledged;
        let room = self.window.saturating_sub(on_the_way).min(self.bucket.left(now));
        let whole = rest.len().min(self.piece);
        // A crumb is not worth a message.
        let is_worth_it = room >= whole as u64;
        if !is_worth_it || !self.bucket.spend(now, whole as u64) {
            return None;
        }
        let piece = rest.get(..whole)?.to_vec();
        self.at += whole;
        self.sent += whole as u64;
        Some(piece)
    }
}
