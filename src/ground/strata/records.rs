//! Strata as integers, and which of them hold a voxel. `kernels/strata.cuh` computes the same.

use std::sync::atomic::{AtomicU64, Ordering};

use bytemuck::{Pod, Zeroable};
use glam::IVec2;

use super::value_noise::{ValueNoise, both_within, exceeded_by};
use super::{Interval, Strata, Stratum, StratumBody, StratumBounds};
use crate::ground::world::Ground;
use crate::lattice::hash::{hash_words, mix};
use crate::lattice::{Column, LatticeBox, ONE};

/// Shapes, as numbers.
pub(crate) const FILL: u32 = 0;
pub(crate) const BED: u32 = 1;
pub(crate) const VEIN: u32 = 2;
pub(crate) const POCKET: u32 = 3;

/// Difference between the seeds of successive noises.
const SECOND: u32 = 0x9E37_79B9;
const ROUGH: u32 = 0x7F4A_7C15;

/// A stratum but for its conditions on columns. Lengths are in 1/256 voxel; ends of ranges are not included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct StratumRecord {
    pub material: u32,
    pub body: u32,
    /// The bit of its condition on columns; 0 without one.
    pub condition: u32,
    pub seed: u32,
    /// The width of the body's noise in voxels, as a power of two.
    pub scale: u32,
    /// Of veins, how far both noises may be from 0; of pockets, what the noise must exceed.
    pub limit: i32,
    /// Amplitude of the noise that moves ends.
    pub rough: i32,
    /// The width of that noise in voxels, as a power of two.
    pub rough_scale: u32,
    pub depth: [i32; 2],
    pub height: [i32; 2],
    /// Of beds: lower face, thickness, distance from one to the next or 0.
    pub bed: [i32; 3],
    /// The lowest y, and the first beyond.
    pub ys: [i32; 2],
}

/// The orientation of beds as numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BeddingRecord {
    /// In 1/65536 voxel per voxel.
    pub dip: [i32; 2],
    /// In 1/256 voxel.
    pub fold: i32,
    /// The width of the noise in voxels, as a power of two.
    pub scale: u32,
    pub seed: u32,
}

/// A stratum's conditions on a column.
#[derive(Clone, Debug)]
pub(super) struct ColumnCondition {
    /// Squares of the slope, as [`Ground::squared_slope`] gives it.
    slope: Option<[u64; 2]>,
    bounds: StratumBounds,
}

/// The strata of a ground, ready to be asked.
#[derive(Debug)]
pub(crate) struct StrataRecords {
    /// A number that no other strata of the program have.
    pub id: u64,
    pub strata: Vec<StratumRecord>,
    pub bedding: BeddingRecord,
    /// The conditions of strata on columns, by the bits of [`StratumRecord::condition`].
    conditions: Vec<ColumnCondition>,
    /// Hash of all of it.
    pub hash: u64,
}

/// Voxels in 1/256.
fn fixed(voxels: f32) -> i32 {
    (f64::from(voxels) * f64::from(ONE)).round() as i32
}

fn ends(span: Interval) -> [i32; 2] {
    [span.from.map_or(i32::MIN, fixed), span.to.map_or(i32::MAX, fixed)]
}

impl StratumRecord {
    fn new(stratum: &Stratum, seed: u32) -> Self {
        let (body, scale, limit, bed) = match stratum.body {
            StratumBody::Fill => (FILL, 8, 0, [0; 3]),
            StratumBody::Bed { from, thickness, every } => {
                (BED, 8, 0, [fixed(from), fixed(thickness), every.map_or(0, fixed)])
            }
            StratumBody::Vein { scale, share } => (VEIN, scale, both_within(share.into()), [0; 3]),
            StratumBody::Pocket { scale, share } => (POCKET, scale, exceeded_by(share.into()), [0; 3]),
        };
        let words = [seed, stratum.seed, stratum.material.0.into(), body];
        let [mut depth, height] = [ends(stratum.depth), ends(stratum.height)];
        if depth[0] <= 0 {
            // However rough the ends are, they leave no holes in the surface.
            depth[0] = i32::MIN;
        }
        let ys = match &stratum.bounds {
            StratumBounds::Box(LatticeBox { min, max }) => [min.y, max.y.saturating_add(1)],
            _ => [i32::MIN, i32::MAX],
        };
        Self {
            material: stratum.material.0.into(),
            body,
            condition: 0,
            seed: hash_words(words.map(u64::from)) as u32,
            scale: scale.trailing_zeros(),
            limit,
            rough: fixed(stratum.rough),
            rough_scale: stratum.rough_scale.trailing_zeros(),
            depth,
            height,
            bed,
            ys,
        }
    }

