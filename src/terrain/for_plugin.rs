//! The plugin's interface to a terrain, in addition to the public one.

use std::sync::Arc;

use super::commit::Commit;
#[cfg(feature = "store")]
use super::edit_settings::EditSettings;
use super::history::DeferredDrop;
use super::model::{StaleCommit, Terrain};
use super::pending_display::PendingDisplay;
use super::receipt::{OrderKind, Receipt};
use crate::redraw::DrawnCut;
#[cfg(feature = "store")]
use crate::volume::RulesError;
use crate::world::Version;

impl Terrain {
    /// Whether a transaction that the plugin began is running.
    pub(crate) fn waits_for_plugin(&self) -> bool {
        self.in_flight.as_ref().is_some_and(|waiting| waiting.is_plugins)
    }

    /// Drops queued and running work, for which all receipts have been sent.
    pub(crate) fn forget(&mut self) {
        self.in_flight = None;
        self.pending_display = None;
        self.queue.clear();
    }

    /// What has no receipt yet, in order: its kind, and the tags of edits.
    pub(crate) fn unanswered(&self) -> impl Iterator<Item = (OrderKind, u64)> {
        let in_flight = self.in_flight.iter().flat_map(|waiting| waiting.work.submissions());
        in_flight.chain(self.queue.iter()).map(|own| (own.kind(), own.tag))
    }

    /// Whether there are receipts of such orders to take.
    pub(crate) fn has_receipts(&self, is_wanted: impl Fn(OrderKind) -> bool) -> bool {
        self.receipts.iter().any(|receipt| is_wanted(receipt.kind))
    }

    /// Takes the receipts of such orders; the others stay.
    pub(crate) fn take_receipts_of(&mut self, is_wanted: impl Fn(OrderKind) -> bool) -> Vec<Receipt> {
        let all = std::mem::take(&mut self.receipts).into_iter();
        let (taken, kept) = all.partition(|receipt| is_wanted(receipt.kind));
        self.receipts = kept;
        Vec::from(taken)
    }

    /// From now on the plugin shows this world, and wants to know what else is committed to it.
    pub(crate) fn watch(&mut self) {
        self.pending_display = Some(PendingDisplay::nothing(self.world.version()));
    }

    /// The changes that the game committed since `shown`; `None` if they are not known.
    pub(crate) fn take_pending_display(&mut self, shown: Version) -> Option<PendingDisplay> {
        let now = self.world.version();
        let pending = self.pending_display.replace(PendingDisplay::nothing(now))?;
        (pending.follows(shown) && pending.version() == now).then_some(pending)
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
    pub(crate) fn forget_pending_display(&mut self) {
        self.pending_display = None;
    }

    /// Sets the cut to draw from now on, or the whole world in full detail; the plugin shows it.
    pub(crate) fn draw_from_now_on(&mut self, drawn: Option<Arc<DrawnCut>>) {
        self.drawn_cut = drawn;
    }

    /// Sets the rules and loose settings that a game has set for the terrain in whose place this one comes: a new version
    /// of the game may have others than the one that saved it. Those that the game has not set stay.
    ///
    /// # Errors
    /// The rules are not valid for this ground. They stay as they were.
    #[cfg(feature = "store")]
    pub(crate) fn adopt_settings(&mut self, settings: &EditSettings) -> Result<(), RulesError> {
        if settings.loose.is_some() && settings.loose.as_ref() != self.loose() {
            self.set_loose(settings.loose);
        }
        match settings.rules.as_deref() {
            Some(rules) if self.rules() != Some(rules) => self.set_rules(rules.clone()),
            _ => Ok(()),
        }
    }

    /// Replaces a terrain: takes over its queue, engine, limits and undo budget. Queued edits obey the rules
    /// of this terrain.
    #[cfg(feature = "store")]
    pub(crate) fn take_over(&mut self, old: &mut Self) {
        old.abandon();
        self.queue.take_over(&mut old.queue);
        self.queue.change_settings(&old.edit_settings, &self.edit_settings);
        self.receipts.append(&mut old.receipts);
        if let Some(engine) = old.engine() {
            self.set_engine(engine.clone());
        }
        self.set_undo_budget(old.undo_budget());
        self.set_meshing(old.meshing());
    }

    /// Commits a transaction that the plugin began and shows. Returns the receipts of edits; the others are kept until
    /// they are taken. The caller may drop the other data on another thread.
    pub(crate) fn commit_shown(
        &mut self,
        commit: Commit,
    ) -> Result<(Vec<Receipt>, DeferredDrop), StaleCommit> {
        let (mut receipts, dropped) = self.install(commit)?;
        let others = receipts.extract_if(.., |receipt| receipt.kind != OrderKind::Edit);
        others.for_each(|receipt| self.answer(receipt));
        if let Some(pending) = &mut self.pending_display {
            *pending = PendingDisplay::nothing(self.world.version());
        }
        Ok((receipts, dropped))
    }
}
