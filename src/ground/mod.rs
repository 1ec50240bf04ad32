//! The pristine world: heights, materials and normals of the ground before any edit.
//!
//! A [`Ground`] is a heightmap on the integer lattice: one height for every [`Column`](crate::lattice::Column), in
//! 1/256 voxel, and one [`ColumnMaterial`]. It never changes; edits are stored elsewhere.
//!
//! | from | how |
//! | --- | --- |
//! | a number, a function, a list | [`Ground::flat`], [`Ground::from_fn`], [`Ground::from_heights`] |
//! | a grey PNG or RAW image | [`GreyImage::decode_png`], [`GreyImage::decode_raw`], then [`Ground::from_image`] |
//! | a TIFF, an EXR, satellite data, a PNG of any kind of grey, tiles of several files | [`ElevationGrid`] |
//! | noise | [`Ground::from_noise`], or [`Ground::from_noise_fn`] for any function of the crate [`noise`] |
//! | anything of these and more, computed where it is needed | a [`HeightSource`], then [`Ground::from_source`] |
//! | materials by slope, height or image | [`Ground::with_materials`] |
//! | materials of splat maps and id maps | [`MaterialMap`], [`MaterialControl::Map`] |
//! | strata and ore below the surface | [`Ground::with_strata`], [`Ground::with_material_fn`] |
//!
//! Equal input gives equal bits on every machine: heights and materials are computed with additions,
//! multiplications, divisions and square roots in a fixed order, then rounded to integers. [`Ground::hash`] sums it up.
//! All input is checked, and invalid input is refused with an error that names the value.

mod columns;
mod control;
mod control_on_ground;
mod error;
mod extent;
mod grey_image;
mod image_heights;
pub mod import;
mod material;
mod material_map;
mod noise_heights;
mod noise_params;
mod noise_rows;
mod on_demand;
mod page;
mod pages;
mod png;
mod region_hash;
mod rise;
mod rules;
pub mod source;
mod sources;
mod stored_materials;
pub mod strata;
mod world;

#[doc(no_inline)]
pub use ::noise;

pub use control::MaterialControl;
pub use error::{GroundError, ImageError};
pub use grey_image::{GreyImage, ImageLimits, RawFormat};
#[doc(hidden)]
pub use image_heights::MAX_VOXELS_PER_SAMPLE;
pub use image_heights::{Detail, ImageScale};
#[doc(hidden)]
pub use import::{
    ElevationGrid, ElevationScale, ElevationTile, HeightFormat, HeightScale, IdOptions, ImportError,
    ImportNote, ImportOptions, ImportReport, MAX_LAYERS, MaterialNote, MaterialReport, RawLayout, Repair,
    SampleKind, SplatOptions, TileEdges,
};
#[doc(hidden)]
pub use material::OVERLAY_DEPTH;
pub use material::{ColumnMaterial, MaterialId};
#[doc(hidden)]
pub use material_map::MaterialMap;
#[doc(hidden)]
pub use noise_heights::{MAX_OCTAVES, MAX_SCALE};
pub use noise_heights::{NoiseHeights, NoiseKind};
#[cfg(feature = "cuda")]
pub(crate) use noise_params::{NoiseFactors, NoiseParams};
pub(crate) use page::GroundPage;
pub use rules::MaterialRule;
#[doc(hidden)]
pub use source::{ColumnGrid, FunctionSource, HeightSource, ImageSource, InsetSource, NoiseSource};
#[cfg(all(test, feature = "cuda"))]
pub(crate) use strata::{BED, FILL, POCKET, VEIN};
#[doc(hidden)]
pub use strata::{Bedding, Interval, Strata, Stratum, StratumBody, StratumBounds};
#[cfg(feature = "cuda")]
pub(crate) use strata::{BeddingRecord, StratumRecord};
#[doc(hidden)]
pub use strata::{MAX_COLUMN_CONDITIONS, MAX_STRATA};
pub use world::Ground;
pub(crate) use world::RowBuffer;

/// See [`Ground::MAX_SIZE`].
pub(crate) const MAX_SIZE: u32 = 16_384;

/// See [`Ground::MAX_SOURCE_SIZE`].
pub(crate) const MAX_SOURCE_SIZE: u32 = crate::lattice::REACH.cast_unsigned();
