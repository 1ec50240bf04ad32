//! Prefabs as files, `.prefab`.

use std::sync::Arc;

use super::error::FormatError;
use super::frame::{self, Kind, WorldId};
use super::plain;
use crate::brush::{MAX_PREFAB_SAMPLES, Prefab};

/// The key of every prefab's frame.
const KEY: &[u8] = b"prefab";

/// The maximum size in bytes of an unpacked prefab: 3 for the density of a sample, and 9 for materials and marks that
/// differ from sample to sample.
const LIMIT: usize = 12 * MAX_PREFAB_SAMPLES as usize + 64;

impl Prefab {
    /// The bytes of the prefab's file: packed, with a checksum and the number of the format. Equal prefabs give equal
    /// bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        packed_prefab(self).to_vec()
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// When the bytes are not a prefab, when they were cut off or changed, or when a newer version wrote them. Memory
    /// is bounded by some 100 MiB, whatever they say.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        let opened = frame::open(bytes, Kind::Prefab, WorldId::default(), KEY, LIMIT)?;
        plain::from_bytes(&opened.payload, "prefab")
    }
}

/// The bytes of a prefab's file, which are made once for each prefab.
pub(crate) fn packed_prefab(prefab: &Prefab) -> &Arc<[u8]> {
    let pack =
        |prefab: &Prefab| frame::seal(Kind::Prefab, WorldId::default(), KEY, 0, 0, &plain::to_bytes(prefab));
    prefab.packed(pack)
}
