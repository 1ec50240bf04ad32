//! Reads a world from its folder while its terrain is held, and then replaces the terrain by it.

use std::sync::Arc;
use std::time::Duration;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use super::closing::{ClosingWorlds, detach};
use super::components::{LevelId, SavedWorld, Unopened, WorldStore, hold_now};
use super::holding::release;
use super::level::{FindLevel, MakingLevel, StartLevel, Waiting};
use super::messages::{ClosedBecause, StoreWarningFound, WorldOpened};
use super::reading::{Found, OpeningWorld, ReadWorld, WorldReader};
use crate::store::{Store, StoreWarning};
use crate::terrain::Terrain;
use crate::threads::free_later;

/// The maximum number of bytes of commits that a terrain keeps until the store takes them, which it does each frame.
const LOG_BYTES: usize = 64 << 20;

/// How long a component waits for a terrain before that is logged.
const REPORT_AFTER: Duration = Duration::from_secs(10);

/// Stops reading for a component that was there before, when another one is inserted.
pub(super) fn begin_anew(new: On<Insert, Unopened>, mut commands: Commands) {
    commands.entity(new.entity).try_remove::<OpeningWorld>();
}

/// Handles components that the game changed in place like newly inserted ones: the world that they named before is
/// closed.
pub(super) fn follow_changed(
    mut commands: Commands,
    changed: Query<
        (Entity, &SavedWorld, Option<&WorldStore>, Option<&OpeningWorld>),
        (Changed<SavedWorld>, Allow<Disabled>),
    >,
) {
    for (entity, saved, store, opening) in &changed {
        let before = store.map(|store| &store.saved).or(opening.map(|opening| &opening.reader.saved));
        if before.is_some_and(|before| before != saved) {
            commands.entity(entity).try_insert(saved.clone());
        }
    }
}

/// Stops reading a world whose component was removed.
pub(super) fn give_up(gone: On<Remove, SavedWorld>, mut commands: Commands) {
    commands.entity(gone.entity).try_remove::<(OpeningWorld, Unopened)>();
    release(&mut commands, gone.entity);
}

/// Starts to read again if another terrain replaces the one that a world was read for.
pub(super) fn read_anew(
    new: On<Insert, Terrain>,
    opening: Query<(), (With<OpeningWorld>, Allow<Disabled>)>,
    mut commands: Commands,
) {
    if opening.contains(new.entity) {
        read_again(&mut commands, new.entity);
    }
}

/// Reads a world again for another terrain. Another level is not saved in that world.
fn read_again(commands: &mut Commands, entity: Entity) {
    commands.queue(move |world: &mut World| {
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        // Another `SavedWorld` that came with the terrain is not being read yet, and stays.
        let (Some(opening), Some(terrain)) = (entity.get::<OpeningWorld>(), entity.get::<Terrain>()) else {
            return;
        };
        let id = opening.reader.id;
        if id == LevelId::of(terrain) {
            entity.insert(Unopened::new(Some(id)));
        } else {
            detach(&mut entity, ClosedBecause::OtherTerrain);
        }
    });
}

/// Waits for another terrain if the one that a world is read for was removed.
pub(super) fn wait_for_terrain(
    gone: On<Remove, Terrain>,
    opening: Query<(), (With<OpeningWorld>, Allow<Disabled>)>,
    mut commands: Commands,
) {
    let entity = gone.entity;
    if !opening.contains(entity) {
        return;
    }
    commands.queue(move |world: &mut World| {
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        // Its `SavedWorld` may have gone with it.
        if let Some(opening) = entity.take::<OpeningWorld>() {
            entity.insert(Unopened::new(Some(opening.reader.id)));
        }
    });
}

/// Starts to read the worlds of new terrains.
pub(super) fn start_opening(
    mut commands: Commands,
    levels: FindLevel,
    mut worlds: Query<
        (Entity, &SavedWorld, &mut Terrain, &Unopened, Option<&StartLevel>),
        (Without<Waiting>, Without<MakingLevel>, Allow<Disabled>),
    >,
) {
    for (entity, saved, mut terrain, unopened, start) in &mut worlds {
        if unopened.level.is_some_and(|level| level != LevelId::of(&terrain)) {
            detach_unless_replaced(&mut commands, entity, saved);
            continue;
        }
        let level = match start.map(|start| levels.find(start)) {
            None | Some(Err(_)) => None,
            Some(Ok(None)) => continue,
            Some(Ok(Some(level))) => Some((level.clone(), levels.path_of(start))),
        };
        // The game does not see this as a change. A new world is made of the terrain as it is now, and what is
        // committed from now on follows.
        let terrain = terrain.bypass_change_detection();
        terrain.abandon();
        // A new log says the rules of edits that wait.
        terrain.keep_log(None);
        terrain.keep_log(Some(LOG_BYTES));
        drop(terrain.take_log());
        let opening = OpeningWorld::new(WorldReader::new(saved, terrain, level), terrain.world().version());
        commands.queue(move |world: &mut World| {
            let Ok(mut entity) = world.get_entity_mut(entity) else { return };
            // The game may have removed the component meanwhile, or inserted another one.
            if entity.get::<SavedWorld>() == Some(&opening.reader.saved)
                && entity.take::<Unopened>().is_some()
            {
                entity.insert(opening);
            }
        });
    }
}

