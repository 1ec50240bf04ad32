//! Strata: what every voxel of the pristine ground is made of, computed and never stored.
//!
//! [`Strata`] is a list of bodies of material, [`Stratum`], each with conditions for where it lies. A voxel is made of
//! the first one that holds it; where none does, of what its column has ([`ColumnMaterial`](super::ColumnMaterial)).
//! All of the model asks the same function: receipts, rules, queries, loose pieces, and the vertices that are drawn.
//!
//! The function is computed with integers (`records`, `conditions`), for a brick at a time (`in_brick`), and has equal
//! results on every machine and on the GPU.

mod below;
mod check;
mod conditions;
mod in_brick;
mod of_ground;
mod presets;
mod records;
mod steep;
mod steep_cells;
#[cfg(test)]
mod tests;
mod value_noise;

use std::sync::Arc;

use glam::{IVec3, Vec2};
use serde::{Deserialize, Serialize};

use super::material::MaterialId;
use crate::lattice::LatticeBox;

pub(crate) use below::Below;
pub(crate) use records::StrataRecords;
#[cfg(all(test, feature = "cuda"))]
pub(crate) use records::{BED, FILL, POCKET, VEIN};
#[cfg(feature = "cuda")]
pub(crate) use records::{BeddingRecord, StratumRecord};
pub(in crate::ground) use steep::steep_word;
pub(crate) use steep_cells::SteepCells;

/// The maximum number of strata of a ground.
#[doc(hidden)]
pub const MAX_STRATA: usize = 32;

/// The maximum number of strata of a ground that have a condition on columns: a slope, a box or a picture.
#[doc(hidden)]
pub const MAX_COLUMN_CONDITIONS: usize = 16;

/// Bodies of material below the surface: soil, beds of rock, veins and pockets of ore.
///
/// A voxel is made of the first stratum in the list that holds it, else of its column's own material. Lengths are in
/// voxels, and rounded to 1/256.
///
/// ```
/// use bevy_burrow::prelude::*;
/// use glam::IVec3;
///
/// let (soil, coal, iron) = (MaterialId(1), MaterialId(2), MaterialId(3));
/// let strata = Strata {
///     seed: 7,
///     strata: vec![
///         Stratum { depth: Interval::below(3.0), ..Stratum::fill(soil) },
///         Stratum { depth: Interval::above(5.0), ..Stratum::pocket(iron, 16, 0.02) },
///         Stratum { rough: 0.5, ..Stratum::bed(coal, -20.0, 2.0) },
///     ],
///     ..Strata::default()
/// };
/// let ground = Ground::flat(64, 64, 10.0)?.with_strata(&strata)?;
/// assert_eq!(ground.material(IVec3::new(5, 8, 5)), soil);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Strata {
    /// The seed of all noise.
    pub seed: u32,
    /// The orientation of beds.
    pub bedding: Bedding,
    /// The bodies, topmost first: at most [`MAX_STRATA`], and [`MAX_COLUMN_CONDITIONS`] with a slope or bounds.
    pub strata: Vec<Stratum>,
}

impl Strata {
    /// Bytes of memory that it takes, pictures included.
    fn bytes(&self) -> usize {
        let picture = |stratum: &Stratum| match &stratum.bounds {
            StratumBounds::Image(image) => size_of::<super::GreyImage>() + size_of_val(image.samples()),
            _ => 0,
        };
        let pictures: usize = self.strata.iter().map(picture).sum();
        size_of::<Self>() + self.strata.capacity() * size_of::<Stratum>() + pictures
    }
}

/// The orientation of beds: level, tilted, folded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Bedding {
    /// Voxels by which beds sink for each voxel along x and along z, -4 to 4.
    pub dip: Vec2,
    /// Voxels by which folds lift and lower beds, 0 to 127.
    pub fold: f32,
    /// Width of folds in voxels: a power of two from 8 to 1024.
    pub scale: u32,
}

impl Default for Bedding {
    /// Level beds.
    fn default() -> Self {
        Self { dip: Vec2::ZERO, fold: 0.0, scale: 128 }
    }
}

/// A body of one material in the ground: a shape, and the conditions under which it fills a voxel. All must hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stratum {
    /// The material of the stratum; not [`MaterialId::GROUND`].
    pub material: MaterialId,
    /// The shape of the stratum.
    pub body: StratumBody,
    /// The depth below the pristine surface, in voxels: from 0 on and below 1 for the highest solid voxel of a column,
    /// below 2 for the next. Voxels above the surface are at depth 0.
    pub depth: Interval,
    /// The height, in voxels.
    pub height: Interval,
    /// The slope of the pristine surface above, as rise over run: 0 is level, 1 is 45 degrees.
    pub slope: Interval,
    /// Voxels by which noise moves the ends of depth, height and bed up and down, 0 to 127.
    pub rough: f32,
    /// Width of that noise in voxels: a power of two from 8 to 1024.
    pub rough_scale: u32,
    /// Distinguishes strata of the same material and shape, which otherwise lie in the same places.
    pub seed: u32,
    /// Bounds of the stratum in the world.
    pub bounds: StratumBounds,
}

