//! A world in a folder, as a game or server holds it open.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use super::database::DATABASE;
use super::error::{StoreError, StoreTrouble};
use super::files::{Files, Folder, Lock};
use super::format::frame::WorldId;
use super::found::Contents;
use super::journal::Journal;
use super::mirror::Mirror;
use super::options::StoreOptions;
use super::progress::Work;
use super::recover::recover;
use super::region_file::RegionFile;
use super::segment::base;
use super::settle::settle;
use super::shared::{GameChange, GameData, Shared, apply_game};
use super::sources::has_world;
use super::unsaved;
use super::writer::{Answer, Message, Writer};
use crate::ground::Ground;
use crate::terrain::{CommitRecord, LogEntry, Terrain, TerrainSettings, WorldChange};

/// The file that is locked while a world is open.
const LOCK: &str = "lock";

/// Bytes of records that a terrain keeps until its store takes them.
const LOG_BYTES: usize = 256 << 20;

/// A world in a folder. Commits go to a thread of its own, which makes them durable within the
/// [loss window](StoreOptions::loss_window); whoever digs never waits for the disk.
///
/// Dropping it saves what is left, and makes a checkpoint.
pub struct Store {
    shared: Arc<Shared>,
    messages: Option<Sender<Message>>,
    thread: Option<JoinHandle<()>>,
    /// The revision that comes before the next record.
    revision: u64,
    game: GameData,
    /// What the game put since the last commits.
    unsent: Vec<GameChange>,
    world: WorldId,
    /// Held as long as the thread may write.
    _lock: Box<dyn Lock>,
}

impl fmt::Debug for Store {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Store")
            .field("world", &self.world)
            .field("revision", &self.revision)
            .field("durable", &self.durable())
            .finish_non_exhaustive()
    }
}

/// A world that was opened.
#[derive(Debug)]
pub struct Opened {
    /// Its terrain, which keeps a [log](Terrain::keep_log). Nothing is meshed, and there is no history.
    pub terrain: Terrain,
    /// Commits after the last checkpoint, which were replayed.
    pub replayed: u64,
    /// Can damaged regions be rebuilt from the log?
    pub is_log_whole: bool,
    /// What should be told.
    pub troubles: Vec<StoreTrouble>,
}

impl Store {
    /// Is there a world in this folder?
    pub fn is_in(folder: impl AsRef<Path>) -> bool {
        let files = Folder::new(folder.as_ref());
        has_world(&files).unwrap_or(false)
    }

    /// Saves a terrain as a new world in a folder, on its [level](StoreOptions::level) if that is given, and lets the terrain
    /// [log](Terrain::keep_log) its commits from now on.
    ///
    /// # Errors
    /// When there is a world already, and when the folder can't be written.
    pub fn create(
        folder: impl AsRef<Path>,
        terrain: &mut Terrain,
        options: StoreOptions,
    ) -> Result<Self, StoreError> {
        Self::create_in(Arc::new(Folder::new(folder.as_ref())), terrain, options)
    }

    /// The same in other [files](Files).
    ///
    /// # Errors
    /// When there is a world already, and when the files can't be written.
    pub fn create_in(
        files: Arc<dyn Files>,
        terrain: &mut Terrain,
        options: StoreOptions,
    ) -> Result<Self, StoreError> {
        Self::create_with_data_in(files, terrain, BTreeMap::new(), options)
    }

