//! Receipts: the outcomes of orders.

use std::fmt;

use super::parts_error::PartsError;
use crate::brush::BrushError;
use crate::lattice::{ChunkPos, LatticeBox};
use crate::loose::{LoosePiece, ReturnedPiece};
use crate::volume::{FieldId, MaterialCounts, Refused, RulesError, Scenario};

/// The outcome of an order. Each brush, step through history, replacement of parts and ground that was submitted gets
/// exactly one; rules and settings of loose pieces get one only if they are invalid.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct Receipt {
    /// The kind of order.
    pub kind: OrderKind,
    /// The tag of the brush; 0 for everything else.
    pub tag: u64,
    /// What it changed, or why it was rejected.
    pub outcome: Result<Applied, Rejection>,
}

impl Receipt {
    /// The receipt of an edit.
    pub fn of_edit(tag: u64, outcome: Result<Applied, Rejection>) -> Self {
        Self { kind: OrderKind::Edit, tag, outcome }
    }

    /// The receipt of anything else.
    pub fn of(kind: OrderKind, outcome: Result<Applied, Rejection>) -> Self {
        Self { kind, tag: 0, outcome }
    }

    /// Whether the order failed for a reason that other machines may not have.
    #[cfg(feature = "net")]
    pub(crate) fn is_local_failure(&self) -> bool {
        let why = self.outcome.as_ref().err();
        matches!(why, Some(Rejection::Panicked | Rejection::Overloaded | Rejection::TerrainGone))
    }
}

/// The kinds of [orders](super::Order), as receipts name them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum OrderKind {
    /// An edit.
    Edit,
    /// An undo.
    Undo,
    /// A redo.
    Redo,
    /// A replacement of parts of the world.
    Parts,
    /// Another ground.
    Ground,
    /// Other rules.
    Rules,
    /// Other settings of loose pieces.
    Loose,
}

impl fmt::Display for OrderKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Edit => "edit",
            Self::Undo => "undo",
            Self::Redo => "redo",
            Self::Parts => "parts",
            Self::Ground => "ground",
            Self::Rules => "rules",
            Self::Loose => "loose settings",
        })
    }
}

impl OrderKind {
    /// Whether it is a step through history.
    pub fn is_step(self) -> bool {
        matches!(self, Self::Undo | Self::Redo)
    }

    /// Whether logs hold it as the parts that it changed.
    pub(crate) fn is_logged_as_parts(self) -> bool {
        matches!(self, Self::Undo | Self::Redo | Self::Parts)
    }

    /// Whether it sets what later edits obey, and does not change the world.
    pub(crate) fn is_setting(self) -> bool {
        matches!(self, Self::Rules | Self::Loose)
    }
}

/// What an order changed. An order that changed nothing, such as a dig in the air, leaves all of this empty.
///
/// Inventories that follow receipts must follow those of undos and redos too. There, voxels of loose pieces are
/// included in `removed` and `added`, although an edit's `removed` does not include them. So an undo takes `added`
/// minus the materials of `returned` out of an inventory, and a redo puts `removed` minus those of `cut_again` into it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Applied {
    /// The scenario in each chunk whose samples changed, of an edit; more than one chunk is the paper's fifth scenario.
    pub chunks: Vec<ChunkScenario>,
    /// Box around all samples that changed.
    pub bounds: Option<LatticeBox>,
    /// Voxels dug away, by the material they had.
    pub removed: MaterialCounts,
    /// Voxels filled, by the material they have.
    pub added: MaterialCounts,
    /// Solid voxels whose material changed, by the new one.
    pub painted: MaterialCounts,
    /// Voxels that the terrain's [`DiggingRules`](crate::volume::DiggingRules) kept from changing, by reason.
    pub refused: Refused,
    /// Pieces of ground that an edit cut off, where the terrain [looks for them](super::Terrain::set_loose). Those that
    /// are gone are not among `removed`.
    pub loose: Vec<LoosePiece>,
    /// Whether the search for loose pieces ended at its [budget](super::LooseSettings) before it had looked everywhere.
    /// Pieces that it did not find stay as ground.
    pub has_unsearched: bool,
    /// The tags of the undone or redone brushes, in order, without those that had changed nothing.
    pub tags: Vec<u64>,
    /// The pieces that had been cut off, and that are ground again: an undo brings them back.
    pub returned: Vec<ReturnedPiece>,
    /// The pieces that a redo took out of the ground again, as receipts had listed them, each with the tag of its
    /// brush.
    pub cut_again: Vec<(u64, LoosePiece)>,
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

/// Why an order was rejected. A rejected order changes nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Rejection {
    /// The brush itself is not valid.
    #[error(transparent)]
    Brush(#[from] BrushError),
    /// The rules are not valid.
    #[error(transparent)]
    Rules(#[from] RulesError),
    /// The parts or the ground do not fit the world.
    #[error(transparent)]
    Parts(#[from] PartsError),
    /// The brush reaches no column of the world.
    #[error("the brush lies outside the world")]
    OutsideWorld,
    /// Nothing was edited, everything was undone already, or the history exceeded its budget of bytes.
    #[error("there is nothing to undo")]
    NothingToUndo,
    /// Nothing was undone since the last edit, or the history exceeded its budget of bytes.
    #[error("there is nothing to redo")]
    NothingToRedo,
    /// The terrain was removed before its turn came, or the entity never had one.
    #[error("the terrain no longer exists")]
    TerrainGone,
    /// Too much work is [waiting](super::WorkLimits::waiting).
    #[error("the queue is full: try again once waiting work is done")]
    Overloaded,
    /// The authority over a shared terrain, usually a server, refused it.
    #[error("the server refused it")]
    Refused,
    /// Applying it panicked. World and history are unchanged, and the others of its transaction were applied without
    /// it.
    #[error("applying it panicked: this is a bug in bevy_burrow")]
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
