//! Sources: entities around which ground has colliders.

use avian3d::prelude::*;
use bevy::math::Vec3A;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::colliders::Grounds;
use super::near::{Neighbourhood, ahead, stops, voxel_size};
use super::solids::{Extent, Solids};
use super::{HeldByGround, PhysicsFigures};
use crate::terrain::Terrain;

/// How far ahead of a source colliders are made, in seconds.
const AHEAD: f32 = 1.0;

/// Ground around this entity has colliders, in all columns of chunks within its radius; elsewhere it has none.
///
/// Put it on players and on whatever else needs ground. With a radius of `f32::INFINITY` all ground has colliders, wherever
/// the entity is.
///
/// A source that comes to another voxel costs some time on the main thread for each column of chunks within its radius, and
/// around each chunk's width of its way; one that reaches all of a terrain, only when it comes to another column. Each
/// collider costs time in a task, and memory.
///
/// With a `LinearVelocity`, ground where it will be in a second, or on the next 64 chunks of its way, has colliders too.
/// Bodies need not be sources: those too far from any are [held](super::HeldByGround).
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default)]
#[require(Transform)]
pub struct ColliderSource {
    /// Metres, along x and z.
    pub radius: f32,
}

impl Default for ColliderSource {
    fn default() -> Self {
        Self { radius: 48.0 }
    }
}

/// Finds where sources are, for tasks to know.
pub(super) fn find_near(
    grounds: Res<Grounds>,
    places: TransformHelper,
    terrains: Query<(Entity, &Terrain)>,
    sources: Query<(Entity, &ColliderSource, Option<&LinearVelocity>, Option<&HeldByGround>, Extent)>,
    solids: Solids,
    mut known: Local<Neighbourhood>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    let mut near = Neighbourhood::default();
    for (terrain, model) in &terrains {
        let Ok(place) = places.compute_global_transform(terrain) else { continue };
        let (inverse, size) = (place.affine().inverse(), voxel_size(&place));
        let grid = model.world().grid();
        let mut all = Vec::new();
        for (source, &ColliderSource { radius }, velocity, hold, extent) in &sources {
            let Ok(place) = places.compute_global_transform(source) else { continue };
            // One that is held goes on as it came, once there is ground where it was going.
            let velocity = hold.and_then(HeldByGround::stopped).or(velocity.map(|velocity| velocity.0));
            let from = inverse.transform_point3(place.translation());
            let way = inverse.transform_vector3(velocity.unwrap_or_default() * AHEAD);
            if !(from.is_finite() && way.is_finite() && radius >= 0.0) {
                continue;
            }
            // No body is held for want of ground that it reaches itself.
            let reach = solids.reach(&extent).map_or(Vec3::ZERO, |reach| reach.farthest());
            let own = Vec3::from(inverse.matrix3.abs() * Vec3A::from(reach)).xz().length();
            all.extend(stops(grid, from.xz(), ahead(way, grid).xz(), (radius / size).max(own)));
        }
        near.insert(terrain, grid, all, &known);
    }
    if !near.is(&known) {
        grounds.set_near(near.clone());
        *known = near;
    }
    figures.main_thread += start.elapsed();
}
