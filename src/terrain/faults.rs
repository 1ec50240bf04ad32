//! Transactions that panic: the edit that is to blame is found and rejected, and the others are applied without it.

use std::sync::Arc;

use super::Work;
use super::commit::Commit;
use super::history::{HistoryReceipt, HistoryRejection};
use super::queue::Submission;
use super::receipt::{Receipt, Rejection};
use super::redraw::MeshUpdates;
use super::transaction::{Panicked, Transaction};

impl Transaction {
    /// Computes the commit of a transaction that panicked. Runs it once more, as what panicked may have been no edit, and
    /// then as often as halving takes for each edit that is to blame.
    pub(super) fn run_without_faults(mut self) -> Commit {
        if let Ok(commit) = self.attempt() {
            return commit;
        }
        while let Work::Edits(submissions) = &self.work {
            let Some(fault) = self.first_fault(submissions) else { break };
            let mut submissions = submissions.to_vec();
            submissions[fault].edit = Err(Rejection::Panicked);
            self.work = Work::Edits(submissions.into());
            if let Ok(commit) = self.attempt() {
                return commit;
            }
        }
        self.refused()
    }

    /// The last of the fewest edits that panic together; `None` where not even all of them are to blame.
    fn first_fault(&self, submissions: &[Submission]) -> Option<usize> {
        // So many run, and so many panic.
        let (mut fine, mut faulty) = (0, submissions.len());
        while faulty - fine > 1 {
            let middle = fine.midpoint(faulty);
            match self.attempt_first(&submissions[..middle]) {
                Ok(()) => fine = middle,
                Err(Panicked) => faulty = middle,
            }
        }
        let last = faulty.checked_sub(1)?;
        submissions[last].edit.is_ok().then_some(last)
    }

    fn attempt_first(&self, submissions: &[Submission]) -> Result<(), Panicked> {
        let work = Work::Edits(Arc::from(submissions));
        Self { work, ..self.clone() }.attempt().map(drop)
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
