//! The queue: edits and steps through history that wait for their transaction.
//!
//! Rules, loose settings and the group of an edit are fixed when it is submitted, so the result does not depend on when
//! transactions begin.

use std::collections::VecDeque;
use std::sync::Arc;

use super::history::HistoryStep;
use super::receipt::Rejection;
use super::replacement::Put;
use crate::brush::{Edit, Kind};
use crate::edits::reach;
use crate::lattice::{BrickPos, ChunkGrid, LatticeBox};
use crate::loose::LooseSettings;
use crate::volume::DiggingRules;

/// Limits of a terrain's work, in bricks of 8x8x8 samples that edits may reach: see [`Terrain::set_work_limits`].
///
/// A brick takes the CPU about 0.3 us in large edits and 2 us in an edit of a few voxels. Searches for loose pieces are
/// not counted: each has a [budget](super::LooseSettings) that follows from its edit. A step through history counts as a fixed
/// amount.
///
/// [`Terrain::set_work_limits`]: super::Terrain::set_work_limits
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WorkLimits {
    /// Most work of a transaction, which holds at least one edit in any case; other edits wait for the next. Smaller
    /// transactions are shown sooner, larger ones take less time per edit.
    pub transaction: u64,
    /// Most work that may wait, the running transaction included. An edit that would exceed it is
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

/// The fixed work of an edit, in bricks.
const EDIT: u64 = 20;
/// The work that a step through history counts as, in bricks.
const STEP: u64 = 200;
/// How many times as much work a brick is for an operation that reads a stencil around each sample.
const LOOKS_AROUND: u64 = 4;

/// The work of an edit, in bricks.
fn work_of(grid: ChunkGrid, edit: &Edit) -> u64 {
    let weight = if edit.kind() == Kind::Sculpt { LOOKS_AROUND } else { 1 };
    EDIT + weight * reach(grid, edit).map_or(0, |reach| BrickPos::range(reach).volume())
}

/// The reason why consecutive edits are one step of undo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Together {
    /// They belong to one stroke.
    Stroke(u64),
    /// They were submitted together, in the batch with this number.
    Batch(u64),
}

/// Everything about an edit that is fixed when it is submitted.
#[derive(Clone, Debug)]
pub(super) struct Terms {
    /// Edits with the same number are one step of undo; later ones have greater numbers.
    pub group: u64,
    /// `None`: no restrictions.
    pub rules: Option<Arc<DiggingRules>>,
    /// `None`: loose pieces are not searched for.
    pub loose: Option<LooseSettings>,
}

impl Terms {
    fn is_same(&self, other: &Self) -> bool {
        let same_rules = match (&self.rules, &other.rules) {
            (None, None) => true,
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            _ => false,
        };
        same_rules && self.group == other.group && self.loose == other.loose
    }
}

/// An edit that was submitted.
#[derive(Clone, Debug)]
pub(crate) struct Submission {
    pub tag: u64,
    pub edit: Result<Edit, Rejection>,
    pub(super) terms: Terms,
    work: u64,
}

impl Submission {
    /// Returns `true` if it belongs to the same group, under the same rules and loose settings.
    pub(super) fn goes_with(&self, other: &Self) -> bool {
        self.terms.is_same(&other.terms)
    }

    /// Returns `true` if it certainly changes none of these samples.
    pub(super) fn misses(&self, samples: LatticeBox) -> bool {
        self.edit.as_ref().map_or(true, |edit| edit.reach().intersection(samples).is_none())
    }
}

/// Requests that wait for their transaction.
#[expect(clippy::large_enum_variant, reason = "almost all are edits")]
pub(super) enum Request {
    Edit(Submission),
    Step(HistoryStep),
    Put(Arc<Put>),
}

impl Request {
    fn work(&self) -> u64 {
        match self {
            Self::Edit(submission) => submission.work,
            Self::Step(_) | Self::Put(_) => STEP,
        }
    }
}

/// Requests in order, and the work of these and of the transaction under way.
#[derive(Default)]
pub(super) struct Queue {
    requests: VecDeque<Request>,
    pub limits: WorkLimits,
    work: u64,
    /// The group of the latest edit, while another edit may join it.
    open: Option<(Together, u64)>,
    groups: u64,
}

impl Queue {
    /// Queues an edit that is valid or not.
    pub fn push_edit(
        &mut self,
        grid: ChunkGrid,
        tag: u64,
        edit: Result<Edit, Rejection>,
        together: Together,
        (rules, loose): (Option<Arc<DiggingRules>>, Option<LooseSettings>),
    ) {
        let group = match self.open {
            Some((open, group)) if open == together => group,
            _ => {
                self.groups += 1;
                self.groups
            }
        };
        self.open = Some((together, group));
        let work = edit.as_ref().map_or(EDIT, |edit| work_of(grid, edit));
        self.work += work;
        let terms = Terms { group, rules, loose };
        self.requests.push_back(Request::Edit(Submission { tag, edit, terms, work }));
    }

    /// Queues a step. Edits after it begin a new group.
    pub fn push_step(&mut self, step: HistoryStep) {
        self.close_group();
        self.work += STEP;
        self.requests.push_back(Request::Step(step));
    }

