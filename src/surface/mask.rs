//! The volumetric mask M: cells whose sheet marching cubes draws (rule 2).

use std::ops::Range;

use rustc_hash::FxHashMap;

use crate::ground::Ground;
use crate::lattice::{Column, ceil, table_bytes};

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

    /// Puts in 8x8 cells at once: bit `z * 8 + x` is the cell (8 `word.0` + x, 8 `word.1` + z).
    pub(crate) fn insert_word(&mut self, word: (i32, i32), cells: u64) {
        if cells != 0 {
            *self.0.entry(word).or_default() |= cells;
        }
    }

    /// Every word that is not empty, in no order.
    pub(crate) fn words(&self) -> impl Iterator<Item = ((i32, i32), u64)> {
        self.0.iter().map(|(&word, &cells)| (word, cells))
    }

    /// Takes in all cells of another mask.
    pub(crate) fn extend(&mut self, other: &Self) {
        for (&word, &bits) in &other.0 {
            *self.0.entry(word).or_default() |= bits;
        }
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

/// The mask of a world, and the cells that a running transaction adds to it.
#[derive(Clone, Copy)]
pub struct MaskView<'a> {
    committed: &'a Mask,
    added: Option<&'a Mask>,
}

impl<'a> MaskView<'a> {
    /// The committed mask alone.
    pub fn new(committed: &'a Mask) -> Self {
        Self { committed, added: None }
    }

    /// The same mask with more cells in it.
    pub fn with(self, added: &'a Mask) -> Self {
        Self { added: Some(added), ..self }
    }

    /// Does marching cubes draw the sheet of this cell?
    pub fn contains(&self, cell: Column) -> bool {
        self.committed.contains(cell) || self.added.is_some_and(|added| added.contains(cell))
    }

    /// The word of 8x8 cells that starts at (8 x, 8 z): bit `z * 8 + x`.
    pub(crate) fn word(&self, word: (i32, i32)) -> u64 {
        let of = |mask: &Mask| mask.0.get(&word).copied().unwrap_or_default();
        of(self.committed) | self.added.map_or(0, of)
    }

    /// Looks at every cell from `low` up to and without `high`, and at those beside them.
    pub fn borders(&self, low: Column, high: Column) -> Borders {
        let (width, depth) = ((high.x - low.x).max(0) as usize, (high.z - low.z).max(0) as usize);
        let mut borders = Borders { low, width, cells: vec![0; width * depth] };
        for z in (low.z - 1) >> 3..=high.z >> 3 {
            for x in (low.x - 1) >> 3..=high.x >> 3 {
                let mut bits = self.word((x, z));
                while bits != 0 {
                    let bit = bits.trailing_zeros() as i32;
                    bits &= bits - 1;
                    let cell = Column::new(x << 3 | bit & 7, z << 3 | bit >> 3);
                    borders.mark(cell, Borders::VOLUMETRIC);
                    for (side, (dx, dz)) in Borders::SIDES.into_iter().enumerate() {
                        borders.mark(cell.offset(-dx, -dz), 1 << side);
                    }
                }
            }
        }
        borders
    }
}

/// For each cell of a rectangle: is it in the mask, and which of its sides border on a cell that is?
pub struct Borders {
    low: Column,
    width: usize,
    cells: Vec<u8>,
}

impl Borders {
    /// Set for a cell that is in the mask itself.
    pub const VOLUMETRIC: u8 = 16;

    /// Steps to the neighbour at each side, in the order of the lower four bits: counter-clockwise seen from above, as
    /// [`Column::corners`] runs.
    pub const SIDES: [(i32, i32); 4] = [(-1, 0), (0, 1), (1, 0), (0, -1)];

    fn mark(&mut self, cell: Column, bits: u8) {
        let (x, z) = ((cell.x - self.low.x) as usize, (cell.z - self.low.z) as usize);
        if x < self.width
            && let Some(flags) = self.cells.get_mut(z.wrapping_mul(self.width).wrapping_add(x))
        {
            *flags |= bits;
        }
    }

    /// The flags of the cells with this z, along x.
    pub fn row(&self, z: i32) -> &[u8] {
        let start = (z - self.low.z) as usize * self.width;
        &self.cells[start..start + self.width]
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
}
