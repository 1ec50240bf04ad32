//! Undo and redo: what edits replaced, kept as far back as a budget of bytes allows.
//!
//! A step holds the bricks, fields and words of the mask that the edits of one group replaced: those of a stroke, or those
//! that were submitted together. Transactions know nothing of groups: one may hold many, and a stroke may take many. Bricks
//! are shared with whoever holds them, so a step takes as many bytes as there are bricks in it that nobody else holds. Going
//! back puts the old ones in place of the new, which in turn are what redo needs.

use std::collections::VecDeque;
use std::sync::Arc;

use super::change::{Change, ChangedBrick, GroupChange};
use super::world::World;
use crate::lattice::LatticeBox;
use crate::volume::MaterialCounts;

/// One step through a terrain's history.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum HistoryStep {
    /// Back to before the last group of edits: a stroke, or what was submitted together.
    Undo,
    /// What was undone last is done again.
    Redo,
}

/// What a terrain's history holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct History {
    /// Steps that can be undone.
    pub undos: usize,
    /// Steps that can be done again.
    pub redos: usize,
    /// Bytes that history alone holds. What it shares with the world is not counted.
    pub bytes: usize,
}

/// What became of a step. Each one that was submitted gets exactly one.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryReceipt {
    /// Back or forth.
    pub step: HistoryStep,
    /// What it changed, or why it changed nothing.
    pub outcome: Result<Restored, HistoryRejection>,
}

/// What a step through history changed. Inventories that follow receipts have to follow this as well; what fell as loose
/// pieces is among it here, though it is not among a receipt's `removed`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Restored {
    /// The tags of the brushes that it took back, or did again, in order; those that had changed nothing are left out.
    pub tags: Vec<u64>,
    /// Box around all samples that changed.
    pub bounds: Option<LatticeBox>,
    /// Voxels that are air now, by the material they had.
    pub removed: MaterialCounts,
    /// Voxels that are solid now, by the material they have.
    pub added: MaterialCounts,
    /// Solid voxels whose material changed, by the new one.
    pub painted: MaterialCounts,
}

/// Why a step changed nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum HistoryRejection {
    /// Nothing was edited, all of it was undone, or the budget of bytes did not reach so far back.
    #[error("there is nothing to undo")]
    NothingToUndo,
    /// Nothing was undone since the last edit, or the budget of bytes had no room for it.
    #[error("there is nothing to redo")]
    NothingToRedo,
    /// The terrain was removed before the step's turn came, or the entity never had one.
    #[error("the terrain is gone")]
    TerrainGone,
    /// Too much work [waits](super::WorkLimits::waiting).
    #[error("too much work waits already")]
    Overloaded,
    /// Taking it panicked. The world is as it was before, and so is its history.
    #[error("the step panicked; this is a bug of the plugin's")]
    Panicked,
}

impl HistoryStep {
    /// The answer where there is nothing to do.
    pub(super) fn nothing(self) -> HistoryReceipt {
        let why = match self {
            Self::Undo => HistoryRejection::NothingToUndo,
            Self::Redo => HistoryRejection::NothingToRedo,
        };
        HistoryReceipt { step: self, outcome: Err(why) }
    }
}

/// What a group of edits replaced.
pub(super) struct Step {
    pub change: Change,
    /// A box around everything in it.
    pub bounds: Option<LatticeBox>,
    /// Bytes of its bricks that nobody else holds.
    pub brick_bytes: usize,
    /// Whose edits they were.
    pub group: u64,
    /// The tags of those that changed something.
    pub tags: Vec<u64>,
}

impl Step {
    /// A step of what a change replaced, which was put in its place.
    pub fn new(GroupChange { change, replaced_bytes, group, tags }: GroupChange) -> Self {
        let boxes = change.bricks.iter().map(|(pos, _)| pos.samples());
        let bounds = boxes.reduce(LatticeBox::union);
        Self { change, bounds, brick_bytes: replaced_bytes, group, tags }
    }

    /// Takes in what later edits of the same group replaced; returns what they did not replace first.
    fn go_on(&mut self, later: Self) -> Vec<ChangedBrick> {
        let (bytes, left) = self.change.go_back_to_before(later.change);
        self.brick_bytes += bytes;
        self.bounds = self.bounds.into_iter().chain(later.bounds).reduce(LatticeBox::union);
        self.tags.reserve_exact(later.tags.len());
        self.tags.extend(later.tags);
        left
    }

    /// Bytes that go with it, the counters of its `Arc` included.
    fn bytes(&self) -> usize {
        let own = 2 * size_of::<usize>() + size_of::<Self>() + size_of_val(&self.tags[..]);
        own + self.change.bytes() + self.brick_bytes
    }
}

/// What a terrain let go of: steps, and a copy of the world that was not needed. Freeing many bricks takes its time, so it
/// is left to whoever has some.
#[derive(Default)]
pub(crate) struct DeferredDrop {
    steps: Vec<Arc<Step>>,
    bricks: Vec<Vec<ChangedBrick>>,
    pub(super) copy: Option<Arc<World>>,
}

