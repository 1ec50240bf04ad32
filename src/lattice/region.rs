//! Regions: cubes of bricks, the unit in which worlds are saved, compared and sent.

use glam::IVec3;

use super::{BrickPos, Column, LatticeBox};

/// Bricks along a region's side, as a power of two.
const BRICKS_LOG: i32 = 3;
/// Voxels along a region's side, as a power of two.
const VOXELS_LOG: i32 = BRICKS_LOG + 3;

/// A cube of 8x8x8 bricks, that is 64x64x64 samples. Regions lie on the world's own grid, whatever the chunk size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RegionPos(pub IVec3);

impl RegionPos {
    /// Bricks along its side.
    pub const BRICKS: i32 = 1 << BRICKS_LOG;
    /// Voxels along its side.
    pub const VOXELS: i32 = 1 << VOXELS_LOG;

    /// The region that a brick lies in.
    pub fn of(brick: BrickPos) -> Self {
        Self(brick.0 >> BRICKS_LOG)
    }

    /// The region that a column lies in, as (x, z).
    pub fn of_column(column: Column) -> (i32, i32) {
        (column.x >> VOXELS_LOG, column.z >> VOXELS_LOG)
    }

    /// The lowest brick of the region.
    pub fn first_brick(self) -> BrickPos {
        BrickPos(self.0 << BRICKS_LOG)
    }

    /// The samples of the region.
    pub fn samples(self) -> LatticeBox {
        let min = self.0 << VOXELS_LOG;
        LatticeBox { min, max: min + (Self::VOXELS - 1) }
    }

    /// The column of regions that it belongs to, as (x, z).
    pub fn column(self) -> (i32, i32) {
        (self.0.x, self.0.z)
    }
}

impl Ord for RegionPos {
    /// By columns (x, then z), and each column from below.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.first_brick().cmp(&other.first_brick())
    }
}

impl PartialOrd for RegionPos {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_brick_lies_in_one_region() {
        for at in [-17, -16, -9, -8, -1, 0, 7, 8, 4095] {
            let brick = BrickPos(IVec3::new(at, -at, at / 2));
            let region = RegionPos::of(brick);
            assert!(region.samples().encloses(brick.samples()));
            let inside = brick.0 - region.first_brick().0;
            assert!(inside.min_element() >= 0 && inside.max_element() < RegionPos::BRICKS);
            assert_eq!(RegionPos::of_column(Column::of(brick.origin())), region.column());
        }
    }
}
