//! Undo and redo: what edits replaced, kept as far back as a budget of bytes allows.
//!
//! A step holds the bricks, fields and words of the mask that one group of edits replaced: a stroke, or edits that were
//! submitted together. Groups are independent of transactions: one transaction may hold many groups, and a stroke may
//! take many transactions. Bricks are shared, so a step costs only the bytes of bricks that are held by it alone. Undo
//! swaps the old parts with the new ones, which redo then needs.

use std::collections::VecDeque;
use std::sync::Arc;

use super::receipt::{OrderKind, Receipt, Rejection};
use super::record::CommitRecord;
use crate::lattice::LatticeBox;
use crate::loose::LoosePiece;
use crate::world::{Change, Patch, Reached, World, brick_bytes};

/// A direction through a terrain's history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    Undo,
    Redo,
}

impl Step {
    /// The step that an order takes, if it is one.
    pub fn of(kind: OrderKind) -> Option<Self> {
        match kind {
            OrderKind::Undo => Some(Self::Undo),
            OrderKind::Redo => Some(Self::Redo),
            _ => None,
        }
    }

    /// The receipt where there is nothing to do.
    pub fn nothing(self) -> Receipt {
        match self {
            Self::Undo => Receipt::of(OrderKind::Undo, Err(Rejection::NothingToUndo)),
            Self::Redo => Receipt::of(OrderKind::Redo, Err(Rejection::NothingToRedo)),
        }
    }
}

/// Statistics of a terrain's history.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct History {
    /// Steps that can be undone.
    pub undos: usize,
    /// Steps that can be redone.
    pub redos: usize,
    /// Bytes that history alone holds. What it shares with the world is not counted.
    pub bytes: usize,
}

/// The parts that a group of edits or a step through history installs; after the commit, the parts that it replaced.
pub(super) struct UndoDelta {
    pub change: Change,
    /// A box around all of its bricks.
    pub bounds: Option<LatticeBox>,
    /// Bytes of the bricks that are in history only, once this is committed.
    pub brick_bytes: usize,
    /// The number of the group.
    pub group: u64,
    /// The tags of its edits that changed something.
    pub tags: Vec<u64>,
    /// The pieces that its edits took out of the ground, with the tags of these.
    pub pieces: Vec<(u64, LoosePiece)>,
    /// Bytes of fields and pieces in its lists, once it is recorded.
    listed_bytes: usize,
    /// Where the change holds something, while later edits of the group are added: its lists are not sorted then.
    reached: Option<Reached>,
}

impl UndoDelta {
    /// A change by a group of edits; `replaced_bytes` is the size of the bricks that it replaces.
    pub fn new(
        mut change: Change,
        replaced_bytes: usize,
        group: u64,
        (tags, pieces): (Vec<u64>, Vec<(u64, LoosePiece)>),
    ) -> Self {
        // Its bytes are counted by what is in its lists.
        change.shrink();
        let bounds = change.patch.bricks.iter().map(|(pos, _)| pos.samples()).reduce(LatticeBox::union);
        Self {
            change,
            bounds,
            brick_bytes: replaced_bytes,
            group,
            tags,
            pieces,
            listed_bytes: 0,
            reached: None,
        }
    }

    /// Counts the bytes of its lists, once they hold the replaced parts.
    fn count(&mut self) {
        let pieces = self.pieces.iter().map(|(tag, piece)| size_of_val(tag) + piece.bytes()).sum::<usize>();
        self.listed_bytes = self.change.field_bytes() + pieces;
    }

    /// Adds what later edits of the same group replaced, and returns what earlier ones had replaced already. Takes as
    /// long as there is to add, however long the stroke is.
    fn extend(&mut self, later: Self) -> Patch {
        let reached = self.reached.get_or_insert_with(|| Reached::of(&self.change));
        let left = self.change.absorb(reached, later.change);
        let left_bricks = left.bricks.iter().flat_map(|(_, brick)| brick).map(|brick| brick_bytes(brick));
        self.brick_bytes += later.brick_bytes.saturating_sub(left_bricks.sum());
        let left_fields = left.fields.iter().map(|(_, fields)| fields.bytes()).sum::<usize>();
        self.listed_bytes += later.listed_bytes.saturating_sub(left_fields);
        self.bounds = self.bounds.into_iter().chain(later.bounds).reduce(LatticeBox::union);
        self.tags.extend(later.tags);
        self.pieces.extend(later.pieces);
        left
    }

    /// No later edit is added to it.
    fn close(&mut self) {
        if self.reached.take().is_some() {
            self.change.shrink();
            self.tags.shrink_to_fit();
            self.pieces.shrink_to_fit();
        }
    }

    /// Bytes that dropping it frees, the counters of its `Arc` included. They do not depend on the number of commits
    /// that it took: what helps to add later edits, and goes when none can come, is not counted.
    fn bytes(&self) -> usize {
        let own = 2 * size_of::<usize>() + size_of::<Self>();
        let lists = size_of_val(&self.tags[..]) + self.change.list_bytes();
        own + lists + self.listed_bytes + self.brick_bytes
    }
}

/// Data that a terrain no longer needs: steps, bricks, records of the log, and a copy of the world. Dropping these is
/// slow; do it off the main thread.
#[derive(Default)]
pub(crate) struct DeferredDrop {
    steps: Vec<Arc<UndoDelta>>,
    parts: Vec<Patch>,
    pub(super) records: Vec<CommitRecord>,
    pub(super) copy: Option<Arc<World>>,
}

impl DeferredDrop {
    /// Returns `true` if there is nothing to drop.
    #[cfg(any(feature = "plugin", test))]
    pub fn is_empty(&self) -> bool {
        let Self { steps, parts, records, copy } = self;
        steps.is_empty() && parts.is_empty() && records.is_empty() && copy.is_none()
    }

