//! Signs of samples, as words of a row's bits.

use super::grid::sealed::Sealed;
use super::{DenseGrid, Density};

/// The signs of three slices: the one under work, the one before it, the one after.
#[derive(Debug, Default)]
pub(super) struct Signs {
    slices: [Slice; 3],
    /// Words in a row, and one more that is always 0.
    words: usize,
    rows: usize,
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

/// One row of signs: 64 corners a word.
pub(super) type Row<'a> = &'a [u64];

impl Signs {
    pub fn begin<S: Density>(&mut self, grid: &DenseGrid<S>) {
        let [width, rows, _] = grid.corners();
        (self.width, self.rows, self.words) = (width, rows, width.div_ceil(64) + 1);
        for slice in &mut self.slices {
            slice.words.clear();
            slice.words.resize(self.words * rows, 0);
        }
    }

    /// Words that hold a row's corners.
    pub fn words(&self) -> usize {
        self.words - 1
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Corners in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// A row of slice `z`, with one more word after its last.
    #[inline(always)]
    pub fn row(&self, y: usize, z: usize) -> Row<'_> {
        &self.slices[z % 3].words[y * self.words..(y + 1) * self.words]
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
        for (y, row) in slice.words.chunks_exact_mut(self.words).enumerate() {
            let samples = &grid.samples()[first + y * stride..][..self.width];
            let mut whole = samples.chunks_exact(64);
            let mut words = row.iter_mut();
            for (samples, word) in whole.by_ref().zip(words.by_ref()) {
                let Some(samples) = samples.first_chunk() else { continue };
                *word = <S as Sealed>::signs(samples);
                any |= *word;
                missing |= !*word;
            }
            let rest = whole.remainder();
            if let (false, Some(word)) = (rest.is_empty(), words.next()) {
                let mut padded = [S::default(); 64];
                padded[..rest.len()].copy_from_slice(rest);
                *word = <S as Sealed>::signs(&padded);
                any |= *word;
                missing |= !*word & ones(rest.len());
            }
        }
        slice.side = match (any, missing) {
            (0, _) => Some(false),
            (_, 0) => Some(true),
            _ => None,
        };
    }
}

/// The lowest `count` bits.
pub(super) fn ones(count: usize) -> u64 {
    if count >= 64 { u64::MAX } else { (1 << count) - 1 }
}
