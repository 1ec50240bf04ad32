//! Hashes of the ground by region, so that a save detects where the ground below it has changed.

use super::Ground;
use crate::lattice::hash::hash_words;
use crate::lattice::{Column, RegionPos};

impl Ground {
    /// Hash of the heights over one column of [regions](RegionPos), as (x, z): the same number on every machine.
    /// Materials and strata do not count, since what is stored of edits does not depend on them.
    pub fn region_hash(&self, (x, z): (i32, i32)) -> u64 {
        let side = RegionPos::VOXELS;
        let low = |at: i32| at.saturating_mul(side);
        let patches = (0..side).step_by(8).flat_map(|dz| (0..side).step_by(8).map(move |dx| (dx, dz)));
        let patches =
            patches.map(|(dx, dz)| Column::new(low(x).saturating_add(dx), low(z).saturating_add(dz)));
        let heights = |patch: Column| {
            let rows = self.heights::<8>(patch);
            hash_words(rows.into_iter().flatten().map(|height| u64::from(height.cast_unsigned())))
        };
        hash_words(patches.map(heights))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_height_changes_the_hash_of_its_region_only() {
        let ground = |raised: Option<(i32, i32)>| {
            let height = |x: i32, z: i32| if raised == Some((x, z)) { 9.0 } else { f64::from(x % 7) };
            Ground::from_fn(200, 100, height).expect("valid heights")
        };
        let hashes = |ground: Ground| {
            let regions = (0..=1).flat_map(|z| (0..=3).map(move |x| (x, z)));
            regions.map(|region| ground.region_hash(region)).collect::<Vec<_>>()
        };
        let plain = hashes(ground(None));
        for (x, z, changed) in [(0, 0, 0), (63, 63, 0), (64, 63, 1), (130, 70, 6)] {
            let raised = hashes(ground(Some((x, z))));
            let differ: Vec<usize> = (0..8).filter(|&at| plain[at] != raised[at]).collect();
            assert_eq!(differ, [changed], "column {x} {z}");
        }
    }
}
