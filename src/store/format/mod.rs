//! The bytes of records: bricks, regions, journal entries. Everything that is read is checked.
#![allow(missing_docs, dead_code, unused)]

pub mod batch;
pub mod bricks;
pub mod bytes;
pub mod change;
pub mod container;
pub mod edits;
pub mod error;
pub mod fields;
pub mod frame;
pub mod level;
pub mod metadata;
pub mod plain;
pub mod portable;
pub mod predict;
pub mod region;
pub mod residuals;

pub use batch::Batch;
pub use error::FormatError;
pub use metadata::Metadata;
pub use region::{REGION_LIMIT, decode_region, encode_region};

#[cfg(test)]
mod tests;
