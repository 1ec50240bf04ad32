//! The store's thread: collects records, writes frames and checkpoints, and tries again what fails.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::time::{Duration, Instant};

use rustc_hash::FxHashMap;

use super::checkpoint::Checkpoint;
use super::error::{StoreError, StoreTrouble};
use super::files::Files;
use super::format::Batch;
use super::format::frame::WorldId;
use super::journal::Journal;
use super::mirror::Mirror;
use super::options::StoreOptions;
use super::region_file::RegionFile;
use super::segment::{FRAME_LIMIT, base};
use super::shared::{GameChange, Shared, apply_game};
use super::unsaved;
use crate::ground::Ground;
use crate::terrain::{CommitRecord, LogEntry, TerrainSettings, WorldChange, WorldParts};

/// The first wait before something that failed is tried again, and the longest.
const RETRY: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(10));

/// Where the answer to a request goes: the revision that is durable then.
pub(super) type Answer = Sender<Result<u64, StoreError>>;

/// What the thread is told.
pub(super) enum Message {
    /// Commits, and what the game puts beside them, in one frame.
    Commits(Vec<CommitRecord>, Vec<GameChange>),
    /// All of the world, since records are missing, its ground, and its hash.
    Whole(Box<WorldParts>, Arc<Ground>, u64, Vec<GameChange>),
    /// Makes all that was told so far durable.
    Flush(Answer),
    /// Makes a checkpoint of all that was told so far.
    Checkpoint(Answer),
    /// The same, and makes the database as small as it can be.
    Compact(Answer),
}

/// What fails, and when it is tried again.
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
    /// When they have to be written.
    due: Option<Instant>,
}

/// The store's thread.
pub(super) struct Writer {
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
    pub(super) state: State,
}

/// What changes while the thread runs.
#[derive(Default)]
pub(super) struct State {
    pending: Pending,
    /// Commits since the last checkpoint, and when the first of them came.
    pub commits: u64,
    pub changed: Option<Instant>,
    /// Are commits missing in the journal since the last checkpoint, so that only a checkpoint makes them durable?
    pub has_gap: bool,
    /// Is a checkpoint being made that ends a gap? Frames are durable with it only.
    pub after_gap: bool,
    failing: Option<Failing>,
    /// Requests that came during a checkpoint.
    later: VecDeque<Message>,
    /// Hashes of the ground by columns of regions.
    pub ground_hashes: FxHashMap<(i32, i32), u64>,
}

