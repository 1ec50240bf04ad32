//! Submitting edits to a terrain, and the receipts for them.

use std::borrow::Borrow;

use super::model::Terrain;
use super::order::{Order, OrderError};
use super::queue::{Together, WorkLimits};
use super::receipt::{Receipt, Rejection};
use crate::brush::{Brush, Edit};
use crate::world::unique;

impl Terrain {
    /// Queues a brush as a separate step of undo, unless it is part of a [stroke](Brush::stroke). An invalid brush is
    /// queued too: its receipt says why it was rejected. A brush that exceeds the [limits](Self::set_work_limits) is
    /// answered [at once](Self::take_answered).
    pub fn submit(&mut self, brush: &Brush) {
        self.submit_all([brush]);
    }

    /// Queues brushes as one step of undo, except for those that are part of strokes.
    ///
    /// ```
    /// # use bevy_burrow::prelude::*;
    /// # use glam::Vec3;
    /// # let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
    /// # let dig = |x| Brush::dig(Shape::sphere(Vec3::new(x, 10.0, 32.0), 4.0));
    /// terrain.submit_all([dig(20.0), dig(30.0)]);
    /// terrain.submit(&dig(40.0));
    /// // Two strokes of a pen that come bit by bit.
    /// for (x, stroke) in [(24.0, 1), (26.0, 1), (28.0, 2)] {
    ///     terrain.submit(&dig(x).with_stroke(stroke));
    /// }
    /// # while let Some(transaction) = terrain.begin() {
    /// #     terrain.commit(transaction.run())?;
    /// # }
    /// # assert_eq!(terrain.history().undos, 4);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn submit_all<B: Borrow<Brush>>(&mut self, brushes: impl IntoIterator<Item = B>) {
        let together = Together::Batch(unique());
        for brush in brushes {
            let brush = brush.borrow();
            self.queue_or_answer(
                brush.tag,
                Edit::quantize(brush).map_err(Into::into),
                brush.stroke,
                together,
            );
        }
    }

    /// Queues an edit, for example from a file or the network. It is checked like a brush, and becomes a step
    /// of undo as a brush does.
    pub fn submit_edit(&mut self, edit: &Edit) {
        self.submit_edits([edit]);
    }

    /// Queues edits as one step of undo, except for those that are part of strokes.
    pub fn submit_edits<E: Borrow<Edit>>(&mut self, edits: impl IntoIterator<Item = E>) {
        let together = Together::Batch(unique());
        for edit in edits {
            let edit = edit.borrow();
            let checked = edit.check().map(|()| edit.clone()).map_err(Into::into);
            self.queue_or_answer(edit.tag(), checked, edit.stroke(), together);
        }
    }

    fn queue_or_answer(
        &mut self,
        tag: u64,
        edit: Result<Edit, Rejection>,
        stroke: Option<u64>,
        together: Together,
    ) {
        match self.admit(edit.as_ref().ok()) {
            Ok(()) => self.queue_edit(tag, edit, stroke, together),
            Err(rejection) => self.answer(Receipt { tag, outcome: Err(rejection) }),
        }
    }

    /// Submits an order. Rules and settings hold for edits that are submitted later; everything else is queued, and
    /// answered like what is submitted by [`submit_edit`](Self::submit_edit), [`submit_undo`](Self::submit_undo),
    /// [`submit_change`](Self::submit_change) and [`submit_ground`](Self::submit_ground).
    ///
    /// # Errors
    /// When rules are invalid, when a ground has another size, or when there is no room for parts or a ground.
    pub fn submit_order(&mut self, order: Order) -> Result<(), OrderError> {
        match order {
            Order::Edit(edit) => self.submit_edit(&edit),
            Order::Undo => self.submit_undo(),
            Order::Redo => self.submit_redo(),
            Order::Parts { change, hash } => self.submit_change(change, hash)?,
            Order::Ground(ground) => self.submit_ground(ground)?,
            Order::Rules(rules) => self.set_rules(rules.as_deref().cloned().unwrap_or_default())?,
            Order::Loose(settings) => self.set_loose(settings),
        }
        Ok(())
    }

    /// Carries out orders at once, after everything that waits; returns the receipts of the edits.
    ///
    /// # Errors
    /// When an order can't be submitted, or parts or a ground among them do not fit; those before may be obeyed then.
    pub(crate) fn obey(
        &mut self,
        orders: impl IntoIterator<Item = Order>,
    ) -> Result<Vec<Receipt>, OrderError> {
        self.abandon();
        let mut replacements = 0;
        for order in orders {
            replacements += usize::from(matches!(order, Order::Parts { .. } | Order::Ground(_)));
            self.submit_order(order)?;
        }
        let receipts = self.finish();
        // Theirs are the last.
        let others = self.change_receipts.len().saturating_sub(replacements);
        self.change_receipts.split_off(others).into_iter().try_for_each(|receipt| receipt.map(drop))?;
        Ok(receipts)
    }

    /// Returns `true` if there is room for an edit. `None` stands for an invalid edit, which is queued too and gets its
    /// receipt in turn.
    pub(crate) fn admit(&self, edit: Option<&Edit>) -> Result<(), Rejection> {
        let has_room = self.queue.has_room(self.world.grid(), edit);
        if has_room { Ok(()) } else { Err(Rejection::Overloaded) }
    }

    /// Queues an edit, whether there is room for it or not.
    pub(crate) fn queue_edit(
        &mut self,
        tag: u64,
        edit: Result<Edit, Rejection>,
        stroke: Option<u64>,
        together: Together,
    ) {
        let together = stroke.map_or(together, Together::Stroke);
        let terms = (self.rules.clone(), self.loose);
        self.queue.push_edit(self.world.grid(), tag, edit, together, terms);
    }

    /// Sets how much work a transaction takes, and how much may wait. Takes effect at once; what waits already stays.
    pub fn set_work_limits(&mut self, limits: WorkLimits) {
        self.queue.limits = limits;
    }

    /// Limits of the work in a transaction and of the work that may wait.
    pub fn work_limits(&self) -> WorkLimits {
        self.queue.limits
    }

    /// The work of all that waits, the transaction under way included, in bricks as [`WorkLimits`] counts them.
    pub fn waiting_work(&self) -> u64 {
        self.queue.work()
    }

    /// Applies brushes at once, after everything that waits: queue, transactions and commits in one call, on this
    /// thread. Returns the receipts of these brushes; those of brushes that waited are kept for
    /// [`take_answered`](Self::take_answered). Tools and tests want this; a game lets the plugin do it.
    ///
    /// All of them are one step of undo, except for strokes among them; a game that replays a journal may want to
    /// [clear](Self::clear_history) history afterwards. The limits on waiting work do not apply.
    ///
    /// A transaction that is under way elsewhere is given up first; its commit will be rejected as
    /// [stale](super::StaleCommit).
    pub fn apply<B: Borrow<Brush>>(&mut self, brushes: impl IntoIterator<Item = B>) -> Vec<Receipt> {
        self.abandon();
        let waiting = self.queue.edits().count();
        let together = Together::Batch(unique());
        for brush in brushes {
            let brush = brush.borrow();
            self.queue_edit(brush.tag, Edit::quantize(brush).map_err(Into::into), brush.stroke, together);
        }
        let mut receipts = self.finish();
        let own = receipts.split_off(waiting.min(receipts.len()));
        receipts.into_iter().for_each(|receipt| self.answer(receipt));
        own
    }

    /// Runs and commits everything that waits.
    pub(super) fn finish(&mut self) -> Vec<Receipt> {
        let mut receipts = Vec::new();
        while let Some(transaction) = self.begin() {
            receipts.append(&mut self.commit(transaction.run()).unwrap_or_default());
        }
        receipts
    }

    /// Receipts of brushes that waited when [`apply`](Self::apply) was called, and of those that there was no room for,
    /// in order; each is returned once. If they are not taken, the latest 65,536 are kept.
    pub fn take_answered(&mut self) -> Vec<Receipt> {
        std::mem::take(&mut self.answered).into()
    }

    /// Returns `true` if there is a receipt to [take](Self::take_answered).
    pub fn has_answered(&self) -> bool {
        !self.answered.is_empty()
    }
}
