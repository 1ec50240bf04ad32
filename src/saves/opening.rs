//! Reads a world from its folder while its terrain is held, and then replaces the terrain by it.

use std::sync::Arc;
use std::time::Duration;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::closing::{ClosingWorlds, detach};
use super::components::{SavedWorld, WorldStore};
use super::level::{BurrowLevel, FindLevel, MakingLevel, StartLevel, Waiting};
use super::messages::{ClosedBecause, StoreTroubleFound, WorldOpened};
use crate::ground::Ground;
use crate::plugin::{Held, ThreadTask, Threads, free_later};
use crate::store::{BaseLevel, Progress, Store, StoreError, StoreOptions, StoreTrouble, read_level};
use crate::terrain::{Terrain, TerrainSettings, Version, WorldParts};

/// How long to wait for a world that is open elsewhere: longer than an exiting server takes to close it.
const LOCK_WAIT: Duration = Duration::from_secs(15);
/// The interval of attempts to open it, and the time after which a trouble is reported.
const LOCK_TRY: Duration = Duration::from_millis(50);
const LOCK_TOLD: Duration = Duration::from_secs(2);

/// Bytes of commits that wait at most until the store takes them, which it does each frame.
const LOG_BYTES: usize = 64 << 20;

/// A world whose reading has not started.
#[derive(Component)]
pub(super) struct Unopened;

/// The world of a [`SavedWorld`] is being read; the plugin inserts it and takes it away.
#[derive(Component)]
pub struct OpeningWorld {
    reader: Arc<WorldReader>,
    /// `None` between two tries.
    task: Option<ThreadTask<Result<Found, StoreError>>>,
    /// The version of the terrain that the world replaces.
    version: Version,
    since: Instant,
    tried: Instant,
    told: bool,
}

impl OpeningWorld {
    /// The progress of reading, 0 to 1, for a progress bar.
    pub fn progress(&self) -> f32 {
        self.reader.progress.share()
    }