impl Writer {
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        files: Arc<dyn Files>,
        options: StoreOptions,
        shared: Arc<Shared>,
        world: WorldId,
        ground: Arc<Ground>,
        settings: TerrainSettings,
        mirror: Mirror,
        journal: Journal,
        database: RegionFile,
        checkpoint: u64,
    ) -> Self {
        let (checkpoints, state) = ([checkpoint; 2], State::default());
        Self {
            files,
            options,
            shared,
            world,
            ground,
            settings,
            mirror,
            journal,
            database,
            checkpoints,
            state,
        }
    }

    /// Makes a world durable of which nothing is on the disk, or only an older or damaged state.
    pub fn save_all(&mut self) -> Result<(), StoreError> {
        self.mirror.mark_all();
        self.checkpoint(None)
    }

    /// The same, or else as soon as it can be done.
    pub fn save_all_or_later(&mut self) {
        self.mirror.mark_all();
        if self.checkpoint(None).is_err() {
            self.give_up_waiting();
        }
    }

    /// Lets the journal's next segment begin with the state of now.
    pub fn begin_segment(&mut self) {
        let frame = self.journal.last_frame();
        let mut checkpoint = Checkpoint::of(&self.mirror, frame, self.metadata()).encode();
        if checkpoint.len() > FRAME_LIMIT {
            // It could not be read; the database has the last one that can.
            checkpoint.clear();
        }
        self.journal.begin_segment(self.mirror.revision, checkpoint);
    }

    /// Does what it is told until nobody can tell it anything any more, and then makes a last checkpoint.
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
        // What can't be saved now is lost with the process; the game was told.
        let mut is_saved = self.flush().is_ok();
        if is_saved && self.is_changed() {
            is_saved = self.checkpoint(None).is_ok();
        }
        if is_saved {
            // If that fails, it says more than is so, which does no harm.
            drop(unsaved::clear(&*self.files));
        }
    }

    /// Is there anything that the database does not hold?
    fn is_changed(&self) -> bool {
        self.mirror.is_dirty() || self.state.has_gap || self.journal.last_frame() > self.checkpoints[1]
    }

    /// When there is something to do.
    fn next_time(&self) -> Option<Instant> {
        if let Some(failing) = &self.state.failing {
            return Some(failing.again);
        }
        let checkpoint = self.state.changed.map(|since| since + self.options.checkpoint_after);
        [self.state.pending.due, checkpoint].into_iter().flatten().min()
    }

    /// Does what is due.
    fn tick(&mut self, messages: &Receiver<Message>) {
        let now = Instant::now();
        if let Some(failing) = &self.state.failing {
            if failing.again <= now {
                drop(self.make_durable(messages));
            }
            return;
        }
        if self.state.pending.due.is_some_and(|due| due <= now) {
            drop(self.flush());
        }
        let is_old = self.state.changed.is_some_and(|since| since + self.options.checkpoint_after <= now);
        if self.state.failing.is_none() && (is_old || self.state.commits >= self.options.checkpoint_commits) {
            drop(self.checkpoint(Some(messages)));
        }
    }

    fn take(&mut self, message: Message, messages: &Receiver<Message>) {
        match message {
            Message::Commits(records, game) => self.enter(records, game),
            Message::Whole(parts, ground, hash, game) => {
                self.enter(Vec::new(), game);
                self.mirror.replace(*parts, hash);
                self.take_ground(ground);
                self.leave_gap();
            }
            Message::Flush(answer) => {
                let done = self.make_durable(messages);
                drop(answer.send(done.map(|()| self.shared.durable())));
            }
            Message::Checkpoint(answer) => {
                let done = self.checkpoint(Some(messages));
                drop(answer.send(done.map(|()| self.shared.durable())));
            }
            Message::Compact(answer) => {
                self.database.compact_next();
                let done = self.checkpoint(Some(messages));
                drop(answer.send(done.map(|()| self.shared.durable())));
            }
        }
    }

    /// Makes all that came so far durable, by the log if that has no gap.
    fn make_durable(&mut self, messages: &Receiver<Message>) -> Result<(), StoreError> {
        if !self.state.has_gap {
            self.flush()?;
        }
        if self.state.has_gap { self.checkpoint(Some(messages)) } else { Ok(()) }
    }

    /// Takes in what has to be saved.
    fn enter(&mut self, records: Vec<CommitRecord>, game: Vec<GameChange>) {
        let now = Instant::now();
        self.state.pending.due.get_or_insert(now + self.options.loss_window);
        self.state.changed.get_or_insert(now);
        for mut record in records {
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
            if !record.entries.contains(&LogEntry::Change) {
                record.change = WorldChange::default();
            }
            let pending = &mut self.state.pending;
            pending.bytes += 64 + record.entries.len() * 64 + record.change.bricks.len() * 1024;
            pending.batch.commits.push(record);
        }
        apply_game(&mut self.mirror.game, &game);
        let bytes = |(key, value): &GameChange| key.len() + value.as_ref().map_or(0, Vec::len);
        self.state.pending.bytes += game.iter().map(bytes).sum::<usize>();
        self.state.pending.batch.game.extend(game);
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

    /// Gives up what waits for the journal: only a checkpoint makes it durable now.
    fn leave_gap(&mut self) {
        if !self.state.has_gap {
            self.shared.tell(StoreTrouble::LogGap { revision: self.shared.durable() });
        }
        self.give_up_waiting();
        self.checkpoint_soon();
    }

    /// Lets the next tick make a checkpoint, since only that makes durable what came.
    fn checkpoint_soon(&mut self) {
        self.state.changed.get_or_insert_with(Instant::now);
        if self.state.failing.is_none() {
            let (wait, again) = (RETRY.0, Instant::now());
            self.state.failing = Some(Failing { wait, again, why: String::new() });
        }
    }

    /// Lets the world stand on another ground from now on.
    fn take_ground(&mut self, ground: Arc<Ground>) {
        if ground.hash() != self.ground.hash() {
            self.journal.set_base(base(&ground, self.mirror.level.as_ref()));
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

    /// Puts what waits into a frame, and makes all frames durable; or leaves a gap, if it is too much for a frame.
    pub(super) fn flush(&mut self) -> Result<(), StoreError> {
        let pending = std::mem::take(&mut self.state.pending);
        if !pending.batch.is_empty() {
            let payload = pending.batch.encode();
            if payload.len() > self.options.frame_bytes.min(FRAME_LIMIT) {
                self.leave_gap();
                return Ok(());
            }
            self.journal.push(self.mirror.revision, &payload);
        }
        match self.journal.write() {
            Ok(written) => {
                let counts = !self.state.has_gap && !self.state.after_gap;
                if let (Some(revision), true) = (written, counts) {
                    self.shared.set_durable(revision);
                }
                if counts {
                    self.succeed();
                }
                Ok(())
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                // What was durable is gone with the file.
                self.leave_gap();
                Err(self.fail(&error.to_string()))
            }
            Err(error) => Err(self.fail(&error.to_string())),
        }
    }

    /// Takes in what came during a checkpoint, and writes it in time.
    pub(super) fn listen(&mut self, messages: &Receiver<Message>) {
        loop {
            match messages.try_recv() {
                Ok(Message::Commits(records, game)) if self.state.later.is_empty() => {
                    self.enter(records, game)
                }
                Ok(message) => self.state.later.push_back(message),
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => break,
            }
        }
        let is_due = self.state.pending.due.is_some_and(|due| due <= Instant::now());
        if is_due && self.state.failing.is_none() && !self.state.has_gap {
            drop(self.flush());
        }
    }

    /// Tells of a failure once, and waits longer each time.
    pub(super) fn fail(&mut self, why: &str) -> StoreError {
        let wait = match &self.state.failing {
            Some(failing) => (failing.wait * 2).min(RETRY.1),
            None => RETRY.0,
        };
        if self.state.failing.as_ref().is_none_or(|failing| failing.why != why) {
            self.shared.tell(StoreTrouble::NotSaved(why.into()));
        }
        self.state.failing = Some(Failing { wait, again: Instant::now() + wait, why: why.into() });
        StoreError::NotSaved(why.into())
    }

    pub(super) fn succeed(&mut self) {
        if self.state.failing.take().is_some_and(|failing| !failing.why.is_empty()) {
            self.shared.tell(StoreTrouble::SavedAgain);
        }
    }
}

/// The ground that a commit set, if it is one that did.
fn new_ground(record: &CommitRecord) -> Option<Arc<Ground>> {
    record.entries.iter().rev().find_map(|entry| match entry {
        LogEntry::Ground(ground) => Some(Arc::clone(ground)),
        _ => None,
    })
}
