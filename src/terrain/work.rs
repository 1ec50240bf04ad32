//! The work of a transaction.

use std::sync::Arc;

use super::history::{HistoryStep, UndoDelta};
use super::queue::Submission;
use super::replacement::Put;
use crate::redraw::ChooseCut;

/// The work of a transaction.
#[derive(Clone)]
pub(super) enum Work {
    Edits(Arc<[Submission]>),
    /// A step through history and the content that it restores.
    Step(HistoryStep, Arc<UndoDelta>),
    /// Parts are replaced.
    Put(Arc<Put>),
    /// Another cut is drawn.
    Cut(Arc<ChooseCut>),
}
