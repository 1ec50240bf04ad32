//! Levels as assets: what a designer sculpted is loaded with the ground's other assets.

use std::sync::Arc;

use bevy::asset::io::{Reader, Writer};
use bevy::asset::saver::{AssetSaver, SavedAsset};
use bevy::asset::{AssetLoadFailedEvent, AssetLoader, AssetPath, AsyncWriteExt, LoadContext};
use bevy::prelude::*;

use super::opening::Unopened;
use crate::plugin::{Held, ThreadTask, Threads, free_later};
use crate::store::{FormatError, Level, LevelFiles, RestoreLevelError, pack_level, read_level, unpack_level};
use crate::terrain::Terrain;

/// A level, packed in one file with the extension `burrow_level`. What it holds is checked when it is loaded; that it fits its ground,
/// when a terrain is made of it.
#[derive(Asset, TypePath, Clone, Debug, Default, PartialEq)]
pub struct BurrowLevel(pub LevelFiles);

impl BurrowLevel {
    /// A level as an asset.
    ///
    /// # Errors
    /// When settings hold numbers that can't be written.
    pub fn new(level: &Level) -> Result<Self, FormatError> {
        crate::store::write_level(level).map(Self)
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
        Ok(read_level(&self.0, &ground)?.terrain(ground)?)
    }
}

/// Why a level can't be loaded or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LevelError {
    /// The file can't be read or written.
    #[error("the level can't be read or written: {0}")]
    File(#[from] std::io::Error),
    /// The file is damaged, or none of a level.
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
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        Ok(BurrowLevel(unpack_level(&bytes)?))
    }

    fn extensions(&self) -> &[&str] {
        &["burrow_level"]
    }
}

/// Writes packed levels, say in an asset processor.
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
        writer.write_all(&pack_level(&asset.0)?).await?;
        Ok(())
    }
}

/// The terrain of this entity begins as a level. Insert it with a terrain without edits, which gives the ground; the terrain is
/// [`Held`] until the level is loaded. With a [`SavedWorld`](super::SavedWorld) beside it, a world that was saved goes on, and only a
/// new one begins as the level. That world saves only what differs from the level, and needs a level to go on: where it is another
/// one, say a new version of it, [`SavedWorld::base_changed`](super::SavedWorld::base_changed) says what happens.
#[derive(Component, Clone, Debug, PartialEq)]
pub struct StartLevel(pub Handle<BurrowLevel>);

/// A level that a terrain is made of.
#[derive(Component)]
pub(super) struct MakingLevel(ThreadTask<Result<Terrain, RestoreLevelError>>);

/// Holds a terrain until its level is loaded.
pub(super) fn hold(new: On<Insert, StartLevel>, mut commands: Commands) {
    commands.entity(new.entity).try_remove::<MakingLevel>().try_insert((Held, Waiting));
}

/// A level that nobody has begun to make a terrain of.
#[derive(Component)]
pub(super) struct Waiting;

/// Makes terrains of levels that are loaded, and puts them in place.
pub(super) fn start_levels(
    mut commands: Commands,
    levels: Option<Res<Assets<BurrowLevel>>>,
    mut failures: Option<MessageReader<AssetLoadFailedEvent<BurrowLevel>>>,
    waiting: Query<(Entity, &StartLevel, &Terrain), With<Waiting>>,
    mut making: Query<(Entity, &mut Terrain, &mut MakingLevel, Has<Unopened>), Without<Waiting>>,
) {
    let failed: Vec<_> =
        failures.iter_mut().flat_map(|failures| failures.read().map(|failure| failure.id)).collect();
    for (entity, start, terrain) in &waiting {
        if failed.contains(&start.0.id()) {
            error!("the level of {entity} can't be loaded: the terrain begins without it");
            commands.entity(entity).try_remove::<(Waiting, Held)>();
        }
        let Some(level) = levels.as_ref().and_then(|levels| levels.get(&start.0)) else { continue };
        let (level, ground) = (level.clone(), terrain.world().shared_ground());
        let task = ThreadTask::start(Threads::Background, move || level.terrain(ground));
        commands.entity(entity).try_remove::<Waiting>().try_insert(MakingLevel(task));
    }
    for (entity, mut terrain, mut level, is_unopened) in &mut making {
        let Some(made) = level.0.finish() else { continue };
        match made {
            Ok(mut made) => {
                made.take_over(&mut terrain);
                free_later(std::mem::replace(&mut *terrain, made));
            }
            Err(why) => error!("the level of {entity} does not fit: {why}"),
        }
        commands.entity(entity).try_remove::<MakingLevel>();
        // A saved world is read next.
        if !is_unopened {
            commands.entity(entity).try_remove::<Held>();
        }
    }
}
