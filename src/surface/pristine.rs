//! The pristine surface: the cubes that it crosses over a cell or a stack of bricks, and the corners below it.

use std::ops::Range;

use wide::i32x8;

use super::layer_bits::{self, ALL, LayerBits, SIDE, X, Z};
use crate::ground::Ground;
use crate::lattice::{Column, ONE, ceil};

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

/// Lattice y of the cubes that the pristine surface crosses over some of the 8x8 cells from `low` on, given as bits
/// `z * 8 + x`.
pub(crate) fn sheet_rows(ground: &Ground, low: Column, cells: u64) -> Range<i32> {
    let heights = ground.heights::<9>(low);
    let cells = layer_bits::spread(cells);
    // The corners of these cells.
    let along = cells | cells << X;
    let mut range = (i32::MAX, i32::MIN);
    layer_bits::for_ones(along | along << Z, |corner| {
        let height = heights.as_flattened()[corner];
        range = (range.0.min(height), range.1.max(height));
    });
    sheet([range.0, range.1])
}

/// Heights of the columns around a stack of bricks, from one before its first on.
pub type Heights = [[i32; SIDE]; SIDE];

/// The pristine surface over a stack of bricks, all with the same x and z.
pub struct PristineStack {
    /// The bricks' x and z.
    pub stack: (i32, i32),
    /// Heights of the columns, in 1/256 voxel.
    pub heights: Heights,
    /// Lowest and highest of the stack's own 9x9 corners.
    range: (i32, i32),
}

impl PristineStack {
    /// Over the stack (x, z).
    pub fn new(ground: &Ground, stack: (i32, i32)) -> Self {
        let heights = ground.heights(Column::new(stack.0 * 8 - 1, stack.1 * 8 - 1));
        Self { stack, heights, range: range(&heights) }
    }

    /// Lattice y of the cubes that the surface crosses.
    pub fn rows(&self) -> Range<i32> {
        sheet([self.range.0, self.range.1])
    }

    /// Returns `Some(true)` if the samples of the nine layers from `y` on are all solid, `Some(false)` if all
    /// are air, and `None` otherwise.
    pub fn side(&self, y: i32) -> Option<bool> {
        match self.filled(y) {
            [_, 0] => Some(false),
            [9, _] => Some(true),
            _ => None,
        }
    }

    /// Which corners are solid, for the nine layers from `y` on.
    pub fn solid(&self, y: i32) -> [LayerBits; 9] {
        let [all, some] = self.filled(y);
        let mut layers = [0; 9];
        layers[..all].fill(ALL);
        for (layer, y) in layers[all..some].iter_mut().zip(y + all as i32..) {
            *layer = below(&self.heights, y * ONE);
        }
        layers
    }

    /// Which of the eight layers of cells from `y` on the surface crosses somewhere.
    pub fn crossed(&self, y: i32) -> Range<usize> {
        let [all, some] = self.filled(y);
        all.saturating_sub(1)..some.min(8)
    }

    /// How many of the nine layers from `y` on are all solid, and how many have a solid corner.
    fn filled(&self, y: i32) -> [usize; 2] {
        [self.range.0, self.range.1].map(|height| (ceil(height) - y).clamp(0, 9) as usize)
    }
}

/// LayerBits whose columns are higher than this.
fn below(heights: &Heights, y: i32) -> LayerBits {
    let mut words = [0u64; 2];
    for (z, row) in heights[1..10].iter().enumerate() {
        let Some(first) = row[1..].first_chunk::<8>() else { continue };
        let solid = i32x8::new(*first).simd_gt(i32x8::splat(y)).to_bitmask() | u32::from(row[9] > y) << 8;
        words[z / 5] |= u64::from(solid) << (z % 5 * 9);
    }
    u128::from(words[0]) | u128::from(words[1]) << 45
}

/// Lowest and highest of a stack's own 9x9 corners.
fn range(heights: &Heights) -> (i32, i32) {
    // Row by row, so that several are compared at once.
    let (mut low, mut high) = ([i32::MAX; 9], [i32::MIN; 9]);
    for row in &heights[1..10] {
        for ((low, high), &height) in low.iter_mut().zip(&mut high).zip(&row[1..10]) {
            (*low, *high) = (height.min(*low), height.max(*high));
        }
    }
    (low.into_iter().fold(i32::MAX, i32::min), high.into_iter().fold(i32::MIN, i32::max))
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn pristine_corners_are_those_below_the_ground() {
        let heights: Heights =
            std::array::from_fn(|z| std::array::from_fn(|x| (z * 11 + x) as i32 * 4051 % 3001 - 900));
        let layers = PristineStack { stack: (0, 0), heights, range: range(&heights) }.solid(-3);
        for (y, layer) in (-3..).zip(layers) {
            for (bit, height) in heights[1..10].iter().flat_map(|row| row[1..10].iter().copied()).enumerate()
            {
                assert_eq!(layer >> bit & 1 == 1, y * ONE < height);
            }
        }
    }
}
