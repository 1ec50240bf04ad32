//! The rectangle of columns that a world covers, and arrays over it.

use rayon::prelude::*;

use super::error::GroundError;
use super::{MAX_SIZE, MAX_SOURCE_SIZE};
use crate::lattice::Column;

/// The columns (0, 0) to (width, depth), both included; arrays over them are row-major, x fastest.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Extent {
    width: i32,
    depth: i32,
}

impl Extent {
    /// The columns of a world of `width` x `depth` cells, each 1 to [`MAX_SIZE`].
    pub(super) fn new(width: u32, depth: u32) -> Result<Self, GroundError> {
        Self::within(MAX_SIZE, width, depth).ok_or(GroundError::Size { width, depth })
    }

    /// The extent of ground with a source: each side 1 to [`MAX_SOURCE_SIZE`].
    pub(super) fn of_source(width: u32, depth: u32) -> Result<Self, GroundError> {
        Self::within(MAX_SOURCE_SIZE, width, depth).ok_or(GroundError::SourceSize { width, depth })
    }

    fn within(most: u32, width: u32, depth: u32) -> Option<Self> {
        let allowed = 1..=most;
        let is_right = allowed.contains(&width) && allowed.contains(&depth);
        is_right.then_some(Self { width: width as i32, depth: depth as i32 })
    }

    /// Cells along x.
    pub(super) fn width(self) -> i32 {
        self.width
    }

    /// Cells along z.
    pub(super) fn depth(self) -> i32 {
        self.depth
    }

    /// Columns in a row.
    pub(super) fn row_len(self) -> usize {
        self.width as usize + 1
    }

    /// Columns of the world.
    pub(super) fn columns(self) -> usize {
        self.row_len() * (self.depth as usize + 1)
    }

    /// The world's column nearest to `column`.
    pub(super) fn clamp(self, column: Column) -> Column {
        Column::new(column.x.clamp(0, self.width), column.z.clamp(0, self.depth))
    }

    /// Place in a row-major array of the world's column nearest to `column`.
    pub(super) fn index(self, column: Column) -> usize {
        self.inner_index(self.clamp(column))
    }

    /// The index of a column inside the world; an arbitrary number for any other column.
    pub(super) fn inner_index(self, Column { x, z }: Column) -> usize {
        (z as usize).wrapping_mul(self.row_len()).wrapping_add(x as usize)
    }

    /// An array over the world whose rows are filled in parallel by `fill(z, row)`. Of several errors that of the
    /// lowest z is returned, however many threads there are.
    pub(super) fn fill_rows<T, F>(self, fill: F) -> Result<Vec<T>, GroundError>
    where
        T: Clone + Default + Send,
        F: Fn(i32, &mut [T]) -> Result<(), GroundError> + Sync,
    {
        let mut values = Vec::new();
        let bytes = self.columns().saturating_mul(size_of::<T>());
        values.try_reserve_exact(self.columns()).map_err(|_| GroundError::Memory { bytes })?;
        values.resize(self.columns(), T::default());
        let first_error = values
            .par_chunks_exact_mut(self.row_len())
            .enumerate()
            .find_map_first(|(z, row)| fill(z as i32, row).err());
        first_error.map_or(Ok(values), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked() {
        for (width, depth) in
            [(0, 1), (1, 0), (0, 0), (MAX_SIZE + 1, 1), (1, MAX_SIZE + 1), (u32::MAX, u32::MAX)]
        {
            assert!(matches!(Extent::new(width, depth), Err(GroundError::Size { .. })));
        }
        assert_eq!(Extent::new(MAX_SIZE, MAX_SIZE).map(Extent::columns), Ok(16_385 * 16_385));
    }

    #[test]
    fn the_error_of_the_lowest_row_is_reported() {
        let extent = Extent::new(3, 500).unwrap();
        let fail = |z, _: &mut [u8]| {
            if z < 40 { Ok(()) } else { Err(GroundError::Height { x: 0, z, value: 0.0 }) }
        };
        let error = GroundError::Height { x: 0, z: 40, value: 0.0 };
        assert_eq!(extent.fill_rows(fail).unwrap_err(), error);
    }
}
