//! The store: a saved world that a game or server has open.
//!
//! | file | what it holds |
//! | --- | --- |
//! | `open_store` | creating, opening and closing a world |
//! | `saving` | commits for the store's thread, and what of them is durable |
//! | `game_data` | data of the game, saved with the commits |

mod game_data;
mod saving;

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use crate::format::frame::WorldId;
use crate::ground::Ground;
use crate::store::checkpoints::Mirror;
use crate::store::error::{StoreError, StoreWarning, WorldSize};
use crate::store::files::{Files, Folder, Lock};
use crate::store::journal::unsaved;
use crate::store::options::StoreOptions;
use crate::store::progress::{Progress, Work};
use crate::store::recovery::{Contents, recover, settle};
use crate::store::regions::RegionFile;
use crate::store::regions::database::DATABASE;
use crate::store::regions::sources::has_world;
use crate::store::store_thread::{
    ClosingStore, Content, GameData, Message, SavePoint, Shared, StoreThread, Writer,
};
use crate::terrain::{CommitRecord, EditSettings, Terrain, TerrainSettings, Version};

/// The file that is locked while a world is open.
const LOCK: &str = "lock";

/// Bytes of records that a terrain keeps until its store takes them.
const LOG_BYTES: usize = 256 << 20;

/// Bytes that may wait for the thread, regardless of the options.
const LEAST_QUEUED: usize = 1 << 20;

/// A world in a folder. Commits are sent to a separate thread, which makes them durable within the
/// [loss window](StoreOptions::loss_window); the caller never waits for the disk.
///
/// Dropping it saves the remaining commits, makes a checkpoint, and waits for both, [for a limited
/// time](StoreOptions::close_timeout). [`close`](Self::close) does so without waiting.
pub struct Store {
    shared: Arc<Shared>,
    /// `None` once it is closed.
    open: Option<(Sender<Message>, StoreThread)>,
    /// The point that the last given commits lead to.
    point: SavePoint,
    /// The version of the last given terrain.
    version: Version,
    size: WorldSize,
    /// The number of the next record of its log.
    next_record: u64,
    /// The hash of its ground.
    ground: u64,
    /// The revision up to which commits were skipped because too much waited; the whole world is saved next.
    skipped: Option<u64>,
    game: GameData,
    /// The game's data since the last commits, the last value of each key.
    unsent: BTreeMap<String, Option<Vec<u8>>>,
    world: WorldId,
    /// Bytes that may wait for the thread.
    max_queued: usize,
    close_timeout: Duration,
}

impl fmt::Debug for Store {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Store")
            .field("world", &self.world)
            .field("revision", &self.revision())
            .field("durable", &self.durable())
            .finish_non_exhaustive()
    }
}

/// A world that was opened.
#[derive(Debug)]
pub struct Opened {
    /// The store's terrain, which keeps a [log](Terrain::keep_log). Nothing is meshed, and there is no history.
    pub terrain: Terrain,
    /// Commits after the last checkpoint, which were replayed.
    pub replayed: u64,
    /// Whether damaged regions can be rebuilt from the log.
    pub is_log_whole: bool,
    /// Warnings to show to a player or an operator.
    pub warnings: Vec<StoreWarning>,
}

impl Store {
    /// Whether there is a world in this folder.
    pub fn is_in(folder: impl AsRef<Path>) -> bool {
        let files = Folder::new(folder.as_ref());
        has_world(&files).unwrap_or(false)
    }

    /// Saves a terrain as a new world in a folder, on its [level](StoreOptions::level) if that is given, and makes the
    /// terrain [log](Terrain::keep_log) its later commits.
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

    /// Creates a world in other [files](Files).
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

