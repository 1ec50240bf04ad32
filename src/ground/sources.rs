//! Ground from a number, a function or a list of heights.

use super::error::GroundError;
use super::extent::Extent;
use super::world::Ground;
use crate::lattice::{LIMIT, ONE};

impl Ground {
    /// Level ground of `width` x `depth` cells at `height_voxels` voxels, rounded to 1/256.
    ///
    /// # Errors
    /// [`GroundError::Size`], [`GroundError::Height`], [`GroundError::Memory`]; see [`Self::from_fn`].
    pub fn flat(width: u32, depth: u32, height_voxels: f64) -> Result<Self, GroundError> {
        Self::from_fn(width, depth, |_, _| height_voxels)
    }

    /// Ground of `width` x `depth` cells whose height in voxels over the column (x, z) is `height(x, z)`, rounded to
    /// 1/256. Rows are evaluated in parallel. The ground has equal bits on all machines only if `height` returns equal
    /// bits on all of them.
    ///
    /// # Errors
    /// - [`GroundError::Size`] unless width and depth are 1 to [`Ground::MAX_SIZE`].
    /// - [`GroundError::Height`] for the first column whose height is not finite or farther than
    ///   [`LIMIT`] voxels from zero.
    /// - [`GroundError::Memory`] if the machine has too little.
    pub fn from_fn(
        width: u32,
        depth: u32,
        height: impl Fn(i32, i32) -> f64 + Sync,
    ) -> Result<Self, GroundError> {
        let extent = Extent::new(width, depth)?;
        let heights = extent.fill_rows(|z, row| fill_row(z, row, |x| height(x, z)))?;
        Ok(Self::new(extent, heights))
    }

    /// Ground of `width` x `depth` cells from heights in 1/256 voxel, row by row, x fastest:
    /// `(width + 1) * (depth + 1)` of them.
    ///
    /// # Errors
    /// - [`GroundError::Size`] unless width and depth are 1 to [`Ground::MAX_SIZE`].
    /// - [`GroundError::Count`] if the list has another length.
    /// - [`GroundError::Height`] for the first height farther than [`LIMIT`] voxels from zero.
    pub fn from_heights(width: u32, depth: u32, heights: Vec<i32>) -> Result<Self, GroundError> {
        let extent = Extent::new(width, depth)?;
        let (expected, actual) = (extent.columns(), heights.len());
        if actual != expected {
            return Err(GroundError::Count { width, depth, expected, actual });
        }
        let highest = LIMIT.unsigned_abs() * ONE.unsigned_abs();
        if let Some(place) = heights.iter().position(|h| h.unsigned_abs() > highest) {
            let (x, z) = ((place % extent.row_len()) as i32, (place / extent.row_len()) as i32);
            return Err(GroundError::Height { x, z, value: f64::from(heights[place]) / f64::from(ONE) });
        }
        Ok(Self::new(extent, heights))
    }
}

/// Fills the row at z with `height(x)` in voxels, rounded to 1/256, halves away from zero.
pub(super) fn fill_row(z: i32, row: &mut [i32], height: impl Fn(i32) -> f64) -> Result<(), GroundError> {
    for (x, fixed) in (0..).zip(row) {
        let value = height(x);
        if value.abs() <= f64::from(LIMIT) {
            *fixed = (value * f64::from(ONE)).round() as i32;
        } else {
            return Err(GroundError::Height { x, z, value }); // NaN comes here too
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::Column;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_height_is_refused_unless_finite_and_within_the_limit(value: f64, x in 0..=6, z in 0..=5) {
            let made = Ground::from_fn(6, 5, |i, k| if (i, k) == (x, z) { value } else { 0.0 });
            if value.abs() <= f64::from(LIMIT) {
                let height = made.unwrap().height(Column::new(x, z));
                prop_assert!((f64::from(height) / 256.0 - value).abs() <= 0.5 / 256.0);
            } else {
                match made {
                    Err(GroundError::Height { x: i, z: k, value: v }) => {
                        prop_assert_eq!((i, k, v.to_bits()), (x, z, value.to_bits()));
                    }
                    other => prop_assert!(false, "{:?}", other),
                }
            }
        }
    }

    #[test]
    fn nan_and_infinities_are_refused() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 32_768.1, -32_768.1, f64::MAX] {
            assert!(
                matches!(Ground::flat(1, 1, value), Err(GroundError::Height { x: 0, z: 0, .. })),
                "{value}"
            );
        }
        assert_eq!(Ground::flat(1, 1, 32_768.0).map(|g| g.height_range()), Ok((1 << 23, 1 << 23)));
        let message = Ground::flat(1, 1, f64::NAN).unwrap_err().to_string();
        assert_eq!(message, "the height at column (0, 0) is NaN voxels: it must lie within -32768 to 32768");
    }

    #[test]
    fn a_list_is_read_row_by_row() {
        let ground = Ground::from_heights(2, 1, vec![0, 1, 2, 10, 11, 12]).unwrap();
        assert_eq!((ground.width(), ground.depth()), (2, 1));
        assert_eq!((ground.height(Column::new(2, 0)), ground.height(Column::new(0, 1))), (2, 10));
    }

    #[test]
    fn a_list_that_does_not_fit_is_refused() {
        let short = GroundError::Count { width: 2, depth: 1, expected: 6, actual: 5 };
        assert_eq!(Ground::from_heights(2, 1, vec![0; 5]), Err(short));
        assert!(matches!(Ground::from_heights(0, 1, vec![0; 2]), Err(GroundError::Size { .. })));
        for height in [(1 << 23) + 1, i32::MIN, i32::MAX] {
            let refused = Ground::from_heights(2, 1, vec![0, 0, 0, 0, height, 0]);
            assert!(matches!(refused, Err(GroundError::Height { x: 1, z: 1, .. })), "{height}");
        }
    }

    #[test]
    fn sizes_beyond_the_largest_are_refused_before_any_height_is_asked_for() {
        let made = Ground::from_fn(u32::MAX, 3, |_, _| unreachable!());
        assert_eq!(made, Err(GroundError::Size { width: u32::MAX, depth: 3 }));
    }
}
