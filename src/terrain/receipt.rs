//! Receipts: the result of a brush.

use crate::brush::BrushError;
use crate::lattice::{ChunkPos, LatticeBox};
use crate::loose::LoosePiece;
use crate::volume::{FieldId, MaterialCounts, Refused, Scenario};

/// The result of a brush. Each submitted brush gets exactly one receipt.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct Receipt {
    /// The brush's tag.
    pub tag: u64,
    /// What it changed, or why it was rejected.
    pub outcome: Result<Applied, Rejection>,
}

/// What a brush changed. A brush that changed nothing, such as a dig in the air, leaves all of this empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Applied {
    /// The scenario in each chunk whose samples changed; more than one chunk is the paper's fifth scenario.
    pub chunks: Vec<ChunkScenario>,
    /// Box around all samples that changed.
    pub bounds: Option<LatticeBox>,
    /// Voxels dug away, by material.
    pub removed: MaterialCounts,
    /// Voxels filled, by material.
    pub added: MaterialCounts,
    /// Solid voxels whose material changed, by the new one.
    pub painted: MaterialCounts,
    /// Voxels that the terrain's [`DiggingRules`](crate::volume::DiggingRules) kept from changing, by reason.
    pub refused: Refused,
    /// Pieces of ground that it cut off, where the terrain [looks for them](super::Terrain::set_loose). Those that are gone
    /// are not among `removed`.
    pub loose: Vec<LoosePiece>,
    /// Whether the search for loose pieces ended at its [budget](super::LooseSettings) before it had looked everywhere. Pieces
    /// that it did not find stay as ground.
    pub has_unsearched: bool,
}

impl Applied {
    /// Whether the edit was split over several chunks (scenario 5).
    pub fn is_split(&self) -> bool {
        self.chunks.len() > 1
    }
}

/// What a brush did to the fields of one chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkScenario {
    /// The chunk.
    pub chunk: ChunkPos,
    /// The scenario.
    pub scenario: Scenario,
    /// The field that holds the edit now.
    pub field: FieldId,
}

/// Why a brush was rejected. A rejected brush changes nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Rejection {
    /// The brush itself is not valid.
    #[error(transparent)]
    Brush(#[from] BrushError),
    /// The terrain was removed before its turn came, or the entity never had one.
    #[error("the terrain is gone")]
    TerrainGone,
    /// The brush reaches no column of the world.
    #[error("the brush lies outside the world")]
    OutsideWorld,
    /// Too much work is [waiting](super::WorkLimits::waiting).
    #[error("too much work waits already")]
    Overloaded,
    /// The authority over a shared terrain, usually a server, refused it.
    #[error("the server refused it")]
    Refused,
    /// Applying it panicked. The others of its transaction were applied without it.
    #[error("applying the brush panicked; this is a bug of the plugin's")]
    Panicked,
}

/// The number of times that each of the paper's scenarios occurred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ScenarioCounts {
    /// 1: fields created.
    pub created: usize,
    /// 2: fields changed inside.
    pub changed: usize,
    /// 3: fields extended.
    pub extended: usize,
    /// 4: merges of fields.
    pub merged: usize,
    /// 5: edits split over several chunks; each of their chunks is counted above as well.
    pub split: usize,
}

impl ScenarioCounts {
    /// Counts the scenarios of one more brush.
    pub fn count(&mut self, receipt: &Receipt) {
        let Ok(applied) = &receipt.outcome else { return };
        for part in &applied.chunks {
            match part.scenario {
                Scenario::Created => self.created += 1,
                Scenario::Changed => self.changed += 1,
                Scenario::Extended => self.extended += 1,
                Scenario::Merged { .. } => self.merged += 1,
            }
        }
        self.split += usize::from(applied.is_split());
    }
}
