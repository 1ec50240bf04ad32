//! Sends commits to stores, and reports their results.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::closing::{ClosingWorlds, detach};
use super::components::{EXIT_WAIT, WorldStore};
use super::follow::follow;
use super::messages::{ClosedBecause, SaveNow, StoreWarningFound, WorldSaved};
use crate::terrain::Terrain;

/// Sends new commits to stores. A terrain that is not a state of the saved world is not written into it: the world is
/// closed.
pub(super) fn save_commits(
    mut commands: Commands,
    mut worlds: Query<(Entity, &mut Terrain, &mut WorldStore), Allow<Disabled>>,
) {
    for (entity, mut terrain, mut world) in &mut worlds {
        match world.store.as_ref().is_some_and(|store| store.is_of(&terrain)) {
            true => follow(&mut terrain, &mut world),
            false => detach_other(&mut commands, entity),
        }
    }
}

/// Closes a world whose terrain was replaced by another level.
fn detach_other(commands: &mut Commands, entity: Entity) {
    commands.queue(move |world: &mut World| {
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        // The game may have inserted another component or terrain meanwhile.
        if let (Some(world), Some(terrain)) = (entity.get::<WorldStore>(), entity.get::<Terrain>())
            && world.store.as_ref().is_some_and(|store| !store.is_of(terrain))
        {
            detach(&mut entity, ClosedBecause::OtherTerrain);
        }
    });
}

/// Saves at once where that is asked for.
pub(super) fn save_now(
    mut requests: MessageReader<SaveNow>,
    mut worlds: Query<(Entity, &mut WorldStore), Allow<Disabled>>,
) {
    for request in requests.read() {
        for (entity, mut world) in &mut worlds {
            if request.terrain.is_none_or(|wanted| wanted == entity) {
                world.asked_again = true;
            }
        }
    }
    for (_, mut world) in &mut worlds {
        // One request at a time: a disk that does not answer is asked once.
        if world.asked_again && world.asked.is_none() {
            let world = &mut *world;
            let Some(store) = &mut world.store else { continue };
            world.asked_again = false;
            // If its thread is gone, that is reported as a warning.
            if store.request_checkpoint().is_ok() {
                world.asked = Some(store.point());
            }
        }
    }
}

/// Reports what has become durable, and warnings.
pub(super) fn report(
    mut worlds: Query<(Entity, &mut WorldStore), Allow<Disabled>>,
    mut saved: MessageWriter<WorldSaved>,
    mut warnings: MessageWriter<StoreWarningFound>,
) {
    for (entity, mut world) in &mut worlds {
        let world = &mut *world;
        let Some(store) = &world.store else { continue };
        for warning in store.take_warnings() {
            warn!("the world in {}: {warning}", world.saved.path.display());
            warnings.write(StoreWarningFound { terrain: entity, warning });
        }
        let Some(durable) = store.durable_point() else { continue };
        let is_answered = world.asked.is_some_and(|asked| store.is_durable(asked));
        if is_answered {
            world.asked = None;
        }
        if is_answered || world.reported.is_none_or(|reported| reported < durable) {
            world.reported = Some(durable);
            saved.write(WorldSaved { terrain: entity, revision: durable.revision() });
        }
    }
}

/// Saves everything before the app ends, also of worlds that are just being closed.
pub(super) fn finish_at_exit(
    mut worlds: Query<(&mut Terrain, &mut WorldStore), Allow<Disabled>>,
    closing: Res<ClosingWorlds>,
) {
    let end = Instant::now() + EXIT_WAIT;
    for (mut terrain, mut world) in &mut worlds {
        let is_of = world.store.as_ref().is_some_and(|store| store.is_of(&terrain));
        if is_of {
            follow(&mut terrain, &mut world);
        }
        let Some(store) = &mut world.store else { continue };
        if let Err(why) = store.flush_within(end.saturating_duration_since(Instant::now())) {
            error!("the last commits are not saved in {}: {why}", world.saved.path.display());
        }
    }
    closing.wait(end);
}
