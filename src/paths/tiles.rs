//! The tiles of a navigation that are loaded, and their islands.

use std::sync::Arc;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy_landmass::prelude::*;

use super::Navigation;
use crate::navigation::{LedgeLink, NavPolygons, NavTilePos, Walker};
use crate::terrain::Version;
use crate::threads::ThreadTask;

/// The tiles of a [`Navigation`] that are loaded.
#[derive(Component, Debug, Default)]
pub struct NavigationTiles {
    /// The agent in voxels; `None` until settings without an error were read.
    pub(super) walker: Option<Arc<Walker>>,
    /// Metres of a voxel in world space.
    pub(super) scale: f32,
    /// The world that the tiles are up to date with, or are being built for.
    pub(super) version: Option<Version>,
    pub(super) tiles: HashMap<NavTilePos, LoadedTile>,
    /// Tiles that are not being built yet.
    pub(super) missing: Vec<NavTilePos>,
    pub(super) builds: Vec<Build>,
    /// The number of the latest build.
    pub(super) count: u64,
    /// The sources of the last choice.
    pub(super) sources: Vec<(Vec2, f32)>,
    pub(super) is_chosen: bool,
}

/// A tile that is loaded, or waits to be.
#[derive(Debug, Default)]
pub(super) struct LoadedTile {
    /// The number of the build that made it; 0 before the first.
    pub build: u64,
    pub polygons: Option<Arc<NavPolygons>>,
    pub island: Option<Entity>,
    /// The tile's links over ledges; `links` are their entities, children of the island.
    pub ledges: Vec<LedgeLink>,
    pub links: Vec<Entity>,
}

/// A tile that was built; `None` where nothing is walkable.
pub(super) type BuiltTile = (NavTilePos, Option<BuiltMesh>);

/// The mesh of a tile.
pub(super) struct BuiltMesh {
    pub polygons: NavPolygons,
    pub ledges: Vec<LedgeLink>,
    pub mesh: Arc<ValidNavigationMesh3d>,
}

/// A task that builds tiles.
pub(super) struct Build {
    pub number: u64,
    pub tiles: Vec<NavTilePos>,
    /// Whether the next frame waits for it: a commit changed these tiles, so agents may be on them.
    pub is_awaited: bool,
    /// Whether a commit changed these tiles.
    pub is_urgent: bool,
    pub task: ThreadTask<Vec<BuiltTile>>,
}

impl std::fmt::Debug for Build {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Build").field("number", &self.number).finish_non_exhaustive()
    }
}

impl NavigationTiles {
    /// Number of tiles, with and without an island.
    pub fn len(&self) -> usize {
        self.tiles.len()
    }

    /// Returns `true` if there are none.
    pub fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// Whether tiles are still being built for the first time.
    pub fn is_loading(&self) -> bool {
        self.walker.is_some() && (!self.is_chosen || self.tiles.values().any(|tile| tile.build == 0))
    }

    /// Whether a change of the ground is still on its way to landmass.
    pub fn is_building(&self) -> bool {
        !self.builds.is_empty() || !self.missing.is_empty()
    }

    /// The islands, in no order: the tile, its entity and its polygons.
    pub fn islands(&self) -> impl Iterator<Item = (NavTilePos, Entity, &NavPolygons)> {
        self.tiles.iter().filter_map(|(&pos, tile)| Some((pos, tile.island?, tile.polygons.as_deref()?)))
    }

    /// Bytes of the polygons of all tiles, without those of landmass.
    pub fn bytes(&self) -> usize {
        self.islands().map(|(.., polygons)| polygons.bytes()).sum()
    }

    /// Drops all tiles and despawns their islands.
    pub(super) fn clear(&mut self, commands: &mut Commands) {
        for (_, tile) in self.tiles.drain() {
            despawn(tile.island, commands);
        }
        let (walker, scale, count) = (self.walker.take(), self.scale, self.count);
        *self = Self { walker, scale, count, ..Self::default() };
    }

    /// All tiles are to be built again: those that wait already first, then the oldest.
    pub(super) fn miss_all(&mut self) {
        let waiting: HashSet<NavTilePos> = self.missing.iter().copied().collect();
        let others = self.tiles.iter().filter(|(pos, _)| !waiting.contains(*pos));
        let mut others: Vec<(u64, NavTilePos)> = others.map(|(&pos, tile)| (tile.build, pos)).collect();
        others.sort_unstable();
        self.missing.extend(others.into_iter().map(|(_, pos)| pos));
    }

    /// Drops the tiles that are not wanted, and adds those that are missing, in this order.
    pub(super) fn choose(
        &mut self,
        wanted: Vec<NavTilePos>,
        kept: &HashSet<NavTilePos>,
        commands: &mut Commands,
    ) {
        self.tiles.retain(|pos, tile| {
            let stays = kept.contains(pos);
            if !stays {
                despawn(tile.island, commands);
            }
            stays
        });
        self.missing.retain(|pos| kept.contains(pos));
        for pos in wanted {
            if !self.tiles.contains_key(&pos) {
                self.tiles.insert(pos, LoadedTile::default());
                self.missing.push(pos);
            }
        }
        self.is_chosen = true;
    }
}

pub(super) fn despawn(island: Option<Entity>, commands: &mut Commands) {
    if let Some(island) = island {
        commands.entity(island).try_despawn();
    }
}

/// Despawns the islands of a navigation that is removed or despawned.
pub(super) fn remove_islands(
    gone: On<Remove, Navigation>,
    mut navigations: Query<&mut NavigationTiles, Allow<Disabled>>,
    mut commands: Commands,
) {
    if let Ok(mut tiles) = navigations.get_mut(gone.entity) {
        tiles.clear(&mut commands);
        tiles.walker = None;
    }
}

/// Despawns the islands of a navigation that is disabled.
pub(super) fn disable(
    disabled: On<Add, Disabled>,
    mut navigations: Query<&mut NavigationTiles, Allow<Disabled>>,
    mut commands: Commands,
) {
    if let Ok(mut tiles) = navigations.get_mut(disabled.entity) {
        tiles.clear(&mut commands);
    }
}