    /// The noise of veins and pockets.
    pub(super) fn noise(&self) -> ValueNoise {
        ValueNoise { seed: self.seed, scale: self.scale }
    }

    /// The second noise of veins.
    pub(super) fn second_noise(&self) -> ValueNoise {
        ValueNoise { seed: self.seed ^ SECOND, scale: self.scale }
    }

    /// The noise that moves ends.
    pub(super) fn roughness(&self) -> ValueNoise {
        ValueNoise { seed: self.seed ^ ROUGH, scale: self.rough_scale }
    }

    /// Displacement of ends for this noise value, in 1/256 voxel.
    pub(super) fn moved(&self, noise: i32) -> i32 {
        (self.rough * noise) >> 15
    }

    /// Returns `true` if a height, in 1/256 voxel along the bedding, is in a bed.
    pub(super) fn is_in_bed(&self, height: i64) -> bool {
        let [from, thickness, every] = self.bed.map(i64::from);
        let above = height - from;
        let above = if every > 0 { above.rem_euclid(every) } else { above };
        (0..thickness).contains(&above)
    }
}

impl BeddingRecord {
    pub(super) fn noise(&self) -> ValueNoise {
        ValueNoise { seed: self.seed, scale: self.scale }
    }

    /// Displacement of a column along the bedding by the tilt, in 1/256 voxel.
    pub(super) fn dip_at(&self, column: Column) -> i64 {
        let [x, z] = self.dip.map(i64::from);
        (x * i64::from(column.x) + z * i64::from(column.z)) >> 8
    }

    /// The displacement by folds for this noise value.
    pub(super) fn fold_at(&self, noise: i32) -> i32 {
        (self.fold * noise) >> 15
    }
}

impl ColumnCondition {
    fn new(stratum: &Stratum) -> Option<Self> {
        let Interval { from, to } = stratum.slope;
        let square = |slope: f32| {
            let steps = (f64::from(slope.max(0.0)) * f64::from(2 * ONE)).round() as u64;
            steps * steps
        };
        let slope =
            (stratum.slope != Interval::ALL).then(|| [from.map_or(0, square), to.map_or(u64::MAX, square)]);
        stratum.has_column_condition().then(|| Self { slope, bounds: stratum.bounds.clone() })
    }

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

    fn words(&self) -> Vec<u64> {
        let [from, to] = self.slope.unwrap_or([0, u64::MAX]);
        let mut words = vec![from, to];
        match &self.bounds {
            StratumBounds::World => {}
            StratumBounds::Box(LatticeBox { min, max }) => {
                words.extend(
                    [min, max].iter().flat_map(|end| end.to_array()).map(|at| u64::from(at.cast_unsigned())),
                );
            }
            StratumBounds::Image(image) => {
                words.extend([u64::from(image.width()), u64::from(image.height())]);
                words.extend(image.samples().iter().map(|&sample| u64::from(sample)));
            }
        }
        words
    }
}

impl StrataRecords {
    /// Strata that were checked.
    pub fn new(given: &Strata) -> Self {
        let mut strata: Vec<_> =
            given.strata.iter().map(|stratum| StratumRecord::new(stratum, given.seed)).collect();
        let super::Bedding { dip, fold, scale } = given.bedding;
        let bedding = BeddingRecord {
            dip: dip.to_array().map(|dip| (f64::from(dip) * 65_536.0).round() as i32),
            fold: fixed(fold),
            scale: scale.trailing_zeros(),
            seed: mix(given.seed.into()) as u32,
        };
        let mut conditions = Vec::new();
        for (record, stratum) in strata.iter_mut().zip(&given.strata) {
            if let Some(condition) = ColumnCondition::new(stratum) {
                record.condition = 1 << conditions.len();
                conditions.push(condition);
            }
        }
        let numbers = bytemuck::cast_slice::<_, u32>(&strata)
            .iter()
            .chain(bytemuck::cast_slice(std::slice::from_ref(&bedding)));
        let words = numbers.map(|&number| u64::from(number));
        let of_columns = conditions.iter().map(|own| hash_words(own.words()));
        let hash = hash_words(words.chain(of_columns));
        static LAST: AtomicU64 = AtomicU64::new(0);
        let id = LAST.fetch_add(1, Ordering::Relaxed) + 1;
        Self { id, strata, bedding, conditions, hash }
    }

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

    /// Bytes of memory that it takes.
    pub fn bytes(&self) -> usize {
        let conditions = self.conditions.capacity() * size_of::<ColumnCondition>();
        size_of::<Self>() + self.strata.capacity() * size_of::<StratumRecord>() + conditions
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
    /// As strata count it, in 1/256 voxel: 0 above the surface.
    pub depth: i32,
    /// As [`Ground::squared_slope`] gives it.
    pub squared_slope: u64,
}
