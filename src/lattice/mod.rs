//! Integer coordinates: where things are, before anything is drawn.
//!
//! Everything that decides what is solid happens on an integer lattice. One lattice step is one **voxel**; y points up.
//!
//! | type | counts | unit |
//! | --- | --- | --- |
//! | [`IVec3`] as a *lattice point* | samples | voxel |
//! | [`Column`] | vertical lines of samples | voxel |
//! | [`Column`] as a *cell* | squares between four columns, named by their lowest one | voxel |
//! | [`BrickPos`] | cubes of 8x8x8 samples | 8 voxels |
//! | [`RegionPos`] | cubes of 8x8x8 bricks | 64 voxels |
//! | [`ChunkPos`], [`TilePos`] | cubes and columns of chunks | chunk size |
//! | distance, height (`i32`) | densities and heights | [`ONE`] per voxel |
//! | drawn position (`i32`) | mesh vertices, local to a chunk | [`SNAP`] per voxel |

mod boxes;
mod grid;
pub(crate) mod hash;
mod parallel;
mod places;
mod region;
mod tables;

pub use boxes::LatticeBox;
#[doc(hidden)]
pub use grid::ChunkGrid;
pub use grid::{BrickPos, ChunkPos, TilePos};
pub(crate) use parallel::{ItemCost, parallel_map, parallel_map_into, pieces, side_by_side};
pub(crate) use places::{sort_by_place, sort_permutation};
pub use region::RegionPos;
pub(crate) use tables::{shrink_if_sparse, table_bytes};

use glam::IVec3;

/// Fixed-point units per voxel of densities and heights.
pub const ONE: i32 = 256;

/// Fixed-point units per voxel of drawn positions: vertices lie on multiples of 1/4096 voxel (rule 4).
#[doc(hidden)]
pub const SNAP: i32 = 4096;

/// Heights, and other vertical lattice coordinates, stay within this many voxels of the origin.
#[doc(hidden)]
pub const LIMIT: i32 = 1 << 15;

/// Horizontal lattice coordinates stay within this many voxels of the origin.
#[doc(hidden)]
pub const REACH: i32 = 1 << 18;

/// Samples along one side of a brick.
#[doc(hidden)]
pub const BRICK: i32 = 8;

/// The lowest lattice y that is not below a height in 1/256 voxel.
pub(crate) const fn ceil(height: i32) -> i32 {
    height.div_euclid(ONE) + (height.rem_euclid(ONE) != 0) as i32
}

/// A vertical line of lattice points; also the cell (square of four columns) of which it is the lowest corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Column {
    /// Voxels along +x.
    pub x: i32,
    /// Voxels along +z.
    pub z: i32,
}

impl Column {
    /// The column through (x, z).
    pub const fn new(x: i32, z: i32) -> Self {
        Self { x, z }
    }

    /// The column that a lattice point lies in.
    pub const fn of(point: IVec3) -> Self {
        Self::new(point.x, point.z)
    }

    /// The lattice point at height `y` of this column.
    pub const fn at(self, y: i32) -> IVec3 {
        IVec3::new(self.x, y, self.z)
    }

    /// The column `dx`, `dz` voxels away; coordinates saturate.
    pub const fn offset(self, dx: i32, dz: i32) -> Self {
        Self::new(self.x.saturating_add(dx), self.z.saturating_add(dz))
    }

    /// The four columns of the cell named by this one, counter-clockwise seen from above (x right, z down).
    pub const fn corners(self) -> [Self; 4] {
        [self, self.offset(0, 1), self.offset(1, 1), self.offset(1, 0)]
    }
}
