//! Sculpted levels as Bevy assets.

use std::sync::Arc;

use bevy::asset::io::{Reader, Writer};
use bevy::asset::saver::{AssetSaver, SavedAsset};
use bevy::asset::{AssetLoader, AssetPath, AsyncWriteExt, LoadContext, LoadState};
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::system::SystemParam;
use bevy::ecs::world::DeferredWorld;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::components::{WorldStore, hold_now, warn_without_plugin};
use crate::format::limits::Limits;
use crate::format::{FormatError, Level, LevelFiles};
use crate::plugin::read_limited;
use crate::store::RestoreLevelError;
use crate::terrain::{Terrain, Version};
use crate::threads::ThreadTask;

/// A level, packed in one file with the extension `burrow_level`. Its content is checked when it is loaded. Whether it
/// fits the ground is checked when a terrain is made from it.
#[derive(Asset, TypePath, Clone, Debug, Default, PartialEq)]
pub struct BurrowLevel(pub LevelFiles);

impl BurrowLevel {
    /// A level as an asset.
    ///
    /// # Errors
    /// When settings hold numbers that can't be written.
    pub fn new(level: &Level) -> Result<Self, FormatError> {
        level.to_files().map(Self)
    }

    /// A terrain of the level over the ground that it was made on.
    ///
    /// # Errors
    /// When a file is damaged, or when the level does not fit the ground.
    pub fn terrain(
        &self,
        ground: impl Into<Arc<crate::ground::Ground>>,
    ) -> Result<Terrain, RestoreLevelError> {
        let ground = ground.into();
        Ok(Level::from_files(&self.0, &ground)?.terrain(ground)?)
    }
}

/// The reason why a level can't be loaded or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LevelError {
    /// The file can't be read or written.
    #[error("the level can't be read or written: {0}")]
    File(#[from] std::io::Error),
    /// The file is damaged, or is not a level.
    #[error(transparent)]
    Format(#[from] FormatError),
}

/// Loads packed levels.
#[derive(Default, TypePath)]
pub struct LevelLoader;

impl AssetLoader for LevelLoader {
    type Asset = BurrowLevel;
    type Settings = ();
    type Error = LevelError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        _: &mut LoadContext<'_>,
    ) -> Result<BurrowLevel, LevelError> {
        let bytes = read_limited(reader, Limits::FORMAT.packed_level as u64).await?;
        Ok(BurrowLevel(Level::unpack_files(&bytes)?))
    }

    fn extensions(&self) -> &[&str] {
        &["burrow_level"]
    }
}

/// Writes packed levels, for example in an asset processor.
#[derive(Default, TypePath)]
pub struct LevelSaver;

impl AssetSaver for LevelSaver {
    type Asset = BurrowLevel;
    type Settings = ();
    type OutputLoader = LevelLoader;
    type Error = LevelError;

    async fn save(
        &self,
        writer: &mut Writer,
        asset: SavedAsset<'_, '_, BurrowLevel>,
        (): &(),
        _: AssetPath<'_>,
    ) -> Result<(), LevelError> {
        writer.write_all(&Level::pack_files(&asset.0)?).await?;
        Ok(())
    }
}

/// Makes the terrain of its entity start as a level. Insert it with a terrain without edits, which provides the ground.
/// The terrain is [`Held`](crate::plugin::Held) until the level is loaded. If the level can't be loaded, an error is
/// logged, and the terrain starts without it.
///
/// With a [`SavedWorld`](super::SavedWorld) on the same entity, an existing world is continued, and only a new one
/// starts from the level. That world saves only its differences from the level, and needs a level to be opened: if that
/// is another one, for example a new version, [`SavedWorld::base_changed`](super::SavedWorld::base_changed) decides
/// what happens. If a world is open already, inserting it has no effect.
///
/// The component is immutable: for another level, insert another one.
#[derive(Component, Clone, Debug, PartialEq)]
#[component(immutable, on_insert = hold)]
pub struct StartLevel(pub Handle<BurrowLevel>);

/// A level that is being made into a terrain.
#[derive(Component)]
pub(super) struct MakingLevel(pub ThreadTask<Result<Terrain, RestoreLevelError>>, pub Version);

/// A level that waits to be made into a terrain.
#[derive(Component)]
pub(super) struct Waiting {
    pub since: Instant,
    pub reported: bool,
}

impl Waiting {
    pub fn new() -> Self {
        Self { since: Instant::now(), reported: false }
    }
}

/// The levels that are loaded, and those that can't be.
#[derive(SystemParam)]
pub(super) struct FindLevel<'w> {
    levels: Option<Res<'w, Assets<BurrowLevel>>>,
    assets: Option<Res<'w, AssetServer>>,
}

impl FindLevel<'_> {
    /// A level; `None` while it is loaded.
    ///
    /// # Errors
    /// When it can't be loaded.
    pub fn find(&self, start: &StartLevel) -> Result<Option<&BurrowLevel>, String> {
        let id = start.0.id();
        if let Some(level) = self.levels.as_ref().and_then(|levels| levels.get(id)) {
            return Ok(Some(level));
        }
        if start.0 == Handle::default() {
            return Err("its handle names no asset".into());
        }
        match self.assets.as_ref().and_then(|assets| assets.get_load_state(id)) {
            Some(LoadState::Failed(why)) => Err(why.to_string()),
            _ => Ok(None),
        }
    }

    /// The game's name for a level.
    pub fn path_of(&self, start: Option<&StartLevel>) -> String {
        start.and_then(|start| start.0.path()).map(ToString::to_string).unwrap_or_default()
    }
}

/// Holds a terrain until its level is loaded.
pub(super) fn hold(mut world: DeferredWorld, context: HookContext) {
    warn_without_plugin(&world, "StartLevel");
    // A world that is closed with the same insertion is closed by then.
    world.commands().queue(move |world: &mut World| {
        let Ok(mut entity) = world.get_entity_mut(context.entity) else { return };
        if !entity.contains::<StartLevel>() {
            return;
        }
        if entity.contains::<WorldStore>() {
            warn!("a level for {} has no effect: its saved world continues", entity.id());
            return;
        }
        entity.remove::<MakingLevel>().insert(Waiting::new());
        hold_now(&mut entity);
    });
}
