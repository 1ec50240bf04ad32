//! Where colliders are wanted.

use std::sync::Arc;

use avian3d::prelude::*;
use bevy::math::Vec3A;
use bevy::platform::collections::HashMap;
use bevy::platform::time::Instant;
use bevy::prelude::*;
use rustc_hash::FxHashMap;

use super::colliders::Grounds;
use super::columns::ColumnKey;
use super::solids::{Extent, Solids};
use super::{HeldByGround, PhysicsFigures};
use crate::lattice::{ChunkGrid, TilePos};
use crate::terrain::Terrain;

/// How far ahead of a source colliders are made, in seconds.
const AHEAD: f32 = 1.0;

/// Places that a way ahead is looked at in, at most: one for each chunk's width of it.
const STOPS: u32 = 64;

/// How long a voxel's side is in the world, in metres: below a scaled parent not what the terrain says. Its shortest side
/// where the terrain is stretched.
pub(super) fn voxel_size(place: &GlobalTransform) -> f32 {
    place.scale().abs().min_element()
}

/// What counts of a way ahead, in voxels: as much of it as colliders are made for.
pub(super) fn ahead(way: Vec3, grid: ChunkGrid) -> Vec3 {
    way.clamp_length_max(STOPS as f32 * grid.size() as f32)
}

/// Ground around this entity has colliders, in all columns of chunks within its radius; elsewhere it has none.
///
/// Put it on players and on whatever else needs ground. With a `LinearVelocity`, ground where it will be in a second, or on
/// the next 64 chunks of its way, has colliders too. Bodies need not be sources: those too far from any are [held](super::HeldByGround).
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

/// A place in voxels along x and z, and how far around it colliders are wanted.
type Stop = (Vec2, f32);

/// Where sources are over one terrain.
#[derive(Debug)]
struct Area {
    grid: ChunkGrid,
    stops: Vec<Stop>,
    /// How far the nearest source's radius ends from a column, in voxels; negative within it. Columns farther off than a
    /// chunk is wide are not in here.
    columns: FxHashMap<TilePos, f32>,
}

impl Area {
    fn new(grid: ChunkGrid, stops: Vec<Stop>) -> Self {
        let (size, (width, depth)) = (grid.size() as f32, grid.tile_counts());
        let mut columns = FxHashMap::default();
        for &(place, radius) in &stops {
            let reach = radius + size;
            let (low, high) = ((place - reach) / size - 1.0, (place + reach) / size);
            let (low, high) = (low.floor().as_ivec2().max(IVec2::ZERO), high.floor().as_ivec2());
            for z in low.y..=high.y.min(depth - 1) {
                for x in low.x..=high.x.min(width - 1) {
                    let corner = Vec2::new(x as f32, z as f32) * size;
                    let distance = place.distance(place.clamp(corner, corner + size)) - radius;
                    if distance <= size {
                        let nearest = columns.entry(TilePos { x, z }).or_insert(distance);
                        *nearest = nearest.min(distance);
                    }
                }
            }
        }
        Self { grid, stops, columns }
    }
}

/// Sources as terrains see them.
#[derive(Clone, Debug, Default)]
pub(super) struct Neighbourhood(HashMap<Entity, Arc<Area>>);

impl Neighbourhood {
    /// How far the nearest source's radius ends from a column, in voxels; negative within it. `None` if that is farther
    /// than a chunk is wide: colliders go there, but not before, for those who walk along a border are not to make them
    /// come and go.
    pub fn distance(&self, (terrain, column): ColumnKey) -> Option<f32> {
        self.0.get(&terrain)?.columns.get(&column).copied()
    }

    /// Is it the very same?
    pub fn is(&self, other: &Self) -> bool {
        let is_in_other =
            |(terrain, area): (_, &Arc<Area>)| other.0.get(terrain).is_some_and(|own| Arc::ptr_eq(own, area));
        self.0.len() == other.0.len() && self.0.iter().all(is_in_other)
    }

    /// The columns that sources have come to since, or have left.
    pub fn changes(&self, before: &Self, mut change: impl FnMut(ColumnKey)) {
        let kind = |distance: Option<f32>| distance.map(|distance| distance <= 0.0);
        for (side, other) in [(self, before), (before, self)] {
            for (&terrain, area) in &side.0 {
                let other = other.0.get(&terrain);
                if other.is_some_and(|other| Arc::ptr_eq(other, area)) {
                    continue;
                }
                for (&column, &distance) in &area.columns {
                    let distance_there = other.and_then(|other| other.columns.get(&column).copied());
                    if kind(Some(distance)) != kind(distance_there) {
                        change((terrain, column));
                    }
                }
            }
        }
    }
}

/// Looks where sources are, and tells tasks.
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
        let stride = grid.size() as f32;
        let mut stops = Vec::new();
        for (source, &ColliderSource { radius }, velocity, hold, extent) in &sources {
            let Ok(place) = places.compute_global_transform(source) else { continue };
            // One that is held goes on as it came, once there is ground where it was going.
            let velocity = hold.and_then(HeldByGround::stopped).or(velocity.map(|velocity| velocity.0));
            let from = inverse.transform_point3(place.translation());
            let way = inverse.transform_vector3(velocity.unwrap_or_default() * AHEAD);
            if !(from.is_finite() && way.is_finite() && radius >= 0.0) {
                continue;
            }
            let (from, way) = (from.xz(), ahead(way, grid).xz());
            let count = (way.length() / stride).ceil();
            let apart = way / count.max(1.0);
            // Nor is a body held for want of ground that it reaches itself, or that is between two stops.
            let reach = solids.reach(&extent).map_or(Vec3::ZERO, |reach| reach.farthest());
            let own = Vec3::from(inverse.matrix3.abs() * Vec3A::from(reach)).xz().length();
            let radius = (radius / size).max(own) + (apart.length() / 2.0).ceil();
            // Not every hair's breadth of a move is news.
            let stop = |at: u32| (from + apart * at as f32).round();
            stops.extend((0..=count as u32).map(|at| (stop(at), radius + 1.0)));
        }
        let same = known.0.get(&terrain).filter(|area| area.grid == grid && area.stops == stops);
        let area = same.cloned().unwrap_or_else(|| Arc::new(Area::new(grid, stops)));
        near.0.insert(terrain, area);
    }
    if !near.is(&known) {
        grounds.set_near(near.clone());
        *known = near;
    }
    figures.main_thread += start.elapsed();
}
