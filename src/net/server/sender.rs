//! Sends data to a client, within a window of bytes that it has not acknowledged.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use super::pace::Pace;
use super::settings::ServerSettings;
use crate::brush::Prefab;
use crate::ground::GreyImage;
use crate::lattice::RegionPos;
use crate::net::bucket::{Bucket, Rate};
use crate::net::bulk::put_message;
use crate::net::message::{RegionContent, ToClient};
use crate::net::regions::chunks_of;
use crate::terrain::World;

/// Unacknowledged entries in the main lane of a client: at most the bytes of the window, or one message.
pub struct EntrySender {
    /// The number of the last entry that was sent.
    sent: u64,
    /// Messages that are not acknowledged: the numbers of their last entries, and their bytes.
    on_the_way: VecDeque<(u64, u64)>,
    bytes: u64,
    window: u64,
}

impl EntrySender {
    /// For a client that starts from this number.
    pub fn new(settings: &ServerSettings, number: u64) -> Self {
        Self { sent: number, on_the_way: VecDeque::new(), bytes: 0, window: settings.window }
    }

    /// The number of the last entry that was sent.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Records that a message with entries up to a number is sent, if there is room for it. Returns `true` if there is.
    pub fn send(&mut self, last: u64, bytes: usize) -> bool {
        let bytes = bytes as u64;
        let has_room = self.on_the_way.is_empty() || self.bytes.saturating_add(bytes) <= self.window;
        if has_room {
            self.sent = last;
            self.bytes += bytes;
            self.on_the_way.push_back((last, bytes));
        }
        has_room
    }

    /// Records that the client has applied all entries up to a number.
    pub fn acknowledge(&mut self, number: u64) {
        while let Some((_, bytes)) = self.on_the_way.pop_front_if(|(last, _)| *last <= number) {
            self.bytes -= bytes;
        }
    }
}

/// A job of the bulk lane.
pub enum Job {
    /// A message in bytes.
    Message(Arc<[u8]>),
    /// An image.
    Image(Arc<GreyImage>),
    /// A prefab.
    Prefab(Arc<Prefab>),
    /// A region of the lane's world, followed by `left` others. It is encoded when its turn comes.
    Region { pos: RegionPos, left: u32 },
}

/// A world at a number.
pub type Snapshot = (u64, Arc<World>);

/// A region of a world in a message.
pub fn region_bytes((number, world): &Snapshot, pos: RegionPos, left: u32) -> Vec<u8> {
    let bricks = world.bricks_in(pos).map(|(at, brick)| (at, Arc::clone(brick))).collect();
    let chunks = chunks_of(world.grid(), pos);
    let fields = chunks.filter_map(|chunk| Some((chunk, world.fields_of(chunk)?.clone()))).collect();
    let next_field = world.next_field();
    ToClient::Region(RegionContent { number: *number, pos, left, next_field, bricks, fields }).to_bytes()
}

/// How many regions may still be encoded in this call, for all clients together: each takes milliseconds, so this
/// bounds a tick.
#[derive(Debug, Default)]
pub struct Encodings {
    left: usize,
    is_short: bool,
    /// The latest regions that were encoded, and their bytes.
    count: usize,
    bytes: usize,
}

impl Encodings {
    /// Resets what is left for another call.
    pub fn refill(&mut self) {
        (self.left, self.is_short) = (Self::MAX_PER_CALL, false);
    }

    /// Regions in a call: at 60 calls a second, 480, of some 20 to 100 KB each.
    const MAX_PER_CALL: usize = 8;

    /// Whether a region was not encoded since the last refill because too many others were.
    pub fn is_short(&self) -> bool {
        self.is_short
    }

    fn begin(&mut self) -> bool {
        self.is_short |= self.left == 0;
        self.left = self.left.saturating_sub(1);
        !self.is_short
    }

    fn note(&mut self, bytes: usize) {
        // The latest ones count most.
        if self.count >= 64 {
            (self.count, self.bytes) = (self.count / 2, self.bytes / 2);
        }
        (self.count, self.bytes) = (self.count + 1, self.bytes + bytes);
    }

    /// Estimates the bytes of regions in messages from those that were encoded. If there were none, some are.
    pub fn estimate(&mut self, world: &Snapshot, regions: &[RegionPos]) -> usize {
        if self.count == 0 {
            let step = regions.len().div_ceil(Self::MAX_PER_CALL).max(1);
            regions.iter().step_by(step).for_each(|region| self.note(region_bytes(world, *region, 0).len()));
        }
        self.bytes / self.count.max(1) * regions.len()
    }
}

/// The bulk lane of a client: limited in bytes a second and in unacknowledged bytes, both by its [pace](Pace).
pub struct BulkSender {
    jobs: VecDeque<Job>,
    /// Regions among these.
    regions: usize,
    /// The world of all regions that wait. There is one, as each takes as much memory as what has changed since.
    world: Option<Snapshot>,
    /// Bytes of the stream that were not sent yet, from `at` on.
    stream: Vec<u8>,
    at: usize,
    sent: u64,
    acknowledged: u64,
    /// The acknowledged bytes at the last [progress](Self::goes_on), and the number of further bytes that count as
    /// progress again.
    noted: u64,
    least: u64,
    pace: Pace,
    piece: usize,
}

