//! Hands commits and whole terrains to the store's thread, and reports what of them is durable.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use super::{LOG_BYTES, Store};
use crate::store::error::{StoreError, WorldSize};
use crate::store::store_thread::{Answer, Content, Given, Message, SavePoint};
use crate::terrain::{CommitRecord, Terrain};

impl Store {
    /// Takes the records of a terrain's commits, so that they become durable. Call it as often as you like: it takes
    /// microseconds, and does nothing if there are no new commits. If it is another terrain of the same size, the whole
    /// terrain replaces the saved one.
    ///
    /// While the limit on data that waits for a disk is reached, nothing is taken. Once there is room, the [whole
    /// terrain](Self::append_whole) is saved.
    ///
    /// # Errors
    /// [`StoreError::OtherSize`] if the terrain has another size than the saved world; then nothing is taken;
    /// [`StoreError::Ended`] when the store's thread has panicked.
    pub fn follow(&mut self, terrain: &mut Terrain) -> Result<(), StoreError> {
        // Earlier records were made before the whole terrain was saved, which has what they say.
        let waiting = terrain.log_numbers().filter(|own| (own.start..=own.end).contains(&self.next_record));
        let is_next = self.follows(terrain) && self.skipped.is_none() && waiting.is_some();
        let revision = terrain.world().revision();
        if is_next && !terrain.has_log() && self.unsent.is_empty() && revision == self.point.revision {
            return Ok(());
        }
        self.check_size(terrain)?;
        self.turn_to(terrain);
        let mut records = terrain.take_log();
        if self.is_full() {
            self.skipped = Some(revision);
            return self.check_thread();
        }
        if is_next {
            records.retain(|record| record.number >= self.next_record);
        }
        let last = records.last().map_or(self.point.revision, |record| record.revision);
        if is_next && last == revision && self.continues(&records) {
            return self.append(records);
        }
        // Records were dropped, or never kept.
        terrain.keep_log(Some(LOG_BYTES));
        self.append_whole(terrain)
    }

    /// Follows this terrain from now on. Its log can be taken then, which may be all that says that it is the last one.
    fn turn_to(&mut self, terrain: &Terrain) {
        self.point.terrain += u64::from(!self.follows(terrain));
        (self.version, self.ground) = (terrain.world().version(), terrain.world().ground().hash());
    }

    /// Whether this is the last given terrain, with or without later commits.
    pub(crate) fn follows(&self, terrain: &Terrain) -> bool {
        terrain.world().version().is_same_world(self.version)
            || terrain.log_sets_ground_after(self.skipped.unwrap_or(self.point.revision))
    }

    /// Replaces the last given terrain by the one that it was made from, when the next record of that one's log had
    /// this number.
    #[cfg(feature = "plugin")]
    pub(crate) fn adopt(&mut self, terrain: &Terrain, next_record: u64) {
        (self.version, self.next_record) = (terrain.world().version(), next_record);
    }

    /// Whether this terrain is another state of the saved world: it has the same ground and size.
    #[cfg(feature = "plugin")]
    pub(crate) fn is_of(&self, terrain: &Terrain) -> bool {
        self.follows(terrain)
            || self.check_size(terrain).is_ok() && terrain.world().ground().hash() == self.ground
    }

    fn check_size(&self, terrain: &Terrain) -> Result<(), StoreError> {
        let (saved, given) = (self.size, WorldSize::of(terrain));
        if saved == given { Ok(()) } else { Err(StoreError::OtherSize { saved, given }) }
    }

    /// Whether more data waits for the thread than allowed.
    fn is_full(&self) -> bool {
        self.shared.queued() > self.max_queued
    }

    fn check_thread(&self) -> Result<(), StoreError> {
        let is_running = self.open.as_ref().is_some_and(|(_, thread)| !thread.is_done());
        if is_running { Ok(()) } else { Err(StoreError::Ended) }
    }

    /// Whether every record follows the previous one.
    fn continues(&self, records: &[CommitRecord]) -> bool {
        let mut at = self.point.revision;
        (self.next_record..).zip(records).all(|(number, record)| {
            let is_next = record.revision == at.saturating_add(record.is_commit().into());
            at = record.revision;
            is_next && record.number == number
        })
    }

    /// Takes records of commits, so that they become durable, together with everything that was [put](Self::put) since
    /// the last ones.
    ///
    /// # Errors
    /// [`StoreError::Gap`] when they do not follow those that were taken before; [`StoreError::Full`] when too much
    /// waits for a disk that does not answer. None is taken then. [`StoreError::Ended`] when the store's thread has
    /// panicked.
    pub fn append(&mut self, records: Vec<CommitRecord>) -> Result<(), StoreError> {
        if self.skipped.is_some() || !self.continues(&records) {
            let found = records.first().map_or(0, |record| record.revision);
            return Err(StoreError::Gap { at: self.point.revision, found });
        }
        let revision = records.last().map_or(self.point.revision, |record| record.revision);
        let next_record = self.next_record + records.len() as u64;
        self.give(SavePoint { revision, ..self.point }, Content::Commits(records))?;
        self.next_record = next_record;
        Ok(())
    }