impl DeferredDrop {
    /// Is there nothing to free?
    #[cfg(any(feature = "plugin", test))]
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty() && self.bricks.is_empty() && self.copy.is_none()
    }
}

/// The steps of a terrain, back and forth.
pub(super) struct UndoStack {
    /// The oldest first.
    undo: VecDeque<Arc<Step>>,
    /// The one that was undone last stands last.
    redo: VecDeque<Arc<Step>>,
    budget: usize,
    /// Bytes of all steps.
    held: usize,
    /// The greatest number of a group whose step the budget had no room for: what is left of it is no step either.
    lost: u64,
}

impl UndoStack {
    /// An empty one with a budget of bytes.
    pub fn new(budget: usize) -> Self {
        Self { undo: VecDeque::new(), redo: VecDeque::new(), budget, held: 0, lost: 0 }
    }

    fn list(&mut self, step: HistoryStep) -> &mut VecDeque<Arc<Step>> {
        match step {
            HistoryStep::Undo => &mut self.undo,
            HistoryStep::Redo => &mut self.redo,
        }
    }

    /// What the next step back or forth puts in place.
    pub fn next(&self, step: HistoryStep) -> Option<&Arc<Step>> {
        match step {
            HistoryStep::Undo => self.undo.back(),
            HistoryStep::Redo => self.redo.back(),
        }
    }

    /// What there is.
    pub fn figures(&self) -> History {
        History { undos: self.undo.len(), redos: self.redo.len(), bytes: self.bytes() }
    }

    fn bytes(&self) -> usize {
        self.held + (self.undo.capacity() + self.redo.capacity()) * size_of::<Arc<Step>>()
    }

    /// Does some step reach these samples?
    pub fn reaches(&self, samples: LatticeBox) -> bool {
        let meets = |step: &Arc<Step>| step.bounds.is_some_and(|own| own.intersection(samples).is_some());
        self.undo.iter().chain(&self.redo).any(meets)
    }

    /// Bytes that it may take.
    pub fn budget(&self) -> usize {
        self.budget
    }

    /// A new budget; what it has no room for goes.
    pub fn set_budget(&mut self, budget: usize) -> DeferredDrop {
        self.budget = budget;
        let mut waste = DeferredDrop::default();
        self.trim(&mut waste);
        waste
    }

    /// Forgets all steps.
    pub fn clear(&mut self) {
        (self.undo, self.redo, self.held) = Default::default();
    }

    /// Edits of a group were committed: they can be undone now, with those of their group before them, and nothing can be
    /// redone.
    pub fn record(&mut self, replaced: Step, waste: &mut DeferredDrop) {
        let first = waste.steps.len();
        waste.steps.extend(self.redo.drain(..));
        self.held -= waste.steps[first..].iter().map(|step| step.bytes()).sum::<usize>();
        let latest = self.undo.back_mut().filter(|latest| latest.group == replaced.group);
        // A transaction that goes back holds a step that no edit can join any more.
        if let Some(latest) = latest.and_then(Arc::get_mut) {
            self.held -= latest.bytes();
            waste.bricks.push(latest.go_on(replaced));
            self.held += latest.bytes();
        } else if replaced.group > self.lost {
            self.keep(HistoryStep::Undo, replaced);
        } else {
            waste.steps.push(Arc::new(replaced));
        }
        self.trim(waste);
    }

    /// A step was committed that put `used` in place; what that replaced is the step in the other direction.
    pub fn passed(&mut self, step: HistoryStep, used: &Arc<Step>, replaced: Step, waste: &mut DeferredDrop) {
        // The budget may have let go of it meanwhile.
        if self.next(step).is_some_and(|next| Arc::ptr_eq(next, used)) {
            waste.steps.extend(self.list(step).pop_back());
            self.held -= used.bytes();
        }
        let other = match step {
            HistoryStep::Undo => HistoryStep::Redo,
            HistoryStep::Redo => HistoryStep::Undo,
        };
        self.keep(other, replaced);
        self.trim(waste);
    }

    fn keep(&mut self, step: HistoryStep, replaced: Step) {
        self.held += replaced.bytes();
        self.list(step).push_back(Arc::new(replaced));
    }

    /// Lets go of what is farthest from now, back first, until the rest is within the budget.
    fn trim(&mut self, waste: &mut DeferredDrop) {
        self.fit();
        while self.bytes() > self.budget {
            let Some(gone) = self.undo.pop_front().or_else(|| self.redo.pop_front()) else { break };
            self.held -= gone.bytes();
            self.lost = self.lost.max(gone.group);
            waste.steps.push(gone);
            self.fit();
        }
    }

    /// Gives back the room of lists that they have for steps that are gone. What is left follows from how many steps there
    /// are, or what is trimmed would depend on how many there were.
    fn fit(&mut self) {
        for list in [&mut self.undo, &mut self.redo] {
            let room = if list.is_empty() { 0 } else { list.len().next_power_of_two().max(4) };
            list.shrink_to(room);
        }
    }
}
