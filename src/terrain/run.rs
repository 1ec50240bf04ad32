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
use super::log::RecordDraft;
use super::order::Order;
use super::queue::Submission;
use super::receipt::{Receipt, Rejection};
use super::resolve::{self, Resolved};
use super::transaction::Transaction;
use super::work::Work;
use crate::backend::{Compute, Cpu, Engine};
use crate::edits::max_bricks;
use crate::lattice::ItemCost;
use crate::redraw;
use crate::redraw::{ChooseCut, Scene, Stages};
use crate::world::World;

/// At most this many faulty edits are found. All edits after the last of them are rejected too, because the search for
/// more would take too long.
const MAX_FAULTS: usize = 16;

/// A transaction panicked.
#[derive(Debug)]
struct Panicked;

impl Transaction {
    /// Computes the commit on another engine than the terrain's own.
    pub fn run_on(self, engine: &Engine) -> Commit {
        Self { engine: Some(engine.clone()), ..self }.run()
    }

    /// Computes the commit on another engine than the terrain's own, and returns the world before it too. It must be
    /// dropped before the commit is installed, otherwise that copies the world.
    #[cfg(feature = "plugin")]
    pub(crate) fn run_with_world(self, engine: &Engine) -> (Commit, Arc<World>) {
        let own = Self { engine: Some(engine.clone()), ..self };
        let commit = own.attempt().unwrap_or_else(|_| own.clone().run_without_faults());
        (commit, own.world)
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
        let scene = self.scene(backend);
        let run = || match &self.work {
            Work::Orders(submissions, target) => resolve::orders(scene, submissions, target.as_deref()),
            Work::Cut(choose) => cut(scene, choose.as_ref()),
        };
        // A large one runs on a thread of the pool: entering the pool for each stage would take longer.
        let mut resolved = if self.is_large() { rayon::scope(|_| run()) } else { run() };
        // Terrain and transaction hold the world. If others do too, the commit changes a copy, which is made here.
        let is_changed = !self.work.is_cut() && resolved.outcome.whole.is_none();
        let is_shared = Arc::strong_count(&self.world) > 2 && is_changed;
        let copy = || is_shared.then(|| Arc::new(World::clone(&self.world)));
        let copy = Stages::time(&mut resolved.stages.whole, copy);
        let commit = self.commit(resolved);
        let record = self
            .is_logged
            .then(|| RecordDraft::new(self.work.submissions(), &commit.outcome.receipts, commit.change()));
        Commit { copy, record, ..commit }
    }

    /// The commit of what its work leads to.
    fn commit(&self, resolved: Resolved) -> Commit {
        Commit::new(self.ticket, self.work.is_cut(), resolved)
    }

    /// Returns `true` if it may reach enough bricks for several threads.
    fn is_large(&self) -> bool {
        let bricks = |own: &Submission| match &own.order {
            Ok(Order::Edit(edit)) => max_bricks(self.world.grid, edit).unwrap_or(0),
            Ok(Order::Parts { change, .. }) => change.bricks.len() as u64,
            Ok(Order::Ground(_)) => self.world.bricks.len() as u64,
            _ => self.work.target().map_or(0, |target| target.change.patch.bricks.len() as u64),
        };
        let bricks = self.work.submissions().iter().map(bricks).fold(0, u64::saturating_add);
        self.work.is_cut() || ItemCost::Lookup.is_shared(usize::try_from(bricks).unwrap_or(usize::MAX))
    }

    /// Computes the commit of a transaction that panicked. Runs it once more, because the panic may not have come from
    /// an edit, and then finds each edit that is to blame by bisection.
    fn run_without_faults(mut self) -> Commit {
        if let Ok(commit) = self.attempt() {
            return commit;
        }
        let mut submissions = self.work.submissions().to_vec();
        if submissions.is_empty() || self.work.edits().count() < submissions.len() {
            return self.rejected();
        }
        // This many are known to run together.
        let mut fine = 0;
        for found in 1..=MAX_FAULTS {
            let fault = self.first_fault(&submissions, fine);
            let rejected = if found == MAX_FAULTS { fault..submissions.len() } else { fault..fault + 1 };
            for own in submissions.iter_mut().take(rejected.end).skip(rejected.start) {
                if own.order.is_ok() {
                    own.order = Err(Rejection::Panicked);
                }
            }
            fine = fault + 1;
            self.work = Work::Orders(submissions.as_slice().into(), None);
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
            let work = Work::Orders(submissions[..middle].into(), None);
            match (Self { work, ..self.clone() }).attempt() {
                Ok(_) => fine = middle,
                Err(Panicked) => faulty = middle,
            }
        }
        fine.min(submissions.len().saturating_sub(1))
    }

    /// The commit that changes nothing and rejects all orders.
    pub(super) fn rejected(&self) -> Commit {
        let rejected = |own: &Submission| Receipt {
            kind: own.kind(),
            tag: own.tag,
            outcome: Err(own.order.as_ref().err().cloned().unwrap_or(Rejection::Panicked)),
        };
        let mut resolved = Resolved::nothing(&self.world);
        resolved.outcome.receipts = self.work.submissions().iter().map(rejected).collect();
        self.commit(resolved)
    }
}

/// Resolves a new cut.
fn cut(scene: Scene, choose: &ChooseCut) -> Resolved {
    let mut resolved = Resolved::nothing(scene.world);
    if let Some(drawn) = scene.cut {
        let (after, nodes) = redraw::change_cut(scene.world, drawn, choose);
        (resolved.meshes.drawn_cut, resolved.meshes.nodes) = (Some(after), nodes);
    }
    resolved
}

/// The tag of an edit that panics in tests has this bit.
#[cfg(test)]
pub(super) const PANICS: u64 = 1 << 63;

/// Panics for an edit that is marked, but not once it is rejected for that.
#[cfg(test)]
fn panic_if_marked(work: &Work) {
    if work.submissions().iter().any(|own| own.tag & PANICS != 0 && own.order.is_ok()) {
        // Without a message: thousands do.
        std::panic::resume_unwind(Box::new("a marked edit"));
    }
}
