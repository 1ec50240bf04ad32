//! The formats of saved worlds, as pure conversions to and from bytes: no files, no threads, no clocks.
//!
//! | file | encodes |
//! | --- | --- |
//! | [`frame`] | the envelope of every part: checksum, schema, world, key |
//! | [`region`], [`bricks`], [`fields`] | a region's record |
//! | [`predict`], [`residuals`] | densities of bricks |
//! | [`batch`], [`edits`], [`change`] | commits, for journals |
//! | [`metadata`] | a world without its regions |
//! | [`portable`] | a whole world as one file |
//! | [`level`] | a designer's level: a folder of files, or one packed file |
//! | [`container`], [`bytes`], [`plain`], [`limits`] | shared by the others |
//!
//! Reading any bytes gives the written content or a [`FormatError`]: nothing panics, and memory is bounded by the
//! length of the input and by limits that the caller sets. Equal content always gives equal bytes.

pub mod batch;
pub mod bricks;
pub mod bytes;
pub mod change;
pub mod container;
pub mod edits;
pub mod error;
pub mod fields;
pub mod frame;
pub mod ids;
pub mod level;
pub mod limits;
pub mod metadata;
pub mod plain;
pub mod portable;
pub mod predict;
pub mod region;
pub mod residuals;

pub use batch::Batch;
pub use error::FormatError;
pub use metadata::Metadata;
pub use region::{decode_region, encode_region};

#[cfg(test)]
mod tests;
