//! Cells so steep that their corners' tops do not show all voxels of the face between them.

use rayon::prelude::*;

use crate::ground::GroundError;
use crate::ground::world::Ground;
use crate::lattice::{Column, ceil};

/// Do voxels of the higher of two neighbouring columns lie between their tops? `a` and `b` are their heights.
///
/// At least two lattice levels separate such heights.
pub(crate) fn is_banded(a: i32, b: i32) -> bool {
    ceil(a).abs_diff(ceil(b)) >= 2
}

/// The cells of a ground that have a banded side or diagonal, one bit each.
#[derive(Clone, PartialEq)]
pub(crate) struct SteepCells {
    /// Words along x.
    across: usize,
    /// Row-major words of 8x8 cells: bit `z * 8 + x`, as in the mask.
    words: Vec<u64>,
}

impl SteepCells {
    /// The steep cells of a ground, found in parallel; `None` if there are none.
    pub(super) fn new(ground: &Ground) -> Result<Option<Self>, GroundError> {
        let [across, along] = [ground.width(), ground.depth()].map(|cells| cells.unsigned_abs().div_ceil(8));
        let (across, count) = (across as usize, across as usize * along as usize);
        let mut words = Vec::new();
        words
            .try_reserve_exact(count)
            .map_err(|_| GroundError::Memory { bytes: count * size_of::<u64>() })?;
        words.resize(count, 0);
        words.par_chunks_mut(across).zip(0..along as i32).for_each(|(row, z)| {
            for (word, x) in row.iter_mut().zip(0..) {
                *word = steep_word(ground, Column::new(x * 8, z * 8));
            }
        });
        let has_any = words.par_iter().any(|&word| word != 0);
        Ok(has_any.then_some(Self { across, words }))
    }

    /// The steep ones of the 8x8 cells from (8 x, 8 z) on; those beyond the rim mean nothing.
    pub fn word(&self, (x, z): (i32, i32)) -> u64 {
        let inside = |at: i32| usize::try_from(at).ok();
        let place = inside(x).filter(|&x| x < self.across).zip(inside(z));
        place.and_then(|(x, z)| self.words.get(z * self.across + x)).copied().unwrap_or_default()
    }

    /// Is this cell of the world steep?
    pub fn contains(&self, cell: Column) -> bool {
        self.word((cell.x >> 3, cell.z >> 3)) >> ((cell.z & 7) << 3 | cell.x & 7) & 1 == 1
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(self.words.as_slice())
    }
}

/// The steep ones of the 8x8 cells from `low` on.
fn steep_word(ground: &Ground, low: Column) -> u64 {
    let heights = ground.heights::<9>(low);
    let is_steep = |x: usize, z: usize| {
        let [a, b, c, d] = [heights[z][x], heights[z + 1][x], heights[z + 1][x + 1], heights[z][x + 1]];
        [(a, b), (b, c), (c, d), (d, a), (a, c)].into_iter().any(|(from, to)| is_banded(from, to))
    };
    (0..64).filter(|bit| is_steep(bit & 7, bit >> 3)).fold(0, |word, bit| word | 1 << bit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{MaterialControl, MaterialId, Strata};
    use crate::lattice::ONE;

    /// A step of so many 1/256 voxels between x = 9 and x = 10.
    fn step(rise: i32) -> Ground {
        let heights = (0..=12).flat_map(|_| (0..=20).map(|x| if x < 10 { 0 } else { rise })).collect();
        Ground::from_heights(20, 12, heights).expect("valid heights")
    }

    #[test]
    fn cells_are_steep_where_two_levels_separate_their_columns() {
        for (rise, is_steep) in [(0, false), (ONE, false), (ONE + 1, true), (-ONE, false), (-2 * ONE, true)] {
            let cells = SteepCells::new(&step(rise)).expect("enough memory");
            assert_eq!(cells.is_some(), is_steep, "a rise of {rise}");
            let Some(cells) = cells else { continue };
            for (x, z) in (0..12).flat_map(|z| (0..20).map(move |x| (x, z))) {
                let found = cells.contains(Column::new(x, z));
                assert_eq!(found, x == 9, "({x}, {z}) at a rise of {rise}");
            }
            assert_eq!([(-1, 0), (0, -1), (3, 0), (0, 2)].map(|word| cells.word(word)), [0; 4]);
        }
    }

    #[test]
    fn steep_cells_are_kept_only_for_grounds_with_materials_of_their_own() {
        let (steep, level) = (step(9 * ONE), step(0));
        let bytes = [steep.bytes(), level.bytes()];
        assert!(steep.steep_cells().is_none());
        let steep = steep.with_strata(&Strata::alpine()).expect("valid strata");
        let level = level.with_strata(&Strata::alpine()).expect("valid strata");
        assert!(level.steep_cells().is_none(), "it has none");
        // Three by two words.
        let words = size_of::<SteepCells>() + 6 * size_of::<u64>();
        assert_eq!(steep.bytes() - bytes[0], level.bytes() - bytes[1] + words);
        let painted = steep
            .with_materials(&MaterialControl::Uniform(crate::ground::ColumnMaterial::solid(MaterialId(3))));
        assert!(painted.expect("valid materials").steep_cells().is_some());
    }
}