/// Removes the component if another level took the place of the terrain whose world was being read.
fn detach_unless_replaced(commands: &mut Commands, entity: Entity, saved: &SavedWorld) {
    let saved = saved.clone();
    commands.queue(move |world: &mut World| {
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        if entity.get::<SavedWorld>() == Some(&saved) {
            detach(&mut entity, ClosedBecause::OtherTerrain);
        }
    });
}

/// Logs that a component waits for a terrain.
pub(super) fn warn_of_no_terrain(
    mut worlds: Query<(Entity, &SavedWorld, &mut Unopened), (Without<Terrain>, Allow<Disabled>)>,
) {
    for (entity, saved, mut unopened) in &mut worlds {
        if !unopened.reported && unopened.since.elapsed() >= REPORT_AFTER {
            unopened.reported = true;
            warn!(
                "the SavedWorld of {entity} waits for a terrain, and saves nothing in {}: insert it on the entity of the Terrain",
                saved.path.display()
            );
        }
    }
}

/// Replaces terrains by the worlds that were read.
pub(super) fn finish_opening(
    mut commands: Commands,
    mut worlds: Query<(Entity, &mut Terrain, &mut OpeningWorld), (With<SavedWorld>, Allow<Disabled>)>,
    mut closing: ResMut<ClosingWorlds>,
    mut opened: MessageWriter<WorldOpened>,
    mut warnings: MessageWriter<StoreWarningFound>,
) {
    for (entity, mut terrain, mut opening) in &mut worlds {
        let saved = &Arc::clone(&opening.reader).saved;
        let mut report = |warning| {
            warn!("the world in {}: {warning}", saved.path.display());
            warnings.write(StoreWarningFound { terrain: entity, warning });
        };
        if opening.reports_lock() {
            report(StoreWarning::WaitsForLock);
        }
        let Some(outcome) = opening.poll() else { continue };
        let now = terrain.world().version();
        if !now.is_same_world(opening.version) {
            // The game assigned another one meanwhile.
            if let Ok(read) = outcome {
                closing.close(entity, saved.path.clone(), ClosedBecause::Removed, read.world().store);
            }
            read_again(&mut commands, entity);
            continue;
        }
        commands.entity(entity).try_remove::<OpeningWorld>();
        let outcome = outcome.map(|found| {
            let store = match found {
                // The terrain and its history stay as they are.
                Found::New(ReadWorld { mut store, terrain: copy, .. }) => {
                    free_later(copy);
                    store.adopt(&terrain, opening.reader.next_record);
                    store
                }
                Found::Old(ReadWorld { store, terrain: mut read, warnings }) => {
                    warnings.into_iter().for_each(&mut report);
                    if now != opening.version {
                        warn!("changes to {entity} while its saved world was being read were discarded");
                    }
                    read.take_over(&mut terrain);
                    free_later(std::mem::replace(&mut *terrain, read));
                    store
                }
            };
            insert_store(&mut commands, entity, saved.clone(), store);
            terrain.world().revision()
        });
        if let Err(why) = &outcome {
            error!("the world of {entity} is not saved: {why}");
        }
        release(&mut commands, entity);
        opened.write(WorldOpened { terrain: entity, outcome: outcome.map_err(Arc::new) });
    }
}

/// Lets a store follow the terrain of its component. If the game has removed or changed that meanwhile, the world is
/// closed, and the one that the component names now is read.
fn insert_store(commands: &mut Commands, entity: Entity, saved: SavedWorld, store: Store) {
    commands.queue(move |world: &mut World| {
        let path = saved.path.clone();
        if let Ok(mut owner) = world.get_entity_mut(entity)
            && let Some(now) = owner.get::<SavedWorld>()
        {
            if *now == saved {
                owner.insert(WorldStore::new(store, saved));
                return;
            }
            owner.insert(Unopened::new(None));
            hold_now(&mut owner);
        }
        world.resource_mut::<ClosingWorlds>().close(entity, path, ClosedBecause::Removed, store);
    });
}
