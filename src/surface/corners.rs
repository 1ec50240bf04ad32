//! Bits of a layer of cells: one for each corner of the 8x8 cells of a brick at one y.
//!
//! Bit `z * 9 + x` stands for the corner (x, z), and also for the cell whose lowest corner that is. So the corner one
//! step along x is one bit further, the one along z nine bits, and a whole layer is judged by a few operations.

use wide::i32x8;

use super::padded_samples::SIDE;
use crate::ground::Ground;
use crate::lattice::{Column, ONE, ceil};

/// A bit for each of 9x9 corners, or of 8x8 cells.
pub type Corners = u128;

/// Bits from a corner to the next along x, to the next along z.
pub const X: u32 = 1;
/// See [`X`].
pub const Z: u32 = 9;

/// The corners of a row along x.
const ROW: Corners = 0x1ff;
/// All 8x8 cells.
pub const CELLS: Corners = spread(u64::MAX);
/// All 9x9 corners.
pub const ALL: Corners = (1 << 81) - 1;

/// Puts the rows of an 8x8 word (bit `z * 8 + x`) where corners have them.
pub const fn spread(word: u64) -> Corners {
    // Row z moves up by z bits: by 4, 2 and 1, as the bits of z say.
    let bits = word as u128;
    let bits = bits & 0xffff_ffff | (bits & 0xffff_ffff << 32) << 4;
    let pairs = 0xffff | 0xffff << 36;
    let bits = bits & pairs | (bits & pairs << 16) << 2;
    let rows = 0xff | 0xff << 18 | 0xff << 36 | 0xff << 54;
    bits & rows | (bits & rows << 8) << 1
}

/// The bits of 9x9 corners from the words of four bricks: the own one, the ones beyond x, beyond z and beyond both.
#[inline]
pub fn join([own, x, z, xz]: [u64; 4]) -> Corners {
    const FIRST_OF_ROWS: u64 = 0x0101_0101_0101_0101;
    // Most layers are all air or all solid.
    if own | x | z | xz == 0 {
        return 0;
    }
    if own & x & z & xz == u64::MAX {
        return ALL;
    }
    spread(own) | spread(x & FIRST_OF_ROWS) << 8 | (z as u128 & 0xff) << 72 | (xz as u128 & 1) << 80
}

/// Cells with a bit at some corner of their lower face.
#[inline]
pub fn any(corners: Corners) -> Corners {
    let along = corners | corners >> X;
    (along | along >> Z) & CELLS
}

/// Cells with bits at all corners of their lower face.
#[inline]
pub fn all(corners: Corners) -> Corners {
    let along = corners & corners >> X;
    along & along >> Z & CELLS
}

/// Cells between two layers of corners that have a solid corner and one of air.
#[inline]
pub fn mixed(below: Corners, above: Corners) -> Corners {
    (any(below) | any(above)) & !(all(below) & all(above))
}

/// The cells from `low` up to `high`, both included and counted from the brick's first cell.
pub fn rectangle(low: Column, high: Column) -> Corners {
    let row = ROW >> (8 - (high.x - low.x)) << low.x;
    (low.z..=high.z).fold(0, |bits, z| bits | row << (z * 9))
}

