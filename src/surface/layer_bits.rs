//! Bits of a layer of cells: one for each corner of the 8x8 cells of a brick at one y.
//!
//! Bit `z * 9 + x` stands for the corner (x, z), and also for the cell whose lowest corner that is. So the corner one
//! step along x is one bit further, the one along z nine bits, and a whole layer is judged by a few operations.

use crate::lattice::Column;

/// A bit for each of 9x9 corners, or of 8x8 cells.
pub type LayerBits = u128;

/// Bits from a corner to the next along x, to the next along z.
pub const X: u32 = 1;
/// See [`X`].
pub const Z: u32 = 9;

/// Padded samples along one side: 9 corners, one more before and after for gradients.
pub const SIDE: usize = 11;

/// The corners of a row along x.
const ROW: LayerBits = 0x1ff;
/// All 8x8 cells.
pub const CELLS: LayerBits = spread(u64::MAX);
/// All 9x9 corners.
pub const ALL: LayerBits = (1 << 81) - 1;

/// Puts the rows of an 8x8 word (bit `z * 8 + x`) where corners have them.
pub const fn spread(word: u64) -> LayerBits {
    // Row z moves up by z bits: by 4, 2 and 1, as the bits of z say.
    let bits = word as u128;
    let bits = bits & 0xffff_ffff | (bits & 0xffff_ffff << 32) << 4;
    let pairs = 0xffff | 0xffff << 36;
    let bits = bits & pairs | (bits & pairs << 16) << 2;
    let rows = 0xff | 0xff << 18 | 0xff << 36 | 0xff << 54;
    bits & rows | (bits & rows << 8) << 1
}

/// The bits of 9x9 corners from the words of four bricks: the brick itself, and its neighbours along x, along z and
/// along both.
#[inline]
pub fn join([own, x, z, xz]: [u64; 4]) -> LayerBits {
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

/// The words of four bricks from the bits of 9x9 corners: [`join`] makes them one.
pub fn split(corners: LayerBits) -> [u64; 4] {
    const FIRST_OF_ROWS: u64 = 0x0101_0101_0101_0101;
    let x = gather(corners >> 8 & CELLS) & FIRST_OF_ROWS;
    [gather(corners & CELLS), x, (corners >> 72 & 0xff) as u64, (corners >> 80 & 1) as u64]
}

/// Puts the rows of 8x8 cells where a word has them: [`spread`] puts them back.
fn gather(cells: LayerBits) -> u64 {
    let rows = 0xff | 0xff << 18 | 0xff << 36 | 0xff << 54;
    let bits = cells & rows | cells >> 1 & rows << 8;
    let pairs = 0xffff | 0xffff << 36;
    let bits = bits & pairs | bits >> 2 & pairs << 16;
    (bits & 0xffff_ffff | bits >> 4 & 0xffff_ffff << 32) as u64
}

/// Cells with a bit at some corner of their lower face.
#[inline]
pub fn any(corners: LayerBits) -> LayerBits {
    let along = corners | corners >> X;
    (along | along >> Z) & CELLS
}

/// Cells with bits at all corners of their lower face.
#[inline]
pub fn all(corners: LayerBits) -> LayerBits {
    let along = corners & corners >> X;
    along & along >> Z & CELLS
}

/// Cells between two layers of corners that have a solid corner and one of air.
#[inline]
pub fn mixed(below: LayerBits, above: LayerBits) -> LayerBits {
    (any(below) | any(above)) & !(all(below) & all(above))
}

/// The cells from `low` up to `high`, both included and counted from the brick's first cell.
pub fn rectangle(low: Column, high: Column) -> LayerBits {
    let row = ROW >> (8 - (high.x - low.x)) << low.x;
    (low.z..=high.z).fold(0, |bits, z| bits | row << (z * 9))
}

/// Calls `each` with the positions of the bits that are set, lowest first.
#[inline(always)]
pub fn for_ones(corners: LayerBits, mut each: impl FnMut(usize)) {
    for (mut bits, base) in [(corners as u64, 0), ((corners >> 64) as u64, 64)] {
        while bits != 0 {
            each(base + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}

/// Where a corner is: from the brick's lowest column in voxels, and in a layer of the padded samples.
pub struct Place {
    /// Voxels along x.
    pub x: i32,
    /// Voxels along z.
    pub z: i32,
    /// Index in a layer of the padded samples.
    pub padded: usize,
    /// Which of the four bricks that hold corners holds it: the brick itself, or its neighbour along x, along z or
    /// along both.
    pub brick: usize,
    /// Index in a layer of that brick.
    pub index: usize,
}

/// The place of each corner.
pub static PLACES: [Place; 81] = {
    let mut places = [const { Place { x: 0, z: 0, padded: 0, brick: 0, index: 0 } }; 81];
    let mut corner = 0;
    while corner < 81 {
        let (x, z) = (corner % 9, corner / 9);
        places[corner] = Place {
            x: x as i32,
            z: z as i32,
            padded: (z + 1) * SIDE + x + 1,
            brick: x / 8 + z / 8 * 2,
            index: z % 8 * 8 + x % 8,
        };
        corner += 1;
    }
    places
};

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::{prop_assert, prop_assert_eq, proptest};

    fn at(bits: LayerBits, x: usize, z: usize) -> bool {
        bits >> (z * 9 + x) & 1 == 1
    }

    proptest! {
        #[test]
        fn words_are_joined_to_corners(words: [u64; 4]) {
            let joined = join(words);
            let [own, x, z, xz] = words;
            prop_assert_eq!(split(joined), [own, x & 0x0101_0101_0101_0101, z & 0xff, xz & 1]);
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
}
