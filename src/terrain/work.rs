//! The work of one transaction: edits in order, one other order, or another cut to draw.

use std::sync::Arc;

use super::history::UndoDelta;
use super::queue::Submission;
use super::receipt::OrderKind;
use crate::redraw::ChooseCut;

/// The work of a transaction.
#[derive(Clone)]
pub(super) enum Work {
    /// Edits in order, or one other order; of a step through history also the content that it restores.
    Orders(Arc<[Submission]>, Option<Arc<UndoDelta>>),
    /// Another cut is drawn.
    Cut(Arc<ChooseCut>),
}

impl Work {
    /// The orders; none for another cut.
    pub fn submissions(&self) -> &[Submission] {
        if let Self::Orders(submissions, _) = self { submissions } else { &[] }
    }

    /// Whether it only draws another cut.
    pub fn is_cut(&self) -> bool {
        matches!(self, Self::Cut(_))
    }

    /// The edits and rejected edits among the orders.
    pub fn edits(&self) -> impl Iterator<Item = &Submission> {
        self.submissions().iter().filter(|own| own.kind() == OrderKind::Edit)
    }

    /// The content that a step through history restores.
    pub fn target(&self) -> Option<&Arc<UndoDelta>> {
        if let Self::Orders(_, target) = self { target.as_ref() } else { None }
    }
}
