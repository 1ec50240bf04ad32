//! A dense grid of densities: a borrowed slice, its size, and whether its outermost samples are an apron.

use super::density::Density;

/// Samples on a box of lattice points.
#[derive(Clone, Copy, Debug)]
pub struct DenseGrid<'a, S> {
    samples: &'a [S],
    size: [usize; 3],
    /// Samples before the first meshed one and after the last, along each axis: 0 or 1.
    apron: usize,
}

/// An error of making a [`DenseGrid`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DenseGridError {
    /// The number of samples is not the product of the sides.
    #[error("{size:?} samples need {expected:?} values, not {found}")]
    Length {
        /// The sides that were asked for.
        size: [usize; 3],
        /// The product of the sides; `None` where it does not fit a `usize`.
        expected: Option<usize>,
        /// The length of the slice.
        found: usize,
    },
    /// A side has too few samples for a single cell.
    #[error("a side of {size:?} samples is shorter than {least}")]
    TooSmall {
        /// The sides that were asked for.
        size: [usize; 3],
        /// The shortest side allowed: 2, or 4 with an apron.
        least: usize,
    },
    /// A side is longer than [`DenseGrid::MAX_SIDE`], or the grid could have more vertices than a `u32` can number.
    #[error(
        "{size:?} samples are too many: sides end at {}, and three times all samples at {}",
        MAX_SIDE,
        u32::MAX
    )]
    TooLarge {
        /// The sides that were asked for.
        size: [usize; 3],
    },
}

const MAX_SIDE: usize = 0x7fff;

impl<S> DenseGrid<'_, S> {
    /// The longest side, in samples.
    pub const MAX_SIDE: usize = MAX_SIDE;
}

impl<'a, S: Density> DenseGrid<'a, S> {
    /// A grid of which every cell is meshed. x runs fastest, then y, then z: the sample at `(x, y, z)` has the index
    /// `x + size[0] * (y + size[1] * z)`.
    ///
    /// Gradients in the grid's border are one-sided differences.
    ///
    /// # Errors
    /// When a side is too short or too long, or when the number of samples is not the product of the sides.
    pub fn new(samples: &'a [S], size: [usize; 3]) -> Result<Self, DenseGridError> {
        Self::checked(samples, size, 0)
    }

    /// A grid whose outermost layer of samples, one at the low and one at the high end of each axis, only serves the
    /// gradients: cells that touch it are not meshed.
    ///
    /// Grids that overlap so have the same normals where they meet, and mesh faster too.
    ///
    /// # Errors
    /// When a side is too short or too long, or when the number of samples is not the product of the sides.
    pub fn with_apron(samples: &'a [S], size: [usize; 3]) -> Result<Self, DenseGridError> {
        Self::checked(samples, size, 1)
    }

    fn checked(samples: &'a [S], size: [usize; 3], apron: usize) -> Result<Self, DenseGridError> {
        let least = 2 + 2 * apron;
        if size.iter().any(|&side| side < least) {
            return Err(DenseGridError::TooSmall { size, least });
        }
        let expected = size.iter().try_fold(1_usize, |product, &side| product.checked_mul(side));
        if expected != Some(samples.len()) {
            return Err(DenseGridError::Length { size, expected, found: samples.len() });
        }
        // Every sample starts three edges, and each edge holds one vertex at most.
        let numbered = u32::try_from(samples.len()).is_ok_and(|count| count.checked_mul(3).is_some());
        if !numbered || size.iter().any(|&side| side > MAX_SIDE) {
            return Err(DenseGridError::TooLarge { size });
        }
        Ok(Self { samples, size, apron })
    }

    /// All samples, the apron included.
    pub(super) fn samples(&self) -> &'a [S] {
        self.samples
    }

    /// Samples along each axis, the apron included.
    pub(super) fn size(&self) -> [usize; 3] {
        self.size
    }

    /// How far apart neighbours along each axis lie in the slice.
    pub(super) fn strides(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    /// The coordinate of the first meshed sample, along every axis.
    pub(super) fn first(&self) -> usize {
        self.apron
    }

    /// Meshed samples along each axis.
    pub(super) fn meshed(&self) -> [usize; 3] {
        self.size.map(|side| side - 2 * self.apron)
    }

    /// The rows of layer `z`, counted from the first meshed one. Each begins with its first meshed sample, and ends
    /// where the grid's next row begins.
    pub(super) fn rows(&self, z: usize) -> impl Iterator<Item = &'a [S]> {
        let [width, height, _] = self.size;
        let start = width * (self.apron + height * (self.apron + z));
        let rows = self.samples[start..start + width * self.meshed()[1]].chunks_exact(width);
        rows.map(|row| &row[self.apron..])
    }
}
