//! Reads a world from its folder, on another thread.

use std::sync::Arc;
use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::components::{LevelId, SavedWorld};
use super::level::BurrowLevel;
use crate::format::Level;
use crate::store::{BaseLevel, Folder, Progress, Store, StoreError, StoreOptions, StoreWarning};
use crate::terrain::{self, EditSettings, Terrain, TerrainSettings, Version, WorldParts};
use crate::threads::{ThreadTask, Threads, free_later};

/// How long to wait for a world that is open elsewhere: longer than an exiting server takes to close it.
const LOCK_WAIT: Duration = Duration::from_secs(15);
/// The interval of attempts to open it, and the time after which a warning is reported.
const LOCK_TRY: Duration = Duration::from_millis(50);
const REPORT_LOCK_AFTER: Duration = Duration::from_secs(2);

/// Present while the world of a [`SavedWorld`] is being read; the plugin inserts and removes it.
#[derive(Component)]
pub struct OpeningWorld {
    pub(super) reader: Arc<WorldReader>,
    /// `None` between two tries.
    task: Option<ThreadTask<Result<Found, StoreError>>>,
    /// The version of the terrain that the world replaces.
    pub(super) version: Version,
    since: Instant,
    tried: Instant,
    reported: bool,
}

impl OpeningWorld {
    /// The progress of reading, 0 to 1, for a progress bar.
    pub fn progress(&self) -> f32 {
        self.reader.progress.share()
    }

    pub(super) fn new(reader: WorldReader, version: Version) -> Self {
        let now = Instant::now();
        let (reader, task) = (Arc::new(reader), None);
        let mut opening = Self { reader, task, version, since: now, tried: now, reported: false };
        opening.begin();
        opening
    }

    fn begin(&mut self) {
        let reader = Arc::clone(&self.reader);
        self.tried = Instant::now();
        self.task = Some(ThreadTask::start(Threads::Background, move || reader.try_read()));
    }

    /// The world once it is read, or the error. A world that is open elsewhere is tried again, without a waiting
    /// thread.
    pub(super) fn poll(&mut self) -> Option<Result<Found, StoreError>> {
        let Some(task) = &mut self.task else {
            if self.tried.elapsed() >= LOCK_TRY {
                self.begin();
            }
            return None;
        };
        let panicked = |_| Err(StoreError::Unreadable("reading it has panicked".into()));
        let outcome = task.check()?.unwrap_or_else(panicked);
        if matches!(outcome, Err(StoreError::Locked(_))) && self.since.elapsed() < LOCK_WAIT {
            self.task = None;
            return None;
        }
        Some(outcome)
    }

    /// Returns `true` once, when it should be reported that another process has the world open.
    pub(super) fn reports_lock(&mut self) -> bool {
        let is_late = self.task.is_none() && self.since.elapsed() >= REPORT_LOCK_AFTER;
        is_late && !std::mem::replace(&mut self.reported, true)
    }
}

/// A world that is no longer wanted is closed and freed on another thread.
impl Drop for OpeningWorld {
    fn drop(&mut self) {
        if let Some(Ok(Ok(found))) = self.task.take().and_then(|mut task| task.check()) {
            let ReadWorld { store, terrain, .. } = found.world();
            drop(store.close());
            free_later(terrain);
        }
    }
}

/// A world that was read or made.
pub(crate) struct ReadWorld {
    pub store: Store,
    pub terrain: Terrain,
    pub warnings: Vec<StoreWarning>,
}

/// The result of reading.
pub(super) enum Found {
    /// An existing world.
    Old(ReadWorld),
    /// A new world, created from the terrain.
    New(ReadWorld),
}

impl Found {
    pub fn world(self) -> ReadWorld {
        match self {
            Self::Old(world) | Self::New(world) => world,
        }
    }
}

/// Reads a world, on another thread.
pub(crate) struct WorldReader {
    pub(super) saved: SavedWorld,
    /// The absolute folder: the process may change its working directory before it is read.
    folder: Folder,
    level: Option<(BurrowLevel, String)>,
    pub(super) id: LevelId,
    /// The content of a world that does not exist yet.
    world: Arc<terrain::World>,
    edit_settings: EditSettings,
    /// The number of the next record in the log of the terrain that this content is of.
    pub(super) next_record: u64,
    pub progress: Progress,
}

impl WorldReader {
    /// A reader for this saved world. If there is none yet, it is created from the terrain, on the level if one is
    /// given. The terrain's rules and loose settings also hold in a world that exists.
    pub fn new(saved: &SavedWorld, terrain: &Terrain, level: Option<(BurrowLevel, String)>) -> Self {
        let (world, edit_settings) = (terrain.snapshot(), terrain.edit_settings().clone());
        let next_record = terrain.log_numbers().map_or(0, |numbers| numbers.end);
        let (saved, folder, id) = (saved.clone(), Folder::new(&saved.path), LevelId::of(terrain));
        let progress = Progress::default();
        Self { saved, folder, level, id, world, edit_settings, next_record, progress }
    }

    /// Reads the world, or creates it. Waits while another process has it open.
    #[cfg(feature = "replicon")]
    pub fn read(self) -> Result<ReadWorld, StoreError> {
        let start = Instant::now();
        loop {
            match self.try_read() {
                Err(StoreError::Locked(_)) if start.elapsed() < LOCK_WAIT => std::thread::sleep(LOCK_TRY),
                other => return other.map(Found::world),
            }
        }
    }

    /// Reads the world, or creates one, unless it is open elsewhere.
    fn try_read(&self) -> Result<Found, StoreError> {
        let Self { saved, folder, level, id, world, edit_settings, progress, .. } = self;
        let ground = &world.shared_ground();
        // An unreadable level was reported when the terrain was built from it.
        let level = level.as_ref();
        let level = level
            .and_then(|(level, path)| Some(BaseLevel::new(Level::from_files(&level.0, ground).ok()?, path)));
        let options = StoreOptions { level, progress: Some(progress.clone()), ..saved.options() };
        if !Store::is_in(folder.path()) {
            let settings = TerrainSettings { chunk_size: id.chunk_size, voxel_size: id.voxel_size };
            let parts = WorldParts::of(world, edit_settings.clone());
            let mut terrain = Terrain::restore(Arc::clone(ground), &settings, parts)?;
            match Store::create(folder.path(), &mut terrain, options.clone()) {
                // Another process created it meanwhile.
                Err(StoreError::Exists(_)) => {}
                created => {
                    let (store, warnings) = (created?, Vec::new());
                    return Ok(Found::New(ReadWorld { store, terrain, warnings }));
                }
            }
        }
        let (store, opened) = Store::open(folder.path(), Arc::clone(ground), options)?;
        let (mut terrain, warnings) = (opened.terrain, opened.warnings);
        if let Err(why) = terrain.adopt_settings(edit_settings) {
            error!("the terrain's rules could not be applied to its saved world: {why}");
        }
        Ok(Found::Old(ReadWorld { store, terrain, warnings }))
    }
}
