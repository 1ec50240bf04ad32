//! A height source that calls a function on demand.

use super::{ColumnGrid, HeightSource, checked_bounds, rounded};

/// Heights from a function of the column, in voxels: the same as [`Ground::from_fn`](crate::ground::Ground::from_fn)
/// gives.
pub struct FunctionSource<F> {
    id: u64,
    bounds: (i32, i32),
    height: F,
}

impl<F: Fn(i32, i32) -> f64 + Send + Sync + 'static> FunctionSource<F> {
    /// The height over the column (x, z) is `height(x, z)` voxels, rounded to 1/256 voxel, between `low` and `high`
    /// voxels. Heights outside are clamped to these; NaN counts as 0.
    ///
    /// `id` represents the function in hashes: use a different one for every function.
    pub fn new(id: u64, low: f64, high: f64, height: F) -> Self {
        Self { id, bounds: (rounded(low), rounded(high)), height }
    }
}

impl<F: Fn(i32, i32) -> f64 + Send + Sync + 'static> HeightSource for FunctionSource<F> {
    fn id(&self) -> u64 {
        self.id
    }

    fn bounds(&self) -> (i32, i32) {
        self.bounds
    }

    fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]) {
        let (low, high) = checked_bounds(self);
        for (height, column) in heights.iter_mut().zip(grid.columns()) {
            *height = rounded((self.height)(column.x, column.z)).clamp(low, high);
        }
    }
}
