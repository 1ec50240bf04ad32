//! The queue: orders that wait for their transaction.
//!
//! Rules, loose settings and the group of an edit are fixed when it is submitted, so the result does not depend on when
//! transactions begin.

use std::collections::VecDeque;
use std::sync::Arc;

use super::edit_settings::EditSettings;
use super::order::{Order, Request};
use super::receipt::{OrderKind, Rejection};
use crate::brush::Edit;

/// Limits of a terrain's work, in bricks of 8x8x8 samples that edits may reach: see [`Terrain::set_work_limits`].
///
/// A brick takes the CPU about 0.3 us in large edits and 2 us in an edit of a few voxels. Searches for loose pieces are
/// not counted: each has a [budget](super::LooseSettings) that follows from its edit. A step through history counts as
/// a fixed amount.
///
/// [`Terrain::set_work_limits`]: super::Terrain::set_work_limits
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WorkLimits {
    /// The maximum work in a transaction, which holds at least one edit in any case; other edits wait for the next.
    /// Smaller transactions are shown sooner, larger ones take less time per edit.
    pub transaction: u64,
    /// The maximum work that may wait, the running transaction included. An edit that would exceed it is
    /// [rejected](Rejection::Overloaded) when it is submitted, unless nothing else waits.
    pub waiting: u64,
}

impl WorkLimits {
    /// No limits: one transaction takes everything that waits, and nothing is rejected. For tools and tests.
    pub const UNBOUNDED: Self = Self { transaction: u64::MAX, waiting: u64::MAX };
}

impl Default for WorkLimits {
    /// About a thirtieth of a second for a transaction and two seconds for waiting work, on two cores.
    fn default() -> Self {
        Self { transaction: 100_000, waiting: 6_000_000 }
    }
}

/// The reason why consecutive edits are one step of undo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Together {
    /// The edits belong to one stroke.
    Stroke(u64),
    /// The edits were submitted together, in the batch with this number.
    Batch(u64),
}

/// An order that was submitted, and what was fixed then.
#[derive(Clone, Debug)]
pub(crate) struct Submission {
    pub tag: u64,
    /// Only edits are rejected before their turn comes.
    pub order: Result<Order, Rejection>,
    /// Edits with the same number are one step of undo; later ones have greater numbers.
    pub(super) group: u64,
    pub(super) edit_settings: EditSettings,
    work: u64,
}

impl Submission {
    /// The edit, if it is a valid one.
    pub(super) fn edit(&self) -> Option<&Edit> {
        self.order.as_ref().ok().and_then(Order::edit)
    }

    /// The kind of its order.
    pub(super) fn kind(&self) -> OrderKind {
        self.order.as_ref().map_or(OrderKind::Edit, Order::kind)
    }

    /// Returns `true` if it belongs to the same group, under the same rules and loose settings.
    pub(super) fn goes_with(&self, other: &Self) -> bool {
        self.group == other.group && self.edit_settings.is_same(&other.edit_settings)
    }

    /// Whether it is a transaction of its own.
    fn is_alone(&self) -> bool {
        self.order.as_ref().is_ok_and(Order::is_alone)
    }
}

/// Orders that wait, and the work of these and of the transaction under way.
#[derive(Default)]
pub(super) struct Queue {
    submissions: VecDeque<Submission>,
    pub limits: WorkLimits,
    work: u64,
    /// The group of the latest edit, while another edit may join it.
    open: Option<(Together, u64)>,
    groups: u64,
}

impl Queue {
    /// Queues an order of this much work. An edit joins the group of the one before it if both belong `together`; edits
    /// after any other order begin a new group.
    pub fn push(&mut self, request: Request, work: u64, together: Together, edit_settings: EditSettings) {
        let is_edit = request.kind() == OrderKind::Edit;
        let together = request.stroke.map_or(together, Together::Stroke);
        let group = match self.open {
            Some((open, group)) if open == together => group,
            _ => self.groups + 1,
        };
        self.groups = self.groups.max(group);
        self.open = is_edit.then_some((together, group));
        self.work += work;
        let Request { tag, order, .. } = request;
        let order = order.map_err(Rejection::from);
        self.submissions.push_back(Submission { tag, order, group, edit_settings, work });
    }

    /// Makes the next edit begin a new group.
    pub fn close_group(&mut self) {
        self.open = None;
    }

    /// Returns `true` if there is room for this much work.
    pub fn has_room(&self, work: u64) -> bool {
        self.work == 0 || self.work.saturating_add(work) <= self.limits.waiting
    }

    /// The work of everything that waits, the running transaction included.
    pub fn work(&self) -> u64 {
        self.work
    }

    /// Subtracts work that is done.
    pub fn finish(&mut self, work: u64) {
        self.work = self.work.saturating_sub(work);
    }

    /// Takes the orders of the next transaction, and their work: edits up to its limit, or one order that is a
    /// transaction of its own.
    pub fn take(&mut self) -> Option<(Arc<[Submission]>, u64)> {
        let is_single = self.submissions.front()?.is_alone();
        let mut work = 0_u64;
        let is_taken = |own: &&Submission| {
            let fits = work == 0 || work.saturating_add(own.work) <= self.limits.transaction;
            let is_apart = work != 0 && (is_single || own.is_alone());
            work += if fits { own.work } else { 0 };
            fits && !is_apart
        };
        let count = self.submissions.iter().take_while(is_taken).count();
        let taken: Arc<[Submission]> = self.submissions.drain(..count).collect();
        // Frees what a flood of edits needed.
        if self.submissions.is_empty() {
            self.submissions.shrink_to(1);
        }
        let work = taken.iter().map(|submission| submission.work).sum();
        Some((taken, work))
    }

    /// Returns orders that were taken but not done to the front of the queue.
    pub fn put_back(&mut self, submissions: &[Submission]) {
        submissions.iter().rev().for_each(|own| self.submissions.push_front(own.clone()));
    }

    /// Takes over the orders and limits of another queue; this queue is empty.
    #[cfg(all(feature = "plugin", feature = "store"))]
    pub fn take_over(&mut self, other: &mut Self) {
        *self = Self { limits: other.limits, ..std::mem::take(other) };
    }

    /// Replaces the rules and loose settings of waiting orders that have the old ones.
    #[cfg(all(feature = "plugin", feature = "store"))]
    pub fn change_settings(&mut self, old: &EditSettings, new: &EditSettings) {
        for submission in self.submissions.iter_mut().filter(|own| own.edit_settings.is_same(old)) {
            submission.edit_settings.clone_from(new);
        }
    }

    /// Drops all orders.
    #[cfg(feature = "plugin")]
    pub fn clear(&mut self) {
        *self = Self { limits: self.limits, groups: self.groups, ..Self::default() };
    }

    pub fn len(&self) -> usize {
        self.submissions.len()
    }

    pub fn iter(&self) -> impl Iterator<Item = &Submission> {
        self.submissions.iter()
    }
}
