//! Closing worlds: remaining data is saved on the store's thread, and only an exiting app waits for it.

use std::path::PathBuf;
use std::sync::Arc;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::lifecycle::Discard;
use bevy::ecs::query::Allow;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::abandoned::AbandonedStores;
use super::components::{EXIT_WAIT, SavedWorld, Unopened, WorldStore};
use super::follow::follow_same;
use super::messages::{ClosedBecause, StoreWarningFound, WorldClosed, WorldOpened};
use super::reading::OpeningWorld;
use crate::store::{ClosingStore, Store, StoreError};
use crate::terrain::Terrain;

/// A world that is being closed.
struct Closing {
    terrain: Entity,
    path: PathBuf,
    because: ClosedBecause,
    store: ClosingStore,
}

/// Worlds that are being closed.
#[derive(Resource, Default)]
pub(crate) struct ClosingWorlds {
    worlds: Vec<Closing>,
    abandoned: AbandonedStores,
}

impl ClosingWorlds {
    pub fn close(&mut self, terrain: Entity, path: PathBuf, because: ClosedBecause, store: Store) {
        self.worlds.push(Closing { terrain, path, because, store: store.close() });
    }

    #[cfg(feature = "replicon")]
    /// Where the owner of a store that belongs to no terrain leaves it when it is dropped.
    pub fn abandoned(&self) -> &AbandonedStores {
        &self.abandoned
    }

    /// Waits until all are closed, or up to a moment.
    pub fn wait(&self, end: Instant) {
        for Closing { path, store, .. } in &self.worlds {
            if let Err(why) = store.wait(end.saturating_duration_since(Instant::now())) {
                error!("not everything is saved in {}: {why}", path.display());
            }
        }
        self.abandoned.wait(end);
    }
}

/// An app that ends before they are closed waits for them, unless the disk does not answer.
impl Drop for ClosingWorlds {
    fn drop(&mut self) {
        self.abandoned.end();
        self.wait(Instant::now() + EXIT_WAIT);
    }
}

/// Closes the store of a world that is no longer wanted, with the last commits of its terrain.
pub(super) fn close(
    gone: On<Discard, WorldStore>,
    mut worlds: Query<(&mut WorldStore, Option<&mut Terrain>), Allow<Disabled>>,
    mut closing: ResMut<ClosingWorlds>,
) {
    let Ok((mut world, terrain)) = worlds.get_mut(gone.entity) else { return };
    if let Some(mut terrain) = terrain {
        follow_same(&mut terrain, &mut world);
    }
    let (path, because) = (std::mem::take(&mut world.saved.path), world.closing);
    if let Some(store) = world.store.take() {
        closing.close(gone.entity, path, because, store);
    }
}

/// Closes a world when its component is removed. A terrain that replaced its own in this frame is not written into it.
pub(super) fn close_with_component(
    gone: On<Discard, SavedWorld>,
    mut worlds: Query<(&mut WorldStore, &mut Terrain), Allow<Disabled>>,
    mut commands: Commands,
) {
    if let Ok((mut world, mut terrain)) = worlds.get_mut(gone.entity) {
        follow_same(&mut terrain, &mut world);
    }
    commands.entity(gone.entity).try_remove::<WorldStore>();
}

/// Sends the last commits of a terrain that is replaced or removed.
pub(super) fn follow_discarded(
    gone: On<Discard, Terrain>,
    mut worlds: Query<(&mut WorldStore, &mut Terrain), Allow<Disabled>>,
) {
    if let Ok((mut world, mut terrain)) = worlds.get_mut(gone.entity) {
        follow_same(&mut terrain, &mut world);
    }
}

/// Takes the [`SavedWorld`] off an entity, and says why.
pub(crate) fn detach(entity: &mut EntityWorldMut, because: ClosedBecause) {
    let Some(saved) = entity.get::<SavedWorld>() else { return };
    warn!("{} is no longer saved in {}, since {because}", entity.id(), saved.path.display());
    if let Some(mut store) = entity.get_mut::<WorldStore>() {
        store.closing = because;
    }
    let was_opening = entity.contains::<Unopened>() || entity.contains::<OpeningWorld>();
    entity.remove::<SavedWorld>();
    if was_opening {
        let why =
            if because == ClosedBecause::Shared { StoreError::Shared } else { StoreError::OtherTerrain };
        let (terrain, outcome) = (entity.id(), Err(Arc::new(why)));
        entity.world_scope(|world| {
            world.write_message(WorldOpened { terrain, outcome });
        });
    }
}

/// Reports worlds that are closed.
pub(super) fn report_closed(
    mut closing: ResMut<ClosingWorlds>,
    mut closed: MessageWriter<WorldClosed>,
    mut warnings: MessageWriter<StoreWarningFound>,
) {
    closing.abandoned.poll();
    if closing.worlds.is_empty() {
        return;
    }
    closing.worlds.retain(|Closing { terrain, path, because, store }| {
        // Its last warnings come before its end.
        let outcome = store.outcome();
        for warning in store.take_warnings() {
            warn!("the world in {}: {warning}", path.display());
            warnings.write(StoreWarningFound { terrain: *terrain, warning });
        }
        let Some(outcome) = outcome else { return true };
        if let Err(why) = &outcome {
            error!("not everything is saved in {}: {why}", path.display());
        }
        let outcome = outcome.map_err(Arc::new);
        closed.write(WorldClosed { terrain: *terrain, path: path.clone(), because: *because, outcome });
        false
    });
}
