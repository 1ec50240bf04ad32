//! The places that need colliders.

use std::sync::Arc;

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use rustc_hash::FxHashMap;

use super::columns::ColumnKey;
use crate::lattice::{ChunkGrid, TilePos};
use crate::plugin::squares_within;

/// The most stops on a way ahead, one for each chunk's width.
const STOPS: u32 = 64;

/// The shortest side of a voxel in world space, in metres: where parents stretch a terrain, colliders must not fall
/// short.
pub(super) fn shortest_side(place: &GlobalTransform) -> f32 {
    place.scale().abs().min_element()
}

/// Limits a way ahead to the length for which colliders are made, in voxels.
pub(super) fn ahead(way: Vec3, grid: ChunkGrid) -> Vec3 {
    way.clamp_length_max(STOPS as f32 * grid.size() as f32)
}

/// A disc in which colliders are wanted: centre (x, z) and radius, in voxels.
pub(super) type Stop = (Vec2, f32);

/// How many of the largest stops are tested for covering others. A crowd has thousands of equal ones, which cover none.
const LARGEST: usize = 16;

/// The far corner of a grid's columns, in voxels.
fn end(grid: ChunkGrid) -> Vec2 {
    let (width, depth) = grid.tile_counts();
    Vec2::new(width as f32, depth as f32) * grid.size() as f32
}

/// Whether a stop covers the whole grid.
fn reaches_all(grid: ChunkGrid, (place, radius): Stop) -> bool {
    let end = end(grid);
    place.abs().max((place - end).abs()).length() <= radius
}

/// Whether the first stop contains the second, by more than rounding.
fn covers((large, radius): Stop, (place, small): Stop) -> bool {
    large == place && radius >= small || large.distance(place) + 1.0 <= radius - small
}

/// The stops that no other one contains.
fn uncovered(stops: &[Stop]) -> Vec<Stop> {
    let mut sorted = stops.to_vec();
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<Stop> = Vec::new();
    for stop in sorted {
        if !kept.iter().take(LARGEST).any(|&large| covers(large, stop)) {
            kept.push(stop);
        }
    }
    kept
}

/// Drops stops that add nothing: if some cover the whole grid, only those are kept.
fn relevant(grid: ChunkGrid, mut stops: Vec<Stop>) -> Vec<Stop> {
    if stops.iter().any(|&stop| reaches_all(grid, stop)) {
        stops.retain(|&stop| reaches_all(grid, stop));
    }
    stops
}

/// The stops of a source at `from` that moves along `way`: one at its place, and one for each chunk's width ahead. All
/// in voxels.
pub(super) fn stops(grid: ChunkGrid, from: Vec2, way: Vec2, radius: f32) -> Vec<Stop> {
    let stride = grid.size() as f32;
    // Rounded, so that small moves change nothing. A source that covers the whole grid is rounded to its column: it
    // only decides which colliders are built first.
    let home = (from / stride).floor() * stride + stride / 2.0;
    if reaches_all(grid, (home, radius + 1.0)) {
        return vec![(home.clamp(Vec2::ZERO, end(grid)), end(grid).length() + 1.0)];
    }
    let count = (way.length() / stride).ceil();
    let apart = way / count.max(1.0);
    // Discs must overlap enough to leave no gap between two stops.
    let radius = radius + (apart.length() / 2.0).ceil() + 1.0;
    (0..=count as u32).map(|at| ((from + apart * at as f32).round(), radius)).collect()
}

/// The stops over one terrain.
#[derive(Debug)]
struct Area {
    grid: ChunkGrid,
    stops: Vec<Stop>,
    /// Whether one stop covers the whole grid.
    is_all: bool,
    /// The distance from each column to the nearest disc, in voxels; negative inside. Columns farther away than a
    /// chunk's width are left out.
    columns: FxHashMap<TilePos, f32>,
}

impl Area {
    fn new(grid: ChunkGrid, stops: Vec<Stop>) -> Self {
        let (size, cells) = (grid.size(), (grid.width(), grid.depth()));
        let mut columns = FxHashMap::default();
        let is_all = stops.iter().any(|&stop| reaches_all(grid, stop));
        for (place, radius) in uncovered(&stops) {
            // One more, as the sum is rounded.
            let reach = radius + size as f32 + 1.0;
            for (square, apart) in squares_within(place, reach, size, cells) {
                let distance = apart - radius;
                if distance > size as f32 {
                    continue;
                }
                let nearest = columns.entry(TilePos { x: square.x, z: square.y }).or_insert(distance);
                *nearest = distance.min(*nearest);
            }
        }
        Self { grid, stops, is_all, columns }
    }
}

/// The stops over all terrains.
#[derive(Clone, Debug, Default)]
pub(super) struct Neighbourhood(HashMap<Entity, Arc<Area>>);

impl Neighbourhood {
    /// Adds a terrain with the stops of its sources. An area equal to that of `before` is shared.
    pub fn insert(&mut self, terrain: Entity, grid: ChunkGrid, stops: Vec<Stop>, before: &Self) {
        let stops = relevant(grid, stops);
        let same = before.0.get(&terrain).filter(|area| area.grid == grid && area.stops == stops);
        let area = same.cloned().unwrap_or_else(|| Arc::new(Area::new(grid, stops)));
        self.0.insert(terrain, area);
    }

    /// The distance from a column to the nearest disc, in voxels; negative inside. `None` beyond a chunk's width, where
    /// colliders are removed. The margin keeps colliders from flickering for sources that move along a border.
    pub fn distance(&self, (terrain, column): ColumnKey) -> Option<f32> {
        self.0.get(&terrain)?.columns.get(&column).copied()
    }

