//! Submitting orders to a terrain, and their receipts.

use super::model::Terrain;
use super::order::{Order, Request};
use super::queue::{Together, WorkLimits};
use super::receipt::{Applied, Receipt, Rejection};
use crate::world::unique;

/// The most untaken receipts that are kept; then the oldest are dropped.
const KEPT_RECEIPTS: usize = 1 << 16;

impl Terrain {
    /// Queues a brush, an edit or any other [order](Order), after everything that was submitted before. An edit is a
    /// separate step of undo, unless it is part of a [stroke](crate::brush::Brush::stroke).
    ///
    /// The receipt comes with the commit of its transaction. An invalid order is rejected in turn, and one that exceeds
    /// the [limits](Self::set_work_limits) [at once](Self::take_receipts). Rules and settings of loose pieces take
    /// effect at once, for later edits.
    pub fn submit(&mut self, order: impl Into<Request>) {
        self.submit_all([order]);
    }

    /// Queues brushes, edits and other orders. Edits that follow each other are one step of undo, except for those that
    /// are part of strokes. Rules and settings of loose pieces have no receipt, unless the rules are invalid.
    ///
    /// ```
    /// # use bevy_burrow::prelude::*;
    /// # use glam::Vec3;
    /// # let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
    /// # let dig = |x| Brush::dig(Shape::sphere(Vec3::new(x, 10.0, 32.0), 4.0));
    /// terrain.submit_all([dig(20.0), dig(30.0)]);
    /// terrain.submit(dig(40.0));
    /// // Two strokes of a pen that come bit by bit.
    /// for (x, stroke) in [(24.0, 1), (26.0, 1), (28.0, 2)] {
    ///     terrain.submit(dig(x).with_stroke(stroke));
    /// }
    /// # while let Some(transaction) = terrain.begin() {
    /// #     terrain.commit(transaction.run())?;
    /// # }
    /// # assert_eq!(terrain.history().undos, 4);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn submit_all<O: Into<Request>>(&mut self, orders: impl IntoIterator<Item = O>) {
        let together = Together::Batch(unique());
        for order in orders {
            let request = order.into();
            let (kind, tag) = (request.kind(), request.tag);
            let outcome = match self.admit(&request) {
                Ok(work) => self.queue_order(request, work, together),
                Err(full) => Err(full),
            };
            if let Err(why) = outcome {
                self.answer(Receipt { kind, tag, outcome: Err(why) });
            }
        }
    }

    /// The work of an order, if there is room for it. Rules and settings of loose pieces are not queued, and cost
    /// nothing.
    ///
    /// # Errors
    /// When there is no room.
    pub(crate) fn admit(&self, request: &Request) -> Result<u64, Rejection> {
        if request.kind().is_setting() {
            return Ok(0);
        }
        let work = request.work(self.world.grid());
        if self.queue.has_room(work) { Ok(work) } else { Err(Rejection::Overloaded) }
    }

    /// Queues an order of this much work, whether there is room for it or not.
    ///
    /// # Errors
    /// When rules are invalid.
    pub(crate) fn queue_order(
        &mut self,
        request: Request,
        work: u64,
        together: Together,
    ) -> Result<(), Rejection> {
        match request.order {
            Ok(Order::Rules(rules)) => self.replace_rules(rules)?,
            Ok(Order::Loose(settings)) => self.set_loose(settings),
            _ => self.queue.push(request, work, together, self.edit_settings.clone()),
        }
        Ok(())
    }

    /// Sets how much work a transaction takes, and how much may wait. Takes effect at once; orders that wait already
    /// stay.
    pub fn set_work_limits(&mut self, limits: WorkLimits) {
        self.queue.limits = limits;
    }

    /// Limits of the work in a transaction and of the work that may wait.
    pub fn work_limits(&self) -> WorkLimits {
        self.queue.limits
    }

    /// The work of everything that waits, the running transaction included, in bricks as [`WorkLimits`] counts them.
    pub fn waiting_work(&self) -> u64 {
        self.queue.work()
    }

    /// Carries out orders at once, after everything that waits: queues them, runs and commits transactions in one call,
    /// on this thread. Returns their receipts; those of orders that waited are kept for
    /// [`take_receipts`](Self::take_receipts). This is for tools and tests; in a game the plugin does it.
    ///
    /// Rules and settings of loose pieces have no receipt, unless the rules are invalid: then it comes last, behind
    /// those of all orders.
    ///
    /// Edits that follow each other are one step of undo, except for strokes among them; a game that replays a journal
    /// may want to [clear](Self::clear_history) history afterwards. The limits on waiting work do not apply.
    ///
    /// A transaction that is running elsewhere is abandoned first; its commit will be rejected as
    /// [stale](super::StaleCommit).
    pub fn apply<O: Into<Request>>(&mut self, orders: impl IntoIterator<Item = O>) -> Vec<Receipt> {
        self.abandon();
        let waiting = self.queue.len();
        let together = Together::Batch(unique());
        let mut invalid = Vec::new();
        for order in orders {
            let request = order.into();
            let kind = request.kind();
            let work = request.work(self.world.grid());
            let outcome = self.queue_order(request, work, together);
            invalid.extend(outcome.err().map(|why| Receipt::of(kind, Err(why))));
        }
        let mut receipts = self.finish();
        let mut own = receipts.split_off(waiting.min(receipts.len()));
        receipts.into_iter().for_each(|receipt| self.answer(receipt));
        own.append(&mut invalid);
        own
    }

    /// Carries out one order at once, like [`apply`](Self::apply).
    pub fn apply_one(&mut self, order: impl Into<Request>) -> Receipt {
        let request = order.into();
        let kind = request.kind();
        // Valid rules and settings of loose pieces have none.
        self.apply([request]).pop().unwrap_or_else(|| Receipt::of(kind, Ok(Applied::default())))
    }

    /// Undoes the last group of edits at once, after everything that waits; see [`Order::Undo`].
    pub fn undo(&mut self) -> Receipt {
        self.apply_one(Order::Undo)
    }

    /// Redoes at once the step that was undone last, after everything that waits; see [`Order::Redo`].
    pub fn redo(&mut self) -> Receipt {
        self.apply_one(Order::Redo)
    }

    /// Runs and commits everything that waits; returns one receipt for each order.
    pub(super) fn finish(&mut self) -> Vec<Receipt> {
        let kept = std::mem::take(&mut self.receipts);
        let mut receipts = Vec::new();
        loop {
            let transaction = self.begin();
            // Of steps that found nothing.
            receipts.extend(self.receipts.drain(..));
            let Some(transaction) = transaction else { break };
            receipts.append(&mut self.commit(transaction.run()).unwrap_or_default());
        }
        self.receipts = kept;
        receipts
    }

    /// Receipts that no commit returned, in order; each is returned once. They are of orders that there was no room
    /// for, of steps through history that found nothing to do when [`begin`](Self::begin) took them, and of orders that
    /// waited when [`apply`](Self::apply) was called. If they are not taken, the latest 65,536 are kept.
    ///
    /// In a Bevy app the plugin takes those of edits and steps, and sends them as messages. Those of parts and grounds
    /// are left here, also if the plugin commits them.
    pub fn take_receipts(&mut self) -> Vec<Receipt> {
        std::mem::take(&mut self.receipts).into()
    }

    /// Keeps a receipt until it is taken.
    pub(super) fn answer(&mut self, receipt: Receipt) {
        if self.receipts.len() == KEPT_RECEIPTS {
            self.receipts.pop_front();
        }
        self.receipts.push_back(receipt);
    }
}
