//! What a game asks for, and what the world obeys.
//!
//! A [`Brush`] is a wish: a [`Shape`] in floats, an [`Operation`], perhaps some [`Roughness`]. [`Edit::quantize`] turns
//! it into an [`Edit`], which holds integers only, or says in a [`BrushError`] why not. An [`Evaluator`] then gives the
//! signed distance of every lattice sample, the same bits on every machine.
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
//! # Limits
//!
//! | what | least | most |
//! | --- | --- | --- |
//! | coordinates | -[`LIMIT`] | [`LIMIT`] |
//! | radius, half side | 1/4 voxel | |
//! | axis of a cylinder or cone | 1/4 voxel | |
//! | side of the box around the shape | | 1024 voxels |
//! | volume of the shape itself | | 2^25 voxels |
//! | roughness amplitude | 0 | 8 voxels |
//! | roughness scale | 1 voxel | 256 voxels |
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

mod distance;
mod edit;
mod error;
mod evaluator;
#[cfg(test)]
mod laws;
mod operation;
mod record;
mod request;
mod roughness;
mod shape;
mod solid;

pub use edit::Edit;
pub use error::BrushError;
pub use evaluator::Evaluator;
pub use operation::Operation;
pub use record::{BrushRecord, OperationName, RecordError, ShapeName};
pub use request::Brush;
pub use roughness::Roughness;
pub use shape::Shape;

use crate::lattice::ONE;

/// How far outside its shape an edit still changes samples, in 1/256 voxel (rule 6).
pub const BAND: i32 = 2 * ONE;

/// How deep inside its shape an edit's distances are told apart, in 1/256 voxel. Two voxels are what surface and normals
/// look at; the rest is for rough shapes, whose distances change faster than the point moves.
pub const DEPTH: i32 = 4 * ONE;
