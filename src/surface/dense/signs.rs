//! Signs of samples, as words of a row's bits.

use wide::{i8x16, i16x8, i16x16};

use super::grid::sealed::Sealed;
use super::{DenseGrid, Density};

/// The signs of three slices: the one under work, the one before it, the one after.
#[derive(Debug, Default)]
pub(super) struct Signs {
    slices: [Slice; 3],
    /// Words in a row, and one more that is always 0.
    words: usize,
    /// Corners in a row.
    width: usize,
}

/// Signs of one slice: rows along x, a bit for each corner. Bits beyond the last corner are 0.
#[derive(Debug, Default)]
struct Slice {
    words: Vec<u64>,
    /// Are all corners air (`Some(false)`), or all solid?
    side: Option<bool>,
}

impl Signs {
    pub fn begin<S: Density>(&mut self, grid: &DenseGrid<S>) {
        let [width, rows, _] = grid.corners();
        (self.width, self.words) = (width, width.div_ceil(64) + 1);
        for slice in &mut self.slices {
            slice.words.clear();
            slice.words.resize(self.words * rows, 0);
        }
    }

    /// Words that hold a row's corners.
    pub fn words(&self) -> usize {
        self.words - 1
    }

    /// Corners in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The rows of slice `z`, each with one more word after its last.
    #[inline(always)]
    pub fn slice(&self, z: usize) -> impl Iterator<Item = &[u64]> + Clone {
        self.slices[z % 3].words.chunks_exact(self.words)
    }

    /// Is all of slice `z` air, or all of it solid?
    pub fn side(&self, z: usize) -> Option<bool> {
        self.slices[z % 3].side
    }

    /// Reads slice `z`.
    pub fn read<S: Density>(&mut self, grid: &DenseGrid<S>, z: usize) {
        let slice = &mut self.slices[z % 3];
        let [_, stride, _] = grid.strides();
        let first = grid.index([0, 0, z]);
        let (mut any, mut missing) = (0, 0);
        let rows = grid.samples()[first..].chunks(stride);
        for (row, samples) in slice.words.chunks_exact_mut(self.words).zip(rows) {
            let samples = &samples[..self.width];
            for (samples, word) in samples.chunks(64).zip(row) {
                let (bits, all) = match samples.first_chunk::<64>() {
                    Some(samples) => (whole(samples), u64::MAX),
                    None => (part(samples), ones(samples.len())),
                };
                *word = bits;
                any |= bits;
                missing |= !bits & all;
            }
        }
        slice.side = match (any, missing) {
            (0, _) => Some(false),
            (_, 0) => Some(true),
            _ => None,
        };
    }
}

/// The signs of 64 samples: bit `i` is set where sample `i` is below zero.
#[inline(always)]
fn whole<S: Sealed>(samples: &[S; 64]) -> u64 {
    let parts = samples.as_chunks::<16>().0;
    sixteen(&parts[0]) | sixteen(&parts[1]) << 16 | sixteen(&parts[2]) << 32 | sixteen(&parts[3]) << 48
}

/// The signs of fewer samples.
#[inline(always)]
fn part<S: Sealed>(samples: &[S]) -> u64 {
    let (mut bits, mut done) = (0, 0);
    for samples in samples.as_chunks::<16>().0 {
        bits |= sixteen(samples) << done;
        done += 16;
    }
    if done == samples.len() {
        return bits;
    }
    // The last eight or sixteen once more, together with the rest.
    if samples.len() - done <= 8
        && let Some(last) = samples.last_chunk::<8>()
    {
        return bits | join(S::below_zero(*last), i16x8::ZERO) << (samples.len() - 8);
    }
    if let Some(last) = samples.last_chunk::<16>() {
        return bits | sixteen(last) << (samples.len() - 16);
    }
    let mut padded = [S::default(); 16];
    padded[..samples.len()].copy_from_slice(samples);
    sixteen(&padded)
}

/// The signs of sixteen samples.
#[inline(always)]
fn sixteen<S: Sealed>(samples: &[S; 16]) -> u64 {
    let eights = samples.as_chunks::<8>().0;
    join(S::below_zero(eights[0]), S::below_zero(eights[1]))
}

/// The signs of sixteen numbers.
#[inline(always)]
fn join(low: i16x8, high: i16x8) -> u64 {
    let sixteen: i16x16 = bytemuck::cast([low, high]);
    u64::from(i8x16::from_i16x16_saturate(sixteen).to_bitmask())
}

/// The lowest `count` bits.
pub(super) fn ones(count: usize) -> u64 {
    if count >= 64 { u64::MAX } else { (1 << count) - 1 }
}
