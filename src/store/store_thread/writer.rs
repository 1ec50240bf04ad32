//! The store's thread: collects records, writes frames and checkpoints, and retries failed writes.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant};

use rustc_hash::FxHashMap;

use super::message::{Answer, Content, Given, Message, game_bytes, record_bytes};
use super::shared::{GameChange, SavePoint, Shared, apply_game};
use crate::format::Batch;
use crate::format::frame::WorldId;
use crate::ground::Ground;
use crate::store::base_level::BaseLevel;
use crate::store::checkpoints::{Checkpoint, Mirror};
use crate::store::error::{StoreError, StoreWarning};
use crate::store::files::{Files, Lock};
use crate::store::journal::segment::{self, FRAME_LIMIT};
use crate::store::journal::{Journal, Segment, unsaved};
use crate::store::options::StoreOptions;
use crate::store::regions::RegionFile;
use crate::terrain::{CommitRecord, Order, TerrainSettings};

/// The first wait before something that failed is tried again, and the longest.
const RETRY: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(10));

/// How long the disk may take for a frame of the log and for a checkpoint, before it is reported that it does not
/// answer.
const FRAME_TIME: Duration = Duration::from_secs(3);
pub(super) const CHECKPOINT_TIME: Duration = Duration::from_secs(30);

/// The present failure, and the time of the next try.
struct Failing {
    wait: Duration,
    again: Instant,
    why: String,
}

/// Records that are not in a frame yet.
#[derive(Default)]
struct Pending {
    batch: Batch,
    bytes: usize,
    /// When the first of them came.
    since: Option<Instant>,
}

impl Pending {
    fn push(&mut self, record: CommitRecord) {
        self.bytes += record_bytes(&record);
        self.batch.commits.push(record);
    }

    /// Enters values of the game's. A frame is read whole or not at all, so only the last value of a key counts.
    fn put(&mut self, game: Vec<GameChange>) {
        for change in game {
            self.bytes += game_bytes(&change);
            match self.batch.game.iter_mut().find(|(key, _)| *key == change.0) {
                Some(old) => self.bytes -= game_bytes(&std::mem::replace(old, change)),
                None => self.batch.game.push(change),
            }
        }
    }
}

/// The store's thread.
pub(in crate::store) struct Writer {
    pub files: Arc<dyn Files>,
    pub options: StoreOptions,
    pub shared: Arc<Shared>,
    pub world: WorldId,
    pub ground: Arc<Ground>,
    pub settings: TerrainSettings,
    pub mirror: Mirror,
    pub journal: Journal,
    pub database: RegionFile,
    /// The frames of the last checkpoint and of the one before.
    pub checkpoints: [u64; 2],
    /// Up to where the mirror holds what was given.
    pub point: SavePoint,
    pub(super) state: State,
    /// Held as long as anything may be written.
    _lock: Box<dyn Lock>,
}

/// The state of the thread.
#[derive(Default)]
pub(super) struct State {
    pending: Pending,
    /// Commits since the last checkpoint, and when the first of them came.
    pub commits: u64,
    pub changed: Option<Instant>,
    /// Whether commits since the last checkpoint are missing in the journal, so that only a checkpoint makes them
    /// durable.
    pub has_gap: bool,
    /// Whether a checkpoint is being made that ends a gap. Frames become durable only with it.
    pub after_gap: bool,
    /// Up to where frames were written since the last checkpoint was begun.
    pub written: Option<SavePoint>,
    failing: Option<Failing>,
    /// Requests that came during a checkpoint.
    later: VecDeque<Message>,
    /// Hashes of the ground by columns of regions.
    pub ground_hashes: FxHashMap<(i32, i32), u64>,
}

impl Writer {
    pub fn new(
        files: Arc<dyn Files>,
        options: StoreOptions,
        world: WorldId,
        ground: Arc<Ground>,
        settings: TerrainSettings,
        mirror: Mirror,
        (segments, next_frame): (Vec<Segment>, u64),
        database: RegionFile,
        checkpoint: u64,
        lock: Box<dyn Lock>,
    ) -> Self {
        let base = segment::base(ground.hash(), mirror.level.as_ref().map(BaseLevel::name));
        let journal = Journal::new(Arc::clone(&files), world, base, segments, next_frame);
        let (checkpoints, state) = ([checkpoint; 2], State::default());
        let point = SavePoint { revision: mirror.revision, ..SavePoint::default() };
        Self {
            files,
            options,
            shared: Arc::default(),
            world,
            ground,
            settings,
            mirror,
            journal,
            database,
            checkpoints,
            point,
            state,
            _lock: lock,
        }
    }

    /// Makes a world durable of which nothing is on the disk, or only an older or damaged state.
    pub fn save_all(&mut self) -> Result<(), StoreError> {
        self.mirror.mark_all();
        self.checkpoint(None)
    }

    /// Saves the whole world now, or as soon as possible.
    pub fn save_all_or_later(&mut self) {
        self.mirror.mark_all();
        if self.checkpoint(None).is_err() {
            self.give_up_waiting();
        }
    }

