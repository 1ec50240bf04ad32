//! Which tiles are loaded: all, or those around sources.

use std::sync::Arc;

use bevy::prelude::*;

use super::build::TILES;
use super::tiles::NavigationTiles;
use super::{Navigation, NavigationArea, NavigationSource};
use crate::ground::Ground;
use crate::navigation::{NavTilePos, Walker};
use crate::plugin::{Places, Squares, TerrainEntities, are_same, position_on, voxel_metres};
use crate::terrain::Terrain;

/// Reads settings that changed, chooses tiles, and starts to build those that are missing.
pub(super) fn choose_tiles(
    mut navigations: Query<(Entity, Ref<Navigation>, &mut NavigationTiles)>,
    terrains: Query<(&Terrain, &TerrainEntities)>,
    sources: Query<(Entity, &NavigationSource)>,
    places: Places,
    mut commands: Commands,
) {
    for (entity, navigation, mut tiles) in &mut navigations {
        let tiles = tiles.bypass_change_detection();
        let found = terrains.get(navigation.terrain).ok().zip(places.of(navigation.terrain));
        let Some(((terrain, entities), place)) = found else {
            tiles.clear(&mut commands);
            tiles.walker = None;
            continue;
        };
        // Negative if it is mirrored.
        let scale = voxel_metres(&place).copysign(place.affine().matrix3.determinant());
        tiles.read_agent((entity, &navigation), scale, &mut commands);
        let world = terrain.world();
        let is_same = tiles.version.is_some_and(|version| version.is_same_world(world.version()));
        if tiles.walker.is_none() || !is_same && !entities.show(world) {
            continue;
        }
        if tiles.version.is_some() && !is_same {
            tiles.clear(&mut commands);
        }
        if tiles.version.is_some() && tiles.version != Some(world.version()) {
            // Follows commits that were not seen, where a game gates their systems.
            tiles.miss_all();
        }
        tiles.version = Some(world.version());
        if navigation.area == NavigationArea::Everywhere {
            if !tiles.is_chosen {
                let all: Vec<NavTilePos> = NavTilePos::all(world).collect();
                tiles.choose(all.clone(), &all.into_iter().collect(), &mut commands);
            }
        } else {
            let inverse = place.affine().inverse();
            let sources: Vec<(Vec2, f32)> = sources
                .iter()
                .filter_map(|(source, &NavigationSource { radius })| {
                    let position = position_on(&inverse, &places.of(source)?)?;
                    Some((position, (radius / scale).clamp(0.0, 65536.0)))
                })
                .collect();
            tiles.choose_near(sources, world.ground(), &mut commands);
        }
        let is_loading = tiles.builds.iter().any(|build| !build.is_urgent);
        if !tiles.missing.is_empty() && !is_loading {
            let rest = tiles.missing.split_off(tiles.missing.len().min(TILES));
            let first = std::mem::replace(&mut tiles.missing, rest);
            tiles.build(&terrain.snapshot(), &first, false);
        }
    }
}

impl NavigationTiles {
    /// Reads the agent if it or the scale of the terrain changed, or if there is none yet. All tiles are dropped then.
    fn read_agent(
        &mut self,
        (entity, navigation): (Entity, &Ref<Navigation>),
        scale: f32,
        commands: &mut Commands,
    ) {
        // A turned terrain has a scale that is rounded in another way.
        let is_scaled = (self.scale - scale).abs() > 1e-4 * scale.abs();
        let is_new = navigation.is_changed() || is_scaled;
        if !is_new && self.walker.is_some() {
            return;
        }
        self.clear(commands);
        self.scale = scale;
        let walker = match scale {
            ..0.0 => Err("its terrain is mirrored, which landmass cannot follow".to_owned()),
            _ => Walker::new(&navigation.agent.scaled(1.0 / scale)).map_err(|error| error.to_string()),
        };
        if let Err(error) = &walker
            && is_new
        {
            error!("the navigation {entity} has no islands: {error}");
        }
        self.walker = walker.ok().map(Arc::new);
    }

    /// Chooses the tiles around sources, if these are others than before or have moved.
    fn choose_near(&mut self, sources: Vec<(Vec2, f32)>, ground: &Ground, commands: &mut Commands) {
        if self.is_chosen && are_same(&self.sources, &sources) {
            return;
        }
        let mut near = Squares::default();
        for &source in &sources {
            let key = |square: IVec2| NavTilePos { x: square.x, z: square.y };
            near.add(source, NavTilePos::SIZE, (ground.width(), ground.depth()), key);
        }
        self.sources = sources;
        self.choose(near.wanted(|_| true), &near.kept, commands);
    }
}
