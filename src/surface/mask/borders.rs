//! The border of the mask and of steep cells: neighbouring cells that stay heightmap.

use std::ops::Range;

use super::MaskView;
use crate::lattice::{ChunkGrid, Column};

/// Cells along a side of a word and its neighbours in [`MaskView::border_edges`]: one more on each side.
pub(crate) const WINDOW: i32 = 10;

impl MaskView<'_> {
    /// Examines every cell from `low` up to and excluding `high`, and their neighbours. `steep` has the steep
    /// ones of 8x8 cells, (x, z) in units of 8 cells, as bits `z * 8 + x`.
    pub fn borders(&self, low: Column, high: Column, steep: impl Fn((i32, i32)) -> u64) -> Borders {
        let (first, last) = ((low.x >> 3, low.z >> 3), ((high.x - 1) >> 3, (high.z - 1) >> 3));
        // With those around them, each looked up once.
        let places = (first.1 - 1..=last.1 + 1).flat_map(|z| (first.0 - 1..=last.0 + 1).map(move |x| (x, z)));
        let words: Vec<Word> = places.map(|at| Word { own: self.word(at), steep: steep(at) }).collect();
        let rows: Vec<&[Word]> = words.chunks((last.0 - first.0 + 3).max(1) as usize).collect();
        let across = (last.0 - first.0 + 1).max(0) as usize;
        let mut patches = Vec::with_capacity(across * rows.len());
        for rows in rows.windows(3) {
            let around = |at: usize| [0, 1, 2].map(|dz| [0, 1, 2].map(|dx| rows[dz][at + dx]));
            patches.extend((0..across).map(|at| Patch::new(&around(at))));
        }
        Borders { low, high, first, across, patches }
    }

    /// Lattice edges along x, y and z between a cell of the mask and one that stays heightmap, in and around the word
    /// (x, z): bit `(z + 1) * 10 + x + 1`.
    pub(crate) fn border_edges(&self, grid: ChunkGrid, (x, z): (i32, i32)) -> [u128; 3] {
        // Rows of a word are bytes. A window row is one bit of the word before, eight of the own, one of the word
        // after.
        let row = |words: [u64; 3], z: i32| {
            let [before, own, after] = words.map(|word| u128::from(word >> (z * 8) & 0xff));
            before >> 7 | own << 1 | (after & 1) << 9
        };
        let words = |dz: i32| [-1, 0, 1].map(|dx| self.word((x + dx, z + dz)));
        let (before, level, after) = (words(-1), words(0), words(1));
        if [before, level, after].iter().flatten().all(|&word| word == 0) {
            return [0; 3];
        }
        let mut mask = row(before, 7) | row(after, 0) << (9 * WINDOW);
        for z in 0..8 {
            mask |= row(level, z) << ((z + 1) * WINDOW);
        }
        let (mut world, inside) = (0u128, |at: i32, cells: i32| (0..cells).contains(&at));
        let rim = (0..WINDOW).filter(|&dx| inside(x * 8 + dx - 1, grid.width()));
        let row = rim.fold(0u128, |row, dx| row | 1 << dx);
        for dz in (0..WINDOW).filter(|&dz| inside(z * 8 + dz - 1, grid.depth())) {
            world |= row << (dz * WINDOW);
        }
        let around = |cells: u128, axis: usize| match axis {
            0 => cells | cells << WINDOW,
            1 => cells | cells << 1 | cells << WINDOW | cells << (WINDOW + 1),
            _ => cells | cells << 1,
        };
        std::array::from_fn(|axis| around(mask, axis) & around(world & !mask, axis))
    }
}

/// For each cell of a rectangle: is it in the mask, is it steep, and which of its sides border on a cell that is
/// either?
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
struct Word {
    /// Cells in the mask.
    own: u64,
    steep: u64,
}

/// 8x8 cells: bit `z * 8 + x`.
#[derive(Clone, Copy, Debug, Default)]
struct Patch {
    /// Cells in the mask.
    own: u64,
    /// Cells with a neighbour that is in the mask or steep, in the order of [`Borders::SIDES`]; then the steep cells.
    lines: [u64; 5],
    /// Cells in the mask or in any of `lines`.
    touched: u64,
    /// Cells with a neighbour in the mask, but not in it themselves.
    at_mask: u64,
}

impl Patch {
    /// By the words around them: `[dz + 1][dx + 1]`.
    fn new(words: &[[Word; 3]; 3]) -> Self {
        let Word { own, steep } = words[1][1];
        let [west, south, east, north] = beside(&words.map(|row| row.map(|word| word.own | word.steep)));
        // A steep cell has vertices on all its lines.
        let lines = [west, south, east, north, 0].map(|line| line | steep);
        let touched = lines.iter().fold(own, |any, line| any | line);
        let at_mask =
            beside(&words.map(|row| row.map(|word| word.own))).iter().fold(0, |any, side| any | side);
        Self { own, lines, touched, at_mask: at_mask & !own }
    }
}

