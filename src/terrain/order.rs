//! Orders: requests to a terrain.

use std::sync::Arc;

use super::receipt::OrderKind;
use crate::brush::{Brush, BrushError, Edit};
use crate::edits::{EDIT_WORK, edit_work};
use crate::ground::Ground;
use crate::lattice::{ChunkGrid, LatticeBox};
use crate::loose::LooseSettings;
use crate::volume::DiggingRules;
use crate::world::Patch;

/// A request to a terrain. The queue, the commit log, servers and clients use the same orders. See
/// [`Terrain::submit`](super::Terrain::submit).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Order {
    /// An edit, under the rules and settings of the orders before it.
    Edit(Edit),
    /// Undoes the last group of edits that changed the world. Groups are decided when edits are submitted, not when
    /// their transactions begin: brushes of one [stroke](crate::brush::Brush::stroke) that follow each other, those
    /// that one call of [`apply`](super::Terrain::apply) or [`submit_all`](super::Terrain::submit_all) was given, or
    /// a single brush. A group that changed nothing is not a step.
    ///
    /// Afterwards everything equals the state before that group, bit by bit: [`World::hash`](super::World::hash),
    /// samples, materials, fields with their names, boxes and revisions, mask, meshes and rings. The exceptions are
    /// [`World::revision`](super::World::revision), which counts this as one more commit, and the names that fields
    /// will get from then on: none is ever used for two.
    Undo,
    /// Redoes the step that was undone last. An edit that changes something in between clears the steps that could be
    /// redone.
    Redo,
    /// Replaces parts of the world, for example by a region of another machine's world. The undo history is cleared,
    /// because its steps refer to the replaced parts.
    Parts {
        /// The parts.
        change: Arc<Patch>,
        /// The [hash](super::World::hash) that the world must have afterwards.
        hash: Option<u64>,
    },
    /// Another ground of the same size lies below all edits. Edited samples, fields and names stay; pristine samples
    /// are those of the new ground, and all is as if the world had been restored on it. The undo history is cleared,
    /// all meshes are made again, and the receipt counts no voxels.
    Ground(Arc<Ground>),
    /// Later edits obey these rules.
    Rules(Option<Arc<DiggingRules>>),
    /// Later edits search for loose pieces with these settings.
    Loose(Option<LooseSettings>),
}

/// The work that any other order counts as, in bricks.
const STEP: u64 = 200;

impl Order {
    /// Replaces parts of the world; see [`Order::Parts`].
    pub fn parts(change: impl Into<Arc<Patch>>, hash: Option<u64>) -> Self {
        Self::Parts { change: change.into(), hash }
    }

    /// Sets the rules of later edits; see [`Order::Rules`].
    pub fn rules(rules: DiggingRules) -> Self {
        Self::Rules(Some(Arc::new(rules)))
    }

    /// The order's kind, as its receipt names it.
    pub fn kind(&self) -> OrderKind {
        match self {
            Self::Edit(_) => OrderKind::Edit,
            Self::Undo => OrderKind::Undo,
            Self::Redo => OrderKind::Redo,
            Self::Parts { .. } => OrderKind::Parts,
            Self::Ground(_) => OrderKind::Ground,
            Self::Rules(_) => OrderKind::Rules,
            Self::Loose(_) => OrderKind::Loose,
        }
    }

    /// The edit, if it is one.
    pub fn edit(&self) -> Option<&Edit> {
        if let Self::Edit(edit) = self { Some(edit) } else { None }
    }

    /// Whether it is a transaction of its own: anything but an edit, a reset, and a paste.
    pub(super) fn is_alone(&self) -> bool {
        self.edit().is_none_or(|edit| edit.kind().is_alone())
    }

    /// The order's work, in bricks.
    pub(super) fn work(&self, grid: ChunkGrid) -> u64 {
        let Some(edit) = self.edit() else { return STEP };
        edit_work(grid, edit).unwrap_or(EDIT_WORK)
    }

    /// Whether it replaces parts of the world that steps of history refer to.
    pub(super) fn replaces_parts(&self) -> bool {
        match self {
            Self::Parts { change, .. } => !change.is_empty(),
            Self::Ground(_) => true,
            _ => false,
        }
    }

    /// Whether it certainly changes none of these samples, where `step` says whether a step through history may.
    pub(super) fn misses(&self, samples: LatticeBox, step: impl FnOnce() -> bool) -> bool {
        match self {
            Self::Edit(edit) => edit.misses(samples),
            Self::Parts { change, .. } => {
                change.bricks.iter().all(|(pos, _)| pos.samples().intersection(samples).is_none())
            }
            Self::Undo | Self::Redo => !step(),
            Self::Ground(_) => false,
            Self::Rules(_) | Self::Loose(_) => true,
        }
    }
}

/// Something to submit: a [`Brush`], an [`Edit`], an [`Order`], or a reference to one. An invalid brush can be
/// submitted too, and gets its receipt in turn.
#[derive(Clone, Debug)]
pub struct Request {
    pub(super) tag: u64,
    pub(super) stroke: Option<u64>,
    pub(super) order: Result<Order, BrushError>,
}

impl Request {
    /// A brush whose edit was made elsewhere.
    #[cfg(feature = "plugin")]
    pub(crate) fn of_edit(brush: &Brush, edit: Result<Edit, BrushError>) -> Self {
        Self { tag: brush.tag, stroke: brush.stroke, order: edit.map(Order::Edit) }
    }

    /// The order.
    ///
    /// # Errors
    /// When its brush or edit is invalid.
    #[cfg(feature = "net")]
    pub(crate) fn into_order(self) -> Result<Order, BrushError> {
        self.order
    }

    /// The request's work, in bricks.
    pub(super) fn work(&self, grid: ChunkGrid) -> u64 {
        self.order.as_ref().map_or(EDIT_WORK, |order| order.work(grid))
    }

    /// The kind of its order. Only edits are invalid.
    pub(super) fn kind(&self) -> OrderKind {
        self.order.as_ref().map_or(OrderKind::Edit, Order::kind)
    }
}

impl From<&Brush> for Request {
    fn from(brush: &Brush) -> Self {
        let edit = Edit::quantize(brush);
        Self { tag: brush.tag, stroke: brush.stroke, order: edit.map(Order::Edit) }
    }
}

impl From<Edit> for Request {
    fn from(edit: Edit) -> Self {
        let (tag, stroke) = (edit.tag(), edit.stroke());
        Self { tag, stroke, order: edit.check().map(|()| Order::Edit(edit)) }
    }
}

impl From<Order> for Request {
    fn from(order: Order) -> Self {
        match order {
            Order::Edit(edit) => edit.into(),
            order => Self { tag: 0, stroke: None, order: Ok(order) },
        }
    }
}

impl From<Brush> for Request {
    fn from(brush: Brush) -> Self {
        (&brush).into()
    }
}

impl From<&Edit> for Request {
    fn from(edit: &Edit) -> Self {
        edit.clone().into()
    }
}

impl From<&Order> for Request {
    fn from(order: &Order) -> Self {
        order.clone().into()
    }
}
