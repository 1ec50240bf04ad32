//! The saved data of a world in addition to its regions.

use serde::{Deserialize, Serialize};

use super::error::FormatError;
use super::plain;
use crate::terrain::{EditSettings, TerrainSettings};

/// A world without its regions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// Chunk and voxel size.
    pub settings: TerrainSettings,
    /// The world's revision.
    pub revision: u64,
    /// The world's hash.
    pub hash: u64,
    /// The greatest name that a field has had.
    pub next_field: u64,
    /// The rules and the search for loose pieces that edits obey.
    pub edit_settings: EditSettings,
    /// The [`Terrain::SIMULATION`](crate::terrain::Terrain::SIMULATION) that made it.
    pub simulation: u32,
    /// The hash of the whole ground, as [`Ground::hash`](crate::ground::Ground::hash) gives it.
    pub ground: u64,
    /// The game's data, by key.
    pub game: Vec<(String, Vec<u8>)>,
}

impl Metadata {
    /// Encodes the metadata.
    pub fn encode(&self) -> Vec<u8> {
        plain::to_bytes(self)
    }

    /// Reads what [`encode`](Self::encode) wrote.
    ///
    /// # Errors
    /// When the bytes are not exactly that.
    pub fn decode(bytes: &[u8]) -> Result<Self, FormatError> {
        plain::from_bytes(bytes, "description of a world")
    }
}
