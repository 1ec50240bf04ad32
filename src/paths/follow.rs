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
