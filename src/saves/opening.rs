//! Reads a world from its folder while its terrain is held, and puts it in the terrain's place.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use bevy::ecs::lifecycle::Discard;
use bevy::prelude::*;

use super::components::{SavedWorld, WorldStore};
use super::level::{BurrowLevel, MakingLevel, StartLevel, Waiting};
use super::messages::{StoreTroubleFound, WorldOpened};
use super::saving::follow;
use crate::ground::Ground;
use crate::plugin::{Held, ThreadTask, Threads, free_later};
use crate::store::{BaseLevel, Opened, Progress, Store, StoreError, StoreOptions, StoreTrouble, read_level};
use crate::terrain::{Terrain, TerrainSettings, WorldParts};

/// How often, and how long, a locked world is waited for.
const LOCK_TRIES: usize = 60;
const LOCK_WAIT: Duration = Duration::from_millis(50);

/// A world that nobody has begun to read.
#[derive(Component)]
pub(super) struct Unopened;

/// The world of a [`SavedWorld`] is being read; the plugin inserts it and takes it away.
#[derive(Component)]
pub struct OpeningWorld {
    task: ThreadTask<Result<ReadWorld, StoreError>>,
    progress: Progress,
}

impl OpeningWorld {
    /// How much of it is read, 0 to 1, for a bar on the screen.
    pub fn progress(&self) -> f32 {
        self.progress.share()
    }
}

/// A world that was read or made.
pub(crate) struct ReadWorld {
    pub store: Store,
    pub terrain: Terrain,
    pub troubles: Vec<StoreTrouble>,
}

/// Reads a world, on another thread.
pub(crate) struct WorldReader {
    saved: SavedWorld,
    level: Option<(BurrowLevel, String)>,
    ground: Arc<Ground>,
    settings: TerrainSettings,
    /// What is made where there is no world yet.
    parts: WorldParts,
    pub progress: Progress,
}

/// Holds a terrain until its world is read.
pub(super) fn hold(new: On<Insert, SavedWorld>, mut commands: Commands) {
    close_later(&mut commands, new.entity);
    commands.entity(new.entity).try_remove::<OpeningWorld>().try_insert((Held, Unopened));
}

/// Saves and closes a world that is no longer wanted.
pub(super) fn close(
    gone: On<Remove, SavedWorld>,
    mut commands: Commands,
    mut worlds: Query<(&mut Terrain, &mut WorldStore)>,
) {
    if let Ok((mut terrain, mut world)) = worlds.get_mut(gone.entity) {
        follow(&mut terrain, &mut world);
    }
    close_later(&mut commands, gone.entity);
    commands.entity(gone.entity).try_remove::<(OpeningWorld, Unopened, Held)>();
}

/// Closes the store of an entity on another thread, since that waits for the disk.
fn close_later(commands: &mut Commands, entity: Entity) {
    commands.queue(move |world: &mut World| {
        let store = world.get_entity_mut(entity).ok().and_then(|mut entity| entity.take::<WorldStore>());
        store.into_iter().for_each(free_later);
    });
}

/// Hands over the last commits of a terrain that another one replaces, or that goes.
pub(super) fn follow_discarded(
    gone: On<Discard, Terrain>,
    mut worlds: Query<(&mut Terrain, &mut WorldStore)>,
) {
    if let Ok((mut terrain, mut world)) = worlds.get_mut(gone.entity) {
        follow(&mut terrain, &mut world);
    }
}

/// Starts to read the worlds of new terrains.
pub(super) fn start_opening(
    mut commands: Commands,
    levels: Option<Res<Assets<BurrowLevel>>>,
    worlds: Query<
        (Entity, &SavedWorld, &Terrain, Option<&StartLevel>),
        (With<Unopened>, Without<Waiting>, Without<MakingLevel>),
    >,
) {
    for (entity, saved, terrain, start) in &worlds {
        let level = start.and_then(|start| {
            let level = levels.as_ref()?.get(&start.0)?.clone();
            Some((level, start.0.path().map(ToString::to_string).unwrap_or_default()))
        });
        let reader = WorldReader::new(saved, terrain, level);
        let progress = reader.progress.clone();
        let task = ThreadTask::start(Threads::Background, move || reader.read());
        commands.entity(entity).try_remove::<Unopened>().try_insert(OpeningWorld { task, progress });
    }
}

impl WorldReader {
    /// Of this world, with the ground and the sizes of this terrain; a new world begins as the terrain is, on a level and its path if
    /// there is one.
    pub fn new(saved: &SavedWorld, terrain: &Terrain, level: Option<(BurrowLevel, String)>) -> Self {
        let (ground, parts) = (terrain.world().shared_ground(), terrain.parts());
        let settings = TerrainSettings { chunk_size: parts.chunk_size, voxel_size: terrain.voxel_size() };
        Self { saved: saved.clone(), level, ground, settings, parts, progress: Progress::default() }
    }

    /// Reads the world, or makes one.
    pub fn read(self) -> Result<ReadWorld, StoreError> {
        let Self { saved, level, ground, settings, parts, progress } = self;
        // One that can't be read was told of when the terrain was made of it.
        let level =
            level.and_then(|(level, path)| Some(BaseLevel::new(read_level(&level.0, &ground).ok()?, path)));
        let options = StoreOptions { level, progress: Some(progress), ..saved.options() };
        if Store::is_in(&saved.path) {
            let (store, opened) = open_unlocked(&saved.path, &ground, &options)?;
            return Ok(ReadWorld { store, terrain: opened.terrain, troubles: opened.troubles });
        }
        let mut terrain = Terrain::restore(ground, &settings, parts)?;
        let store = Store::create(&saved.path, &mut terrain, options)?;
        Ok(ReadWorld { store, terrain, troubles: Vec::new() })
    }
}

/// Opens a world. This app may be about to close it: then it is waited for a little.
fn open_unlocked(
    path: &Path,
    ground: &Arc<Ground>,
    options: &StoreOptions,
) -> Result<(Store, Opened), StoreError> {
    for _ in 0..LOCK_TRIES {
        match Store::open(path, Arc::clone(ground), options.clone()) {
            Err(StoreError::Locked(_)) => std::thread::sleep(LOCK_WAIT),
            other => return other,
        }
    }
    Store::open(path, Arc::clone(ground), options.clone())
}

/// Puts worlds that were read in place of their terrains.
pub(super) fn finish_opening(
    mut commands: Commands,
    mut worlds: Query<(Entity, &mut Terrain, &mut OpeningWorld)>,
    mut opened: MessageWriter<WorldOpened>,
    mut troubles: MessageWriter<StoreTroubleFound>,
) {
    for (entity, mut terrain, mut opening) in &mut worlds {
        let Some(outcome) = opening.task.finish() else { continue };
        commands.entity(entity).try_remove::<(OpeningWorld, Held)>();
        let outcome = outcome.map(|ReadWorld { store, terrain: mut read, troubles: found }| {
            troubles
                .write_batch(found.into_iter().map(|trouble| StoreTroubleFound { terrain: entity, trouble }));
            let revision = read.world().revision();
            read.take_over(&mut terrain);
            free_later(std::mem::replace(&mut *terrain, read));
            let version = terrain.world().version();
            commands.entity(entity).try_insert(WorldStore { store, version, told: None });
            revision
        });
        if let Err(why) = &outcome {
            error!("the world of {entity} is not saved: {why}");
        }
        opened.write(WorldOpened { terrain: entity, outcome: outcome.map_err(Arc::new) });
    }
}
