//! The world as a heightmap, edits included.

use rayon::prelude::*;

use super::state::World;
use crate::ground::{ElevationGrid, ImageLimits, ImportError};
use crate::lattice::{Column, ONE};

impl World {
    /// The topmost ground over every column of the world, in voxels: a heightmap with all edits, to be
    /// [written](ElevationGrid::encode_png) to a file. Caves and overhangs are lost. Columns are computed in parallel;
    /// those that no edit is near take no longer than their ground.
    ///
    /// # Errors
    /// [`ImportError::Limit`] for a world of more than 16385 columns along a side.
    pub fn elevation(&self) -> Result<ElevationGrid, ImportError> {
        let (width, depth) = (self.ground().width(), self.ground().depth());
        self.check_map_size()?;
        let height = |x: i32, z: i32| {
            let is_edited = [x - 1, x + 1]
                .iter()
                .any(|&x| [z - 1, z + 1].iter().any(|&z| self.stacks.contains_key(&(x >> 3, z >> 3))));
            let found = if is_edited { self.height(x.into(), z.into()) } else { None };
            let pristine = || f64::from(self.ground().height(Column::new(x, z))) / f64::from(ONE);
            found.unwrap_or_else(pristine) as f32
        };
        let rows = (0..=depth).into_par_iter();
        let samples = rows.flat_map_iter(|z| (0..=width).map(move |x| height(x, z))).collect();
        ElevationGrid::from_samples(width as u32 + 1, depth as u32 + 1, samples)
    }

    /// Checks that a map with a sample for each column is within the limits of images, before any memory is taken.
    pub(super) fn check_map_size(&self) -> Result<(), ImportError> {
        let [width, depth] = [self.ground().width(), self.ground().depth()].map(|side| side as u32 + 1);
        Ok(ImageLimits::check_sides(width, depth)?)
    }
}
