//! The volumetric mask M: cells whose sheet marching cubes draws (rule 2).

use std::ops::Range;

use rustc_hash::FxHashMap;

use crate::ground::Ground;
use crate::lattice::{Column, ceil, give_back, table_bytes};

/// Lattice y of the cubes that the pristine surface crosses over columns of these heights (1/256 voxel). A height on a
/// lattice point counts below it.
pub fn sheet(heights: impl IntoIterator<Item = i32>) -> Range<i32> {
    let (low, high) =
        heights.into_iter().fold((i32::MAX, i32::MIN), |(low, high), h| (low.min(h), high.max(h)));
    ceil(low) - 1..ceil(high)
}

/// The sheet of a cell.
pub fn cell_sheet(ground: &Ground, cell: Column) -> Range<i32> {
    sheet(cell.corners().map(|column| ground.height(column)))
}

/// A set of cells, one 64-bit word for each 8x8 of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mask(FxHashMap<(i32, i32), u64>);

impl Mask {
    fn place(cell: Column) -> ((i32, i32), u64) {
        ((cell.x >> 3, cell.z >> 3), 1 << ((cell.z & 7) << 3 | (cell.x & 7)))
    }

    /// Does marching cubes draw the sheet of this cell?
    pub fn contains(&self, cell: Column) -> bool {
        let (word, bit) = Self::place(cell);
        self.0.get(&word).is_some_and(|bits| bits & bit != 0)
    }

    /// Without cells, and with room for so many words.
    pub(crate) fn with_room(words: usize) -> Self {
        Self(FxHashMap::with_capacity_and_hasher(words, Default::default()))
    }

    /// Puts in 8x8 cells at once: bit `z * 8 + x` is the cell (8 `word.0` + x, 8 `word.1` + z).
    pub(crate) fn insert_word(&mut self, word: (i32, i32), cells: u64) {
        if cells != 0 {
            *self.0.entry(word).or_default() |= cells;
        }
    }

    /// How many words there are.
    pub(crate) fn word_count(&self) -> usize {
        self.0.len()
    }

    /// Every word that is not empty, in no order.
    pub(crate) fn words(&self) -> impl Iterator<Item = ((i32, i32), u64)> {
        self.0.iter().map(|(&word, &cells)| (word, cells))
    }

    /// Stands the words of a newer mask in place of those that are here.
    pub(crate) fn lay(&mut self, newer: &Self) {
        newer.words().for_each(|(word, cells)| self.lay_word(word, cells));
    }

    /// Stands 8x8 cells in place of those of a word, even if that leaves it empty: for masks that lie over another one.
    pub(crate) fn lay_word(&mut self, word: (i32, i32), cells: u64) {
        self.0.insert(word, cells);
    }

    /// Puts 8x8 cells in place of those of a word; returns what was there.
    pub(crate) fn replace_word(&mut self, word: (i32, i32), cells: u64) -> u64 {
        let before = if cells == 0 { self.0.remove(&word) } else { self.0.insert(word, cells) };
        before.unwrap_or_default()
    }

    /// Gives back what words held that are gone.
    pub(crate) fn give_back(&mut self) {
        give_back(&mut self.0);
    }

    /// The 8x8 cells of a word that was put in or laid.
    pub(crate) fn get_word(&self, word: (i32, i32)) -> Option<u64> {
        self.0.get(&word).copied()
    }

    /// The 8x8 cells of a word.
    pub(crate) fn word(&self, word: (i32, i32)) -> u64 {
        self.get_word(word).unwrap_or_default()
    }

    /// How many cells are in the mask.
    pub fn len(&self) -> usize {
        self.0.values().map(|bits| bits.count_ones() as usize).sum()
    }

    /// Is the whole world heightmap?
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

    /// The same mask with newer words in place of its own.
    pub(crate) fn over(self, newer: &'a Mask) -> Self {
        Self { newer: Some(newer), ..self }
    }

    /// Does marching cubes draw the sheet of this cell?
    pub fn contains(&self, cell: Column) -> bool {
        let (word, bit) = Mask::place(cell);
        self.word(word) & bit != 0
    }

