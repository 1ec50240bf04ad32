//! Strata as records of integers, as they are evaluated and hashed, on the CPU and on GPUs.

use std::sync::atomic::{AtomicU64, Ordering};

use super::value_noise::{ValueNoise, both_within, exceeded_by};
use super::{Interval, Strata, Stratum, StratumBody, StratumBounds};
use crate::lattice::hash::{hash_words, mix};
use crate::lattice::{Column, LatticeBox, ONE};
use bytemuck::{Pod, Zeroable};

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
    /// For veins, how far both noises may be from 0; for pockets, what the noise must exceed.
    pub limit: i32,
    /// Amplitude of the noise that moves ends.
    pub rough: i32,
    /// The width of that noise in voxels, as a power of two.
    pub rough_scale: u32,
    pub depth: [i32; 2],
    pub height: [i32; 2],
    /// For beds: lower face, thickness, distance from one to the next or 0.
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
    /// Squares of the slope, as [`squared_slope`](crate::ground::Ground::squared_slope) gives it.
    pub slope: Option<[u64; 2]>,
    pub bounds: StratumBounds,
}

/// The strata of a ground, ready to be asked.
#[derive(Debug)]
pub(crate) struct StrataRecords {
    /// A number that no other strata of the program have.
    pub id: u64,
    pub strata: Vec<StratumRecord>,
    pub bedding: BeddingRecord,
    /// The conditions of strata on columns, by the bits of [`StratumRecord::condition`].
    pub(super) conditions: Vec<ColumnCondition>,
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

    /// Bytes of memory that it takes.
    pub fn bytes(&self) -> usize {
        let conditions = self.conditions.capacity() * size_of::<ColumnCondition>();
        size_of::<Self>() + self.strata.capacity() * size_of::<StratumRecord>() + conditions
    }
}
