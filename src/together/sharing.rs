//! Which of the shared terrains of an app is shared.

use bevy::prelude::*;

/// Which of an app's shared terrains is shared: a connection carries one ground.
#[derive(Resource, Default)]
pub(super) struct Sharing {
    pub active: Option<Entity>,
    orders: u64,
}

impl Sharing {
    /// The place of a new shared terrain among all.
    pub fn next_order(&mut self) -> u64 {
        self.orders += 1;
        self.orders
    }

    /// Keeps the terrain that is shared, or takes the one that was inserted first.
    pub fn choose(&mut self, all: impl Iterator<Item = (Entity, u64)> + Clone) {
        let is_there = |entity| all.clone().any(|(other, _)| other == entity);
        if !self.active.is_some_and(is_there) {
            self.active = all.clone().min_by_key(|(_, order)| *order).map(|(entity, _)| entity);
        }
    }
}
