//! Checkpoints: the state of a world at one frame of the journal, except for its regions, which have separate records.

use std::collections::BTreeMap;

use glam::IVec3;

use super::ground_size::GroundSize;
use super::mirror::Mirror;
use crate::format::Metadata;
use crate::lattice::RegionPos;
use crate::store::base_level::LevelName;
use crate::store::journal::segment;

/// A world at one frame of the journal, but for the content of its regions.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::store) struct Checkpoint {
    /// The last frame that it contains.
    pub frame: u64,
    pub metadata: Metadata,
    /// The regions that hold anything, and the revision that changed each last: that of its record.
    pub regions: BTreeMap<RegionPos, u64>,
    /// The level below, from which the regions differ.
    pub level: Option<LevelName>,
    /// The size of the ground, where it is known.
    pub cells: Option<GroundSize>,
}

/// A region and its revision as they are stored.
type Entry = ([i32; 3], u64);

impl Checkpoint {
    /// The checkpoint of a world at this frame.
    pub fn of(mirror: &Mirror, frame: u64, metadata: Metadata) -> Self {
        let stored = mirror.regions.iter().filter(|(_, region)| region.is_stored);
        let regions = stored.map(|(at, region)| (*at, region.revision)).collect();
        let level = mirror.level.as_ref().map(|level| level.name().clone());
        Self { frame, metadata, regions, level, cells: None }
    }

    /// The [base](segment::base) of frames that lead on from it.
    pub fn base(&self) -> u64 {
        segment::base(self.metadata.ground, self.level.as_ref())
    }

    /// Encodes the checkpoint; empty if it can't be encoded, which never happens.
    pub fn encode(&self) -> Vec<u8> {
        let regions: Vec<Entry> =
            self.regions.iter().map(|(at, revision)| (at.0.to_array(), *revision)).collect();
        let mut bytes = postcard::to_stdvec(&(self.frame, &regions, &self.metadata)).unwrap_or_default();
        if let Some(level) = &self.level {
            bytes.append(&mut postcard::to_stdvec(level).unwrap_or_default());
        }
        bytes
    }

    /// Decodes a checkpoint; `None` if the bytes are not one.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        type Parts = (u64, Vec<Entry>, Metadata);
        let ((frame, regions, mut metadata), rest): (Parts, _) = postcard::take_from_bytes(bytes).ok()?;
        let cells = GroundSize::take(&mut metadata.game);
        let level = (!rest.is_empty()).then(|| postcard::from_bytes(rest)).transpose().ok()?;
        let region = |(at, revision)| (RegionPos(IVec3::from_array(at)), revision);
        Some(Self { frame, metadata, regions: regions.into_iter().map(region).collect(), level, cells })
    }
}
