//! Releases terrains that were held until their world or level was read.

use bevy::prelude::*;

use super::components::{HeldHere, SavedWorld, Unopened};
use super::level::{MakingLevel, StartLevel, Waiting};
use super::reading::OpeningWorld;
use crate::plugin::Held;

/// Releases a terrain, unless its level or saved world is still being read, or the game holds it. Only this function
/// removes [`Held`] in this module.
pub(super) fn release(commands: &mut Commands, entity: Entity) {
    commands.queue(move |world: &mut World| {
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        let waits_for_world = entity.contains::<Unopened>() || entity.contains::<OpeningWorld>();
        let waits_for_level = entity.contains::<Waiting>() || entity.contains::<MakingLevel>();
        let waits = entity.contains::<SavedWorld>() && waits_for_world
            || entity.contains::<StartLevel>() && waits_for_level;
        if !waits && entity.take::<HeldHere>().is_some() {
            entity.remove::<Held>();
        }
    });
}
