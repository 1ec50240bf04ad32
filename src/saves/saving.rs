//! Hands commits to stores, and tells what they say.

use bevy::prelude::*;

use super::components::WorldStore;
use super::messages::{SaveNow, StoreTroubleFound, WorldSaved};
use crate::terrain::Terrain;

/// Bytes of commits that wait at most until the store takes them, which it does each frame.
const LOG_BYTES: usize = 64 << 20;

/// Hands over what was committed to one terrain.
pub(super) fn follow(terrain: &mut Mut<Terrain>, world: &mut WorldStore) {
    // For the game this is no change of the terrain.
    let terrain = terrain.bypass_change_detection();
    let now = terrain.world().version();
    let followed = match now.is_same_world(world.version) {
        true => world.store.follow(terrain),
        // The game put another world in its place.
        false => {
            terrain.keep_log(Some(LOG_BYTES));
            drop(terrain.take_log());
            world.store.append_whole(terrain)
        }
    };
    world.version = now;
    if let Err(why) = followed {
        error_once!("nothing is saved any more: {why}");
    }
}

/// Hands over what was committed.
pub(super) fn save_commits(mut worlds: Query<(&mut Terrain, &mut WorldStore)>) {
    for (mut terrain, mut world) in &mut worlds {
        follow(&mut terrain, &mut world);
    }
}

/// Saves at once where that is asked for.
pub(super) fn save_now(mut requests: MessageReader<SaveNow>, mut worlds: Query<(Entity, &mut WorldStore)>) {
    for request in requests.read() {
        for (entity, mut world) in &mut worlds {
            if request.terrain.is_none_or(|wanted| wanted == entity) {
                // If its thread is gone, that was told.
                let _ = world.store.request_checkpoint();
                world.told = None;
            }
        }
    }
}

/// Tells what became durable, and what went wrong.
pub(super) fn tell(
    mut worlds: Query<(Entity, &mut WorldStore)>,
    mut saved: MessageWriter<WorldSaved>,
    mut troubles: MessageWriter<StoreTroubleFound>,
) {
    for (entity, mut world) in &mut worlds {
        let found = world.store.take_troubles();
        for trouble in &found {
            warn!("the world of {entity}: {trouble}");
        }
        troubles.write_batch(found.into_iter().map(|trouble| StoreTroubleFound { terrain: entity, trouble }));
        let revision = world.store.durable();
        let is_news = world.told.is_none_or(|told| told < revision);
        if is_news && revision == world.store.revision() {
            world.told = Some(revision);
            saved.write(WorldSaved { terrain: entity, revision });
        }
    }
}

/// Saves everything before the app ends.
pub(super) fn finish_at_exit(
    mut exits: MessageReader<AppExit>,
    mut worlds: Query<(&mut Terrain, &mut WorldStore)>,
) {
    if exits.read().next().is_none() {
        return;
    }
    for (mut terrain, mut world) in &mut worlds {
        follow(&mut terrain, &mut world);
        if let Err(why) = world.store.flush() {
            error!("the last commits are not saved: {why}");
        }
    }
}
