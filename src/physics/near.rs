//! Where colliders are wanted.

use avian3d::prelude::*;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::colliders::Grounds;
use crate::plugin::Part;
use crate::terrain::{Drawn, Terrain};

/// How far ahead of a source colliders are made, in seconds.
const AHEAD: f32 = 1.0;

/// Places that a way ahead is looked at in, at most.
const STOPS: u32 = 64;

/// Ground around this entity has colliders, in all columns of chunks within its radius; elsewhere it has none.
///
/// Put it on players and on whatever else needs ground. With a `LinearVelocity`, ground where it will be in a second has
/// colliders too. Bodies need not be sources: those too far from any are [held](super::HeldByGround).
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

/// Sources as terrains see them: places in voxels along x and z, and a radius.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Neighbourhood(HashMap<Entity, Vec<(Vec2, f32)>>);

impl Neighbourhood {
    /// How far the nearest source's radius ends from a part's column, in voxels; negative within it.
    pub fn distance(&self, part: &Part) -> Option<f32> {
        let size = part.size as f32;
        let low = match part.drawn {
            Drawn::Tile(tile) => Vec2::new(tile.x as f32, tile.z as f32) * size,
            Drawn::Chunk(chunk) => Vec2::new(chunk.x as f32, chunk.z as f32) * size,
        };
        let sources = self.0.get(&part.terrain)?.iter();
        let distance = |&(place, radius): &(Vec2, f32)| place.distance(place.clamp(low, low + size)) - radius;
        sources.map(distance).min_by(f32::total_cmp)
    }
}

/// Tells tasks where sources are.
pub(super) fn find_near(
    grounds: Res<Grounds>,
    places: TransformHelper,
    terrains: Query<(Entity, &Terrain)>,
    sources: Query<(Entity, &ColliderSource, Option<&LinearVelocity>)>,
    mut known: Local<Neighbourhood>,
) {
    let mut near = Neighbourhood::default();
    for (terrain, model) in &terrains {
        let Ok(place) = places.compute_global_transform(terrain) else { continue };
        let (inverse, size) = (place.affine().inverse(), model.voxel_size());
        let stride = model.world().grid().size() as f32;
        let mut stops = Vec::new();
        for (source, &ColliderSource { radius }, velocity) in &sources {
            let Ok(place) = places.compute_global_transform(source) else { continue };
            let from = place.translation();
            let to = from + velocity.map_or(Vec3::ZERO, |velocity| velocity.0 * AHEAD);
            let [from, to] = [from, to].map(|place| inverse.transform_point3(place).xz());
            if !(from.is_finite() && to.is_finite() && radius >= 0.0) {
                continue;
            }
            let count = ((from.distance(to) / stride).ceil() as u32).min(STOPS);
            // Not every hair's breadth of a move is news.
            let stop = |at: u32| from.lerp(to, at as f32 / count.max(1) as f32).round();
            stops.extend((0..=count).map(|at| (stop(at), radius / size + 1.0)));
        }
        near.0.insert(terrain, stops);
    }
    if *known != near {
        grounds.set_near(near.clone());
        *known = near;
    }
}
