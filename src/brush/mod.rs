//! Brushes, which a game sends, and edits, which the world applies.
//!
//! A [`Brush`] is a request in floats: a [`Shape`], an [`Operation`], perhaps some [`Roughness`]. [`Edit::quantize`]
//! converts it to an [`Edit`], which holds integers only, or returns a [`BrushError`]. An [`Evaluator`] then computes
//! the signed distance of every lattice sample, with equal bits on every machine.
//!
//! ```text
//! Brush (f32, voxels) --quantize--> Edit (1/256 voxel) --evaluator--> distance per sample --apply--> new sample
//! ```
//!
//! | quantity | in a [`Brush`] | in an [`Edit`] |
//! | --- | --- | --- |
//! | positions, sizes, axes, amplitude | voxels of terrain space | 1/256 voxel, `i32` |
//! | rotation | unit quaternion | four `i16` of 1/32767, q and -q alike |
//!
//! Each part of a brush has an integer counterpart inside the [`Edit`]; games do not need these.
//!
//! | in a brush, floats | in an edit, integers | ready to be applied |
//! | --- | --- | --- |
//! | [`Shape`] | `QuantizedShape` | `ShapeSdf`, in the [`Evaluator`] |
//! | [`Roughness`] | `QuantizedRoughness` | the same, in the [`Evaluator`] |
//! | [`Operation`] | `QuantizedOperation` | `Kind`, and a `SculptKernel` for those that sculpt |
//! | [`Blend`] | `QuantizedBlend` | the same, in the `SculptKernel` |
//! | [`Stamp`] | `QuantizedStamp` | the same, in the `SculptKernel` |
//!
//! # Limits
//!
//! | what | least | most |
//! | --- | --- | --- |
//! | coordinates along x and z | -[`REACH`] | [`REACH`] |
//! | coordinates along y, heights | -[`LIMIT`] | [`LIMIT`] |
//! | radius, half side | 1/4 voxel | |
//! | axis of a cylinder or cone | 1/4 voxel | |
//! | side of the box around the shape | | 1024 voxels; 8192 for a path or a corridor |
//! | points of a path | 2 | 256 |
//! | samples along a side of a grid | 3 | 128 |
//! | voxels between samples of a grid | 1/16 | 64 |
//! | height of a corridor above and below its path | 0 | 256 voxels |
//! | volume of the shape itself | | 2^25 voxels |
//! | roughness amplitude | 0 | 8 voxels |
//! | roughness scale | 1 voxel | 256 voxels |
//! | strength of sculpting | 0 | 1 |
//! | falloff of sculpting | 0 | 64 voxels |
//! | amount of a raise or lower | 0 | 64 voxels |
//! | step of a terrace | 1 voxel | 256 voxels |
//! | rounding: falloff of a fill or a carve | 0 | 16 voxels |
//! | samples along a side of a stamp | 2 | 256 |
//! | side of a stamp | 1/2 voxel | 2048 voxels |
//! | height of a stamp | -256 voxels | 256 voxels |
//!
//! # Sculpting
//!
//! Dig and add know their shape's distance and nothing else. [`Operation::Smooth`],
//! [`Sharpen`](Operation::Sharpen), [`Flatten`](Operation::Flatten), [`Level`](Operation::Level),
//! [`Raise`](Operation::Raise), [`Lower`](Operation::Lower), [`Stamp`](Operation::Stamp) and
//! [`Terrace`](Operation::Terrace) *sculpt*: they change the densities that are there, with a weight that
//! rises from 0 at the shape's surface to the [`Blend`]'s strength over its falloff, so that nothing jumps at
//! the rim. On pristine ground a density is the height above the surface, and so they act like the same tools
//! on a heightmap; where the ground was dug, it is the distance to the surface, and they work on walls and
//! ceilings too. A sample whose density stays as it is is not edited.
//!
//! [`Operation::Fill`] and [`Operation::Carve`] are an add and a dig with the edge between shape and ground rounded, by
//! a radius that is the blend's falloff. They reach that far beyond the shape.
//!
//! New solid samples get the blend's material; without one, that of the [`ShapeGrid`] at this place, if the shape is
//! one with [materials](ShapeGrid::with_materials); else of the first solid voxel straight below within 64 voxels, else
//! straight above within 64, else of the first solid neighbour (-x, +x, -z, +z), else of the ground's own.
//!
//! ```
//! use bevy_burrow::prelude::*;
//! use glam::Vec3;
//!
//! let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
//! let at = Shape::sphere(Vec3::new(32.0, 10.0, 32.0), 8.0);
//! let receipts = terrain.apply([Brush::raise(at, 3.0), Brush::smooth(at, 0.5), Brush::terrace(at, 2.0)]);
//! assert!(receipts[0].outcome.as_ref().is_ok_and(|applied| applied.added.total() > 50));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Why the bits agree
//!
//! Coordinates relative to the shape are integers below 2^24 in 1/256 voxel, so `f32` holds them exactly. From there
//! on only `+ - * / sqrt`, comparisons and integer hashing are used, each exactly rounded and in one written order: no
//! fused multiply-add, no sine, no library normalisation. CUDA gives the same bits with `-fmad=false`.
//!
//! ```
//! use bevy_burrow::brush::{Brush, Edit, Shape};
//! use glam::{IVec3, Vec3};
//!
//! let edit = Edit::quantize(&Brush::dig(Shape::sphere(Vec3::new(8.0, 0.0, 8.0), 4.0)))?;
//! assert_eq!(edit.evaluator().distance(IVec3::new(8, 5, 8)), 256); // one voxel outside
//! assert!(edit.reach().contains(IVec3::new(8, 6, 8))); // two voxels outside: rule 6
//! # Ok::<(), bevy_burrow::brush::BrushError>(())
//! ```
//!
//! [`LIMIT`]: crate::lattice::LIMIT
//! [`REACH`]: crate::lattice::REACH

