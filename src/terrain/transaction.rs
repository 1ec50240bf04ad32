//! A transaction: edits in order, or one step through history, with the snapshot that they apply to.

use std::fmt;
use std::sync::Arc;

use super::work::Work;
use crate::backend::{Compute, Engine};
use crate::redraw::{DrawnCut, Scene};
use crate::world::{Meshing, World};

/// Edits to be applied, or a step through history, with the snapshot that they apply to. A clone gives the same commit;
/// a terrain accepts only one of them.
#[derive(Clone)]
pub struct Transaction {
    pub(super) ticket: u64,
    pub(super) world: Arc<World>,
    pub(super) work: Work,
    /// `None` runs on the CPU.
    pub(super) engine: Option<Engine>,
    /// The cut that is drawn; `None` if all of the world is drawn in full detail.
    pub(super) drawn_cut: Option<Arc<DrawnCut>>,
    pub(super) meshing: Meshing,
    /// Whether the terrain keeps a log.
    pub(super) is_logged: bool,
}

impl fmt::Debug for Transaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Transaction")
            .field("ticket", &self.ticket)
            .field("edits", &self.len())
            .finish_non_exhaustive()
    }
}

impl Transaction {
    /// The transaction's number.
    #[cfg(feature = "plugin")]
    pub(crate) fn ticket(&self) -> u64 {
        self.ticket
    }

    /// Number of its edits; other orders and changes of the cut hold none.
    pub fn len(&self) -> usize {
        self.work.edits().count()
    }

    /// Returns `true` if it holds no edit.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The world that it applies to, and how it is drawn.
    pub(super) fn scene<'a>(&'a self, backend: &'a dyn Compute) -> Scene<'a> {
        Scene { world: &self.world, meshing: self.meshing, cut: self.drawn_cut.as_ref(), backend }
    }
}