impl BulkSender {
    pub fn new(settings: &ServerSettings) -> Self {
        Self {
            jobs: VecDeque::new(),
            regions: 0,
            world: None,
            stream: Vec::new(),
            at: 0,
            sent: 0,
            acknowledged: 0,
            noted: 0,
            least: (settings.window / 8).min(settings.bulk.per_second).max(1),
            pace: Pace::new(settings),
            piece: (settings.piece as u64).min(settings.bulk.burst).min(settings.window).max(1) as usize,
        }
    }

    /// Adds a message after all others.
    pub fn push(&mut self, message: Arc<[u8]>) {
        self.jobs.push_back(Job::Message(message));
    }

    /// Adds an image before all others that were not begun: entries that have come wait for it.
    pub fn push_image(&mut self, image: Arc<GreyImage>) {
        self.jobs.push_front(Job::Image(image));
    }

    /// Adds a prefab, likewise.
    pub fn push_prefab(&mut self, prefab: Arc<Prefab>) {
        self.jobs.push_front(Job::Prefab(prefab));
    }

    /// Whether regions of this world can be added: of another one only where no regions wait.
    pub fn takes(&self, number: u64) -> bool {
        self.world.as_ref().is_none_or(|(other, _)| *other == number)
    }

    /// Adds regions of a world that the lane [takes](Self::takes).
    pub fn push_regions(&mut self, world: Snapshot, regions: &[RegionPos]) {
        if regions.is_empty() || !self.takes(world.0) {
            return;
        }
        let left = (0..regions.len() as u32).rev();
        self.jobs.extend(regions.iter().zip(left).map(|(pos, left)| Job::Region { pos: *pos, left }));
        self.regions += regions.len();
        self.world = Some(world);
    }

    /// Messages and regions that wait.
    pub fn waiting(&self) -> usize {
        self.jobs.len()
    }

    /// The number of the world of regions that wait.
    pub fn number(&self) -> Option<u64> {
        self.world.as_ref().map(|(number, _)| *number)
    }

    /// Whether the client has acknowledged enough since its last progress, or everything, so that the server has to
    /// send more.
    pub fn goes_on(&mut self) -> bool {
        let is_waiting = !self.jobs.is_empty() || self.at < self.stream.len();
        let has_all = self.acknowledged == self.sent && (is_waiting || self.acknowledged > self.noted);
        let goes_on = has_all || self.acknowledged - self.noted >= self.least;
        if goes_on {
            self.noted = self.acknowledged;
        }
        goes_on
    }

    /// The rate at which it may send.
    pub fn rate(&self) -> Rate {
        self.pace.rate()
    }

    /// Records the number of bytes that have arrived. Returns `false` if it is impossible.
    pub fn acknowledge(&mut self, bytes: u64, now: Duration) -> bool {
        if self.acknowledged < bytes && bytes <= self.sent {
            self.pace.acknowledge(bytes, self.sent, now);
        }
        self.acknowledged = self.acknowledged.max(bytes.min(self.sent));
        bytes <= self.sent
    }

    /// The next piece that may be sent, with at most as many regions encoded as `encodings` allows.
    pub fn next_piece(
        &mut self,
        bucket: &mut Bucket,
        now: Duration,
        encodings: &mut Encodings,
    ) -> Option<Vec<u8>> {
        if self.at == self.stream.len() {
            let Some(message) = self.next_message(encodings) else {
                self.pace.stop();
                return None;
            };
            self.stream.clear();
            self.at = 0;
            put_message(&mut self.stream, &message);
        }
        let rest = self.stream.get(self.at..)?;
        let on_the_way = self.sent - self.acknowledged;
        let whole = rest.len().min(self.piece);
        // Only whole ones: a tiny piece is not worth a message.
        if self.pace.window().saturating_sub(on_the_way) < whole as u64 {
            self.pace.hold();
            return None;
        }
        if !bucket.spend(now, whole as u64) {
            return None;
        }
        let piece = rest.get(..whole)?.to_vec();
        self.at += whole;
        self.sent += whole as u64;
        self.pace.send(self.sent, now);
        Some(piece)
    }

    fn next_message(&mut self, encodings: &mut Encodings) -> Option<Arc<[u8]>> {
        if matches!(self.jobs.front(), Some(Job::Region { .. })) && !encodings.begin() {
            return None;
        }
        match self.jobs.pop_front()? {
            Job::Message(bytes) => Some(bytes),
            Job::Image(image) => Some(ToClient::Image(image).to_bytes().into()),
            Job::Prefab(prefab) => Some(ToClient::Prefab(prefab).to_bytes().into()),
            Job::Region { pos, left } => {
                let bytes: Arc<[u8]> = region_bytes(self.world.as_ref()?, pos, left).into();
                encodings.note(bytes.len());
                self.regions -= 1;
                if self.regions == 0 {
                    self.world = None;
                }
                Some(bytes)
            }
        }
    }
}