    /// The word of 8x8 cells that starts at (8 x, 8 z): bit `z * 8 + x`.
    pub(crate) fn word(&self, word: (i32, i32)) -> u64 {
        let newer = self.newer.and_then(|newer| newer.get_word(word));
        newer.unwrap_or_else(|| self.committed.word(word))
    }

    /// Looks at every cell from `low` up to and without `high`, and at those beside them.
    pub fn borders(&self, low: Column, high: Column) -> Borders {
        let (first, last) = ((low.x >> 3, low.z >> 3), ((high.x - 1) >> 3, (high.z - 1) >> 3));
        // With those around them, each looked up once.
        let row = |z: i32| (first.0 - 1..=last.0 + 1).map(move |x| self.word((x, z)));
        let words: Vec<u64> = (first.1 - 1..=last.1 + 1).flat_map(row).collect();
        let rows: Vec<&[u64]> = words.chunks((last.0 - first.0 + 3).max(1) as usize).collect();
        let across = (last.0 - first.0 + 1).max(0) as usize;
        let mut patches = Vec::with_capacity(across * rows.len());
        for rows in rows.windows(3) {
            let around = |at: usize| [0, 1, 2].map(|dz| [0, 1, 2].map(|dx| rows[dz][at + dx]));
            patches.extend((0..across).map(|at| Patch::new(&around(at))));
        }
        Borders { low, high, first, across, patches }
    }
}

/// For each cell of a rectangle: is it in the mask, and which of its sides border on a cell that is?
#[derive(Clone, Debug)]
pub struct Borders {
    low: Column,
    high: Column,
    /// The first of the patches along x and along z, and how many there are along x.
    first: (i32, i32),
    across: usize,
    patches: Vec<Patch>,
}

/// 8x8 cells: bit `z * 8 + x`.
#[derive(Clone, Copy, Debug, Default)]
struct Patch {
    /// Those in the mask.
    own: u64,
    /// Those with a neighbour in the mask, in the order of [`Borders::SIDES`].
    sides: [u64; 4],
    /// All of these.
    touched: u64,
}

impl Patch {
    /// By the words of the mask around them: `[dz + 1][dx + 1]`.
    fn new(words: &[[u64; 3]; 3]) -> Self {
        const FIRST: u64 = 0x0101_0101_0101_0101;
        let own = words[1][1];
        // Each cell's neighbour moved to where the cell is.
        let sides = [
            (own & !(FIRST << 7)) << 1 | words[1][0] >> 7 & FIRST,
            own >> 8 | words[2][1] << 56,
            (own & !FIRST) >> 1 | (words[1][2] & FIRST) << 7,
            own << 8 | words[0][1] >> 56,
        ];
        Self { own, sides, touched: sides.iter().fold(own, |any, side| any | side) }
    }
}

impl Borders {
    /// Steps to the neighbour at each side, in the order of flags: counter-clockwise seen from above, as
    /// [`Column::corners`] runs.
    pub const SIDES: [(i32, i32); 4] = [(-1, 0), (0, 1), (1, 0), (0, -1)];

    fn patch(&self, (x, z): (i32, i32)) -> Option<&Patch> {
        let x = usize::try_from(x - self.first.0).ok().filter(|&x| x < self.across)?;
        let z = usize::try_from(z - self.first.1).ok()?;
        self.patches.get(z * self.across + x)
    }

    /// The cells of 8x8 that lie in the rectangle, are not in the mask and border on it: row by row, each with a bit for
    /// every side where it does. `(z, x)` in units of 8 cells.
    pub fn bordering(&self, (z, x): (i32, i32)) -> impl Iterator<Item = (Column, u8)> {
        let (low, high) = (self.low, self.high);
        let patch = self.patch((x, z)).copied().unwrap_or_default();
        let mut cells = patch.touched & !patch.own;
        let next = move || {
            let bit = cells.trailing_zeros();
            cells &= cells.wrapping_sub(1);
            let flags = (0..).zip(patch.sides).map(|(side, cells)| ((cells >> bit & 1) as u8) << side);
            (bit < 64)
                .then(|| (Column::new(x * 8 + (bit & 7) as i32, z * 8 + (bit >> 3) as i32), flags.sum()))
        };
        let is_inside =
            move |cell: Column| (low.x..high.x).contains(&cell.x) && (low.z..high.z).contains(&cell.z);
        std::iter::from_fn(next).filter(move |&(cell, _)| is_inside(cell))
    }

