//! The edges that a tile shares with the tiles around it.
//!
//! Both tiles compute the same line along their border: from the floors on it, and from which cells on both sides are
//! walkable. Vertices in between are put on that line, so edges of both tiles lie in it, wherever their polygons begin
//! and end.

use rustc_hash::FxHashMap;

use super::links::Axis;
use super::tiles::NavTilePos;
use super::walkable::WalkableTile;
use crate::lattice::{ONE, SNAP};

/// Fine units of height in those of floors.
pub(super) const FINE: i32 = SNAP / ONE;

/// The lines along the borders of a tile.
#[derive(Debug, Default)]
pub(super) struct Border {
    /// Floors at which the line turns, begins or ends.
    pub corners: Vec<usize>,
    /// Heights of the line at the floors in between, in 1/4096 voxel.
    pub heights: FxHashMap<usize, i32>,
}

impl Border {
    /// The lines along the four sides.
    pub fn new(tile: &WalkableTile) -> Self {
        let mut border = Self::default();
        let (floors, side) = (&tile.floors, tile.floors.side);
        let origin = tile.pos().origin();
        let start = (origin.z - floors.low.z) as usize * side + (origin.x - floors.low.x) as usize;
        let size = NavTilePos::SIZE as usize;
        for (first, step, along) in [
            (start, side, Axis::Z),
            (start + size, side, Axis::Z),
            (start, 1, Axis::X),
            (start + size * side, 1, Axis::X),
        ] {
            for place in 0..size {
                for floor in floors.of(first + place * step) {
                    let is_shared = |floor| shared_edge(tile, floor, along).is_some();
                    let continues = place > 0 && tile.links.last(floor, along).is_some_and(is_shared);
                    if !continues && is_shared(floor) {
                        border.add_line(tile, floor, along, size - place);
                    }
                }
            }
        }
        border
    }

    /// Adds the line that begins at a floor, of at most this many edges.
    fn add_line(&mut self, tile: &WalkableTile, first: usize, along: Axis, most: usize) {
        let edges = std::iter::successors(Some(first), |&floor| shared_edge(tile, floor, along));
        let line: Vec<usize> = edges.take(most + 1).collect();
        let height = |place: usize| i64::from(tile.floors.floor[line[place]] * FINE);
        let mut open = vec![(0, line.len() - 1)];
        self.corners.extend([first, line[line.len() - 1]]);
        while let Some((low, high)) = open.pop() {
            let at = |place: usize| {
                let (span, part) = ((high - low) as i64, (place - low) as i64);
                (height(low) * (span - part) + height(high) * part).div_euclid(span)
            };
            let apart = |place: &usize| (height(*place) - at(*place)).abs();
            let Some(farthest) = (low + 1..high).max_by_key(apart) else { continue };
            if apart(&farthest) > i64::from(tile.precision * FINE) {
                self.corners.push(line[farthest]);
                open.extend([(low, farthest), (farthest, high)]);
            } else {
                self.heights.extend((low + 1..high).map(|place| (line[place], at(place) as i32)));
            }
        }
    }
}

/// The other end of the edge from a floor towards +x or +z, if the cells on both sides are walkable.
fn shared_edge(tile: &WalkableTile, floor: usize, along: Axis) -> Option<usize> {
    let across = if along == Axis::X { Axis::Z } else { Axis::X };
    let beside = tile.links.last(floor, across)?;
    (tile.is_walkable(floor) && tile.is_walkable(beside)).then(|| tile.links.next(floor, along))?
}
