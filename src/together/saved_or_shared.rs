//! A terrain is either saved or shared: the server saves a shared world, and a player's `SavedWorld` never does.

use bevy::prelude::*;

use super::SharedTerrain;
use crate::saves::{ClosedBecause, SavedWorld, detach};

/// A terrain that becomes shared is no longer saved here: its own world is saved and closed.
pub(super) fn close_own_world(
    new: On<Insert, SharedTerrain>,
    saved: Query<(), With<SavedWorld>>,
    mut commands: Commands,
) {
    if saved.contains(new.entity) {
        detach(&mut commands, new.entity, ClosedBecause::Shared);
    }
}

/// A terrain that is shared can't be saved here.
pub(super) fn refuse_own_world(
    new: On<Insert, SavedWorld>,
    shared: Query<(), With<SharedTerrain>>,
    mut commands: Commands,
) {
    if shared.contains(new.entity) {
        detach(&mut commands, new.entity, ClosedBecause::Shared);
    }
}
