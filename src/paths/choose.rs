//! Which tiles are loaded: all, or those around sources.

use std::sync::Arc;

use bevy::platform::collections::HashSet;
use bevy::prelude::*;

use super::build::TILES;
use super::tiles::NavigationTiles;
use super::{Navigation, NavigationArea, NavigationSource};
use crate::lattice::Column;
use crate::navigation::{NAV_TILE, NavTilePos, Walker};
use crate::plugin::{Places, TerrainEntities, voxel_metres};
use crate::terrain::{Terrain, World};

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
        // A turned terrain has a scale that is rounded in another way.
        let is_scaled = (tiles.scale - scale).abs() > 1e-4 * scale.abs();
        if navigation.is_changed() || tiles.walker.is_none() || is_scaled {
            let is_new = navigation.is_changed() || is_scaled;
            tiles.clear(&mut commands);
            tiles.scale = scale;
            let walker = match scale {
                ..0.0 => Err("its terrain is mirrored, which landmass cannot follow".to_owned()),
                _ => Walker::new(&navigation.agent.scaled(1.0 / scale)).map_err(|error| error.to_string()),
            };
            if let Err(error) = &walker
                && is_new
            {
                error!("the navigation {entity} has no islands: {error}");
            }
            tiles.walker = walker.ok().map(Arc::new);
        }
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
                    let at = inverse.transform_point3(places.of(source)?.translation());
                    at.is_finite().then_some((at.xz(), (radius / scale).clamp(0.0, 65536.0)))
                })
                .collect();
            let near = |(a, b): (&(Vec2, f32), &(Vec2, f32))| a.0.distance(b.0) < 1.0 && a.1 == b.1;
            let is_settled = tiles.is_chosen && sources.len() == tiles.sources.len();
            if !is_settled || !sources.iter().zip(&tiles.sources).all(near) {
                let (wanted, kept) = around(world, &sources);
                tiles.sources = sources;
                tiles.choose(wanted, &kept, &mut commands);
            }
        }
        let is_loading = tiles.builds.iter().any(|build| !build.is_urgent);
        if !tiles.missing.is_empty() && !is_loading {
            let rest = tiles.missing.split_off(tiles.missing.len().min(TILES));
            let first = std::mem::replace(&mut tiles.missing, rest);
            tiles.build(&terrain.snapshot(), &first, false);
        }
    }
}

/// The tiles near to sources, nearest first, and those that stay if they are there.
fn around(world: &World, sources: &[(Vec2, f32)]) -> (Vec<NavTilePos>, HashSet<NavTilePos>) {
    let (mut near, mut kept, mut seen) = (Vec::new(), HashSet::default(), HashSet::<NavTilePos>::default());
    let side = NAV_TILE as f32;
    for &(at, radius) in sources {
        // Half a tile more keeps one from coming and going.
        let far = radius + side / 2.0;
        let corner = |more: f32| Column::new((at.x + more).floor() as i32, (at.y + more).floor() as i32);
        for pos in NavTilePos::covering(world, corner(-far), corner(far)) {
            let low = Vec2::new(pos.x as f32, pos.z as f32) * side;
            let apart = at.distance(at.clamp(low, low + side));
            if apart <= far {
                kept.insert(pos);
            }
            if apart <= radius && seen.insert(pos) {
                near.push((apart, pos));
            }
        }
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    (near.into_iter().map(|(_, pos)| pos).collect(), kept)
}