    fn new(reader: WorldReader, version: Version) -> Self {
        let now = Instant::now();
        let (reader, task) = (Arc::new(reader), None);
        let mut opening = Self { reader, task, version, since: now, tried: now, told: false };
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
    fn poll(&mut self) -> Option<Result<Found, StoreError>> {
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

    /// Reads again for a terrain that took the place of the one that it is read for. Another level is not saved in that world.
    fn read_anew(&self, terrain: &Terrain, entity: Entity, commands: &mut Commands) {
        if self.reader.is_for(terrain) {
            commands.entity(entity).try_remove::<Self>().try_insert(Unopened);
        } else {
            detach(commands, entity, ClosedBecause::OtherTerrain);
        }
    }

    /// Whether to report now that another process has the world open.
    fn tells_of_lock(&mut self) -> bool {
        let is_late = self.task.is_none() && self.since.elapsed() >= LOCK_TOLD;
        is_late && !std::mem::replace(&mut self.told, true)
    }
}

/// A world that was read or made.
pub(crate) struct ReadWorld {
    pub store: Store,
    pub terrain: Terrain,
    pub troubles: Vec<StoreTrouble>,
}

/// The result of reading.
enum Found {
    /// An existing world.
    Old(ReadWorld),
    /// There was none, and it was made of the terrain.
    New(ReadWorld),
}

impl Found {
    fn world(self) -> ReadWorld {
        match self {
            Self::Old(world) | Self::New(world) => world,
        }
    }
}

/// Reads a world, on another thread.
pub(crate) struct WorldReader {
    saved: SavedWorld,
    level: Option<(BurrowLevel, String)>,
    ground: Arc<Ground>,
    settings: TerrainSettings,
    /// The parts of a new world, if there is none yet.
    parts: WorldParts,
    pub progress: Progress,
}

impl WorldReader {
    /// Of this world, with the ground and the sizes of this terrain; a new world begins as the terrain is, on a level and its path if
    /// there is one. Rules and settings of loose pieces that the terrain has hold for a world that was saved as well.
    pub fn new(saved: &SavedWorld, terrain: &Terrain, level: Option<(BurrowLevel, String)>) -> Self {
        let (ground, parts) = (terrain.world().shared_ground(), terrain.parts());
        let settings = TerrainSettings { chunk_size: parts.chunk_size, voxel_size: terrain.voxel_size() };
        Self { saved: saved.clone(), level, ground, settings, parts, progress: Progress::default() }
    }

    /// Whether this terrain has the ground and the size that the world is read for.
    fn is_for(&self, terrain: &Terrain) -> bool {
        let (world, settings) = (terrain.world(), &self.settings);
        world.ground().hash() == self.ground.hash()
            && (world.ground().width(), world.ground().depth()) == (self.ground.width(), self.ground.depth())
            && world.grid().size().cast_unsigned() == settings.chunk_size
            && terrain.voxel_size() == settings.voxel_size
    }

    /// Reads the world, or creates it. Waits while another process has it open.
    pub fn read(self) -> Result<ReadWorld, StoreError> {
        let start = Instant::now();
        loop {
            match self.try_read() {
                Err(StoreError::Locked(_)) if start.elapsed() < LOCK_WAIT => std::thread::sleep(LOCK_TRY),
                other => return other.map(Found::world),
            }
        }
    }

    /// Reads the world, or makes one, unless somebody has it open.
    fn try_read(&self) -> Result<Found, StoreError> {
        let Self { saved, level, ground, settings, parts, progress } = self;
        // A level that can't be read was reported when the terrain was made from it.
        let level = level.as_ref();
        let level =
            level.and_then(|(level, path)| Some(BaseLevel::new(read_level(&level.0, ground).ok()?, path)));
        let options = StoreOptions { level, progress: Some(progress.clone()), ..saved.options() };
        if !Store::is_in(&saved.path) {
            let mut terrain = Terrain::restore(Arc::clone(ground), settings, parts.clone())?;
            match Store::create(&saved.path, &mut terrain, options.clone()) {
                // Somebody made it in between.
                Err(StoreError::Exists(_)) => {}
                created => {
                    let (store, troubles) = (created?, Vec::new());
                    return Ok(Found::New(ReadWorld { store, terrain, troubles }));
                }
            }
        }
        let (store, opened) = Store::open(&saved.path, Arc::clone(ground), options)?;
        let (mut terrain, troubles) = (opened.terrain, opened.troubles);
        // A new version of the game may have other rules than the one that saved the world.
        if let Some(rules) = parts.rules.clone().filter(|rules| terrain.rules() != Some(rules))
            && let Err(why) = terrain.set_rules(rules)
        {
            error!("the rules of the terrain do not hold for its saved world: {why}");
        }
        if parts.loose.is_some() && parts.loose.as_ref() != terrain.loose() {
            terrain.set_loose(parts.loose);
        }
        Ok(Found::Old(ReadWorld { store, terrain, troubles }))
    }
}

/// Holds a terrain until its world is read. Running edits are applied to the world that was read.
pub(super) fn hold(
    new: On<Insert, SavedWorld>,
    mut commands: Commands,
    mut terrains: Query<&mut Terrain, Allow<Disabled>>,
) {
    if let Ok(mut terrain) = terrains.get_mut(new.entity) {
        terrain.abandon();
    }
    commands.entity(new.entity).try_remove::<OpeningWorld>().try_insert((Held, Unopened));
}

/// A world is no longer wanted.
pub(super) fn give_up(gone: On<Remove, SavedWorld>, mut commands: Commands) {
    commands.entity(gone.entity).try_remove::<(OpeningWorld, Unopened)>();
    release(&mut commands, gone.entity);
}

/// Removes [`Held`] from a terrain, unless its level or its saved world is still missing. Nothing else in this module
/// removes it.
pub(super) fn release(commands: &mut Commands, entity: Entity) {
    commands.queue(move |world: &mut World| {
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        let waits = entity.contains::<Unopened>()
            || entity.contains::<OpeningWorld>()
            || entity.contains::<Waiting>()
            || entity.contains::<MakingLevel>();
        if !waits {
            entity.remove::<Held>();
        }
    });
}

/// Starts to read again if another terrain replaces the one that a world was read for.
pub(super) fn read_anew(
    new: On<Insert, Terrain>,
    opening: Query<(&OpeningWorld, &Terrain), Allow<Disabled>>,
    mut commands: Commands,
) {
    if let Ok((opening, terrain)) = opening.get(new.entity) {
        opening.read_anew(terrain, new.entity, &mut commands);
    }
}

/// Stops reading for a removed terrain.
pub(super) fn wait_for_terrain(
    gone: On<Remove, Terrain>,
    opening: Query<(), (With<OpeningWorld>, Allow<Disabled>)>,
    mut commands: Commands,
) {
    if opening.contains(gone.entity) {
        commands.entity(gone.entity).try_remove::<OpeningWorld>().try_insert(Unopened);
    }
}

/// Starts to read the worlds of new terrains.
pub(super) fn start_opening(
    mut commands: Commands,
    levels: FindLevel,
    mut worlds: Query<
        (Entity, &SavedWorld, &mut Terrain, Option<&StartLevel>),
        (With<Unopened>, Without<Waiting>, Without<MakingLevel>, Allow<Disabled>),
    >,
) {
    for (entity, saved, mut terrain, start) in &mut worlds {
        let level = match start.map(|start| levels.find(start)) {
            None | Some(Err(_)) => None,
            Some(Ok(None)) => continue,
            Some(Ok(Some(level))) => Some((level.clone(), levels.path_of(start))),
        };
        // For the game this is no change. A new world is made of the terrain as it is now, and what is committed from now on follows.
        let terrain = terrain.bypass_change_detection();
        terrain.abandon();
        terrain.keep_log(Some(LOG_BYTES));
        drop(terrain.take_log());
        let opening = OpeningWorld::new(WorldReader::new(saved, terrain, level), terrain.world().version());
        commands.entity(entity).try_remove::<Unopened>().try_insert(opening);
    }
}

/// Replaces terrains by the worlds that were read.
pub(super) fn finish_opening(
    mut commands: Commands,
    mut worlds: Query<(Entity, &SavedWorld, &mut Terrain, &mut OpeningWorld), Allow<Disabled>>,
    mut closing: ResMut<ClosingWorlds>,
    mut opened: MessageWriter<WorldOpened>,
    mut troubles: MessageWriter<StoreTroubleFound>,
) {
    for (entity, saved, mut terrain, mut opening) in &mut worlds {
        let mut tell = |trouble| {
            warn!("the world in {}: {trouble}", saved.path.display());
            troubles.write(StoreTroubleFound { terrain: entity, trouble });
        };
        if opening.tells_of_lock() {
            tell(StoreTrouble::WaitsForLock);
        }
        let Some(outcome) = opening.poll() else { continue };
        let now = terrain.world().version();
        if !now.is_same_world(opening.version) {
            // The game assigned another one meanwhile.
            if let Ok(read) = outcome {
                closing.close(entity, saved.path.clone(), ClosedBecause::Removed, read.world().store);
            }
            opening.read_anew(&terrain, entity, &mut commands);
            continue;
        }
        commands.entity(entity).try_remove::<OpeningWorld>();
        let outcome = outcome.map(|found| {
            let store = match found {
                // The terrain and its history stay as they are.
                Found::New(ReadWorld { mut store, terrain: copy, .. }) => {
                    free_later(copy);
                    store.adopt(&terrain);
                    store
                }
                Found::Old(ReadWorld { store, terrain: mut read, troubles }) => {
                    troubles.into_iter().for_each(&mut tell);
                    if now != opening.version {
                        warn!("what the game did to {entity} while its world was read is not in that");
                    }
                    read.take_over(&mut terrain);
                    free_later(std::mem::replace(&mut *terrain, read));
                    store
                }
            };
            commands.entity(entity).try_insert(WorldStore::new(store, saved.path.clone()));
            terrain.world().revision()
        });
        if let Err(why) = &outcome {
            error!("the world of {entity} is not saved: {why}");
        }
        release(&mut commands, entity);
        opened.write(WorldOpened { terrain: entity, outcome: outcome.map_err(Arc::new) });
    }
}
