//! Which strata hold a voxel of a ground. `kernels/strata.cuh` computes the same.

use glam::IVec2;

use super::StratumBounds;
use super::records::{BED, ColumnCondition, POCKET, StrataRecords, StratumRecord, VEIN};
use super::value_noise::ValueNoise;
use crate::ground::world::Ground;
use crate::lattice::{Column, LatticeBox, ONE};

impl ColumnCondition {
    /// Returns `true` if the stratum may be in this column of the world.
    #[inline]
    pub(super) fn admits(&self, ground: &Ground, column: Column) -> bool {
        self.admits_slope(ground, column, || ground.squared_slope(column))
    }

    /// Like [`Self::admits`], given the square of the column's slope.
    fn admits_slope(&self, ground: &Ground, column: Column, squared_slope: impl FnOnce() -> u64) -> bool {
        let is_inside = match &self.bounds {
            StratumBounds::World => true,
            StratumBounds::Box(LatticeBox { min, max }) => {
                (min.x..=max.x).contains(&column.x) && (min.z..=max.z).contains(&column.z)
            }
            StratumBounds::Image(image) => ground.stretched(image, column).grey() >= 32_768.0,
        };
        is_inside && self.slope.is_none_or(|[from, to]| (from..to).contains(&squared_slope()))
    }
}

impl StrataRecords {
    /// Returns `true` if a column of the world fulfils the condition with this bit.
    #[inline]
    pub fn meets(&self, ground: &Ground, column: Column, condition: u32) -> bool {
        let own = self.conditions.get(condition.trailing_zeros() as usize);
        own.is_none_or(|own| own.admits(ground, column))
    }

    /// The conditions that a column of the world fulfils: a bit each.
    #[cfg(feature = "cuda")]
    pub fn conditions_of(&self, ground: &Ground, column: Column) -> u32 {
        let is_met = |(bit, own): (u32, &ColumnCondition)| u32::from(own.admits(ground, column)) << bit;
        (0..).zip(&self.conditions).map(is_met).sum()
    }

    /// Returns `true` if a stratum holds the voxel, by definition and without data on its brick; `in_brick` must agree.
    pub fn holds(&self, record: &StratumRecord, ground: &Ground, voxel: LoneVoxel) -> bool {
        let LoneVoxel { column, y, depth, squared_slope } = voxel;
        let (place, at) = (IVec2::new(column.x, column.z), column.at(y));
        let height = y * ONE;
        let flat = |noise: ValueNoise| noise.flat_within(noise.flat_corners(place), place);
        let moved = if record.rough == 0 { 0 } else { record.moved(flat(record.roughness())) };
        let is_admitted = || {
            let own = self.conditions.get(record.condition.trailing_zeros() as usize);
            own.is_none_or(|own| own.admits_slope(ground, column, || squared_slope))
        };
        (record.depth[0]..record.depth[1]).contains(&(depth + moved))
            && (record.height[0]..record.height[1]).contains(&(height + moved))
            && (record.ys[0]..record.ys[1]).contains(&y)
            && is_admitted()
            && match record.body {
                BED => {
                    let fold = self.bedding.fold_at(flat(self.bedding.noise()));
                    record
                        .is_in_bed(i64::from(height + moved) + self.bedding.dip_at(column) + i64::from(fold))
                }
                VEIN => {
                    let is_within = |noise: ValueNoise| noise.at(at).abs() < record.limit;
                    is_within(record.noise()) && is_within(record.second_noise())
                }
                POCKET => record.noise().at(at) > record.limit,
                _ => true,
            }
    }
}

/// A voxel in a column of the world, with everything that strata depend on.
#[derive(Clone, Copy)]
pub(crate) struct LoneVoxel {
    pub column: Column,
    pub y: i32,
    /// The depth as strata count it, in 1/256 voxel: 0 above the surface.
    pub depth: i32,
    /// The squared slope, as [`Ground::squared_slope`] returns it.
    pub squared_slope: u64,
}
