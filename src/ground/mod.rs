//! The pristine world: heights, materials and normals of the ground before any edit.
//!
//! A [`Ground`] is a heightmap on the integer lattice: one height for every [`Column`](crate::lattice::Column), in
//! 1/256 voxel, and one [`ColumnMaterial`]. It never changes; edits are stored elsewhere.
//!
//! | from | how |
//! | --- | --- |
//! | a number, a function, a list | [`Ground::flat`], [`Ground::from_fn`], [`Ground::from_heights`] |
//! | a grey PNG or RAW image | [`GreyImage::decode_png`], [`GreyImage::decode_raw`], then [`Ground::from_image`] |
//! | noise | [`Ground::from_noise`] |
//! | materials by slope, height or image | [`Ground::with_materials`] |
//! | strata and ore below the surface | [`Ground::with_strata`], [`Ground::with_material_fn`] |
//!
//! The same input gives the same bits on every machine: heights and materials are computed with additions,
//! multiplications, divisions and square roots in a fixed order, then rounded to integers. [`Ground::hash`] sums it up.
//! All input is checked, and invalid input is refused with an error that names the value.

mod control;
mod error;
mod extent;
mod grey_image;
mod image_heights;
mod material;
mod noise_heights;
#[cfg(feature = "cuda")]
mod noise_terms;
mod png;
mod rules;
mod sources;
mod strata;
mod world;

pub use control::MaterialControl;
pub use error::{GroundError, ImageError};
pub use grey_image::{GreyImage, ImageLimits, RawFormat};
pub use image_heights::{Detail, ImageScale, MAX_VOXELS_PER_SAMPLE};
pub use material::{ColumnMaterial, MaterialId, OVERLAY_DEPTH};
pub use noise_heights::{MAX_OCTAVES, MAX_SCALE, NoiseHeights, NoiseKind};
#[cfg(feature = "cuda")]
pub(crate) use noise_terms::{NoiseNumbers, NoiseTerms};
pub use rules::MaterialRule;
#[cfg(all(test, feature = "cuda"))]
pub(crate) use strata::{BED, FILL, POCKET, VEIN};
pub use strata::{
    Bedding, Interval, MAX_COLUMN_CONDITIONS, MAX_STRATA, Strata, Stratum, StratumBody, StratumBounds,
};
#[cfg(feature = "cuda")]
pub(crate) use strata::{BeddingRecord, StratumRecord};
pub use world::Ground;

/// Most cells along one side of a world.
pub const MAX_SIZE: u32 = 16_384;
