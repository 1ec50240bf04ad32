//! Sources: entities around which ground has colliders.

use avian3d::prelude::*;
use bevy::ecs::entity::EntityHashSet;
use bevy::math::Vec3A;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::colliders::GroundColliders;
use super::near::{Neighbourhood, ahead, shortest_side, stops};
use super::solids::{Extent, Solids};
use super::{ColliderSource, HeldByGround, PhysicsFigures, TerrainPhysicsDisabled};
use crate::lattice::ChunkGrid;
use crate::plugin::{LevelsOfDetail, Places, WantedTiles};
use crate::terrain::Terrain;

/// How far ahead of a moving source colliders are made, in seconds.
const AHEAD: f32 = 1.0;

/// About how many bytes colliders take for each cell (x, z): two triangles, with their share of vertices and of the
/// tree.
const CELL_BYTES: f32 = 186.0;

/// A source that wants colliders of more bytes than this is warned of.
const MUCH: f32 = 256e6;

/// About how many bytes the colliders within a radius take, in voxels.
fn bytes_within(grid: ChunkGrid, radius: f32) -> f32 {
    let all = grid.width() as f32 * grid.depth() as f32;
    (std::f32::consts::PI * radius * radius).min(all) * CELL_BYTES
}

fn warn_of_radius(source: Entity, terrain: Entity, bytes: f32) {
    warn!(
        "the ColliderSource of {source} wants colliders of about {:.0} MB on the terrain {terrain}, which take long to make \
         and stay in memory: give it a radius of what moves there in a few seconds, and a source of its own to everything \
         else that needs ground",
        bytes / 1e6
    );
}

/// Finds where sources want colliders.
pub(super) fn find_near(
    colliders: Res<GroundColliders>,
    places: Places,
    terrains: Query<(Entity, &Terrain, Has<LevelsOfDetail>), Without<TerrainPhysicsDisabled>>,
    sources: Query<(Entity, &ColliderSource, Option<&LinearVelocity>, Option<&HeldByGround>, Extent)>,
    solids: Solids,
    mut known: Local<Neighbourhood>,
    mut wanted: ResMut<WantedTiles>,
    mut warned: Local<EntityHashSet>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    let mut near = Neighbourhood::default();
    for (terrain, model, _) in &terrains {
        let Ok(place) = places.compute_global_transform(terrain) else { continue };
        let (inverse, size) = (place.affine().inverse(), shortest_side(&place));
        let (grid, layers) = (model.world().grid(), solids.layers(terrain));
        let mut all = Vec::new();
        for (source, &ColliderSource { radius }, velocity, hold, extent) in &sources {
            let Ok(place) = places.compute_global_transform(source) else { continue };
            // A held body continues with the velocity that it had.
            let velocity = hold.and_then(HeldByGround::stopped).or(velocity.map(|velocity| velocity.0));
            let from = inverse.transform_point3(place.translation());
            let way = inverse.transform_vector3(velocity.unwrap_or_default() * AHEAD);
            if !(from.is_finite() && way.is_finite() && radius >= 0.0) {
                continue;
            }
            // A source reaches at least its own size; otherwise it could be held forever.
            let reach = solids.reach(&extent, layers).map_or(Vec3::ZERO, |reach| reach.farthest());
            let own = Vec3::from(inverse.matrix3.abs() * Vec3A::from(reach)).xz().length();
            let radius = (radius / size).max(own);
            all.extend(stops(grid, from.xz(), ahead(way, grid).xz(), radius));
            if bytes_within(grid, radius) > MUCH && warned.insert(source) {
                warn_of_radius(source, terrain, bytes_within(grid, radius));
            }
        }
        near.insert(terrain, grid, all, &known);
    }
    if !near.is_same(&known) {
        colliders.set_near(near.clone());
        let with_lod = terrains.iter().filter(|(.., has_lod)| *has_lod);
        wanted.0 = with_lod.map(|(terrain, ..)| (terrain, near.tiles(terrain).collect())).collect();
        *known = near;
    }
    figures.main_thread += start.elapsed();
}
