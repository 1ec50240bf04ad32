//! Solid samples of a layer as bits, 64 samples to a word.
//!
//! A word holds 64 samples but only 63 columns, because neighbouring words share a sample:
//!
//! ```text
//! word 0: samples  0 ..= 63    columns  0 ..= 62
//! word 1: samples 63 ..= 126   columns 63 ..= 125
//! ```
//!
//! So both samples of a cell's edge along x always lie in one word, and no bit is ever carried. The last sample of a
//! row is repeated: the column that it starts is not a cell, and no edge along x is crossed there. The last row is
//! repeated as well.

use super::density::Density;
use super::grid::DenseGrid;

/// Columns that one word holds.
pub(super) const COLUMNS: usize = 63;

/// Samples that are compared together.
const BLOCK: usize = 16;

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
        self.words.resize(words_per_row * (height + 1), 0);
        let last_samples = width - (words_per_row - 1) * COLUMNS;
        // All rows end alike, so it is decided here, once, how the last word is read.
        self.content = match last_samples / BLOCK {
            _ if width < BLOCK => self.read_rows(grid, z, |row| short_word(row)),
            0 => self.read_rows(grid, z, |row| last_word::<S, 0>(row, last_samples)),
            1 => self.read_rows(grid, z, |row| last_word::<S, 1>(row, last_samples)),
            2 => self.read_rows(grid, z, |row| last_word::<S, 2>(row, last_samples)),
            _ => self.read_rows(grid, z, |row| last_word::<S, 3>(row, last_samples)),
        };
        let last_row = words_per_row * (height - 1);
        self.words.copy_within(last_row..last_row + words_per_row, last_row + words_per_row);
    }

    /// Reads all rows; `last_word` reads the last word of one.
    #[inline(always)]
    fn read_rows<S: Density>(
        &mut self,
        grid: &DenseGrid<S>,
        z: usize,
        last_word: impl Fn(&[S]) -> u64,
    ) -> Content {
        let width = grid.meshed()[0];
        let words_per_row = Self::words_per_row(width);
        let (mut some, mut every) = (0, u64::MAX);
        for (words, row) in self.words.chunks_exact_mut(words_per_row).zip(grid.rows(z)) {
            let row = &row[..width];
            if let Some((last, full)) = words.split_last_mut() {
                let mut rest = row;
                for word in full {
                    *word = full_word(rest);
                    some |= *word;
                    every &= *word;
                    rest = &rest[COLUMNS..];
                }
                *last = last_word(row);
                some |= *last;
                every &= *last;
            }
        }
        match (some, every) {
            (0, _) => Content::Air,
            (_, u64::MAX) => Content::Solid,
            _ => Content::Mixed,
        }
    }

    /// The words of all rows, and behind them those of the last row once more.
    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    /// Returns `true` if the layer and `other` are both all air, or both all solid.
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

/// The signs of the last `count` samples of a row, which hold `BLOCKS` full blocks. The row has one at least.
#[inline(always)]
fn last_word<S: Density, const BLOCKS: usize>(row: &[S], count: usize) -> u64 {
    let samples = &row[row.len() - count..];
    let mut word = 0;
    for (block, samples) in samples[..BLOCKS * BLOCK].as_chunks().0.iter().enumerate() {
        word |= S::signs(samples) << (block * BLOCK);
    }
    // What is left over, together with samples that were read before.
    if let Some(end) = row.last_chunk() {
        word |= S::signs(end) << (64 - BLOCK) >> (64 - count);
    }
    repeat_last(word, count)
}

/// The signs of a row that is shorter than a block.
fn short_word<S: Density>(row: &[S]) -> u64 {
    let bit = |(bit, sample): (usize, &S)| u64::from(sample.is_solid()) << bit;
    repeat_last(row.iter().enumerate().map(bit).sum(), row.len())
}

/// Repeats the last of `count` bits until the word is full.
#[inline(always)]
fn repeat_last(word: u64, count: usize) -> u64 {
    ((word << (64 - count)) as i64 >> (64 - count)) as u64
}
