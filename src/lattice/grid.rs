//! The grids that lie over the lattice: bricks, chunks, tiles.

use std::cmp::Ordering;
use std::hash::{Hash, Hasher};

use glam::IVec3;

use super::{BRICK, Column, LIMIT, LatticeBox};

/// A cube of 8x8x8 samples, the unit of storage. Bricks lie on the world's own grid, whatever the chunk size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrickPos(pub IVec3);

impl Ord for BrickPos {
    /// By stacks (x, then z), and each stack from below.
    fn cmp(&self, other: &Self) -> Ordering {
        // As tuples: arrays compare in a loop.
        let order = |IVec3 { x, y, z }: IVec3| (x, z, y);
        order(self.0).cmp(&order(other.0))
    }
}

impl PartialOrd for BrickPos {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Hash for BrickPos {
    /// As one word: lookups of bricks dominate all other hash lookups.
    fn hash<H: Hasher>(&self, state: &mut H) {
        let IVec3 { x, y, z } = self.0;
        state.write_u64(x as u32 as u64 ^ (z as u32 as u64) << 21 ^ (y as u32 as u64) << 42);
    }
}

impl BrickPos {
    /// The brick that stores a sample.
    pub fn of(point: IVec3) -> Self {
        Self(point >> 3)
    }

    /// The lowest sample of the brick.
    pub fn origin(self) -> IVec3 {
        self.0 << 3
    }

    /// The samples of the brick.
    pub fn samples(self) -> LatticeBox {
        LatticeBox { min: self.origin(), max: self.origin() + (BRICK - 1) }
    }

    /// The bricks that store some sample of `samples`.
    pub fn covering(samples: LatticeBox) -> impl Iterator<Item = Self> {
        Self::range(samples).points().map(Self)
    }

    /// The positions of the bricks that store some sample of `samples`.
    pub(crate) fn range(samples: LatticeBox) -> LatticeBox {
        LatticeBox { min: samples.min >> 3, max: samples.max >> 3 }
    }

    /// The stack of bricks that it belongs to, as (x, z).
    pub(crate) fn stack(self) -> (i32, i32) {
        (self.0.x, self.0.z)
    }

    /// The position as (x, z, y): its order among other bricks.
    pub(crate) fn stack_order(self) -> [i32; 3] {
        [self.0.x, self.0.z, self.0.y]
    }

    /// The position as (y, z, x): its order from the lowest layer up.
    pub(crate) fn layer_order(self) -> [i32; 3] {
        [self.0.y, self.0.z, self.0.x]
    }

    /// The brick with this [`Self::layer_order`].
    pub(crate) fn from_layer_order([y, z, x]: [i32; 3]) -> Self {
        Self(IVec3::new(x, y, z))
    }

    /// Position of a sample inside its brick's arrays: x fastest, then z, then y.
    pub fn index(point: IVec3) -> usize {
        ((point.y & 7) << 6 | (point.z & 7) << 3 | (point.x & 7)) as usize
    }
}

/// A cube of chunk-size cells: the bound of its fields and the unit of drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChunkPos {
    /// Chunks along +x.
    pub x: i32,
    /// Chunks along +y.
    pub y: i32,
    /// Chunks along +z.
    pub z: i32,
}

/// A column of chunks, over which one tile draws the heightmap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TilePos {
    /// Chunks along +x.
    pub x: i32,
    /// Chunks along +z.
    pub z: i32,
}

/// The grid of chunks and tiles.
///
/// Cells of chunk `c` along an axis are `c * size .. (c + 1) * size`. Along x and z the world ends at `width` and
/// `depth`, so the last chunk may hold fewer cells; y has no end. A sample belongs to the chunk of the cell it is the
/// lowest corner of; samples in the world's far rim, where no such cell exists, belong to the last chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkGrid {
    size: i32,
    width: i32,
    depth: i32,
}

impl ChunkGrid {
    /// A grid of chunks of `size` cells over a world of `width` x `depth` cells; all at least 1.
    pub(crate) fn new(size: i32, width: i32, depth: i32) -> Self {
        debug_assert!(size > 0 && width > 0 && depth > 0);
        Self { size, width, depth }
    }

    /// Cells along a chunk's side.
    pub fn size(self) -> i32 {
        self.size
    }

    /// Cells of the world along x.
    pub fn width(self) -> i32 {
        self.width
    }

    /// Cells of the world along z.
    pub fn depth(self) -> i32 {
        self.depth
    }

    /// The samples that edits may reach: the world's columns, at heights within [`LIMIT`].
    pub fn edit_bounds(self) -> LatticeBox {
        LatticeBox { min: IVec3::new(0, -LIMIT, 0), max: IVec3::new(self.width, LIMIT, self.depth) }
    }

    /// Tiles along x and along z.
    pub fn tile_counts(self) -> (i32, i32) {
        let count = |cells: i32| (cells + self.size - 1) / self.size;
        (count(self.width), count(self.depth))
    }

