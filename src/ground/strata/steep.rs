//! Steep cells: their corners' tops do not show all materials of the face between them.

use rayon::prelude::*;

use super::steep_cells::SteepCells;
use crate::ground::GroundError;
use crate::ground::world::Ground;
use crate::lattice::{Column, ceil};

/// The maximum number of lattice levels on a line between two columns of a steep cell.
///
/// Each level is a vertex on every line, and a voxel whose material is computed. Faces of one cell's width that are
/// higher are not cliffs but errors in the data, such as a void of a survey, whose height has no bound.
pub(in crate::ground) const MAX_FACE_LEVELS: u32 = 64;

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
}

/// Which cells of a ground are steep, in memory or computed on demand.
#[derive(Clone, Copy)]
pub(crate) enum Steep<'a> {
    Resident(&'a SteepCells),
    OnDemand(&'a Ground),
}

impl Steep<'_> {
    /// The steep ones of the 8x8 cells from (8 x, 8 z) on; there are none beyond the rim.
    pub fn word(self, (x, z): (i32, i32)) -> u64 {
        match self {
            Self::Resident(cells) => cells.word((x, z)),
            Self::OnDemand(ground) => {
                ground.steep_word_on_demand(Column::new(x.saturating_mul(8), z.saturating_mul(8)))
            }
        }
    }

    /// Returns `true` if this cell is steep.
    pub fn contains(self, cell: Column) -> bool {
        self.word((cell.x >> 3, cell.z >> 3)) >> ((cell.z & 7) << 3 | cell.x & 7) & 1 == 1
    }
}

/// The steep ones of the 8x8 cells from `low` on that lie in the world.
pub(in crate::ground) fn steep_word(ground: &Ground, low: Column) -> u64 {
    // The lowest air of each column.
    let levels = ground.heights::<9>(low).map(|row| row.map(ceil));
    let is_steep = |at: Column| {
        let corners = at.corners();
        let levels = corners.map(|corner| levels[corner.z as usize][corner.x as usize]);
        let lines = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)];
        let highest = lines.iter().map(|&(from, to)| levels[from].abs_diff(levels[to])).max();
        if !highest.is_some_and(|highest| (2..=MAX_FACE_LEVELS).contains(&highest)) {
            return false;
        }
        // How far down each column is seen.
        let mut lowest = levels.map(|level| level - 1);
        for (from, to) in lines {
            lowest[from] = lowest[from].min(levels[to]);
            lowest[to] = lowest[to].min(levels[from]);
        }
        let material = |corner: usize, y| {
            let Column { x, z } = corners[corner];
            ground.material(low.offset(x, z).at(y))
        };
        let first = material(0, levels[0] - 1);
        let differs = |corner| (lowest[corner]..levels[corner]).rev().any(|y| material(corner, y) != first);
        (0..4).any(differs)
    };
    let (width, depth) = ((ground.width() - low.x).min(8), (ground.depth() - low.z).min(8));
    let cells = (0..depth).flat_map(|z| (0..width).map(move |x| Column::new(x, z)));
    cells.filter(|&at| is_steep(at)).fold(0, |word, Column { x, z }| word | 1 << (z * 8 + x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{ColumnMaterial, MaterialControl, MaterialId, Strata, Stratum, StratumBounds};
    use crate::lattice::{LatticeBox, ONE};

    /// A step of `rise` 1/256 voxels between x = 9 and x = 10.
    fn step(rise: i32) -> Ground {
        let heights = (0..=12).flat_map(|_| (0..=20).map(|x| if x < 10 { 0 } else { rise })).collect();
        Ground::from_heights(20, 12, heights).expect("valid heights")
    }

    /// A step whose material has this thickness, in voxels, over another one.
    fn covered_step(rise: i32, thickness: i32) -> Ground {
        let material = move |_, depth| Some(MaterialId(u8::from(depth >= thickness * ONE)));
        step(rise).with_material_fn(1, material).expect("enough memory")
    }

    #[test]
    fn cells_are_steep_where_two_levels_separate_columns_and_materials_differ() {
        let cases = [
            (0, 1, false),
            (ONE, 1, false),
            (ONE + 1, 1, true),
            (ONE + 1, 2, false),
            (2 * ONE + 1, 2, true),
            (-ONE, 1, false),
            (-2 * ONE, 1, true),
            (-2 * ONE, 2, false),
        ];
        for (rise, thickness, is_steep) in cases {
            let ground = covered_step(rise, thickness);
            assert_eq!(ground.steep_cells().is_some(), is_steep, "a rise of {rise} and {thickness}");
            let Some(cells) = ground.steep_cells() else { continue };
            for (x, z) in (-9..24).flat_map(|z| (-9..40).map(move |x| (x, z))) {
                let expected = x == 9 && (0..12).contains(&z);
                assert_eq!(cells.contains(Column::new(x, z)), expected, "({x}, {z}) at a rise of {rise}");
            }
        }
    }

    #[test]
    fn faces_above_the_bound_are_not_steep() {
        let bound = MAX_FACE_LEVELS as i32;
        for (rise, is_steep) in [(bound, true), (bound + 1, false), (-bound, true), (-bound - 1, false)] {
            assert_eq!(covered_step(rise * ONE, 1).steep_cells().is_some(), is_steep, "a rise of {rise}");
        }
    }

    #[test]
    fn tops_of_different_materials_make_a_cell_steep() {
        let material = |point: glam::IVec3, _| Some(MaterialId((point.x / 10) as u8));
        for (rise, is_steep) in [(ONE, false), (2 * ONE, true)] {
            let ground = step(rise).with_material_fn(1, material).expect("enough memory");
            assert_eq!(ground.steep_cells().is_some(), is_steep, "a rise of {rise}");
        }
    }

    #[test]
    fn steep_cells_are_kept_only_for_grounds_with_materials_of_their_own() {
        let steep = step(9 * ONE);
        assert!(steep.steep_cells().is_none());
        let [thick, thin] = [9, 8].map(|thickness| covered_step(9 * ONE, thickness));
        assert!(thick.steep_cells().is_none() && thin.steep_cells().is_some());
        // Three by two words.
        assert_eq!(thin.bytes() - thick.bytes(), size_of::<SteepCells>() + 6 * size_of::<u64>());
    }

    #[test]
    fn steep_cells_follow_the_columns_materials() {
        let far = LatticeBox::new(glam::IVec3::splat(900), glam::IVec3::splat(901)).expect("not empty");
        let nowhere = Stratum { bounds: StratumBounds::Box(far), ..Stratum::fill(MaterialId(7)) };
        let strata = Strata { strata: vec![nowhere], ..Strata::default() };
        let mut ground = step(9 * ONE).with_strata(&strata).expect("valid strata");
        let bare = ColumnMaterial::solid(MaterialId(3));
        let covered = ColumnMaterial { overlay: MaterialId(4), blend: 255, ..bare };
        for (material, is_steep) in [(bare, false), (covered, true), (bare, false)] {
            ground = ground.with_materials(&MaterialControl::Uniform(material)).expect("valid materials");
            assert_eq!(ground.steep_cells().is_some(), is_steep);
        }
    }
}
