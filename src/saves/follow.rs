//! Lets a store follow the commits of its terrain.

use bevy::prelude::*;

use super::components::WorldStore;
use crate::terrain::Terrain;

/// Sends new commits of a terrain to the store, if the store follows it. A terrain that replaced it is ignored.
pub(super) fn follow_same(terrain: &mut Mut<Terrain>, world: &mut WorldStore) {
    if world.store.as_ref().is_some_and(|store| store.follows(terrain)) {
        follow(terrain, world);
    }
}

/// Sends new commits of a terrain to the store, or the whole terrain if it is another one.
pub(super) fn follow(terrain: &mut Mut<Terrain>, world: &mut WorldStore) {
    let Some(store) = &mut world.store else { return };
    // The game does not see this as a change of the terrain.
    let followed = store.follow(terrain.bypass_change_detection());
    match followed {
        Err(why) if !std::mem::replace(&mut world.has_failed, true) => {
            error!("saving to {} has stopped: {why}", world.saved.path.display());
        }
        _ => {}
    }
}
