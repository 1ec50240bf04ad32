//! Nodes of the quadtree, and how many there are in a world.

use crate::lattice::{ChunkGrid, Column, TilePos};

/// The coarsest level there may be: cells 1,024 voxels wide.
const MAX_LEVELS: u8 = 10;

/// A square of the world that is drawn at one level of detail: a node of the quadtree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node {
    /// The level of detail: cells are 2^`level` voxels wide.
    pub level: u8,
    /// Along +x, in units of the node's width.
    pub x: i32,
    /// Along +z, in units of the node's width.
    pub z: i32,
}

impl Node {
    /// Steps to the nodes of its level that share an edge with it.
    pub(super) const BESIDE: [(i32, i32); 4] = [(-1, 0), (0, 1), (1, 0), (0, -1)];

    /// The node of this level that covers a tile.
    pub const fn over(tile: TilePos, level: u8) -> Self {
        Self { level, x: tile.x >> level, z: tile.z >> level }
    }

    /// The node's lowest tile.
    pub const fn tile(self) -> TilePos {
        TilePos { x: self.x << self.level, z: self.z << self.level }
    }

    /// The width of its cells in voxels.
    pub const fn stride(self) -> i32 {
        1 << self.level
    }

    /// The node one level coarser that covers it.
    pub const fn parent(self) -> Self {
        Self { level: self.level + 1, x: self.x >> 1, z: self.z >> 1 }
    }

    /// The four nodes that it splits into; `None` at level 0. At the rim, some may lie outside the world.
    pub fn children(self) -> Option<[Self; 4]> {
        let level = self.level.checked_sub(1)?;
        Some([(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, z)| Self {
            level,
            x: self.x * 2 + x,
            z: self.z * 2 + z,
        }))
    }

    /// The nodes of its level across its four edges. At the rim, some lie outside the world.
    pub fn beside(self) -> [Self; 4] {
        Self::BESIDE.map(|(x, z)| Self { x: self.x + x, z: self.z + z, ..self })
    }

    /// Returns `true` if it covers the other node or equals it.
    pub const fn covers(self, other: Self) -> bool {
        if other.level > self.level {
            return false;
        }
        let up = self.level - other.level;
        other.x >> up == self.x && other.z >> up == self.z
    }

    /// Returns `true` if two nodes share an edge or a corner, and no cell.
    pub fn touches(self, other: Self) -> bool {
        // Both in tiles: the first, and the one after the last.
        let span = |node: Self| {
            let TilePos { x, z } = node.tile();
            [(x, x + node.stride()), (z, z + node.stride())]
        };
        let gaps = std::iter::zip(span(self), span(other)).map(|(a, b)| a.0.max(b.0) - a.1.min(b.1));
        gaps.max() == Some(0)
    }
}

/// All nodes that a world can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LodGrid {
    grid: ChunkGrid,
    top: u8,
}

impl LodGrid {
    /// Levels up to `top`, or as many as it takes until one node covers the world, if these are fewer.
    pub fn new(grid: ChunkGrid, top: u8) -> Self {
        let (x, z) = grid.tile_counts();
        let enough = (x.max(z).max(1) as u32).next_power_of_two().trailing_zeros();
        Self { grid, top: top.min(MAX_LEVELS).min(enough as u8) }
    }

    /// The chunks and tiles below.
    pub const fn chunks(self) -> ChunkGrid {
        self.grid
    }

    /// The coarsest level.
    pub const fn top(self) -> u8 {
        self.top
    }

    /// Returns `true` if any cell of the node is inside the world.
    pub fn has(self, node: Node) -> bool {
        node.level <= self.top && self.grid.has_tile(node.tile())
    }

    /// The nodes of the coarsest level, row by row.
    pub fn roots(self) -> impl Iterator<Item = Node> {
        let (x, z) = self.grid.tile_counts();
        let [across, down] = [x, z].map(|tiles| ((tiles - 1) >> self.top) + 1);
        let level = self.top;
        (0..down).flat_map(move |z| (0..across).map(move |x| Node { level, x, z }))
    }

    /// The lowest column of a node, and that after its last cell inside the world.
    pub fn columns(self, node: Node) -> (Column, Column) {
        let (low, size) = (node.tile(), self.grid.size());
        let end = |tile: i32, cells: i32| (tile + node.stride()).saturating_mul(size).min(cells);
        let high = Column::new(end(low.x, self.grid.width()), end(low.z, self.grid.depth()));
        (Column::new(low.x * size, low.z * size), high)
    }
}