    /// Continues the journal in a new segment. The very first segment begins with the present state, so that a world
    /// can be made from the log alone; in others this would only reduce the room for commits.
    pub fn begin_segment(&mut self) {
        let mut checkpoint = Vec::new();
        if !self.journal.has_segments() {
            let frame = self.journal.last_frame();
            checkpoint = Checkpoint::of(&self.mirror, frame, self.metadata()).encode();
        }
        if checkpoint.len() > FRAME_LIMIT {
            // It could not be read; the database has the last one that can.
            checkpoint.clear();
        }
        self.journal.begin_segment(self.mirror.revision, checkpoint);
    }

    /// Handles messages until the channel is closed, and then makes a last checkpoint.
    pub fn run(mut self, messages: &Receiver<Message>) {
        loop {
            let message = match self.state.later.pop_front() {
                Some(message) => Ok(message),
                None => match self.next_time() {
                    Some(at) => messages.recv_timeout(at.saturating_duration_since(Instant::now())),
                    None => messages.recv().map_err(|_| RecvTimeoutError::Disconnected),
                },
            };
            match message {
                Ok(message) => self.take(message, messages),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.tick(messages);
        }
        // Data that can't be saved now is lost with the process; the game was notified.
        let mut is_saved = self.flush().is_ok();
        if is_saved && self.is_changed() {
            is_saved = self.checkpoint(None).is_ok();
        }
        if is_saved {
            // If that fails, it says more than is so, which does no harm.
            drop(unsaved::clear(&*self.files));
        }
    }

    /// Whether the database lacks any changes.
    fn is_changed(&self) -> bool {
        self.mirror.is_dirty() || self.state.has_gap || self.journal.last_frame() > self.checkpoints[1]
    }

    /// The time of the next work.
    fn next_time(&self) -> Option<Instant> {
        if let Some(failing) = &self.state.failing {
            return Some(failing.again);
        }
        [self.frame_due(), self.checkpoint_due()].into_iter().flatten().min()
    }

    /// The time at which waiting records have to be written.
    fn frame_due(&self) -> Option<Instant> {
        self.state.pending.since?.checked_add(self.options.loss_window)
    }

    /// The time at which a checkpoint has to be made.
    fn checkpoint_due(&self) -> Option<Instant> {
        self.state.changed?.checked_add(self.options.checkpoint_after)
    }

    /// Does the work that is due.
    fn tick(&mut self, messages: &Receiver<Message>) {
        let now = Instant::now();
        if let Some(failing) = &self.state.failing {
            if failing.again <= now {
                drop(self.make_durable(messages));
            }
            return;
        }
        if self.frame_due().is_some_and(|due| due <= now) {
            drop(self.flush());
        }
        let is_old = self.checkpoint_due().is_some_and(|due| due <= now);
        if self.state.failing.is_none() && (is_old || self.state.commits >= self.options.checkpoint_commits) {
            drop(self.checkpoint(Some(messages)));
        }
    }

    fn take(&mut self, message: Message, messages: &Receiver<Message>) {
        match message {
            Message::Save(given) => self.enter(given),
            Message::Flush(answer) => {
                let done = self.make_durable(messages);
                self.answer(&answer, done);
            }
            Message::Checkpoint(answer) => {
                let done = self.checkpoint(Some(messages));
                self.answer(&answer, done);
            }
            Message::Compact(answer) => {
                self.database.compact_next();
                let done = self.checkpoint(Some(messages));
                self.answer(&answer, done);
            }
        }
    }

    /// Answers a request, which may no longer be awaited.
    fn answer(&self, answer: &Answer, done: Result<(), StoreError>) {
        let revision = || self.shared.durable().map_or(0, SavePoint::revision);
        drop(answer.send(done.map(|()| revision())));
    }

    /// Makes everything received durable, through the log if that has no gap.
    fn make_durable(&mut self, messages: &Receiver<Message>) -> Result<(), StoreError> {
        if !self.state.has_gap {
            self.flush()?;
        }
        if self.state.has_gap { self.checkpoint(Some(messages)) } else { Ok(()) }
    }

    /// Accepts data that has to be saved.
    fn enter(&mut self, given: Given) {
        self.shared.remove_queued(given.bytes());
        let Given { point, content, game } = given;
        let now = Instant::now();
        self.state.pending.since.get_or_insert(now);
        self.state.changed.get_or_insert(now);
        apply_game(&mut self.mirror.game, &game);
        match content {
            Content::Commits(records) => {
                records.into_iter().for_each(|record| self.enter_record(record));
                self.state.pending.put(game);
            }
            Content::Whole(parts, ground, hash) => {
                self.mirror.replace(*parts, hash);
                self.take_ground(ground);
                self.leave_gap();
            }
        }
        self.point = point;
        if self.state.has_gap {
            // A checkpoint saves them, since the journal can't.
            self.state.pending = Pending::default();
        } else if self.state.pending.bytes + self.journal.waiting_bytes() > self.options.waiting_bytes {
            match self.state.failing {
                Some(_) => self.leave_gap(),
                None => drop(self.flush()),
            }
        }
    }

    fn enter_record(&mut self, mut record: CommitRecord) {
        if let Some(ground) = new_ground(&record) {
            // The log that follows can't be replayed on the old ground.
            drop(self.flush());
            self.take_ground(ground);
            self.give_up_waiting();
            self.checkpoint_soon();
        }
        self.mirror.apply(&record);
        self.state.commits += 1;
        // Edits lead to the same bricks again.
        if !record.has_change() {
            record.change = Arc::default();
        }
        self.state.pending.push(record);
    }

    /// Drops the records that wait for the journal: now only a checkpoint makes them durable.
    fn leave_gap(&mut self) {
        if !self.state.has_gap {
            let revision = self.shared.durable().map_or(0, SavePoint::revision);
            self.shared.report_warning(StoreWarning::LogGap { revision });
        }
        self.give_up_waiting();
        self.checkpoint_soon();
    }

    /// Makes the next tick write a checkpoint, because only that makes received data durable.
    fn checkpoint_soon(&mut self) {
        self.state.changed.get_or_insert_with(Instant::now);
        if self.state.failing.is_none() {
            let (wait, again) = (RETRY.0, Instant::now());
            self.state.failing = Some(Failing { wait, again, why: String::new() });
        }
    }

    /// Changes the ground of the world.
    fn take_ground(&mut self, ground: Arc<Ground>) {
        if ground.hash() != self.ground.hash() {
            self.journal
                .set_base(segment::base(ground.hash(), self.mirror.level.as_ref().map(BaseLevel::name)));
            self.state.ground_hashes.clear();
            self.mirror.mark_all();
        }
        self.ground = ground;
    }

    pub(super) fn give_up_waiting(&mut self) {
        self.state.pending = Pending::default();
        self.journal.drop_waiting();
        self.state.has_gap = true;
    }

    /// Writes waiting records to a frame, and makes all frames durable; or leaves a gap, if they are too large for a
    /// frame.
    pub(super) fn flush(&mut self) -> Result<(), StoreError> {
        let pending = std::mem::take(&mut self.state.pending);
        if !pending.batch.is_empty() {
            // Equal bytes where there is nothing to name, so that earlier versions read them.
            let payload = match pending.batch.contents().next() {
                Some(_) => pending.batch.encode_named(),
                None => pending.batch.encode(),
            };
            if payload.len() > self.options.frame_bytes.min(FRAME_LIMIT) {
                self.leave_gap();
                return Ok(());
            }
            self.journal.push(self.mirror.revision, &pending.batch, &payload);
        }
        self.shared.begin_waiting(FRAME_TIME);
        let written = self.journal.write();
        self.shared.end_waiting();
        match written {
            // Frames behind a gap are durable with the checkpoint that ends it.
            Ok(()) if self.state.has_gap => Ok(()),
            Ok(()) => {
                self.state.written = Some(self.point);
                if !self.state.after_gap {
                    self.shared.set_durable(self.point);
                    self.succeed();
                }
                Ok(())
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                // Durable commits are lost with the file.
                self.leave_gap();
                Err(self.fail(&error.to_string()))
            }
            Err(error) => Err(self.fail(&error.to_string())),
        }
    }

    /// Accepts messages during a checkpoint, and writes their data in time.
    pub(super) fn listen(&mut self, messages: &Receiver<Message>) {
        loop {
            match messages.try_recv() {
                Ok(Message::Save(given)) if self.state.later.is_empty() && !given.is_whole() => {
                    self.enter(given)
                }
                Ok(message) => self.state.later.push_back(message),
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => break,
            }
        }
        let is_due = self.frame_due().is_some_and(|due| due <= Instant::now());
        if is_due && self.state.failing.is_none() && !self.state.has_gap {
            drop(self.flush());
        }
    }

    /// Reports a failure once, and waits longer each time.
    pub(super) fn fail(&mut self, why: &str) -> StoreError {
        let wait = match &self.state.failing {
            Some(failing) => (failing.wait * 2).min(RETRY.1),
            None => RETRY.0,
        };
        if self.state.failing.as_ref().is_none_or(|failing| failing.why != why) {
            self.shared.report_warning(StoreWarning::NotSaved(why.into()));
        }
        self.shared.set_failing(Some(why));
        self.state.failing = Some(Failing { wait, again: Instant::now() + wait, why: why.into() });
        StoreError::NotSaved(why.into())
    }

    pub(super) fn succeed(&mut self) {
        if self.state.failing.take().is_some_and(|failing| !failing.why.is_empty()) {
            self.shared.report_warning(StoreWarning::SavedAgain);
        }
        self.shared.set_failing(None);
    }
}

/// The ground that a commit set, if it is one that did.
fn new_ground(record: &CommitRecord) -> Option<Arc<Ground>> {
    record.orders.iter().rev().find_map(|order| match order {
        Order::Ground(ground) => Some(Arc::clone(ground)),
        _ => None,
    })
}
