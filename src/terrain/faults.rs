//! Transactions that panic: the edit that is to blame is found and rejected, and the others are applied without it.

use super::Work;
use super::commit::Commit;
use super::history::{HistoryReceipt, HistoryRejection};
use super::queue::Submission;
use super::receipt::{Receipt, Rejection};
use super::redraw::MeshUpdates;
use super::transaction::{Panicked, Transaction};

/// So many edits are found to be to blame; what comes after the last of them is rejected with them, or the search for many
/// would keep everybody waiting.
const MOST_FAULTS: usize = 16;

impl Transaction {
    /// Computes the commit of a transaction that panicked. Runs it once more, as what panicked may have been no edit, and
    /// then as often as halving takes for each edit that is to blame.
    pub(super) fn run_without_faults(mut self) -> Commit {
        if let Ok(commit) = self.attempt() {
            return commit;
        }
        let Work::Edits(all) = &self.work else { return self.refused() };
        let mut submissions = all.to_vec();
        // So many are known to run together.
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
        self.refused()
    }

    /// The last of the fewest edits that panic together, where so many are known not to and all do.
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

    /// The commit that changes nothing, and says so to everybody.
    pub(super) fn refused(&self) -> Commit {
        let commit = self.commit(Vec::new(), self.world.sample_hash, MeshUpdates::default());
        match &self.work {
            Work::Edits(submissions) => {
                let refused = |own: &Submission| Receipt {
                    tag: own.tag,
                    outcome: Err(own.edit.as_ref().err().cloned().unwrap_or(Rejection::Panicked)),
                };
                Commit { receipts: submissions.iter().map(refused).collect(), ..commit }
            }
            Work::Step(step, _) => {
                let outcome = Err(HistoryRejection::Panicked);
                Commit { moved: Some(HistoryReceipt { step: *step, outcome }), ..commit }
            }
        }
    }
}
