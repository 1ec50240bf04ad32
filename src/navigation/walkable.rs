//! Which cells of a tile are walkable.

use super::floors::Floors;
use super::links::{Axis, Links};
use super::settings::{LedgeRules, Walker};
use super::tiles::NavTilePos;
use crate::lattice::Column;
use crate::terrain::World;

/// The cells of a tile on which an agent can stand.
#[derive(Debug)]
pub struct WalkableTile {
    pos: NavTilePos,
    pub(super) floors: Floors,
    pub(super) links: Links,
    /// Whether the cell with this floor at its lowest corner is walkable.
    walkable: Vec<bool>,
    pub(super) precision: i32,
    pub(super) ledges: Option<LedgeRules>,
}

/// A cell on which an agent can stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct WalkableCell {
    /// The cell's lowest column.
    pub cell: Column,
    /// Heights of the ground at its [corners](Column::corners), in 1/256 voxel.
    pub heights: [i32; 4],
}

impl WalkableTile {
    /// The walkable cells of a tile. Reads the columns of the tile and as far around it as the agent
    /// [reaches](Walker::reach).
    pub fn new(world: &World, pos: NavTilePos, walker: &Walker) -> Self {
        // The cells of a tile, those around it, and those that these and their ledges depend on.
        let around = walker.reach();
        let low = pos.origin().offset(-around, -around);
        let side = (NavTilePos::SIZE + 2 * around + 1) as usize;
        let floors = Floors::new(world, low, side, walker.height);
        let links = Links::new(&floors, walker);
        let walkable = erode(&floors, &links, walker);
        Self { pos, floors, links, walkable, precision: walker.precision, ledges: walker.ledges }
    }

    /// The tile's position.
    pub fn pos(&self) -> NavTilePos {
        self.pos
    }

    /// The tile's walkable cells, row by row; cells above each other from the lowest up.
    pub fn cells(&self) -> impl Iterator<Item = WalkableCell> {
        self.columns().flat_map(|(cell, _)| self.cells_of(cell))
    }

    /// Number of walkable cells.
    pub fn cell_count(&self) -> usize {
        self.columns()
            .flat_map(|(_, column)| self.floors.of(column))
            .filter(|&floor| self.walkable[floor])
            .count()
    }

    /// The cells of the tile with the indices of their lowest columns, row by row.
    pub(super) fn columns(&self) -> impl Iterator<Item = (Column, usize)> + use<> {
        let (origin, low, side) = (self.pos.origin(), self.floors.low, self.floors.side);
        (0..NavTilePos::SIZE).flat_map(move |z| {
            (0..NavTilePos::SIZE).map(move |x| {
                let cell = origin.offset(x, z);
                (cell, (cell.z - low.z) as usize * side + (cell.x - low.x) as usize)
            })
        })
    }

    /// Whether the cell with this floor at its lowest corner is walkable; also of cells next to the tile.
    pub(super) fn is_walkable(&self, floor: usize) -> bool {
        self.walkable[floor]
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        let floors = self.floors.len();
        self.floors.starts.len() * 4 + floors * (2 * 4 + 4 * 4 + 2)
    }

    /// The stretches of air above floors, for a debug view: the floor's lattice column, its height and that of the
    /// ceiling, in 1/256 voxel, if there is one.
    pub fn spans(&self) -> impl Iterator<Item = (Column, i32, Option<i32>)> {
        self.columns().flat_map(move |(at, column)| {
            self.floors.of(column).map(move |floor| {
                let ceiling = self.floors.ceiling[floor];
                (at, self.floors.floor[floor], (ceiling != super::floors::SKY).then_some(ceiling))
            })
        })
    }

    /// The walkable cells above each other at a place, from below; none outside the tile.
    pub fn cells_of(&self, cell: Column) -> impl Iterator<Item = WalkableCell> {
        let (low, side) = (self.floors.low, self.floors.side);
        let is_own = NavTilePos::of_cell(cell) == self.pos;
        let column = is_own.then(|| (cell.z - low.z) as usize * side + (cell.x - low.x) as usize);
        let floors = column.into_iter().flat_map(|column| self.floors.of(column));
        floors.filter(|&floor| self.is_walkable(floor)).filter_map(move |floor| {
            let heights = self.links.corners(floor)?.map(|corner| self.floors.floor[corner]);
            Some(WalkableCell { cell, heights })
        })
    }
}

/// The passable cells whose neighbours within an agent's reach are passable too.
fn erode(floors: &Floors, links: &Links, walker: &Walker) -> Vec<bool> {
    let count = floors.len();
    let most = walker.reach[0];
    // How many cells in a row are passable before and after each one, up to the agent's reach. Floors are in order of
    // their columns, so each is seen after the one before it.
    let (mut before, mut after) = (vec![0u8; count], vec![0u8; count]);
    for floor in 0..count {
        if let Some(last) = links.last(floor, Axis::X)
            && links.is_passable(last)
        {
            before[floor] = (before[last] + 1).min(most as u8);
        }
    }
    for floor in (0..count).rev() {
        if let Some(next) = links.next(floor, Axis::X)
            && links.is_passable(next)
        {
            after[floor] = (after[next] + 1).min(most as u8);
        }
    }
    let is_free = |floor: usize, cells: i32| i32::from(before[floor].min(after[floor])) >= cells;
    let rows = |floor: usize, step: fn(&Links, usize) -> Option<usize>| {
        let mut at = floor;
        walker.reach[1..].iter().all(|&cells| match step(links, at) {
            Some(next) if links.is_passable(next) && is_free(next, cells) => {
                at = next;
                true
            }
            _ => false,
        })
    };
    let is_walkable = |floor: usize| {
        links.is_passable(floor)
            && is_free(floor, most)
            && rows(floor, |links, floor| links.next(floor, Axis::Z))
            && rows(floor, |links, floor| links.last(floor, Axis::Z))
    };
    (0..count).map(is_walkable).collect()
}
