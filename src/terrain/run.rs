//! Running a transaction, from its snapshot to a commit.
//!
//! ```text
//! edits -> bricks -> mask -> dirty blocks -> parts -> chunk meshes
//!                \       \-> touched tiles -> index lists
//!                 \-> fields, receipts
//! step  -> bricks, fields, mask of another time -> the same
//! ```
//!
//! Where it panics, the edit that is to blame is found and rejected, and the others are applied without it.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;

use super::commit::Commit;
use super::history::{HistoryReceipt, HistoryRejection};
use super::log::RecordDraft;
use super::queue::Submission;
use super::receipt::{Receipt, Rejection};
use super::resolve::{self, ChangeError};
use super::transaction::{Transaction, Work};
use crate::backend::{Compute, Cpu, Engine};
use crate::brush::Kind;
use crate::edits::reach;
use crate::lattice::{BrickPos, ItemCost};
use crate::redraw;
use crate::redraw::{ChooseCut, MeshUpdates, Stages};
use crate::world::World;

/// At most this many faulty edits are found. All edits after the last of them are rejected too, because the search for
/// more would take too long.
const MOST_FAULTS: usize = 16;

/// A transaction panicked.
#[derive(Debug)]
struct Panicked;

impl Transaction {
    /// Computes the commit on another engine than the terrain's own.
    pub fn run_on(self, engine: &Engine) -> Commit {
        Self { engine: Some(engine.clone()), ..self }.run()
    }

    /// Computes the commit. Runs on any thread; large transactions use the threads of the current rayon pool, and the
    /// result does not depend on how many those are.
    ///
    /// An edit that panics is [rejected](super::Rejection::Panicked), and the others are applied without it.
    pub fn run(self) -> Commit {
        self.attempt().unwrap_or_else(|_| self.run_without_faults())
    }

    /// Computes the commit, unless that panics: then nothing has changed.
    fn attempt(&self) -> Result<Commit, Panicked> {
        // Unwind safe: a transaction only reads the world, and its own lists are cleared before use.
        std::panic::catch_unwind(AssertUnwindSafe(|| self.compute())).map_err(|_| Panicked)
    }

    fn compute(&self) -> Commit {
        let backend = self.engine.as_ref().map_or(&Cpu as &dyn Compute, Engine::compute);
        #[cfg(test)]
        panic_if_marked(&self.work);
        let run = || match &self.work {
            Work::Edits(submissions) => match &submissions[..] {
                [own @ Submission { edit: Ok(edit), .. }] if edit.kind() == Kind::Reset => {
                    resolve::reset(self, own, edit, backend)
                }
                all => resolve::edit(self, all, backend),
            },
            Work::Step(step, target) => resolve::step(self, *step, target, backend),
            Work::Put(parts) => resolve::put(self, parts, backend),
            Work::Cut(choose) => self.cut(choose.as_ref()),
        };
        // A large one runs on a thread of the pool: entering the pool for each stage would take longer.
        let commit = if self.is_large() { rayon::scope(|_| run()) } else { run() };
        // Terrain and transaction hold the world. If others do too, the commit changes a copy, which is made here.
        let is_changed = !matches!(self.work, Work::Cut(_)) && commit.whole.is_none();
        let is_shared = Arc::strong_count(&self.world) > 2 && is_changed;
        let mut stages = commit.stages;
        let copy = || is_shared.then(|| Arc::new(World::clone(&self.world)));
        let copy = Stages::time(&mut stages.whole, copy);
        let record = self.is_logged.then(|| RecordDraft::new(&self.work, &commit));
        Commit { copy, record, stages, ..commit }
    }

