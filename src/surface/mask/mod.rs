//! The volumetric mask: cells whose sheet marching cubes draws.
//!
//! Rule 2: a cell is in the mask when a corner of its [sheet](cell_sheet), the cubes that the pristine surface crosses
//! over it, is edited. `rule::joined_cells` finds these cells.

mod borders;
mod rule;

use rustc_hash::FxHashMap;

use crate::lattice::{Column, shrink_if_sparse, table_bytes};

pub use super::pristine::{cell_sheet, sheet};
pub use borders::Borders;
pub(super) use borders::WINDOW;
pub(crate) use rule::joined_cells;

/// A set of cells, one 64-bit word for each 8x8 of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mask(FxHashMap<(i32, i32), u64>);

impl Mask {
    fn place(cell: Column) -> ((i32, i32), u64) {
        ((cell.x >> 3, cell.z >> 3), 1 << ((cell.z & 7) << 3 | (cell.x & 7)))
    }

    /// Returns `true` if marching cubes draws the sheet of this cell.
    pub fn contains(&self, cell: Column) -> bool {
        let (word, bit) = Self::place(cell);
        self.0.get(&word).is_some_and(|bits| bits & bit != 0)
    }

    /// An empty mask with room for this many words.
    pub(crate) fn with_room(words: usize) -> Self {
        Self(FxHashMap::with_capacity_and_hasher(words, Default::default()))
    }

    /// Adds 8x8 cells at once: bit `z * 8 + x` is the cell (8 `word.0` + x, 8 `word.1` + z).
    pub(crate) fn insert_word(&mut self, word: (i32, i32), cells: u64) {
        if cells != 0 {
            *self.0.entry(word).or_default() |= cells;
        }
    }

    /// Number of words.
    pub(crate) fn word_count(&self) -> usize {
        self.0.len()
    }

    /// Every word that is not empty, in no order.
    pub(crate) fn words(&self) -> impl Iterator<Item = ((i32, i32), u64)> {
        self.0.iter().map(|(&word, &cells)| (word, cells))
    }

    /// Replaces words by those of a newer mask.
    pub(crate) fn lay(&mut self, newer: &Self) {
        newer.words().for_each(|(word, cells)| self.lay_word(word, cells));
    }

    /// Replaces a word, and keeps it even if it is empty: for masks that lie over another one.
    pub(crate) fn lay_word(&mut self, word: (i32, i32), cells: u64) {
        self.0.insert(word, cells);
    }

    /// Replaces a word, and drops it if it is empty; returns the old one.
    pub(crate) fn replace_word(&mut self, word: (i32, i32), cells: u64) -> u64 {
        let before = if cells == 0 { self.0.remove(&word) } else { self.0.insert(word, cells) };
        before.unwrap_or_default()
    }

    /// Shrinks the table once most of it is unused.
    pub(crate) fn shrink_if_sparse(&mut self) {
        shrink_if_sparse(&mut self.0);
    }

    /// The 8x8 cells of a word, if it is stored.
    pub(crate) fn get_word(&self, word: (i32, i32)) -> Option<u64> {
        self.0.get(&word).copied()
    }

    /// The 8x8 cells of a word.
    pub(crate) fn word(&self, word: (i32, i32)) -> u64 {
        self.get_word(word).unwrap_or_default()
    }

    /// Number of cells in the mask.
    pub fn len(&self) -> usize {
        self.0.values().map(|bits| bits.count_ones() as usize).sum()
    }

    /// Returns `true` if the whole world is heightmap.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Every cell of the mask, in no order.
    pub fn iter(&self) -> impl Iterator<Item = Column> {
        self.0.iter().flat_map(|(&(x, z), &bits)| {
            (0..64)
                .filter(move |bit| bits >> bit & 1 == 1)
                .map(move |bit| Column::new(x << 3 | bit & 7, z << 3 | bit >> 3))
        })
    }

    /// Bytes of the mask.
    pub fn bytes(&self) -> usize {
        table_bytes(&self.0)
    }
}

/// The mask of a world, and words of it that a running transaction changes.
#[derive(Clone, Copy)]
pub struct MaskView<'a> {
    committed: &'a Mask,
    newer: Option<&'a Mask>,
}

impl<'a> MaskView<'a> {
    /// The committed mask alone.
    pub fn new(committed: &'a Mask) -> Self {
        Self { committed, newer: None }
    }

    /// This mask with newer words in place of its own.
    pub(crate) fn over(self, newer: &'a Mask) -> Self {
        Self { newer: Some(newer), ..self }
    }

    /// Returns `true` if marching cubes draws the sheet of this cell.
    pub fn contains(&self, cell: Column) -> bool {
        let (word, bit) = Mask::place(cell);
        self.word(word) & bit != 0
    }

    /// The word of 8x8 cells that starts at (8 x, 8 z): bit `z * 8 + x`.
    pub(crate) fn word(&self, word: (i32, i32)) -> u64 {
        let newer = self.newer.and_then(|newer| newer.get_word(word));
        newer.unwrap_or_else(|| self.committed.word(word))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_goes_in_once() {
        let mut mask = Mask::default();
        let cell = Column::new(-3, 17);
        mask.insert_word((-1, 2), 1 << 13);
        mask.insert_word((-1, 2), 1 << 13);
        mask.insert_word((4, 4), 0);
        assert!(mask.contains(cell) && mask.len() == 1);
        assert_eq!(mask.iter().collect::<Vec<_>>(), [cell]);
        assert_eq!(mask.words().count(), 1);
    }

    #[test]
    fn newer_words_stand_in_place_of_older_ones() {
        let (mut mask, mut newer) = (Mask::default(), Mask::default());
        mask.insert_word((0, 0), 0b111);
        mask.insert_word((1, 0), 0b1);
        newer.lay_word((0, 0), 0b100);
        newer.lay_word((1, 0), 0);
        newer.lay_word((2, 0), 0b10);
        let view = MaskView::new(&mask).over(&newer);
        let cells: Vec<i32> = (0..24).filter(|&x| view.contains(Column::new(x, 0))).collect();
        assert_eq!(cells, [2, 17]);
        assert_eq!([(0, 0), (1, 0), (2, 0)].map(|word| mask.replace_word(word, newer.word(word))), [7, 1, 0]);
        assert_eq!(mask.words().count(), 2, "empty words are left out");
    }
}