    /// Saves a terrain as a new world in [files](Files), together with data of the game's: both are there, or neither.
    ///
    /// # Errors
    /// When there is a world already, and when the files can't be written.
    pub fn create_with_data_in(
        files: Arc<dyn Files>,
        terrain: &mut Terrain,
        data: BTreeMap<String, Vec<u8>>,
        options: StoreOptions,
    ) -> Result<Self, StoreError> {
        files.create_folder("").map_err(StoreError::files("creating the world's folder"))?;
        let lock = take_lock(&*files)?;
        if has_world(&*files).map_err(StoreError::files("reading the world's folder"))? {
            return Err(StoreError::Exists(name(&*files)));
        }
        // That of a world which somebody removed.
        unsaved::clear(&*files).map_err(StoreError::files("creating the world"))?;
        terrain.keep_log(Some(LOG_BYTES));
        drop(terrain.take_log());
        let (parts, hash) = (terrain.parts(), terrain.world().hash());
        let revision = parts.revision;
        let world = WorldId::random();
        let ground = terrain.world().shared_ground();
        let settings = TerrainSettings { chunk_size: parts.chunk_size, voxel_size: terrain.voxel_size() };
        let terms = (parts.rules.clone(), parts.loose);
        let (grid, level) = (terrain.world().grid(), options.level.clone());
        let progress = options.progress.clone();
        let mirror = Mirror::new(grid, parts, hash, data.clone(), level);
        // A log that begins with the level, or with a pristine world, is whole. Rules are in it too, then.
        let is_whole = revision == 0 && mirror.is_as_level() && data.is_empty();
        let mut entries = Vec::new();
        if is_whole {
            entries.extend(terms.0.map(|rules| LogEntry::Rules(Some(Arc::new(rules)))));
            entries.extend(terms.1.map(|loose| LogEntry::Loose(Some(loose))));
        }
        let frame = u64::from(!is_whole);
        let shared = Arc::new(Shared::default());
        let journal = Journal::new(
            Arc::clone(&files),
            world,
            base(&ground, mirror.level.as_ref()),
            Vec::new(),
            frame + 1,
            (0, Vec::new()),
        );
        let saved = Arc::clone(&shared);
        let database = RegionFile::new();
        let mut writer =
            Writer::new(files, options, saved, world, ground, settings, mirror, journal, database, frame);
        writer.save_all()?;
        let mut store = Self::start(writer, shared, lock, world, revision, data)?;
        if !entries.is_empty() {
            let change = WorldChange::default();
            store.append(vec![CommitRecord { revision, hash, entries, change }])?;
            store.flush()?;
        }
        Work::until(progress.as_ref(), 1.0, 1).finish();
        Ok(store)
    }

    /// Opens the world in a folder over the ground that it was saved with.
    ///
    /// # Errors
    /// When there is none, when it is open already, when a newer version saved it, when the ground or the level below has changed
    /// and the options [say so](super::BaseChanged::Refuse), when the [level](StoreOptions::level) below is missing, and when
    /// nothing of it can be read. So is a world of which a file can't be read at the moment that holds something that no other file
    /// does, and one whose ground had a size in which this one has no room for what was dug. Nothing is changed then. Whatever else
    /// is wrong is told in [`Opened::troubles`].
    pub fn open(
        folder: impl AsRef<Path>,
        ground: impl Into<Arc<Ground>>,
        options: StoreOptions,
    ) -> Result<(Self, Opened), StoreError> {
        Self::open_in(Arc::new(Folder::new(folder.as_ref())), ground, options)
    }