impl Default for Stratum {
    /// Material 0 everywhere.
    fn default() -> Self {
        Self {
            material: MaterialId(0),
            body: StratumBody::Fill,
            depth: Interval::ALL,
            height: Interval::ALL,
            slope: Interval::ALL,
            rough: 0.0,
            rough_scale: 32,
            seed: 0,
            bounds: StratumBounds::World,
        }
    }
}

impl Stratum {
    /// Everything that its conditions admit.
    pub fn fill(material: MaterialId) -> Self {
        Self { material, ..Self::default() }
    }

    /// A bed from a height on, that thick, in voxels.
    pub fn bed(material: MaterialId, from: f32, thickness: f32) -> Self {
        Self { body: StratumBody::Bed { from, thickness, every: None }, ..Self::fill(material) }
    }

    /// Beds that repeat.
    pub fn beds(material: MaterialId, from: f32, thickness: f32, every: f32) -> Self {
        Self { body: StratumBody::Bed { from, thickness, every: Some(every) }, ..Self::fill(material) }
    }

    /// Veins of this scale that hold this share of all voxels.
    pub fn vein(material: MaterialId, scale: u32, share: f32) -> Self {
        Self { body: StratumBody::Vein { scale, share }, ..Self::fill(material) }
    }

    /// Pockets of this scale that hold this share of all voxels.
    pub fn pocket(material: MaterialId, scale: u32, share: f32) -> Self {
        Self { body: StratumBody::Pocket { scale, share }, ..Self::fill(material) }
    }
}

/// The shape of a stratum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum StratumBody {
    /// Everything that its conditions admit.
    #[default]
    Fill,
    /// A sheet that lies as the [`Bedding`] has it.
    Bed {
        /// The bed's lower face in voxels, where the bedding is neither tilted nor folded.
        from: f32,
        /// Voxels up to the bed's upper face, more than 0.
        thickness: f32,
        /// The voxels after which it repeats, more than its thickness; none for a single bed.
        every: Option<f32>,
    },
    /// Threads that wind through the ground.
    Vein {
        /// Distance between bends in voxels: a power of two from 8 to 1024.
        scale: u32,
        /// The share of all voxels that it holds where its conditions admit it, more than 0 and up to 1.
        share: f32,
    },
    /// Separate lumps.
    Pocket {
        /// How far apart lumps are in voxels, and about twice as large as they are: a power of two from 8 to 1024.
        scale: u32,
        /// The share of all voxels that they hold where its conditions admit them, more than 0 and up to 1.
        share: f32,
    },
}

/// Bounds of a stratum in the world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum StratumBounds {
    /// Everywhere.
    #[default]
    World,
    /// At the lattice points of a box, ends included.
    Box(LatticeBox),
    /// In columns where a picture, stretched over the world, is at least half white. Not part of the JSON form.
    #[serde(skip)]
    Image(Arc<super::GreyImage>),
}

/// The numbers from one on and below another; either end may be open. In JSON `[from, to]`, `null` for an open end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "(Option<f32>, Option<f32>)", into = "(Option<f32>, Option<f32>)")]
pub struct Interval {
    /// The first number, included.
    pub from: Option<f32>,
    /// Where the interval ends, not included.
    pub to: Option<f32>,
}

impl Interval {
    /// All numbers.
    pub const ALL: Self = Self { from: None, to: None };

    /// All numbers below one.
    pub const fn below(to: f32) -> Self {
        Self { from: None, to: Some(to) }
    }

    /// All numbers from one on.
    pub const fn above(from: f32) -> Self {
        Self { from: Some(from), to: None }
    }

    /// The numbers from one on and below another.
    pub const fn between(from: f32, to: f32) -> Self {
        Self { from: Some(from), to: Some(to) }
    }
}

impl From<(Option<f32>, Option<f32>)> for Interval {
    fn from((from, to): (Option<f32>, Option<f32>)) -> Self {
        Self { from, to }
    }
}

impl From<Interval> for (Option<f32>, Option<f32>) {
    fn from(Interval { from, to }: Interval) -> Self {
        (from, to)
    }
}

/// A game's own function in place of [`Strata`]: the material at a lattice point that lies so deep, in 1/256 voxel;
/// `None` for what the column has.
pub(crate) type MaterialFn = dyn Fn(IVec3, i32) -> Option<MaterialId> + Send + Sync;

/// What a ground has instead of its columns' materials.
#[derive(Clone)]
pub(crate) enum OwnMaterials {
    Strata { given: Arc<Strata>, records: Arc<StrataRecords> },
    Function { id: u64, function: Arc<MaterialFn> },
}

impl PartialEq for OwnMaterials {
    /// Functions are the same if their ids are.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Strata { given: a, .. }, Self::Strata { given: b, .. }) => a == b,
            (Self::Function { id: a, .. }, Self::Function { id: b, .. }) => a == b,
            _ => false,
        }
    }
}