/// Each cell's neighbour moved to where the cell is, in the order of [`Borders::SIDES`].
fn beside(words: &[[u64; 3]; 3]) -> [u64; 4] {
    const FIRST: u64 = 0x0101_0101_0101_0101;
    let own = words[1][1];
    [
        (own & !(FIRST << 7)) << 1 | words[1][0] >> 7 & FIRST,
        own >> 8 | words[2][1] << 56,
        (own & !FIRST) >> 1 | (words[1][2] & FIRST) << 7,
        own << 8 | words[0][1] >> 56,
    ]
}

impl Borders {
    /// Steps to the neighbour at each side, in the order of flags: counter-clockwise seen from above, as
    /// [`Column::corners`] runs.
    pub const SIDES: [(i32, i32); 4] = [(-1, 0), (0, 1), (1, 0), (0, -1)];

    /// The flags of a steep cell: its diagonal's after those of its sides.
    pub const STEEP: u8 = 0b1_1111;

    fn patch(&self, (x, z): (i32, i32)) -> Option<&Patch> {
        let x = usize::try_from(x - self.first.0).ok().filter(|&x| x < self.across)?;
        let z = usize::try_from(z - self.first.1).ok()?;
        self.patches.get(z * self.across + x)
    }

    /// The cells of 8x8 that lie in the rectangle, are not in the mask, and border on it or on a steep cell or are
    /// steep: row by row, each with a bit for every side where it borders, or with [`Self::STEEP`]. `(z, x)` in units
    /// of 8 cells.
    pub fn bordering(&self, (z, x): (i32, i32)) -> impl Iterator<Item = (Column, u8)> {
        let patch = self.patch((x, z)).copied().unwrap_or_default();
        self.cells(patch.touched & !patch.own, (z, x)).map(move |(bit, cell)| {
            let flags = (0..).zip(patch.lines).map(|(line, cells)| ((cells >> bit & 1) as u8) << line);
            (cell, flags.sum())
        })
    }

    /// Those cells of an 8x8 word that lie in the rectangle, with their bits. `(z, x)` in units of 8 cells.
    fn cells(&self, mut bits: u64, (z, x): (i32, i32)) -> impl Iterator<Item = (u32, Column)> {
        let (low, high) = (self.low, self.high);
        let next = move || {
            let bit = bits.trailing_zeros();
            bits &= bits.wrapping_sub(1);
            (bit < 64).then(|| (bit, Column::new(x * 8 + (bit & 7) as i32, z * 8 + (bit >> 3) as i32)))
        };
        let is_inside =
            move |cell: Column| (low.x..high.x).contains(&cell.x) && (low.z..high.z).contains(&cell.z);
        std::iter::from_fn(next).filter(move |&(_, cell)| is_inside(cell))
    }

    /// Returns `true` if any cell borders on the mask.
    pub fn has_bordering(&self) -> bool {
        let places = (self.first.1..).flat_map(|z| (self.first.0..).take(self.across).map(move |x| (z, x)));
        self.patches.iter().zip(places).any(|(patch, at)| self.cells(patch.at_mask, at).next().is_some())
    }

    /// The runs of cells with this z, in order, that neither are in the mask or steep nor border on such cells: of the
    /// rectangle's rows, by x.
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
    use super::super::Mask;
    use super::*;

    #[test]
    fn borders_are_next_to_the_mask() {
        let mut mask = Mask::default();
        for (word, cells) in
            [((0, 0), 0x8100_0000_0012_0081), ((1, 0), 0x0180), ((0, 1), 0xf0), ((-1, 0), 0x80)]
        {
            mask.insert_word(word, cells);
        }
        let view = MaskView::new(&mask);
        for (low, high) in [((0, 0), (8, 8)), ((-3, -2), (11, 13)), ((3, 5), (5, 7)), ((7, 7), (30, 9))] {
            let (low, high) = (Column::new(low.0, low.1), Column::new(high.0, high.1));
            let steep = |(x, z): (i32, i32)| if (x, z) == (1, 0) { 0x8000_0100_0000_0208 } else { 0 };
            let is_steep = |cell: Column| {
                steep((cell.x >> 3, cell.z >> 3)) >> ((cell.z & 7) * 8 + (cell.x & 7)) & 1 == 1
            };
            let borders = view.borders(low, high, steep);
            let mut has_bordering = false;
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
                    let bends = |cell| mask.contains(cell) || is_steep(cell);
                    let bordering =
                        sides.map(|(side, (dx, dz))| u8::from(bends(cell.offset(dx, dz))) << side);
                    let is_at_mask =
                        Borders::SIDES.iter().any(|(dx, dz)| mask.contains(cell.offset(*dx, *dz)));
                    has_bordering |= is_at_mask && !mask.contains(cell);
                    let expected = if is_steep(cell) { Borders::STEEP } else { bordering.sum() };
                    let is_own = mask.contains(cell);
                    let found = flags.remove(&(z, x));
                    let is_drawn = !is_own && expected != 0;
                    assert_eq!(found, is_drawn.then_some(expected), "{cell:?}");
                    let is_whole = whole.iter().any(|run| run.contains(&x));
                    assert_eq!(is_whole, !is_own && !is_drawn, "{cell:?}");
                }
            }
            assert_eq!(borders.has_bordering(), has_bordering);
            assert!(flags.is_empty(), "cells outside: {flags:?}");
        }
    }
}
