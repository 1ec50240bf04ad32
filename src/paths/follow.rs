//! Follows commits: tiles that a commit changed are built at once.

use bevy::prelude::*;

use super::Navigation;
use super::tiles::NavigationTiles;
use crate::navigation::NavTilePos;
use crate::plugin::GroundChanged;
use crate::terrain::Terrain;

/// Starts to build the tiles that a commit of this frame changed.
pub(super) fn follow_commits(
    mut changed: MessageReader<GroundChanged>,
    mut navigations: Query<(&Navigation, &mut NavigationTiles)>,
    terrains: Query<&Terrain>,
) {
    for GroundChanged { terrain, versions: [before, after], boxes } in changed.read() {
        let Ok(model) = terrains.get(*terrain) else { continue };
        let world = model.world();
        for (_, mut tiles) in navigations.iter_mut().filter(|(navigation, _)| navigation.terrain == *terrain)
        {
            let tiles = tiles.bypass_change_detection();
            let (Some(version), Some(walker)) = (tiles.version, tiles.walker.clone()) else { continue };
            // Another world is loaded again as a whole. This system runs twice in a frame, so it may have followed this
            // commit already.
            if !version.is_same_world(*after) || version == *after || version == world.version() {
                continue;
            }
            let mut stale: Vec<NavTilePos> = match boxes {
                Some(boxes) if version == *before => {
                    let affected =
                        boxes.iter().flat_map(|&samples| NavTilePos::affected(world, samples, &walker));
                    affected.filter(|pos| tiles.tiles.contains_key(pos)).collect()
                }
                _ => tiles.tiles.keys().copied().collect(),
            };
            stale.sort_unstable();
            stale.dedup();
            tiles.version = Some(*after);
            // Those that were not begun yet are built from the latest world anyway.
            stale.retain(|pos| !tiles.missing.contains(pos));
            if !stale.is_empty() {
                tiles.build(&model.snapshot(), &stale, true);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::time::Duration;

    use bevy_landmass::prelude::{Archipelago3d, Landmass3dPlugin};

    use super::*;
    use crate::BurrowPlugins;
    use crate::brush::{Brush, Shape};
    use crate::ground::Ground;
    use crate::navigation::{WalkSettings, WalkableTile};
    use crate::paths::{NavigationArea, NavigationPlugin};
    use crate::plugin::test_app::{commit_two_in_a_frame, meshes_only, model, run_until};
    use crate::terrain::TerrainSettings;

    /// A dig in the middle of the tile with this number along x and z.
    fn dig(tile: i32) -> Brush {
        let middle = tile as f32 * 32.0 + 16.0;
        Brush::dig(Shape::sphere(Vec3::new(middle, 10.0, middle), 3.0))
    }

    /// An app with level ground of 5 x 5 tiles, all of which are loaded: the terrain and its navigation.
    fn app() -> (App, [Entity; 2]) {
        let mut app = meshes_only();
        app.add_plugins(Landmass3dPlugin::default().in_schedule(PreUpdate))
            .add_plugins((BurrowPlugins, NavigationPlugin { wait: Duration::from_secs(60) }));
        app.finish();
        app.cleanup();
        let agent = WalkSettings::default();
        let archipelago = app.world_mut().spawn(Archipelago3d::new(agent.archipelago_options(1.0))).id();
        let ground = Ground::flat(160, 160, 10.0).expect("valid ground");
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        let terrain = app.world_mut().spawn(terrain).id();
        let area = NavigationArea::Everywhere;
        let navigation = app.world_mut().spawn(Navigation { terrain, archipelago, agent, area }).id();
        run_until(&mut app, |app| {
            let tiles = tiles(app, navigation);
            tiles.len() == 25 && !tiles.is_loading() && !tiles.is_building()
        });
        (app, [terrain, navigation])
    }

    fn tiles(app: &App, navigation: Entity) -> &NavigationTiles {
        app.world().get(navigation).expect("`Navigation` requires it")
    }

    /// The number of the build that made each tile.
    fn builds(app: &App, navigation: Entity) -> BTreeMap<NavTilePos, u64> {
        tiles(app, navigation).tiles.iter().map(|(&pos, tile)| (pos, tile.build)).collect()
    }

    #[test]
    fn after_two_commits_in_one_frame_only_tiles_near_them_are_built_again() {
        let (mut app, [terrain, navigation]) = app();
        let before = builds(&app, navigation);
        commit_two_in_a_frame(&mut app, terrain, [0, 3].map(dig));
        run_until(&mut app, |app| !tiles(app, navigation).is_building());
        let rebuilt: Vec<NavTilePos> = builds(&app, navigation)
            .into_iter()
            .filter(|(pos, build)| before[pos] != *build)
            .map(|(pos, _)| pos)
            .collect();
        assert_eq!(rebuilt, [0, 3].map(|at| NavTilePos { x: at, z: at }));
        // All tiles are those of the ground with both digs.
        let tiles = tiles(&app, navigation);
        let walker = tiles.walker.as_ref().expect("valid settings");
        for (&pos, tile) in &tiles.tiles {
            let polygons = WalkableTile::new(model(&app, terrain), pos, walker).polygons();
            assert_eq!(tile.polygons.as_deref(), Some(&polygons), "{pos:?}");
        }
    }
}