    /// Adds what a change replaced.
    pub(super) fn add(&mut self, replaced: UndoDelta) {
        self.steps.push(Arc::new(replaced));
    }
}

/// The steps of a terrain, back and forth, within a budget of bytes.
pub(super) struct UndoStack {
    /// The oldest first.
    undo: VecDeque<Arc<UndoDelta>>,
    /// The one that was undone last comes last.
    redo: VecDeque<Arc<UndoDelta>>,
    budget: usize,
    /// Bytes of all steps.
    step_bytes: usize,
    /// The greatest number of a group whose step was dropped for the budget; later edits of this group are not
    /// recorded.
    last_dropped: u64,
}

impl UndoStack {
    /// An empty one with a budget of bytes.
    pub fn new(budget: usize) -> Self {
        Self { undo: VecDeque::new(), redo: VecDeque::new(), budget, step_bytes: 0, last_dropped: 0 }
    }

    fn list(&mut self, step: Step) -> &mut VecDeque<Arc<UndoDelta>> {
        match step {
            Step::Undo => &mut self.undo,
            Step::Redo => &mut self.redo,
        }
    }

    /// The parts that the next undo or redo installs.
    pub fn next(&self, step: Step) -> Option<&Arc<UndoDelta>> {
        match step {
            Step::Undo => self.undo.back(),
            Step::Redo => self.redo.back(),
        }
    }

    /// Steps and bytes.
    pub fn figures(&self) -> History {
        History { undos: self.undo.len(), redos: self.redo.len(), bytes: self.bytes() }
    }

    fn bytes(&self) -> usize {
        self.step_bytes + (self.undo.capacity() + self.redo.capacity()) * size_of::<Arc<UndoDelta>>()
    }

    /// Returns `true` if some step reaches these samples.
    pub fn reaches(&self, samples: LatticeBox) -> bool {
        let meets =
            |step: &Arc<UndoDelta>| step.bounds.is_some_and(|own| own.intersection(samples).is_some());
        self.undo.iter().chain(&self.redo).any(meets)
    }

    /// Bytes that it may take.
    pub fn budget(&self) -> usize {
        self.budget
    }

    /// Sets the budget and drops what exceeds it.
    pub fn set_budget(&mut self, budget: usize) -> DeferredDrop {
        self.budget = budget;
        let mut dropped = DeferredDrop::default();
        self.trim(&mut dropped);
        dropped
    }

    /// Forgets all steps.
    pub fn clear(&mut self, dropped: &mut DeferredDrop) {
        dropped.steps.extend(self.undo.drain(..).chain(self.redo.drain(..)));
        (self.undo, self.redo, self.step_bytes) = Default::default();
    }

    /// Edits of a group were committed: they can be undone now, with those of their group before them, and nothing can
    /// be redone.
    pub fn record(&mut self, mut replaced: UndoDelta, dropped: &mut DeferredDrop) {
        replaced.count();
        let first = dropped.steps.len();
        dropped.steps.extend(self.redo.drain(..));
        self.step_bytes -= dropped.steps[first..].iter().map(|step| step.bytes()).sum::<usize>();
        let latest = self.undo.back_mut().filter(|latest| latest.group == replaced.group);
        // A transaction that undoes this step holds it too; then no edit can join it any more.
        if let Some(latest) = latest.and_then(Arc::get_mut) {
            self.step_bytes -= latest.bytes();
            dropped.parts.push(latest.extend(replaced));
            self.step_bytes += latest.bytes();
        } else if replaced.group > self.last_dropped {
            self.keep(Step::Undo, replaced);
        } else {
            dropped.add(replaced);
        }
        self.trim(dropped);
    }

    /// Records a committed step that installed `used`; the parts that it replaced are the step in the other direction.
    pub fn record_step(
        &mut self,
        step: Step,
        used: &Arc<UndoDelta>,
        mut replaced: UndoDelta,
        dropped: &mut DeferredDrop,
    ) {
        replaced.count();
        // The budget may have dropped it meanwhile.
        if self.next(step).is_some_and(|next| Arc::ptr_eq(next, used)) {
            dropped.steps.extend(self.list(step).pop_back());
            self.step_bytes -= used.bytes();
        }
        let other = match step {
            Step::Undo => Step::Redo,
            Step::Redo => Step::Undo,
        };
        self.keep(other, replaced);
        self.trim(dropped);
    }

    fn keep(&mut self, step: Step, replaced: UndoDelta) {
        // No edit joins the step before it any more.
        if let Some(before) = self.undo.back_mut().and_then(Arc::get_mut) {
            before.close();
        }
        self.step_bytes += replaced.bytes();
        self.list(step).push_back(Arc::new(replaced));
    }

    /// Drops the steps farthest from the present, undo first, until the rest is within the budget.
    fn trim(&mut self, dropped: &mut DeferredDrop) {
        self.shrink();
        while self.bytes() > self.budget {
            let Some(gone) = self.undo.pop_front().or_else(|| self.redo.pop_front()) else { break };
            self.step_bytes -= gone.bytes();
            self.last_dropped = self.last_dropped.max(gone.group);
            dropped.steps.push(gone);
            self.shrink();
        }
    }

    /// Shrinks the lists. Their capacity depends only on how many steps there are; otherwise what is trimmed would
    /// depend on how many there were before.
    fn shrink(&mut self) {
        for list in [&mut self.undo, &mut self.redo] {
            let room = if list.is_empty() { 0 } else { list.len().next_power_of_two().max(4) };
            list.shrink_to(room);
        }
    }
}
