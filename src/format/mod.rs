//! The formats of worlds that are saved or sent, as pure conversions to and from bytes: no files, no threads, no
//! clocks.
//!
//! | file | encodes |
//! | --- | --- |
//! | `frame` | the envelope of every part: checksum, schema, world, key |
//! | `region`, `bricks`, `fields` | a region's record |
//! | `predict`, `residuals` | densities of bricks |
//! | `batch`, `edits`, `change` | commits, for journals |
//! | `contents` | images and prefabs that edits name |
//! | `metadata` | a world without its regions |
//! | `portable` | a whole world as one file |
//! | `prefab` | a prefab as a file |
//! | `level` | a designer's level: a folder of files, or one packed file |
//! | `container`, `bytes`, `plain`, `limits` | shared by the others |
//!
//! Reading any bytes gives the written content or a [`FormatError`]: nothing panics, and memory is bounded by the
//! length of the input and by limits that the caller sets. Equal content always gives equal bytes.

pub(crate) mod batch;
pub(crate) mod bricks;
pub(crate) mod bytes;
pub(crate) mod change;
pub(crate) mod container;
#[cfg_attr(
    not(all(feature = "net", feature = "store")),
    allow(dead_code, reason = "for messages and journals")
)]
pub(crate) mod contents;
pub(crate) mod edits;
pub(crate) mod error;
pub(crate) mod fields;
pub(crate) mod frame;
pub(crate) mod ids;
pub(crate) mod level;
pub(crate) mod limits;
pub(crate) mod metadata;
pub(crate) mod plain;
pub(crate) mod portable;
pub(crate) mod predict;
pub(crate) mod prefab;
pub(crate) mod region;
pub(crate) mod residuals;

#[doc(hidden)]
pub use batch::Batch;
pub use error::FormatError;
pub use ids::WorldId;
pub use level::{Level, LevelFiles};
#[doc(hidden)]
pub use metadata::Metadata;
#[doc(hidden)]
pub use portable::{PortableHead, SavedRegion, read_portable_head};
#[doc(hidden)]
pub use portable::{PortableWorld, read_portable, write_portable};
#[cfg(any(feature = "net", feature = "store", test))]
pub(crate) use region::{decode_region, encode_region};

#[cfg(test)]
mod tests;
