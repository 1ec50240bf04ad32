//! Builds terrains from levels.

use std::time::Duration;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use super::holding::release;
use super::level::{FindLevel, MakingLevel, StartLevel, Waiting};
use crate::terrain::Terrain;
use crate::threads::{ThreadTask, Threads, free_later};

/// How long a level is waited for before that is logged.
const REPORT_AFTER: Duration = Duration::from_secs(10);

/// Stops building a terrain when its `StartLevel` is removed.
pub(super) fn give_up(gone: On<Remove, StartLevel>, mut commands: Commands) {
    commands.entity(gone.entity).try_remove::<(MakingLevel, Waiting)>();
    release(&mut commands, gone.entity);
}

/// Starts again to make a terrain from the level if another terrain replaces the first one.
pub(super) fn make_anew(
    new: On<Insert, Terrain>,
    making: Query<(), (With<MakingLevel>, Allow<Disabled>)>,
    mut commands: Commands,
) {
    if making.contains(new.entity) {
        commands.entity(new.entity).try_remove::<MakingLevel>().try_insert(Waiting::new());
    }
}

/// Makes terrains of levels that are loaded, and puts them in place.
pub(super) fn start_levels(
    mut commands: Commands,
    levels: FindLevel,
    mut waiting: Query<(Entity, &StartLevel, &Terrain, &mut Waiting), Allow<Disabled>>,
    mut making: Query<
        (Entity, &mut Terrain, &mut MakingLevel),
        (With<StartLevel>, Without<Waiting>, Allow<Disabled>),
    >,
) {
    for (entity, start, terrain, mut wait) in &mut waiting {
        match levels.find(start) {
            Ok(Some(level)) => {
                let world = terrain.world();
                let (level, ground) = (level.clone(), world.shared_ground());
                let task = ThreadTask::start(Threads::Background, move || level.terrain(ground));
                let (making, start) = (MakingLevel(task, world.version()), start.clone());
                commands.queue(move |world: &mut World| {
                    let Ok(mut entity) = world.get_entity_mut(entity) else { return };
                    // The game may have removed the component meanwhile, or inserted another one.
                    if entity.get::<StartLevel>() == Some(&start) && entity.take::<Waiting>().is_some() {
                        entity.insert(making);
                    }
                });
            }
            Ok(None) if !wait.reported && wait.since.elapsed() >= REPORT_AFTER => {
                wait.reported = true;
                warn!(
                    "{entity} still waits for its level {:?}: remove its StartLevel to begin without",
                    start.0
                );
            }
            Ok(None) => {}
            Err(why) => {
                error!("the level of {entity} can't be loaded, so the terrain begins without it: {why}");
                commands.entity(entity).try_remove::<Waiting>();
                release(&mut commands, entity);
            }
        }
    }
    for (entity, mut terrain, mut level) in &mut making {
        let Some(made) = level.0.check() else { continue };
        commands.entity(entity).try_remove::<MakingLevel>();
        if !terrain.world().version().is_same_world(level.1) {
            // The game assigned another one meanwhile.
            commands.entity(entity).try_insert(Waiting::new());
            continue;
        }
        match made {
            Ok(Ok(mut made)) => {
                if let Err(why) = made.adopt_settings(terrain.edit_settings()) {
                    error!("the terrain's rules could not be applied to the level of {entity}: {why}");
                }
                made.take_over(&mut terrain);
                free_later(std::mem::replace(&mut *terrain, made));
            }
            Ok(Err(why)) => {
                error!("the level of {entity} does not fit, so the terrain begins without it: {why}");
            }
            Err(_) => error!("making the level of {entity} panicked, so the terrain begins without it"),
        }
        // A saved world is read next.
        release(&mut commands, entity);
    }
}