    /// Takes the whole terrain, if records are missing or another terrain replaces the last one. It is durable with the
    /// next checkpoint, which is made at once.
    ///
    /// # Errors
    /// [`StoreError::OtherSize`] when the terrain has another size than the saved world; [`StoreError::Full`] when too
    /// much waits for a disk that does not answer. Nothing is taken then. [`StoreError::Ended`] when the store's thread
    /// has panicked.
    pub fn append_whole(&mut self, terrain: &Terrain) -> Result<(), StoreError> {
        self.check_size(terrain)?;
        if self.is_full() {
            return Err(StoreError::Full);
        }
        self.turn_to(terrain);
        let world = terrain.world();
        let (parts, hash) = (Box::new(terrain.logged_parts()), world.hash());
        let point = SavePoint { revision: parts.revision, ..self.point };
        self.give(point, Content::Whole(parts, world.shared_ground(), hash))?;
        self.next_record = terrain.log_numbers().map_or(0, |numbers| numbers.end);
        self.skipped = None;
        Ok(())
    }

    /// Sends content that leads to a point, with the game's data since the last time.
    pub(super) fn give(&mut self, point: SavePoint, content: Content) -> Result<(), StoreError> {
        if self.is_full() {
            return Err(StoreError::Full);
        }
        let game = std::mem::take(&mut self.unsent).into_iter().collect();
        let given = Given { point: SavePoint { number: point.number + 1, ..point }, content, game };
        let (bytes, point) = (given.bytes(), given.point);
        self.shared.add_queued(bytes);
        self.send(Message::Save(given))?;
        self.point = point;
        Ok(())
    }

    /// Sends the game's data. While commits are missing, it waits for the world with them.
    pub(super) fn send_game(&mut self) -> Result<(), StoreError> {
        if self.unsent.is_empty() || self.skipped.is_some() { Ok(()) } else { self.append(Vec::new()) }
    }

    fn send(&self, message: Message) -> Result<(), StoreError> {
        let sent = self.open.as_ref().map(|(messages, _)| messages.send(message));
        sent.and_then(Result::ok).ok_or(StoreError::Ended)
    }

    /// The revision up to which the last given terrain is durable, together with the game's data at that time: it would
    /// survive a loss of power. 0 also if nothing of it is durable yet; [`durable_point`](Self::durable_point)
    /// distinguishes the two.
    pub fn durable(&self) -> u64 {
        self.durable_point().map_or(0, SavePoint::revision)
    }

    /// The last point up to which everything is durable; `None` if nothing of the last given terrain is.
    pub fn durable_point(&self) -> Option<SavePoint> {
        self.shared.durable().filter(|durable| durable.is_same_terrain(self.point))
    }

    /// Whether everything up to a point is durable.
    pub fn is_durable(&self, point: SavePoint) -> bool {
        self.shared.durable() >= Some(point)
    }

    /// The point up to which everything was taken.
    pub fn point(&self) -> SavePoint {
        self.point
    }

    /// The revision of the last record that was taken.
    pub fn revision(&self) -> u64 {
        self.point.revision
    }

    fn ask(&mut self, wait: Duration, message: impl FnOnce(Answer) -> Message) -> Result<u64, StoreError> {
        self.send_game()?;
        let (answer, answered) = channel();
        self.send(message(answer))?;
        answered.recv_timeout(wait).map_err(|error| match error {
            RecvTimeoutError::Timeout => StoreError::TimedOut,
            RecvTimeoutError::Disconnected => StoreError::Ended,
        })?
    }

    /// Waits until everything taken is durable, and returns its revision.
    ///
    /// # Errors
    /// When it can't be saved for now.
    pub fn flush(&mut self) -> Result<u64, StoreError> {
        self.flush_within(Duration::MAX)
    }

    /// Waits until everything taken is durable, but no longer than this, and returns its revision.
    ///
    /// # Errors
    /// When it can't be saved for now; [`StoreError::TimedOut`] when the disk does not answer in time.
    pub fn flush_within(&mut self, wait: Duration) -> Result<u64, StoreError> {
        self.ask(wait, Message::Flush)
    }

    /// Waits for a checkpoint of everything that was taken, so that nothing has to be replayed. Checkpoints are also
    /// made regularly, and when the store is dropped.
    ///
    /// # Errors
    /// When it can't be saved for now.
    pub fn checkpoint(&mut self) -> Result<u64, StoreError> {
        self.ask(Duration::MAX, Message::Checkpoint)
    }

    /// Asks for a checkpoint without waiting for it.
    ///
    /// # Errors
    /// [`StoreError::Ended`] when the store's thread has panicked.
    pub fn request_checkpoint(&mut self) -> Result<(), StoreError> {
        self.send_game()?;
        // Nobody waits for the answer.
        self.send(Message::Checkpoint(channel().0))
    }

    /// Makes a checkpoint, and makes the file of regions as small as possible.
    ///
    /// # Errors
    /// When it can't be saved for now.
    pub fn compact(&mut self) -> Result<u64, StoreError> {
        self.ask(Duration::MAX, Message::Compact)
    }
}