    /// Every tile of the world, x fastest.
    pub fn tiles(self) -> impl Iterator<Item = TilePos> {
        let (nx, nz) = self.tile_counts();
        (0..nz).flat_map(move |z| (0..nx).map(move |x| TilePos { x, z }))
    }

    /// Returns `true` if the world has this tile.
    pub fn has_tile(self, tile: TilePos) -> bool {
        let (nx, nz) = self.tile_counts();
        (0..nx).contains(&tile.x) && (0..nz).contains(&tile.z)
    }

    /// Returns `true` if the cell is inside the world.
    pub fn has_cell(self, cell: Column) -> bool {
        (0..self.width).contains(&cell.x) && (0..self.depth).contains(&cell.z)
    }

    /// The tile that draws a cell. The cell must lie in the world.
    pub fn tile_of_cell(self, cell: Column) -> TilePos {
        TilePos { x: cell.x / self.size, z: cell.z / self.size }
    }

    /// The cells of a tile, which the world must have: lowest and one past the highest, cut at the rim.
    pub fn tile_cells(self, tile: TilePos) -> (Column, Column) {
        let low = Column::new(tile.x.saturating_mul(self.size), tile.z.saturating_mul(self.size));
        let end = |low: i32, cells: i32| low.saturating_add(self.size).min(cells);
        let high = Column::new(end(low.x, self.width), end(low.z, self.depth));
        (low, high)
    }

    /// The chunk that a sample belongs to.
    pub fn chunk_of(self, point: IVec3) -> ChunkPos {
        let last = |cells: i32| (cells - 1).div_euclid(self.size);
        ChunkPos {
            x: point.x.div_euclid(self.size).min(last(self.width)),
            y: point.y.div_euclid(self.size),
            z: point.z.div_euclid(self.size).min(last(self.depth)),
        }
    }

    /// The samples that belong to a chunk, far-rim samples included.
    pub fn chunk_samples(self, chunk: ChunkPos) -> LatticeBox {
        let min = self.origin(chunk);
        let mut max = min.saturating_add(IVec3::splat(self.size - 1));
        if max.x >= self.width - 1 {
            max.x = self.width;
        }
        if max.z >= self.depth - 1 {
            max.z = self.depth;
        }
        LatticeBox { min, max }
    }

    /// The cells of a chunk, named by their lowest corners, cut at the rim.
    pub fn chunk_cells(self, chunk: ChunkPos) -> LatticeBox {
        let min = self.origin(chunk);
        let end = min.saturating_add(IVec3::splat(self.size - 1)).min(IVec3::new(
            self.width - 1,
            i32::MAX,
            self.depth - 1,
        ));
        LatticeBox { min, max: end }
    }

    /// The chunks that hold some sample of a box.
    pub fn chunks_of(self, samples: LatticeBox) -> impl Iterator<Item = ChunkPos> {
        let low = self.chunk_of(samples.min);
        // Usually it is one chunk; this saves divisions.
        let is_one = self.chunk_samples(low).contains(samples.max);
        let high = if is_one { low } else { self.chunk_of(samples.max) };
        LatticeBox { min: low.as_ivec3(), max: high.as_ivec3() }.points().map(ChunkPos::from_ivec3)
    }

    /// The lowest lattice point of a chunk.
    pub fn origin(self, chunk: ChunkPos) -> IVec3 {
        chunk.as_ivec3().saturating_mul(IVec3::splat(self.size))
    }
}

impl ChunkPos {
    /// The position as a vector, for arithmetic.
    pub const fn as_ivec3(self) -> IVec3 {
        IVec3::new(self.x, self.y, self.z)
    }

    /// The position from a vector.
    pub const fn from_ivec3(v: IVec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }

    /// The tile over this chunk.
    pub const fn tile(self) -> TilePos {
        TilePos { x: self.x, z: self.z }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_belongs_to_one_chunk_the_far_rim_included() {
        for (size, width, depth) in [(8, 24, 20), (25, 64, 75), (9, 8, 10)] {
            let grid = ChunkGrid::new(size, width, depth);
            let world = LatticeBox::new(IVec3::new(0, -9, 0), IVec3::new(width, 9, depth)).unwrap();
            for point in world.points() {
                let chunk = grid.chunk_of(point);
                assert!(grid.chunk_samples(chunk).contains(point));
                let owners = grid
                    .chunks_of(LatticeBox::point(point).grown(1))
                    .filter(|&c| grid.chunk_samples(c).contains(point));
                assert_eq!(owners.count(), 1);
            }
        }
    }

    #[test]
    fn tiles_cover_every_cell_once() {
        let grid = ChunkGrid::new(25, 60, 51);
        let mut cells = 0;
        for tile in grid.tiles() {
            let (low, high) = grid.tile_cells(tile);
            cells += (high.x - low.x) * (high.z - low.z);
            assert_eq!(grid.tile_of_cell(low), tile);
            assert_eq!(grid.tile_of_cell(Column::new(high.x - 1, high.z - 1)), tile);
        }
        assert_eq!(cells, 60 * 51);
    }
}