/// Calls `each` with the positions of the bits that are set, lowest first.
#[inline(always)]
pub fn for_ones(corners: Corners, mut each: impl FnMut(usize)) {
    for (mut bits, base) in [(corners as u64, 0), ((corners >> 64) as u64, 64)] {
        while bits != 0 {
            each(base + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}

/// Where a corner is: from the brick's lowest column in voxels, and in a layer of the apron.
pub struct Place {
    /// Voxels along x.
    pub x: i32,
    /// Voxels along z.
    pub z: i32,
    /// Index in a layer of the apron.
    pub apron: usize,
    /// Which of the four bricks that hold corners holds it: the own one, those beyond x, beyond z and beyond both.
    pub brick: usize,
    /// Index in a layer of that brick.
    pub index: usize,
}

/// The place of each corner.
pub static PLACES: [Place; 81] = {
    let mut places = [const { Place { x: 0, z: 0, apron: 0, brick: 0, index: 0 } }; 81];
    let mut corner = 0;
    while corner < 81 {
        let (x, z) = (corner % 9, corner / 9);
        places[corner] = Place {
            x: x as i32,
            z: z as i32,
            apron: (z + 1) * SIDE + x + 1,
            brick: x / 8 + z / 8 * 2,
            index: z % 8 * 8 + x % 8,
        };
        corner += 1;
    }
    places
};

/// Which corners of the 9 layers from `y` on are solid in the pristine world, under columns of these heights, of which
/// `range` is the range.
pub fn pristine(heights: &Heights, range: (i32, i32), y: i32) -> [Corners; 9] {
    let [all, some] = filled(range, y);
    let mut layers = [0; 9];
    layers[..all].fill(ALL);
    for (layer, y) in layers[all..some].iter_mut().zip(y + all as i32..) {
        *layer = below(heights, y * ONE);
    }
    layers
}

/// Of the 8 layers of cells from `y` on, those that have both signs somewhere, under columns of heights in a range; all others
/// are solid or air.
pub fn between(range: (i32, i32), y: i32) -> std::ops::Range<usize> {
    let [all, some] = filled(range, y);
    all.saturating_sub(1)..some.min(8)
}

/// How many of the 9 layers from `y` on are all solid, and how many have anything solid: below the lowest height all is, from
/// the highest on nothing is.
fn filled(range: (i32, i32), y: i32) -> [usize; 2] {
    [range.0, range.1].map(|height| (ceil(height) - y).clamp(0, 9) as usize)
}

/// Corners whose columns are higher than this.
fn below(heights: &Heights, y: i32) -> Corners {
    let mut words = [0u64; 2];
    for (z, row) in heights[1..10].iter().enumerate() {
        let Some(first) = row[1..].first_chunk::<8>() else { continue };
        let solid = i32x8::new(*first).simd_gt(i32x8::splat(y)).to_bitmask() | u32::from(row[9] > y) << 8;
        words[z / 5] |= u64::from(solid) << (z % 5 * 9);
    }
    u128::from(words[0]) | u128::from(words[1]) << 45
}

/// Heights of the columns around a stack of bricks, from one before its first on.
pub type Heights = [[i32; 11]; 11];

/// The heights around the stack of bricks whose lowest column is `low`.
pub fn heights(ground: &Ground, low: Column) -> Heights {
    ground.heights(low.offset(-1, -1))
}

/// Lowest and highest of a stack's own 9x9 corners.
pub fn range(heights: &Heights) -> (i32, i32) {
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
    use proptest::{prop_assert, prop_assert_eq, proptest};

    fn at(bits: Corners, x: usize, z: usize) -> bool {
        bits >> (z * 9 + x) & 1 == 1
    }

    proptest! {
        #[test]
        fn words_are_joined_to_corners(words: [u64; 4]) {
            let joined = join(words);
            for (x, z) in (0..9).flat_map(|z| (0..9).map(move |x| (x, z))) {
                let word = words[x / 8 + z / 8 * 2];
                prop_assert_eq!(at(joined, x, z), word >> (z % 8 * 8 + x % 8) & 1 == 1, "{} {}", x, z);
            }
            prop_assert_eq!(joined & !ALL, 0);
            let mut found = Vec::new();
            for_ones(joined, |bit| found.push(bit));
            prop_assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
            prop_assert_eq!(found.iter().fold(0, |bits: u128, bit| bits | 1 << bit), joined);
        }

        #[test]
        fn cells_are_judged_by_their_corners(words: [u64; 4], other: [u64; 4], few in 0u64..5) {
            let thin = |words: [u64; 4]| words.map(|word| word >> (few * 11) & word);
            let (below, above) = (join(thin(words)), join(thin(other)));
            for (x, z) in (0..8).flat_map(|z| (0..8).map(move |x| (x, z))) {
                let own = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dz)| (x + dx, z + dz));
                let count = |bits| own.iter().filter(|&&(x, z)| at(bits, x, z)).count();
                prop_assert_eq!(at(any(below), x, z), count(below) > 0);
                prop_assert_eq!(at(all(below), x, z), count(below) == 4);
                prop_assert_eq!(at(mixed(below, above), x, z), (1..8).contains(&(count(below) + count(above))));
            }
        }
    }

    #[test]
    fn rectangles_hold_their_cells() {
        let bits = rectangle(Column::new(2, 1), Column::new(5, 7));
        for (x, z) in (0..9).flat_map(|z| (0..9).map(move |x| (x, z))) {
            assert_eq!(at(bits, x, z), (2..=5).contains(&x) && (1..=7).contains(&z));
        }
        assert_eq!(rectangle(Column::new(0, 0), Column::new(7, 7)), CELLS);
    }

    #[test]
    fn pristine_corners_are_those_below_the_ground() {
        let heights: Heights =
            std::array::from_fn(|z| std::array::from_fn(|x| (z * 11 + x) as i32 * 4051 % 3001 - 900));
        let layers = pristine(&heights, range(&heights), -3);
        for (y, layer) in (-3..).zip(layers) {
            for (bit, height) in heights[1..10].iter().flat_map(|row| row[1..10].iter().copied()).enumerate()
            {
                assert_eq!(layer >> bit & 1 == 1, y * ONE < height);
            }
        }
    }
}