    /// The runs of cells with this z, in order, that neither are in the mask nor border on it: of the rectangle's rows,
    /// by x.
    pub fn whole(&self, z: i32) -> impl Iterator<Item = Range<i32>> {
        // Where the next cell is that is whole, or is not.
        let next = move |mut x: i32, is_whole: bool| {
            while x < self.high.x {
                let patch = self.patch((x >> 3, z >> 3));
                let touched = patch.map_or(0, |patch| (patch.touched >> ((z & 7) * 8)) as u8);
                let wanted = if is_whole { !touched } else { touched } >> (x & 7);
                if wanted != 0 {
                    return (x + wanted.trailing_zeros() as i32).min(self.high.x);
                }
                x = (x | 7) + 1;
            }
            self.high.x
        };
        let mut at = self.low.x;
        std::iter::from_fn(move || {
            let start = next(at, true);
            at = next(start, false);
            (start < at).then_some(start..at)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::ONE;

    #[test]
    fn the_sheet_holds_every_cube_with_both_signs() {
        let cases = [
            ([0, 0], -1..0), // on a lattice point: the cube below
            ([1, 1], 0..1),
            ([ONE, ONE + 1], 0..2),
            ([-ONE, 2 * ONE], -2..2),
            ([-1, 1], -1..1),
        ];
        for (heights, expected) in cases {
            assert_eq!(sheet(heights), expected, "{heights:?}");
        }
    }

    #[test]
    fn borders_are_beside_the_mask() {
        let mut mask = Mask::default();
        for (word, cells) in
            [((0, 0), 0x8100_0000_0012_0081), ((1, 0), 0x0180), ((0, 1), 0xf0), ((-1, 0), 0x80)]
        {
            mask.insert_word(word, cells);
        }
        let view = MaskView::new(&mask);
        for (low, high) in [((0, 0), (8, 8)), ((-3, -2), (11, 13)), ((3, 5), (5, 7)), ((7, 7), (30, 9))] {
            let (low, high) = (Column::new(low.0, low.1), Column::new(high.0, high.1));
            let borders = view.borders(low, high);
            let mut flags = std::collections::BTreeMap::new();
            for patch in (-1..2).flat_map(|z| (-1..5).map(move |x| (z, x))) {
                let before = flags.len();
                flags.extend(borders.bordering(patch).map(|(cell, flags)| ((cell.z, cell.x), flags)));
                let cells: Vec<_> = borders.bordering(patch).map(|(cell, _)| (cell.z, cell.x)).collect();
                assert!(cells.is_sorted() && cells.len() == flags.len() - before, "{patch:?}");
            }
            for z in low.z..high.z {
                let whole: Vec<_> = borders.whole(z).collect();
                assert!(whole.windows(2).all(|pair| pair[0].end < pair[1].start), "{whole:?}");
                for x in low.x..high.x {
                    let cell = Column::new(x, z);
                    let sides = (0..).zip(Borders::SIDES);
                    let expected = sides
                        .map(|(side, (dx, dz))| u8::from(mask.contains(cell.offset(dx, dz))) << side)
                        .sum::<u8>();
                    let is_own = mask.contains(cell);
                    let found = flags.remove(&(z, x)).unwrap_or_default();
                    assert_eq!(found, if is_own { 0 } else { expected }, "{cell:?}");
                    let is_whole = whole.iter().any(|run| run.contains(&x));
                    assert_eq!(is_whole, !is_own && expected == 0, "{cell:?}");
                }
            }
            assert!(flags.is_empty(), "cells outside: {flags:?}");
        }
    }

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
        assert_eq!(mask.words().count(), 2, "an empty word is no word");
    }
}
