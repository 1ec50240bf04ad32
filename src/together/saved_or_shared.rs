//! A terrain is either saved or shared: the server saves a shared world, and a player's `SavedWorld` never does.

use bevy::prelude::*;

use super::SharedTerrain;
use crate::saves::{ClosedBecause, SavedWorld, detach};

/// A terrain that becomes shared is no longer saved here: its own world is closed with all that was dug in it.
pub(super) fn close_own_world(new: On<Insert, SharedTerrain>, mut commands: Commands) {
    close_if_shared(&mut commands, new.entity);
}

/// A terrain that is shared can't be saved here.
pub(super) fn refuse_own_world(new: On<Insert, SavedWorld>, mut commands: Commands) {
    close_if_shared(&mut commands, new.entity);
}

fn close_if_shared(commands: &mut Commands, entity: Entity) {
    commands.queue(move |world: &mut World| {
        if let Ok(mut entity) = world.get_entity_mut(entity)
            && entity.contains::<SharedTerrain>()
        {
            detach(&mut entity, ClosedBecause::Shared);
        }
    });
}
