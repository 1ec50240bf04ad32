//! Dense grids of samples.

use wide::{f32x8, i16x8, i32x8};

/// What a sample of a [`DenseGrid`] may be: `f32` or `i16`. Below zero is solid.
pub trait Density: Copy + sealed::Sealed {}

impl Density for f32 {}
impl Density for i16 {}

pub(super) mod sealed {
    /// What the mesher asks of samples.
    pub trait Sealed: Copy + Default {
        /// The sample as a number.
        fn value(self) -> f32;
        /// The signs of eight samples, as many lanes of all ones or all zeros.
        fn below_zero(samples: [Self; 8]) -> wide::i16x8;
    }
}

impl sealed::Sealed for f32 {
    #[inline(always)]
    fn value(self) -> f32 {
        self
    }

    #[inline(always)]
    fn below_zero(samples: [f32; 8]) -> i16x8 {
        // Not by the sign bit: -0 is air, and so is every NaN.
        let below: i32x8 = bytemuck::cast(f32x8::new(samples).simd_lt(f32x8::ZERO));
        i16x8::from_i32x8_saturate(below)
    }
}

impl sealed::Sealed for i16 {
    #[inline(always)]
    fn value(self) -> f32 {
        f32::from(self)
    }

    #[inline(always)]
    fn below_zero(samples: [i16; 8]) -> i16x8 {
        i16x8::new(samples).simd_lt(i16x8::ZERO)
    }
}

/// Samples of a box, x fastest, then y, then z.
#[derive(Clone, Copy, Debug)]
pub struct DenseGrid<'a, S> {
    samples: &'a [S],
    size: [usize; 3],
    /// Samples on each side that are not meshed: 1 with an apron, 0 without.
    apron: usize,
}

/// Why samples are no grid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DenseGridError {
    /// There are too few or too many samples.
    #[error("a grid of {size:?} samples needs {expected} of them, not {given}")]
    Length {
        /// Samples along x, y and z.
        size: [usize; 3],
        /// Their product.
        expected: usize,
        /// How many there are.
        given: usize,
    },
    /// A side is too short to hold a cell.
    #[error("a grid of {size:?} samples holds no cell: each side needs {least} at least")]
    Thin {
        /// Samples along x, y and z.
        size: [usize; 3],
        /// Least side.
        least: usize,
    },
    /// Vertices could be more than `u32` counts, or a side longer than 65,536.
    #[error("a grid of {size:?} samples is too large: {most} samples at most, and 65536 along a side")]
    Large {
        /// Samples along x, y and z.
        size: [usize; 3],
        /// Most samples.
        most: usize,
    },
}

/// Most samples of a grid: each has three edges, and each of these a vertex at most.
const MOST: usize = u32::MAX as usize / 3;
/// Longest side.
const LONGEST: usize = 1 << 16;

impl<'a, S: Density> DenseGrid<'a, S> {
    /// A grid of `size[0]` x `size[1]` x `size[2]` samples, all of which are meshed: sample (x, y, z) stands at index
    /// `x + size[0] * (y + size[1] * z)`.
    ///
    /// # Errors
    /// When the number of samples is another one, when a side is shorter than 2, and when the grid is too large.
    pub fn new(samples: &'a [S], size: [usize; 3]) -> Result<Self, DenseGridError> {
        Self::checked(samples, size, 0)
    }

    /// The same, but the outermost layer of samples on each side is there for gradients only: cells there are not meshed.
    /// So chunks that overlap by three samples share vertices with the same normals. Positions still count from sample
    /// (0, 0, 0).
    ///
    /// # Errors
    /// As [`new`](Self::new), but sides are at least 4.
    pub fn with_apron(samples: &'a [S], size: [usize; 3]) -> Result<Self, DenseGridError> {
        Self::checked(samples, size, 1)
    }

    fn checked(samples: &'a [S], size: [usize; 3], apron: usize) -> Result<Self, DenseGridError> {
        let least = 2 + 2 * apron;
        if size.iter().any(|&side| side < least) {
            return Err(DenseGridError::Thin { size, least });
        }
        let count = size.iter().try_fold(1usize, |count, &side| count.checked_mul(side));
        let Some(expected) = count.filter(|&count| count <= MOST && size.iter().all(|&side| side <= LONGEST))
        else {
            return Err(DenseGridError::Large { size, most: MOST });
        };
        if expected != samples.len() {
            return Err(DenseGridError::Length { size, expected, given: samples.len() });
        }
        Ok(Self { samples, size, apron })
    }

    /// Samples along x, y and z that are corners of meshed cells.
    pub(super) fn corners(&self) -> [usize; 3] {
        self.size.map(|side| side - 2 * self.apron)
    }

    /// From each sample to the next along x, y and z.
    pub(super) fn strides(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    pub(super) fn apron(&self) -> usize {
        self.apron
    }

    pub(super) fn samples(&self) -> &'a [S] {
        self.samples
    }

    /// Index of a corner.
    pub(super) fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        let [_, row, slice] = self.strides();
        x + self.apron + row * (y + self.apron) + slice * (z + self.apron)
    }
}
