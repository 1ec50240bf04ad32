//! Squares of cells.

use crate::lattice::{Column, LatticeBox};
use crate::terrain::World;

use super::settings::Walker;

/// The position of a navigation tile, in tiles. Its size does not depend on that of chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NavTilePos {
    /// Along +x.
    pub x: i32,
    /// Along +z.
    pub z: i32,
}

impl NavTilePos {
    /// Cells along the sides of a tile.
    pub const SIZE: i32 = 32;

    /// The tile of a cell.
    pub const fn of_cell(cell: Column) -> Self {
        Self { x: cell.x.div_euclid(Self::SIZE), z: cell.z.div_euclid(Self::SIZE) }
    }

    /// The tile's lowest cell.
    pub const fn origin(self) -> Column {
        Column::new(self.x.saturating_mul(Self::SIZE), self.z.saturating_mul(Self::SIZE))
    }

    /// The tiles with cells of a rectangle of cells, both corners included, that belong to a world.
    pub fn covering(world: &World, low: Column, high: Column) -> impl Iterator<Item = Self> + use<> {
        let (width, depth) = (world.ground().width(), world.ground().depth());
        let along = |low: i32, high: i32, cells: i32| {
            low.max(0).div_euclid(Self::SIZE)..=high.min(cells - 1).div_euclid(Self::SIZE)
        };
        let (xs, zs) = (along(low.x, high.x, width), along(low.z, high.z, depth));
        zs.flat_map(move |z| xs.clone().map(move |x| Self { x, z }))
    }

    /// All tiles of a world, row by row.
    pub fn all(world: &World) -> impl Iterator<Item = Self> + use<> {
        Self::covering(world, Column::new(0, 0), Column::new(world.ground().width(), world.ground().depth()))
    }

    /// The tiles of a world that may change when these samples do.
    pub fn affected(
        world: &World,
        samples: LatticeBox,
        walker: &Walker,
    ) -> impl Iterator<Item = Self> + use<> {
        // A cell depends on columns as far away as its reach, and a tile on the cells around it.
        let reach = walker.reach() + 1;
        let low = Column::of(samples.min).offset(-reach, -reach);
        Self::covering(world, low, Column::of(samples.max).offset(reach, reach))
    }
}