    /// Saves a terrain as a new world in [files](Files), together with the game's data: both are created, or neither.
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
            return Err(StoreError::Exists(files.name()));
        }
        // The marker of a world that was removed.
        unsaved::clear(&*files).map_err(StoreError::files("creating the world"))?;
        terrain.keep_log(Some(LOG_BYTES));
        drop(terrain.take_log());
        let (parts, hash) = (terrain.logged_parts(), terrain.world().hash());
        let revision = parts.revision;
        let world = WorldId::random();
        let ground = terrain.world().shared_ground();
        let settings = TerrainSettings { chunk_size: parts.chunk_size, voxel_size: terrain.voxel_size() };
        let edit_settings = parts.edit_settings.clone();
        let (grid, level) = (terrain.world().grid(), options.level.clone());
        let progress = options.progress.clone();
        let mirror = Mirror::new(grid, parts, hash, data.clone(), level);
        // A log that begins with the level, or with a pristine world, is whole. Rules are in it too, then.
        let is_whole = revision == 0 && mirror.is_as_level() && data.is_empty();
        let mut orders = Vec::new();
        if is_whole {
            orders.extend(edit_settings.orders_after(Some(&EditSettings::default())));
        }
        let frame = u64::from(!is_whole);
        let (journal, database) = ((Vec::new(), frame + 1), RegionFile::new());
        let mut writer =
            Writer::new(files, options, world, ground, settings, mirror, journal, database, frame, lock);
        writer.save_all()?;
        let mut store = Self::start(writer, terrain)?;
        if !orders.is_empty() {
            let record = CommitRecord { number: 0, revision, hash, orders, change: Arc::default() };
            store.give(store.point, Content::Commits(vec![record]))?;
            store.flush()?;
        }
        Work::until(progress.as_ref(), 1.0, 1).finish();
        Ok(store)
    }

    /// Opens the world in a folder over the ground that it was saved with.
    ///
    /// # Errors
    /// When there is none, when it is open already, when a newer version saved it, when the ground or the level below
    /// has changed and the options [say so](super::BaseChanged::Refuse), when the [level](StoreOptions::level) below is
    /// missing, and when nothing of it can be read. Also when a file that can't be read at the moment holds something
    /// that no other file has, and when this ground has no room for edits that were made on a ground of another size.
    /// Nothing is changed then. All other problems are reported in [`Opened::warnings`].
    pub fn open(
        folder: impl AsRef<Path>,
        ground: impl Into<Arc<Ground>>,
        options: StoreOptions,
    ) -> Result<(Self, Opened), StoreError> {
        Self::open_in(Arc::new(Folder::new(folder.as_ref())), ground, options)
    }

    /// Opens a world in other [files](Files).
    ///
    /// # Errors
    /// As for a folder.
    pub fn open_in(
        files: Arc<dyn Files>,
        ground: impl Into<Arc<Ground>>,
        options: StoreOptions,
    ) -> Result<(Self, Opened), StoreError> {
        let (ground, progress) = (ground.into(), options.progress.clone());
        let (lock, mut contents) = read(&*files, progress.as_ref())?;
        let recovered = recover(&contents, &ground, &options)?;
        if !options.salvage {
            contents.refuse_unread(
                recovered.frame,
                recovered.is_log_whole,
                recovered.findings.has_lost_regions(),
            )?;
        }
        let settled = settle(&*files, &contents, &recovered);
        let (is_log_whole, replayed, is_new) = (
            recovered.is_log_whole,
            recovered.replayed,
            recovered.is_new || settled.is_unfinished || contents.damaged.is_some(),
        );
        let (settings, findings) = (recovered.settings(), recovered.findings.clone());
        let (mut terrain, mirror) = (recovered.terrain, recovered.mirror);
        let database = match &contents.damaged {
            None => RegionFile::new(),
            Some(_) => RegionFile::damaged(contents.choose_checkpoint().map_or(0, |own| own.frame)),
        };
        let (journal, frame) = ((settled.segments, settled.next_frame), recovered.checkpoint);
        let mut writer = Writer::new(
            files,
            options,
            contents.world,
            ground,
            settings,
            mirror,
            journal,
            database,
            frame,
            lock,
        );
        if settled.is_unfinished {
            // Frames that are no part of the world may still be there.
            writer.journal.keep_content(contents.names(..));
        }
        let mut failures = Vec::new();
        if is_new {
            writer.save_all_or_later();
            failures = writer.shared.take_warnings();
        } else {
            writer.shared.set_durable(writer.point);
        }
        // Where it could not be replaced yet, the damaged file is still in its place.
        let is_in_place = contents.has_database && !failures.is_empty();
        let kept = writer.database.kept().or(is_in_place.then_some(DATABASE));
        let mut warnings = findings.warnings(&settled.copies, contents.damaged.as_deref(), kept);
        warnings.extend(settled.warnings);
        warnings.extend(failures);
        terrain.keep_log(Some(LOG_BYTES));
        drop(terrain.take_log());
        let store = Self::start(writer, &terrain)?;
        Work::until(progress.as_ref(), 1.0, 1).finish();
        Ok((store, Opened { terrain, replayed, is_log_whole, warnings }))
    }

    fn start(mut writer: Writer, terrain: &Terrain) -> Result<Self, StoreError> {
        writer.begin_segment();
        let (shared, world) = (Arc::clone(&writer.shared), writer.world);
        let StoreOptions { waiting_bytes, close_timeout, .. } = writer.options;
        let (point, game) = (writer.point, writer.mirror.game.clone());
        let (messages, inbox): (Sender<Message>, Receiver<Message>) = channel();
        let thread = StoreThread::start(Arc::clone(&shared), move || writer.run(&inbox))?;
        Ok(Self {
            shared,
            open: Some((messages, thread)),
            point,
            version: terrain.world().version(),
            next_record: terrain.log_numbers().map_or(0, |numbers| numbers.end),
            size: WorldSize::of(terrain),
            ground: terrain.world().ground().hash(),
            skipped: None,
            game,
            unsent: BTreeMap::new(),
            world,
            max_queued: waiting_bytes.max(LEAST_QUEUED),
            close_timeout,
        })
    }

    /// Warnings since the last call, to show to a player or an operator. If they are not taken, the latest 256 are
    /// kept.
    pub fn take_warnings(&self) -> Vec<StoreWarning> {
        self.shared.take_warnings()
    }

    /// The unique id of the world.
    pub fn world_id(&self) -> WorldId {
        self.world
    }

    /// Saves the remaining commits and makes a last checkpoint, on the store's thread.
    pub fn close(mut self) -> ClosingStore {
        self.begin_closing()
    }

    fn begin_closing(&mut self) -> ClosingStore {
        // If it can't be taken, the outcome says that it is not saved.
        drop(self.send_game());
        let is_given = self.unsent.is_empty() && self.skipped.is_none();
        let thread = self.open.take().map(|(_, thread)| thread);
        ClosingStore::new(Arc::clone(&self.shared), thread, self.point, is_given)
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        if self.open.is_some() {
            // If the thread panicked, durable commits stay durable.
            drop(self.begin_closing().wait(self.close_timeout));
        }
    }
}

/// Locks a world, and reads its files.
pub(super) fn read(
    files: &dyn Files,
    progress: Option<&Progress>,
) -> Result<(Box<dyn Lock>, Contents), StoreError> {
    if !has_world(files).map_err(StoreError::files("reading the world's folder"))? {
        return Err(StoreError::Missing(files.name()));
    }
    let lock = take_lock(files)?;
    Ok((lock, Contents::read(files, progress)?))
}

fn take_lock(files: &dyn Files) -> Result<Box<dyn Lock>, StoreError> {
    let lock = files.lock(LOCK).map_err(StoreError::files("locking the world"))?;
    lock.ok_or_else(|| StoreError::Locked(files.name()))
}