    /// The same from other [files](Files).
    ///
    /// # Errors
    /// As for a folder.
    pub fn open_in(
        files: Arc<dyn Files>,
        ground: impl Into<Arc<Ground>>,
        options: StoreOptions,
    ) -> Result<(Self, Opened), StoreError> {
        if !has_world(&*files).map_err(StoreError::files("reading the world's folder"))? {
            return Err(StoreError::Missing(name(&*files)));
        }
        let lock = take_lock(&*files)?;
        let ground = ground.into();
        let progress = options.progress.clone();
        let mut contents = Contents::read(&*files, progress.as_ref())?;
        let recovered = recover(&contents, &ground, &options)?;
        if !options.salvage {
            contents.refuse_unread(recovered.frame, recovered.is_log_whole)?;
        }
        let settled = settle(&*files, &contents, &recovered);
        let (is_log_whole, replayed, is_new) = (
            recovered.is_log_whole,
            recovered.replayed,
            recovered.is_new || settled.is_unfinished || contents.damaged.is_some(),
        );
        let (settings, findings) = (recovered.settings(), recovered.findings.clone());
        let (mut terrain, mirror) = (recovered.terrain, recovered.mirror);
        let (revision, game) = (mirror.revision, mirror.game.clone());
        let shared = Arc::new(Shared::default());
        let world = contents.world;
        let database = match &contents.damaged {
            None => RegionFile::new(),
            Some(_) => RegionFile::damaged(contents.choose_checkpoint().map_or(0, |own| own.frame)),
        };
        let journal = Journal::new(
            Arc::clone(&files),
            world,
            base(&ground, mirror.level.as_ref()),
            settled.segments,
            settled.next_frame,
            (0, Vec::new()),
        );
        let mut writer = Writer::new(
            files,
            options,
            Arc::clone(&shared),
            world,
            ground,
            settings,
            mirror,
            journal,
            database,
            recovered.checkpoint,
        );
        let mut failures = Vec::new();
        if is_new {
            writer.save_all_or_later();
            failures = shared.take_troubles();
        } else {
            shared.set_durable(revision);
        }
        // Where it could not be replaced yet, the damaged file is still in its place.
        let is_in_place = contents.has_database && !failures.is_empty();
        let kept = writer.database.kept().or(is_in_place.then_some(DATABASE));
        let mut troubles = findings.troubles(&settled.copies, contents.damaged.as_deref(), kept);
        troubles.extend(settled.troubles);
        troubles.extend(failures);
        terrain.keep_log(Some(LOG_BYTES));
        drop(terrain.take_log());
        let store = Self::start(writer, shared, lock, world, revision, game)?;
        Work::until(progress.as_ref(), 1.0, 1).finish();
        Ok((store, Opened { terrain, replayed, is_log_whole, troubles }))
    }

    fn start(
        mut writer: Writer,
        shared: Arc<Shared>,
        lock: Box<dyn Lock>,
        world: WorldId,
        revision: u64,
        game: GameData,
    ) -> Result<Self, StoreError> {
        writer.begin_segment();
        let (messages, inbox): (Sender<Message>, Receiver<Message>) = channel();
        let thread = std::thread::Builder::new().name("burrow store".into());
        let thread = thread.spawn(move || writer.run(&inbox));
        let thread = thread.map_err(StoreError::files("starting the store's thread"))?;
        let unsent = Vec::new();
        let (messages, thread) = (Some(messages), Some(thread));
        Ok(Self { shared, messages, thread, revision, game, unsent, world, _lock: lock })
    }

    /// Takes the records of a terrain's commits, so that they become durable. Call it as often as you like: it takes
    /// microseconds, and does nothing where nothing was committed.
    ///
    /// # Errors
    /// [`StoreError::Ended`] when the store's thread has panicked.
    pub fn follow(&mut self, terrain: &mut Terrain) -> Result<(), StoreError> {
        let now = terrain.world().revision();
        if !terrain.has_log() && self.unsent.is_empty() && now == self.revision {
            return Ok(());
        }
        let records = terrain.take_log();
        let last = records.last().map_or(self.revision, |record| record.revision);
        if last == now && self.continues(&records) {
            return self.append(records);
        }
        // Records were dropped, or never kept.
        terrain.keep_log(Some(LOG_BYTES));
        self.append_whole(terrain)
    }

    /// Does every record follow the one before?
    fn continues(&self, records: &[CommitRecord]) -> bool {
        let mut at = self.revision;
        records.iter().all(|record| {
            let follows = record.revision == at.saturating_add(record.is_commit().into());
            at = record.revision;
            follows
        })
    }

    /// Takes records of commits, so that they become durable, together with all that was [put](Self::put) since the last ones.
    ///
    /// # Errors
    /// [`StoreError::Gap`] when they do not follow those that were taken before, and none is taken then;
    /// [`StoreError::Ended`] when the store's thread has panicked.
    pub fn append(&mut self, records: Vec<CommitRecord>) -> Result<(), StoreError> {
        if !self.continues(&records) {
            let found = records.first().map_or(0, |record| record.revision);
            return Err(StoreError::Gap { at: self.revision, found });
        }
        self.revision = records.last().map_or(self.revision, |record| record.revision);
        let game = std::mem::take(&mut self.unsent);
        self.send(Message::Commits(records, game))
    }

