//! Which samples of a layer are solid: bits, 64 samples to a word.
//!
//! A word holds 64 samples but only 63 columns, because neighbouring words share a sample:
//!
//! ```text
//! word 0: samples  0 ..= 63    columns  0 ..= 62
//! word 1: samples 63 ..= 126   columns 63 ..= 125
//! ```
//!
//! So both samples of a cell's edge along x always lie in one word, and no bit is ever carried. The last sample of a row
//! stands twice: the column that it starts is no cell, and no edge along x is crossed there.

use super::density::Density;
use super::grid::DenseGrid;

/// Columns that one word holds.
pub(super) const COLUMNS: usize = 63;

/// The signs of one layer of samples, row by row.
#[derive(Debug, Default)]
pub(super) struct Signs {
    words: Vec<u64>,
    content: Content,
}

/// What a layer holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Content {
    #[default]
    Air,
    Solid,
    Mixed,
}

impl Signs {
    /// Words of a row of `samples` samples.
    pub(super) fn words_per_row(samples: usize) -> usize {
        samples.div_ceil(COLUMNS)
    }

    /// Reads layer `z` of the meshed samples.
    pub(super) fn read<S: Density>(&mut self, grid: &DenseGrid<S>, z: usize) {
        let [width, height, _] = grid.meshed();
        let words_per_row = Self::words_per_row(width);
        let length = words_per_row * height;
        if self.words.len() != length {
            self.words.resize(length, 0);
        }
        let (mut some, mut every) = (0, u64::MAX);
        for (y, words) in self.words.chunks_exact_mut(words_per_row).enumerate() {
            let mut rest = grid.row(y, z);
            if let Some((last, full)) = words.split_last_mut() {
                for word in full {
                    *word = full_word(rest);
                    some |= *word;
                    every &= *word;
                    rest = &rest[COLUMNS..];
                }
                *last = last_word(rest);
                some |= *last;
                // Bits behind the row's end are neither.
                every &= *last | !(u64::MAX >> (COLUMNS - rest.len()));
            }
        }
        self.content = match (some, every) {
            (0, _) => Content::Air,
            (_, u64::MAX) => Content::Solid,
            _ => Content::Mixed,
        };
    }

    /// The words of all rows.
    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    /// Is the layer one with `other`: both all air, or both all solid?
    pub(super) fn is_uniform_with(&self, other: &Self) -> bool {
        self.content != Content::Mixed && self.content == other.content
    }
}

/// The signs of the first 64 samples.
#[inline(always)]
fn full_word<S: Density>(samples: &[S]) -> u64 {
    let (blocks, _) = samples[..64].as_chunks();
    S::signs(&blocks[0])
        | S::signs(&blocks[1]) << 16
        | S::signs(&blocks[2]) << 32
        | S::signs(&blocks[3]) << 48
}

/// The signs of a row's last samples, 1 to 63, the very last one twice.
#[inline(always)]
fn last_word<S: Density>(samples: &[S]) -> u64 {
    let (blocks, rest) = samples.as_chunks();
    let (mut word, mut bit) = (0, 0);
    for block in blocks {
        word |= S::signs(block) << bit;
        bit += 16;
    }
    for sample in rest {
        word |= u64::from(sample.is_solid()) << bit;
        bit += 1;
    }
    word | (word >> (bit - 1) & 1) << bit
}