    /// Returns `true` if it may reach enough bricks for several threads.
    fn is_large(&self) -> bool {
        match &self.work {
            Work::Edits(submissions) => {
                let edits = submissions.iter().filter_map(|submission| submission.edit.as_ref().ok());
                let bricks = edits
                    .filter_map(|edit| reach(self.world.grid, edit))
                    .map(|reach| BrickPos::range(reach).volume());
                ItemCost::Lookup
                    .is_shared(usize::try_from(bricks.fold(0, u64::saturating_add)).unwrap_or(usize::MAX))
            }
            Work::Step(_, target) => ItemCost::Lookup.is_shared(target.change.patch.bricks.len()),
            Work::Put(put) => {
                let bricks =
                    if put.ground.is_some() { self.world.bricks.len() } else { put.change.bricks.len() };
                ItemCost::Lookup.is_shared(bricks)
            }
            Work::Cut(_) => true,
        }
    }

    /// Computes the commit that leads to another cut.
    fn cut(&self, choose: &ChooseCut) -> Commit {
        let mut meshes = MeshUpdates::default();
        if let Some(drawn) = &self.drawn_cut {
            let (after, nodes) = redraw::change_cut(&self.world, drawn, choose);
            (meshes.drawn_cut, meshes.nodes) = (Some(after), nodes);
        }
        self.commit(Vec::new(), self.world.sample_hash, meshes)
    }

    /// Computes the commit of a transaction that panicked. Runs it once more, because the panic may not have come from
    /// an edit, and then finds each edit that is to blame by bisection.
    fn run_without_faults(mut self) -> Commit {
        if let Ok(commit) = self.attempt() {
            return commit;
        }
        let Work::Edits(all) = &self.work else { return self.rejected() };
        let mut submissions = all.to_vec();
        // This many are known to run together.
        let mut fine = 0;
        for found in 1..=MOST_FAULTS {
            let fault = self.first_fault(&submissions, fine);
            let rejected = if found == MOST_FAULTS { fault..submissions.len() } else { fault..fault + 1 };
            for own in submissions.iter_mut().take(rejected.end).skip(rejected.start) {
                if own.edit.is_ok() {
                    own.edit = Err(Rejection::Panicked);
                }
            }
            fine = fault + 1;
            self.work = Work::Edits(submissions.as_slice().into());
            if let Ok(commit) = self.attempt() {
                return commit;
            }
        }
        self.rejected()
    }

    /// The last edit of the shortest list of first edits that panics; the first `fine` are known not to panic, all of
    /// them do.
    fn first_fault(&self, submissions: &[Submission], mut fine: usize) -> usize {
        let mut faulty = submissions.len();
        while faulty > fine + 1 {
            let middle = fine.midpoint(faulty);
            let work = Work::Edits(submissions[..middle].into());
            match (Self { work, ..self.clone() }).attempt() {
                Ok(_) => fine = middle,
                Err(Panicked) => faulty = middle,
            }
        }
        fine.min(submissions.len().saturating_sub(1))
    }

    /// The commit that changes nothing and rejects all edits, or the step.
    pub(super) fn rejected(&self) -> Commit {
        let commit = self.commit(Vec::new(), self.world.sample_hash, MeshUpdates::default());
        match &self.work {
            Work::Edits(submissions) => {
                let rejected = |own: &Submission| Receipt {
                    tag: own.tag,
                    outcome: Err(own.edit.as_ref().err().cloned().unwrap_or(Rejection::Panicked)),
                };
                Commit { receipts: submissions.iter().map(rejected).collect(), ..commit }
            }
            Work::Step(step, _) => {
                let outcome = Err(HistoryRejection::Panicked);
                Commit { step: Some(HistoryReceipt { step: *step, outcome }), ..commit }
            }
            Work::Put(_) => Commit { put: Some(Err(ChangeError::Panicked)), ..commit },
            Work::Cut(_) => commit,
        }
    }
}

/// The tag of an edit that panics in tests has this bit.
#[cfg(test)]
pub(super) const PANICS: u64 = 1 << 63;

/// Panics for an edit that is marked, but not once it is rejected for that.
#[cfg(test)]
fn panic_if_marked(work: &Work) {
    if let Work::Edits(submissions) = work
        && submissions.iter().any(|own| own.tag & PANICS != 0 && own.edit.is_ok())
    {
        // Without a message: thousands do.
        std::panic::resume_unwind(Box::new("a marked edit"));
    }
}
