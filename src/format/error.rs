//! Errors of reading the formats.

use thiserror::Error;

use super::ids::{ContentId, Kind, WorldId};
use crate::lattice::{BrickPos, ChunkPos};

/// Why bytes can't be read as a part of a saved world.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The bytes do not begin like a record.
    #[error("these bytes are not a record of a saved world")]
    Magic,
    /// The record is cut off.
    #[error("the record is cut off")]
    Truncated,
    /// The record changed after it was written.
    #[error("the record is damaged: its checksum differs")]
    Checksum,
    /// A newer version of the crate wrote the record.
    #[error(
        "the record has schema {found}, but this version knows schemas up to {known}: use a newer version"
    )]
    Newer {
        /// The record's schema.
        found: u32,
        /// The newest that this version knows.
        known: u32,
    },
    /// The record is of another kind.
    #[error("the record is of kind {found}, not {expected:?}")]
    Kind {
        /// The number of the record's kind.
        found: u8,
        /// What was asked for.
        expected: Kind,
    },
    /// The record belongs to another world.
    #[error("the record belongs to the world {found}, not to {expected}")]
    World {
        /// The record's world.
        found: WorldId,
        /// The one that was asked for.
        expected: WorldId,
    },
    /// The record belongs elsewhere in the same world.
    #[error("the record belongs in another place: it has another key")]
    Key,
    /// The record declares more content than is allowed.
    #[error("the record declares {length} bytes, but {limit} are allowed")]
    TooLarge {
        /// Bytes of the content.
        length: u64,
        /// The most allowed.
        limit: u64,
    },
    /// The checksum is valid, but the content is not.
    #[error("the record holds an invalid {0}")]
    Invalid(&'static str),
    /// A brick is invalid.
    #[error("the record holds an invalid brick at {0:?}")]
    Brick(BrickPos),
    /// The fields of a chunk are invalid.
    #[error("the record holds invalid fields of {0:?}")]
    Fields(ChunkPos),
    /// An edit is invalid.
    #[error("the record holds an invalid edit: {0}")]
    Edit(String),
    /// An edit names an image or a prefab that is not there.
    #[error("the record names the content {:016x}, which is missing or damaged", .0.0)]
    ContentMissing(ContentId),
    /// A file of a level is missing, or a file does not belong to a level.
    #[error("`{name}`: {why}")]
    File {
        /// The file's name.
        name: String,
        /// What is wrong with the file.
        why: String,
    },
}

impl FormatError {
    /// The schema of a record that is newer than what this version can read.
    pub fn newer_schema(&self) -> Option<u32> {
        match self {
            Self::Newer { found, .. } => Some(*found),
            _ => None,
        }
    }
}
