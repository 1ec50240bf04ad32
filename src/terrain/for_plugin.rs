//! The plugin's interface to a terrain, in addition to the public one.

use std::sync::Arc;

use super::commit::Commit;
use super::history::{DeferredDrop, HistoryStep};
use super::model::{StaleCommit, Terrain};
use super::queue::{Request, Submission};
use super::receipt::Receipt;
use super::unseen::Unseen;
use super::work::Work;
use crate::redraw::DrawnCut;
use crate::world::Version;

impl Terrain {
    /// Whether a transaction that the plugin began is running.
    pub(crate) fn waits_for_plugin(&self) -> bool {
        self.in_flight.as_ref().is_some_and(|waiting| waiting.is_plugins)
    }

    /// Drops queued and running work, for which all receipts have been sent.
    pub(crate) fn forget(&mut self) {
        self.in_flight = None;
        self.unseen = None;
        self.queue.clear();
    }

    /// Tags of all brushes without a receipt, in order.
    pub(crate) fn unanswered(&self) -> impl Iterator<Item = u64> {
        self.submissions_in_flight().chain(self.queue.edits()).map(|submission| submission.tag)
    }

    fn submissions_in_flight(&self) -> impl Iterator<Item = &Submission> {
        self.in_flight.iter().flat_map(|waiting| match &waiting.work {
            Work::Edits(submissions) => &submissions[..],
            Work::Step(..) | Work::Put(_) | Work::Cut(_) => &[],
        })
    }

    /// All steps through history without a receipt, in order.
    pub(crate) fn unanswered_steps(&self) -> impl Iterator<Item = HistoryStep> {
        let in_flight = self.in_flight.iter().filter_map(|waiting| match waiting.work {
            Work::Step(step, _) => Some(step),
            Work::Edits(_) | Work::Put(_) | Work::Cut(_) => None,
        });
        let queued = self.queue.iter().filter_map(|request| match request {
            Request::Step(step) => Some(*step),
            Request::Edit(_) | Request::Put(_) => None,
        });
        in_flight.chain(queued)
    }

    /// How many [changes](Terrain::submit_change) have no receipt yet.
    #[cfg(feature = "replicon")]
    pub(crate) fn waiting_changes(&self) -> usize {
        let in_flight = self.in_flight.iter().filter(|waiting| matches!(waiting.work, Work::Put(_)));
        in_flight.count() + self.queue.iter().filter(|request| matches!(request, Request::Put(_))).count()
    }

    /// From now on the plugin shows this world, and wants to know what else is committed to it.
    pub(crate) fn watch(&mut self) {
        self.unseen = Some(Unseen::nothing(self.world.version()));
    }

    /// The changes that the game committed since `shown`; `None` if they are not known.
    pub(crate) fn take_unseen(&mut self, shown: Version) -> Option<Unseen> {
        let now = self.world.version();
        let unseen = self.unseen.replace(Unseen::nothing(now))?;
        (unseen.follows(shown) && unseen.version() == now).then_some(unseen)
    }

    /// The commit that rejects everything in the transaction with this ticket, because its task panicked; `None` if it
    /// is not running.
    pub(crate) fn rejected(&self, ticket: u64) -> Option<Commit> {
        let waiting = self.in_flight.as_ref().filter(|waiting| waiting.ticket == ticket)?;
        let work = waiting.work.clone();
        Some(self.transaction(ticket, work).rejected())
    }

    /// Whether the transaction with this ticket is running.
    pub(crate) fn waits_for(&self, ticket: u64) -> bool {
        self.in_flight.as_ref().is_some_and(|waiting| waiting.ticket == ticket)
    }

    /// Drops changes that are not shown yet; the plugin then has to show the whole world again.
    pub(crate) fn forget_unseen(&mut self) {
        self.unseen = None;
    }

    /// Sets the cut to draw from now on, or the whole world in full detail; the plugin shows it.
    pub(crate) fn draw_from_now_on(&mut self, drawn: Option<Arc<DrawnCut>>) {
        self.drawn_cut = drawn;
    }

    /// Replaces a terrain: takes over its queue, engine, limits and undo budget. Queued edits obey the rules
    /// of this terrain.
    #[cfg(feature = "store")]
    pub(crate) fn take_over(&mut self, old: &mut Self) {
        old.abandon();
        self.queue.take_over(&mut old.queue);
        self.queue.change_terms((&old.rules, &old.loose), (&self.rules, &self.loose));
        self.answered.append(&mut old.answered);
        self.step_receipts.append(&mut old.step_receipts);
        self.change_receipts.append(&mut old.change_receipts);
        if let Some(engine) = old.engine() {
            self.set_engine(engine.clone());
        }
        self.set_undo_budget(old.undo_budget());
        self.set_meshing(old.meshing());
    }

    /// Commits a transaction that the plugin began and shows. The caller may drop the returned data on another thread.
    pub(crate) fn commit_shown(
        &mut self,
        commit: Commit,
    ) -> Result<(Vec<Receipt>, DeferredDrop), StaleCommit> {
        let done = self.install(commit)?;
        if let Some(unseen) = &mut self.unseen {
            *unseen = Unseen::nothing(self.world.version());
        }
        Ok(done)
    }
}
