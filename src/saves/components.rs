//! The components of saved worlds.

use std::path::PathBuf;
use std::time::Duration;

use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::messages::ClosedBecause;
use crate::plugin::Held;
use crate::store::{BaseChanged, SavePoint, Store, StoreOptions};
use crate::terrain::Terrain;

/// The longest time that an exiting app waits for the disk.
pub(crate) const EXIT_WAIT: Duration = Duration::from_secs(10);

/// Saves the terrain of its entity in a folder, and continues the world that is there. Insert it with the terrain.
/// Scenes may contain it; they leave out the terrain itself.
///
/// If it or the entity is removed, remaining changes are saved and the world is closed, which
/// [`WorldClosed`](super::WorldClosed) reports. Changing it in place is like inserting another one.
///
/// | inserted on the same entity | what happens |
/// | --- | --- |
/// | a `SavedWorld` with another path | the first world is closed, and the second takes the terrain's place, or is made of it |
/// | a [`Terrain`](crate::terrain::Terrain) over another ground, or of another size | that is another level: the world is closed, and this component removed |
/// | a `Terrain` over the same ground, of the same size | that is another state of the same world, and takes the place of what was saved |
/// | a `SharedTerrain` | the world is closed, and this component removed: the server saves what players share |
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[component(on_insert = hold)]
#[reflect(Component)]
pub struct SavedWorld {
    /// The folder, for this world alone. It is created if it is missing, together with its parent folders.
    pub path: PathBuf,
    /// The longest time whose commits may be lost if the machine loses power, plus a little for the disk.
    pub loss_window: Duration,
    /// How edits are kept if the ground or the [level](super::StartLevel) differs from the one that they were made on.
    #[reflect(ignore)]
    pub base_changed: BaseChanged,
}

impl SavedWorld {
    /// A world in a folder, with a loss window of a second.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        let StoreOptions { loss_window, base_changed, .. } = StoreOptions::default();
        Self { path: path.into(), loss_window, base_changed }
    }

    pub(super) fn options(&self) -> StoreOptions {
        let Self { loss_window, base_changed, .. } = *self;
        StoreOptions { loss_window, base_changed, close_timeout: EXIT_WAIT, ..StoreOptions::default() }
    }
}

/// The open store of a terrain's world. The plugin inserts it once the world is read.
#[derive(Component)]
pub struct WorldStore {
    /// `None` once it is being closed.
    pub(super) store: Option<Store>,
    /// The component that it was opened for.
    pub(super) saved: SavedWorld,
    /// The last point that was reported as durable.
    pub(super) reported: Option<SavePoint>,
    /// The point that [`SaveNow`](super::SaveNow) waits for; `asked_again` if another was sent since.
    pub(super) asked: Option<SavePoint>,
    pub(super) asked_again: bool,
    /// Why it is closed, if it is.
    pub(super) closing: ClosedBecause,
    /// Whether it was logged that nothing is saved any more.
    pub(super) has_failed: bool,
}

impl WorldStore {
    pub(super) fn new(store: Store, saved: SavedWorld) -> Self {
        Self {
            store: Some(store),
            saved,
            reported: None,
            asked: None,
            asked_again: false,
            closing: ClosedBecause::Removed,
            has_failed: false,
        }
    }

    /// The revision up to which the terrain would survive a crash.
    pub fn durable(&self) -> u64 {
        self.store.as_ref().map_or(0, Store::durable)
    }

    /// Stores data of the game with the world: an inventory, the time of day. It is saved together with the commits of
    /// this frame, so that after a crash data and ground match. An unchanged value is not written again; of a value
    /// that changes in each frame, the last one in each [loss window](SavedWorld::loss_window) is saved.
    pub fn put(&mut self, key: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        if let Some(store) = &mut self.store {
            store.put(key, bytes);
        }
    }

    /// Removes data of the game.
    pub fn remove(&mut self, key: impl Into<String>) {
        if let Some(store) = &mut self.store {
            store.remove(key);
        }
    }

    /// Data of the game as it was put last.
    pub fn get(&self, key: &str) -> Option<&[u8]> {
        self.store.as_ref()?.get(key)
    }
}

/// Exists if the plugin that opens and saves worlds was added.
#[derive(Resource)]
pub(super) struct SavesWorlds;

/// Warns if the plugin is missing: the terrain would be held forever, without any message.
pub(super) fn warn_without_plugin(world: &DeferredWorld, component: &str) {
    if world.get_resource::<SavesWorlds>().is_none() {
        error!("a {component} holds its terrain until there is a SavePlugin: add BurrowPlugins");
    }
}

/// A world that is not being read yet.
#[derive(Component)]
pub(super) struct Unopened {
    pub since: Instant,
    /// Whether it was logged that there is no terrain.
    pub reported: bool,
    /// What the world was to be read for before its terrain was removed.
    pub level: Option<LevelId>,
}

impl Unopened {
    pub fn new(level: Option<LevelId>) -> Self {
        Self { since: Instant::now(), reported: false, level }
    }
}

/// What distinguishes a level from others: its ground and its sizes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LevelId {
    ground: u64,
    size: (i32, i32),
    pub chunk_size: u32,
    pub voxel_size: f32,
}

impl LevelId {
    pub fn of(terrain: &Terrain) -> Self {
        let (ground, grid) = (terrain.world().ground(), terrain.world().grid());
        Self {
            ground: ground.hash(),
            size: (ground.width(), ground.depth()),
            chunk_size: grid.size().cast_unsigned(),
            voxel_size: terrain.voxel_size(),
        }
    }
}

/// A terrain is [`Held`] by this module, and not by the game.
#[derive(Component)]
pub(super) struct HeldHere;

/// Holds a terrain. Its running transaction is begun again later.
pub(super) fn hold_now(entity: &mut EntityWorldMut) {
    if let Some(mut terrain) = entity.get_mut::<Terrain>() {
        terrain.abandon();
    }
    if !entity.contains::<Held>() {
        entity.insert((Held, HeldHere));
    }
}

/// Holds a terrain until its world is read. Its running transaction is then begun again on the world that was read.
///
/// It is a hook because hooks run before observers, which may remove the component again; so it checks that the
/// component is still there.
fn hold(mut world: DeferredWorld, context: HookContext) {
    warn_without_plugin(&world, "SavedWorld");
    world.commands().queue(move |world: &mut World| {
        let Ok(mut entity) = world.get_entity_mut(context.entity) else { return };
        if entity.contains::<SavedWorld>() {
            entity.insert(Unopened::new(None));
            hold_now(&mut entity);
        }
    });
}
