//! Checkpoints: what a world is at one frame of the journal, but for its regions, which have records of their own.

use std::collections::BTreeMap;

use glam::IVec3;

use super::format::Metadata;
use super::mirror::Mirror;
use crate::lattice::RegionPos;

/// A world at one frame of the journal, but for the content of its regions.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Checkpoint {
    /// The last frame that it contains.
    pub frame: u64,
    pub metadata: Metadata,
    /// The regions that hold anything, and the revision that changed each last: that of its record.
    pub regions: BTreeMap<RegionPos, u64>,
}

/// A region and its revision as they are stored.
type Entry = ([i32; 3], u64);

impl Checkpoint {
    /// Of a world at this frame.
    pub fn of(mirror: &Mirror, frame: u64, metadata: Metadata) -> Self {
        let regions = mirror.regions.iter().map(|(at, region)| (*at, region.revision)).collect();
        Self { frame, metadata, regions }
    }

    /// Its bytes; none if it can't be encoded, which is never so.
    pub fn encode(&self) -> Vec<u8> {
        let regions: Vec<Entry> =
            self.regions.iter().map(|(at, revision)| (at.0.to_array(), *revision)).collect();
        postcard::to_stdvec(&(self.frame, &regions, &self.metadata)).unwrap_or_default()
    }

    /// The checkpoint of these bytes, if they are one.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (frame, regions, metadata): (u64, Vec<Entry>, Metadata) = postcard::from_bytes(bytes).ok()?;
        let region = |(at, revision)| (RegionPos(IVec3::from_array(at)), revision);
        Some(Self { frame, metadata, regions: regions.into_iter().map(region).collect() })
    }
}