mod blend;
#[cfg_attr(not(feature = "format"), allow(dead_code, reason = "for messages and journals"))]
mod content;
mod edit;
mod error;
mod evaluator;
mod json;
#[cfg(test)]
mod laws;
mod operation;
mod paste;
mod prefab;
mod quantize;
mod quantized_operation;
#[cfg(feature = "plugin")]
mod reach;
mod request;
mod roughness;
mod rounding;
mod sculpt_kernel;
#[doc(hidden)]
pub mod shapes;
mod stamp;
mod stencil;
mod voxel_count;

pub use blend::Blend;
#[cfg(feature = "format")]
pub(crate) use content::{Content, ContentMut};
pub use edit::Edit;
pub use error::BrushError;
#[doc(hidden)]
pub use evaluator::Evaluator;
pub(crate) use operation::Kind;
pub use operation::Operation;
pub use paste::Paste;
pub(crate) use paste::{PasteSource, ground_level};
pub(crate) use prefab::PrefabSample;
#[doc(hidden)]
pub use prefab::{MAX_PREFAB_SAMPLES, MAX_PREFAB_SIDE};
pub use prefab::{Prefab, PrefabError};
#[cfg(feature = "plugin")]
pub(crate) use reach::reaches;
pub use request::Brush;
pub use roughness::Roughness;
pub(crate) use rounding::Rounding;
pub(crate) use sculpt_kernel::SculptKernel;
#[cfg(feature = "cuda")]
pub(crate) use sculpt_kernel::SculptOp;
#[doc(hidden)]
pub use shapes::{AnyShape, CustomShape};
pub use shapes::{BrushPath, Corridor, GridShape, MeshGrid, Shape, ShapeGrid};
pub use stamp::Stamp;
pub(crate) use stencil::{FARTHEST, Stencil, is_moved};

use crate::lattice::ONE;

/// The default power of a brush, which removes everything that rules allow to be removed.
#[doc(hidden)]
pub const FULL_POWER: u8 = u8::MAX;

/// Distance outside its shape within which an edit changes samples, in 1/256 voxel (rule 6).
#[doc(hidden)]
pub const BAND: i32 = 2 * ONE;

/// Depth inside its shape down to which an edit distinguishes distances, in 1/256 voxel. Surface and normals
/// need two voxels; the rest is for rough shapes, whose distances change faster than the point moves.
#[doc(hidden)]
pub const DEPTH: i32 = 4 * ONE;

/// Returns `true` if the value is the default, which is left out when writing.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
