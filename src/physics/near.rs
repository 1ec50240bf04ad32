//! Where colliders are wanted.

use std::sync::Arc;

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use rustc_hash::FxHashMap;

use super::columns::ColumnKey;
use crate::lattice::{ChunkGrid, TilePos};

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

/// A place in voxels along x and z, and how far around it colliders are wanted.
pub(super) type Stop = (Vec2, f32);

/// The largest stops, by which others may be covered: a crowd has thousands that are all alike, and cover none.
const LARGEST: usize = 16;

/// The far corner of a grid's columns, in voxels.
fn end(grid: ChunkGrid) -> Vec2 {
    let (width, depth) = grid.tile_counts();
    Vec2::new(width as f32, depth as f32) * grid.size() as f32
}

/// Does a stop reach all of a grid?
fn reaches_all(grid: ChunkGrid, (place, radius): Stop) -> bool {
    let end = end(grid);
    place.abs().max((place - end).abs()).length() <= radius
}

/// Is the first stop's radius nowhere farther off than the second one's? Not where only rounding says so.
fn covers((large, radius): Stop, (place, small): Stop) -> bool {
    large == place && radius >= small || large.distance(place) + 1.0 <= radius - small
}

/// The stops that no other one covers.
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

/// Where some stops reach all of a grid, those: the others add nothing to them, and are no news.
fn telling(grid: ChunkGrid, mut stops: Vec<Stop>) -> Vec<Stop> {
    if stops.iter().any(|&stop| reaches_all(grid, stop)) {
        stops.retain(|&stop| reaches_all(grid, stop));
    }
    stops
}

/// Where a source that is at `from` and goes this `way` wants ground within a `radius`, in voxels: here, and ahead, in one
/// place for each chunk's width of the way.
pub(super) fn stops(grid: ChunkGrid, from: Vec2, way: Vec2, radius: f32) -> Vec<Stop> {
    let stride = grid.size() as f32;
    // Not every hair's breadth of a move is news; where all of the ground is near, not even another voxel is, and what is
    // ahead is near already. How much farther it would reach says nothing: what is nearest comes first.
    let home = (from / stride).floor() * stride + stride / 2.0;
    if reaches_all(grid, (home, radius + 1.0)) {
        return vec![(home.clamp(Vec2::ZERO, end(grid)), end(grid).length() + 1.0)];
    }
    let count = (way.length() / stride).ceil();
    let apart = way / count.max(1.0);
    // Nor is a body held for want of ground that is between two stops.
    let radius = radius + (apart.length() / 2.0).ceil() + 1.0;
    (0..=count as u32).map(|at| ((from + apart * at as f32).round(), radius)).collect()
}

/// Where sources are over one terrain.
#[derive(Debug)]
struct Area {
    grid: ChunkGrid,
    stops: Vec<Stop>,
    /// Is all of the ground within a source's radius?
    is_all: bool,
    /// How far the nearest source's radius ends from a column, in voxels; negative within it. Columns farther off than a
    /// chunk is wide are not in here.
    columns: FxHashMap<TilePos, f32>,
}

impl Area {
    fn new(grid: ChunkGrid, stops: Vec<Stop>) -> Self {
        let (size, (width, depth)) = (grid.size() as f32, grid.tile_counts());
        let mut columns = FxHashMap::default();
        let is_all = stops.iter().any(|&stop| reaches_all(grid, stop));
        for (place, radius) in uncovered(&stops) {
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
        Self { grid, stops, is_all, columns }
    }
}

/// Sources as terrains see them.
#[derive(Clone, Debug, Default)]
pub(super) struct Neighbourhood(HashMap<Entity, Arc<Area>>);

impl Neighbourhood {
    /// Enters a terrain with the stops of its sources. What is the same as before shares its memory.
    pub fn insert(&mut self, terrain: Entity, grid: ChunkGrid, stops: Vec<Stop>, before: &Self) {
        let stops = telling(grid, stops);
        let same = before.0.get(&terrain).filter(|area| area.grid == grid && area.stops == stops);
        let area = same.cloned().unwrap_or_else(|| Arc::new(Area::new(grid, stops)));
        self.0.insert(terrain, area);
    }

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

    /// What an area has to be, worked out for each column and stop.
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
    fn an_area_is_that_of_all_stops_though_covered_ones_are_skipped() {
        let mut rng = fastrand::Rng::with_seed(7);
        let mut skipped = 0;
        for _ in 0..300 {
            let mut stops: Vec<Stop> = Vec::new();
            for _ in 0..rng.usize(0..40) {
                let place = Vec2::new(rng.f32() * 300.0 - 50.0, rng.f32() * 220.0 - 50.0).round();
                let radius = [0.0, 8.0, 8.5, 60.0, 400.0][rng.usize(0..5)] * rng.f32();
                stops.push((place, radius));
                // Many stand where others do.
                if rng.bool() {
                    stops.push((place, radius * rng.f32()));
                }
            }
            skipped += stops.len() - uncovered(&stops).len();
            let (area, expected) =
                (Area::new(grid(), telling(grid(), stops.clone())), distances(grid(), &stops));
            if area.is_all {
                assert!(area.columns.len() == expected.len() && area.columns.values().all(|&own| own <= 0.0));
            } else {
                assert_eq!(area.columns, expected);
            }
        }
        assert!(skipped > 1000, "{skipped}");
    }

    #[test]
    fn a_source_that_reaches_all_ground_is_news_only_in_another_column() {
        let grid = grid();
        let at = |x: f32, radius: f32| stops(grid, Vec2::new(x, 50.0), Vec2::X * 200.0, radius);
        // However far an endless one reaches, what is nearest to it comes first.
        let endless = Area::new(grid, at(10.0, f32::INFINITY));
        let [near, far] = [0, 9].map(|x| endless.columns[&TilePos { x, z: 3 }]);
        assert!(endless.is_all && near < far && far <= 0.0, "{near} {far}");
        assert_eq!(at(-4000.0, f32::INFINITY), at(-5000.0, f32::INFINITY));
        // Whoever else moves is no news then.
        let among = |x: f32| telling(grid, [at(10.0, f32::INFINITY), at(x, 20.0)].concat());
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
        after.changes(&before, |column| panic!("{column:?} has been near all the time"));
        assert!(!after.is(&before), "the nearest is another one");

        assert_eq!(at(81.0, 20.0).len(), 1 + 13, "for each chunk's width of the way");
        assert_ne!(at(81.0, 20.0), at(82.0, 20.0));
    }

    #[test]
    fn columns_that_a_source_comes_to_or_leaves_are_told() {
        let grid = grid();
        let [here, there] = [40.0, 72.0].map(|x| {
            let area = Area::new(grid, stops(grid, Vec2::new(x, 50.0), Vec2::ZERO, 20.0));
            Neighbourhood([(Entity::PLACEHOLDER, Arc::new(area))].into_iter().collect())
        });
        let mut told = std::collections::BTreeSet::new();
        there.changes(&here, |(_, column)| {
            told.insert(column);
        });
        let is_near = |area: &Neighbourhood, column: TilePos| {
            area.distance((Entity::PLACEHOLDER, column)).is_some_and(|distance| distance <= 0.0)
        };
        for column in grid.tiles().filter(|&column| is_near(&here, column) != is_near(&there, column)) {
            assert!(told.contains(&column), "{column:?}");
        }
    }
}