    /// The columns within a chunk's width of the discs over a terrain.
    pub fn tiles(&self, terrain: Entity) -> impl Iterator<Item = TilePos> {
        self.0.get(&terrain).into_iter().flat_map(|area| area.columns.keys().copied())
    }

    /// Whether both share the same areas.
    pub fn is_same(&self, other: &Self) -> bool {
        let is_in_other =
            |(terrain, area): (_, &Arc<Area>)| other.0.get(terrain).is_some_and(|own| Arc::ptr_eq(own, area));
        self.0.len() == other.0.len() && self.0.iter().all(is_in_other)
    }

    /// Calls `change` for each column that sources entered or left since `before`.
    pub fn changes(&self, before: &Self, mut change: impl FnMut(ColumnKey)) {
        let kind = |distance: Option<f32>| distance.map(|distance| distance <= 0.0);
        for (side, other) in [(self, before), (before, self)] {
            for (&terrain, area) in &side.0 {
                let other = other.0.get(&terrain);
                let is_all = |other: &Area| area.is_all && other.is_all && area.grid == other.grid;
                if other.is_some_and(|other| Arc::ptr_eq(other, area) || is_all(other)) {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> ChunkGrid {
        ChunkGrid::new(16, 200, 120)
    }

    /// The columns of an area by brute force.
    fn distances(grid: ChunkGrid, stops: &[Stop]) -> FxHashMap<TilePos, f32> {
        let size = grid.size() as f32;
        let nearest = |tile: TilePos| {
            let corner = Vec2::new(tile.x as f32, tile.z as f32) * size;
            let distance =
                |&(place, radius): &Stop| place.distance(place.clamp(corner, corner + size)) - radius;
            stops.iter().map(distance).fold(f32::INFINITY, f32::min)
        };
        grid.tiles().map(|tile| (tile, nearest(tile))).filter(|&(_, distance)| distance <= size).collect()
    }

    #[test]
    fn an_area_is_that_of_all_stops_although_covered_ones_are_skipped() {
        let mut rng = fastrand::Rng::with_seed(7);
        let mut skipped = 0;
        for _ in 0..300 {
            let mut stops: Vec<Stop> = Vec::new();
            for _ in 0..rng.usize(0..40) {
                let place = Vec2::new(rng.f32() * 300.0 - 50.0, rng.f32() * 220.0 - 50.0).round();
                let radius = [0.0, 8.0, 8.5, 60.0, 400.0][rng.usize(0..5)] * rng.f32();
                stops.push((place, radius));
                // Some share a place.
                if rng.bool() {
                    stops.push((place, radius * rng.f32()));
                }
            }
            skipped += stops.len() - uncovered(&stops).len();
            let (area, expected) =
                (Area::new(grid(), relevant(grid(), stops.clone())), distances(grid(), &stops));
            if area.is_all {
                assert!(area.columns.len() == expected.len() && area.columns.values().all(|&own| own <= 0.0));
            } else {
                assert_eq!(area.columns, expected);
            }
        }
        assert!(skipped > 1000, "{skipped}");
    }

    #[test]
    fn a_source_that_covers_the_grid_changes_only_with_its_column() {
        let grid = grid();
        let at = |x: f32, radius: f32| stops(grid, Vec2::new(x, 50.0), Vec2::X * 200.0, radius);
        // Even with an infinite radius, the nearest columns come first.
        let endless = Area::new(grid, at(10.0, f32::INFINITY));
        let [near, far] = [0, 9].map(|x| endless.columns[&TilePos { x, z: 3 }]);
        assert!(endless.is_all && near < far && far <= 0.0, "{near} {far}");
        assert_eq!(at(-4000.0, f32::INFINITY), at(-5000.0, f32::INFINITY));
        // Other sources add nothing.
        let among = |x: f32| relevant(grid, [at(10.0, f32::INFINITY), at(x, 20.0)].concat());
        assert_eq!(among(150.0), among(40.0));

        let large = at(81.0, 300.0);
        assert_eq!(large.len(), 1);
        assert_eq!(large, at(95.0, 300.0));
        let moved = at(97.0, 300.0);
        assert_ne!(large, moved);
        let [before, after] = [large, moved].map(|stops| {
            let area = Area::new(grid, stops);
            assert!(area.is_all && area.columns.len() == grid.tiles().count());
            Neighbourhood([(Entity::PLACEHOLDER, Arc::new(area))].into_iter().collect())
        });
        after.changes(&before, |column| panic!("{column:?} was near before"));
        assert!(!after.is_same(&before), "the nearest is another one");

        assert_eq!(at(81.0, 20.0).len(), 1 + 13, "for each chunk's width of the way");
        assert_ne!(at(81.0, 20.0), at(82.0, 20.0));
    }

    #[test]
    fn columns_that_a_source_enters_or_leaves_are_reported() {
        let grid = grid();
        let [here, there] = [40.0, 72.0].map(|x| {
            let area = Area::new(grid, stops(grid, Vec2::new(x, 50.0), Vec2::ZERO, 20.0));
            Neighbourhood([(Entity::PLACEHOLDER, Arc::new(area))].into_iter().collect())
        });
        let mut reported = std::collections::BTreeSet::new();
        there.changes(&here, |(_, column)| {
            reported.insert(column);
        });
        let is_near = |area: &Neighbourhood, column: TilePos| {
            area.distance((Entity::PLACEHOLDER, column)).is_some_and(|distance| distance <= 0.0)
        };
        for column in grid.tiles().filter(|&column| is_near(&here, column) != is_near(&there, column)) {
            assert!(reported.contains(&column), "{column:?}");
        }
    }
}
