//! A height source that computes noise on demand.

use super::{ColumnGrid, HeightSource, rounded};
use crate::ground::GroundError;
use crate::ground::noise_heights::{NoiseHeights, NoiseKind};
use crate::ground::noise_params::NoiseParams;
use crate::lattice::hash::hash_words;

/// Heights from fractal noise: the same as [`Ground::from_noise`](crate::ground::Ground::from_noise) gives.
pub struct NoiseSource {
    heights: NoiseHeights,
    params: NoiseParams,
}

impl NoiseSource {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`GroundError::Parameter`] for a parameter out of its range.
    pub fn new(heights: &NoiseHeights) -> Result<Self, GroundError> {
        Ok(Self { heights: *heights, params: heights.params(1, 1)? })
    }
}

impl HeightSource for NoiseSource {
    fn id(&self) -> u64 {
        let NoiseHeights { seed, kind, octaves, scale, amplitude, base } = self.heights;
        let kind = match kind {
            NoiseKind::Fractal => 0,
            NoiseKind::Ridged => 1,
        };
        let [scale, amplitude, base] = [scale, amplitude, base].map(f64::to_bits);
        // The first word distinguishes kinds of sources.
        hash_words([0x6e6f_6973, seed.into(), kind, octaves.into(), scale, amplitude, base])
    }

    fn bounds(&self) -> (i32, i32) {
        let NoiseHeights { amplitude, base, .. } = self.heights;
        (rounded(base - amplitude.abs()) - 1, rounded(base + amplitude.abs()) + 1)
    }

    fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]) {
        let mut voxels = vec![0.0; grid.width];
        for (row, z) in heights.chunks_exact_mut(grid.width.max(1)).zip(0..grid.depth) {
            self.params.row(grid.low.x, grid.column(0, z).z, grid.stride, &mut voxels);
            row.iter_mut().zip(&voxels).for_each(|(height, &voxels)| *height = rounded(voxels));
        }
    }

    fn bytes(&self) -> usize {
        // A table of permutations for each octave.
        size_of::<Self>() + self.heights.octaves as usize * 256
    }
}