    /// Takes all of a terrain, where records are missing. It is durable with the next checkpoint, which is made at once.
    ///
    /// # Errors
    /// [`StoreError::Ended`] when the store's thread has panicked.
    pub fn append_whole(&mut self, terrain: &Terrain) -> Result<(), StoreError> {
        let (parts, hash) = (Box::new(terrain.parts()), terrain.world().hash());
        self.revision = parts.revision;
        let game = std::mem::take(&mut self.unsent);
        self.send(Message::Whole(parts, terrain.world().shared_ground(), hash, game))
    }

    fn send(&self, message: Message) -> Result<(), StoreError> {
        let sent = self.messages.as_ref().map(|messages| messages.send(message));
        sent.and_then(Result::ok).ok_or(StoreError::Ended)
    }

    /// Everything up to this revision would survive a loss of power, what the game put with it included.
    pub fn durable(&self) -> u64 {
        self.shared.durable()
    }

    /// The revision of the last record that was taken.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    fn ask(&mut self, message: impl FnOnce(Answer) -> Message) -> Result<u64, StoreError> {
        if !self.unsent.is_empty() {
            self.append(Vec::new())?;
        }
        let (answer, answered) = channel();
        self.send(message(answer))?;
        answered.recv().map_err(|_| StoreError::Ended)?
    }

    /// Waits until all that was taken is durable, and returns its revision.
    ///
    /// # Errors
    /// When it can't be saved for now.
    pub fn flush(&mut self) -> Result<u64, StoreError> {
        self.ask(Message::Flush)
    }

    /// Waits until a checkpoint is made of all that was taken, so that nothing has to be replayed. It is made by itself now and
    /// then, and when the store is dropped.
    ///
    /// # Errors
    /// When it can't be saved for now.
    pub fn checkpoint(&mut self) -> Result<u64, StoreError> {
        self.ask(Message::Checkpoint)
    }

    /// Asks for a checkpoint without waiting for it.
    ///
    /// # Errors
    /// [`StoreError::Ended`] when the store's thread has panicked.
    pub fn request_checkpoint(&mut self) -> Result<(), StoreError> {
        if !self.unsent.is_empty() {
            self.append(Vec::new())?;
        }
        // Nobody waits for the answer.
        self.send(Message::Checkpoint(channel().0))
    }

    /// The same, and makes the file of regions as small as it can be.
    ///
    /// # Errors
    /// When it can't be saved for now.
    pub fn compact(&mut self) -> Result<u64, StoreError> {
        self.ask(Message::Compact)
    }

    /// Keeps data of the game's under a key, say an inventory or the time of day. It becomes durable together with the commits
    /// of the next [`append`](Self::append) or [`follow`](Self::follow): after a crash both are there, or neither.
    pub fn put(&mut self, key: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.change_game((key.into(), Some(bytes.into())));
    }

    /// Removes data of the game's.
    pub fn remove(&mut self, key: impl Into<String>) {
        self.change_game((key.into(), None));
    }

    fn change_game(&mut self, change: GameChange) {
        apply_game(&mut self.game, std::slice::from_ref(&change));
        self.unsent.push(change);
    }

    /// Data of the game's.
    pub fn get(&self, key: &str) -> Option<&[u8]> {
        self.game.get(key).map(Vec::as_slice)
    }

    /// All data of the game's, by key.
    pub fn game_data(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.game
    }

    /// What happened since the last call that a player or an operator should be told of; if nobody asks, the latest 256 are kept.
    pub fn take_troubles(&self) -> Vec<StoreTrouble> {
        self.shared.take_troubles()
    }

    /// The world's name, which no other world has.
    pub fn world_id(&self) -> WorldId {
        self.world
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        if !self.unsent.is_empty() {
            drop(self.append(Vec::new()));
        }
        self.messages = None;
        if let Some(thread) = self.thread.take() {
            // If it panicked, what is durable stays so.
            drop(thread.join());
        }
    }
}

pub(super) fn take_lock(files: &dyn Files) -> Result<Box<dyn Lock>, StoreError> {
    let lock = files.lock(LOCK).map_err(StoreError::files("locking the world"))?;
    lock.ok_or_else(|| StoreError::Locked(name(files)))
}

/// How messages name the world.
pub(super) fn name(files: &dyn Files) -> String {
    files.name()
}