    /// Queues replacement parts. Edits after them begin a new group.
    pub fn push_put(&mut self, put: Put) {
        self.close_group();
        self.work += STEP;
        self.requests.push_back(Request::Put(Arc::new(put)));
    }

    /// Makes the next edit begin a new group.
    pub fn close_group(&mut self) {
        self.open = None;
    }

    /// Returns `true` if there is room for an edit, valid or not.
    pub fn has_room(&self, grid: ChunkGrid, edit: Option<&Edit>) -> bool {
        self.fits(edit.map_or(EDIT, |edit| work_of(grid, edit)))
    }

    /// Returns `true` if there is room for a step.
    pub fn has_room_for_step(&self) -> bool {
        self.fits(STEP)
    }

    fn fits(&self, more: u64) -> bool {
        self.work == 0 || self.work.saturating_add(more) <= self.limits.waiting
    }

    /// The work of everything that waits, the running transaction included.
    pub fn work(&self) -> u64 {
        self.work
    }

    /// Subtracts work that is done.
    pub fn finish(&mut self, work: u64) {
        self.work = self.work.saturating_sub(work);
    }

    /// Takes the next step, or edits up to the first step and to the limit of a transaction; and their work.
    pub fn take(&mut self) -> Option<(Taken, u64)> {
        let single = match self.requests.front()? {
            Request::Edit(_) => None,
            Request::Step(step) => Some(Taken::Step(*step)),
            Request::Put(put) => Some(Taken::Put(Arc::clone(put))),
        };
        if let Some(single) = single {
            self.requests.pop_front();
            return Some((single, STEP));
        }
        let mut work = 0_u64;
        // A reset is a transaction of its own.
        let is_reset = |request: &Request| match request {
            Request::Edit(own) => own.edit.as_ref().is_ok_and(|edit| edit.kind() == Kind::Reset),
            Request::Step(_) | Request::Put(_) => false,
        };
        let is_single = self.requests.front().is_some_and(is_reset);
        let is_taken = |request: &&Request| {
            let fits = work == 0 || work.saturating_add(request.work()) <= self.limits.transaction;
            let is_alone = work != 0 && (is_single || is_reset(request));
            work += if fits { request.work() } else { 0 };
            fits && !is_alone && matches!(request, Request::Edit(_))
        };
        let count = self.requests.iter().take_while(is_taken).count();
        let edits = self.requests.drain(..count).filter_map(|request| match request {
            Request::Edit(submission) => Some(submission),
            Request::Step(_) | Request::Put(_) => None,
        });
        let edits: Arc<[Submission]> = edits.collect();
        // Frees what a flood of edits needed.
        if self.requests.is_empty() {
            self.requests.shrink_to(1);
        }
        let work = edits.iter().map(|submission| submission.work).sum();
        Some((Taken::Edits(edits), work))
    }

    /// Returns requests that were taken but not done to the front of the queue.
    pub fn put_back(&mut self, requests: impl DoubleEndedIterator<Item = Request>) {
        requests.rev().for_each(|request| self.requests.push_front(request));
    }

    /// Takes over the requests and limits of another queue; this queue is empty.
    #[cfg(all(feature = "plugin", feature = "store"))]
    pub fn take_over(&mut self, other: &mut Self) {
        *self = Self { limits: other.limits, ..std::mem::take(other) };
    }

    /// Replaces the rules and loose settings of waiting edits that have these ones.
    #[cfg(all(feature = "plugin", feature = "store"))]
    pub fn change_terms(
        &mut self,
        (old_rules, old_loose): (&Option<Arc<DiggingRules>>, &Option<LooseSettings>),
        (rules, loose): (&Option<Arc<DiggingRules>>, &Option<LooseSettings>),
    ) {
        let edits = self.requests.iter_mut().filter_map(|request| match request {
            Request::Edit(submission) => Some(&mut submission.terms),
            Request::Step(_) | Request::Put(_) => None,
        });
        for terms in edits {
            let is_old = match (&terms.rules, old_rules) {
                (Some(own), Some(old)) => Arc::ptr_eq(own, old),
                (own, old) => own.is_none() && old.is_none(),
            };
            if is_old && terms.loose == *old_loose {
                (terms.rules, terms.loose) = (rules.clone(), *loose);
            }
        }
    }

    /// Drops all requests.
    #[cfg(feature = "plugin")]
    pub fn clear(&mut self) {
        *self = Self { limits: self.limits, groups: self.groups, ..Self::default() };
    }

    pub fn len(&self) -> usize {
        self.requests.len()
    }

    pub fn iter(&self) -> impl Iterator<Item = &Request> {
        self.requests.iter()
    }

    /// The edits among them.
    pub fn edits(&self) -> impl Iterator<Item = &Submission> {
        self.requests.iter().filter_map(|request| match request {
            Request::Edit(submission) => Some(submission),
            Request::Step(_) | Request::Put(_) => None,
        })
    }
}

/// The work of a transaction.
pub(super) enum Taken {
    Edits(Arc<[Submission]>),
    Step(HistoryStep),
    Put(Arc<Put>),
}
