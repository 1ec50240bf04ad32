//! Applies entries of the log to the server's world.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::strokes::NoUndo;
use super::{Later, Ordered, Server, ServerEvent, UndoPolicy, UndoRequest};
use crate::brush::Edit;
use crate::lattice::RegionPos;
use crate::net::encoding::entry_bytes;
use crate::net::message::{Entry, Refusal, RegionHashes, ToClient};
use crate::net::price::{MAX_UNDO_BYTES, UNDO, UNDO_BYTES};
use crate::net::regions::run_submitted;
use crate::terrain::{Order, Patch, Receipt, World};

impl Server {
    /// Applies entries, as much as one call may.
    pub(super) fn apply(&mut self) {
        let mut left = self.settings.work.max(1);
        while left > 0 {
            let work = if !self.waiting.is_empty() {
                self.apply_some(left)
            } else if let Some(Later::Undo(request)) = self.later.pop_front() {
                let work = self.undo(&request);
                self.release();
                work
            } else {
                return;
            };
            left = left.saturating_sub(work);
        }
    }

    /// Applies the next entry, or edits that go into one transaction; returns their work.
    fn apply_some(&mut self, most: u64) -> u64 {
        let count = self.edits_together(most);
        if count > 0 {
            return self.apply_edits(count);
        }
        let Some(Ordered { entry, .. }) = self.waiting.pop_front() else { return 0 };
        let number = self.applied + 1;
        let (by, order) = match entry {
            Entry::Order { by, order } => (by, order),
            Entry::HashCheck => {
                self.send_hashes(number);
                self.applied = number;
                return 1;
            }
        };
        if let Order::Parts { change, .. } = order {
            self.put_parts(number, &change);
            if let Some((client, sequence)) = by {
                self.sequences.apply(client, sequence, number);
            }
            self.applied = number;
            return change.bricks.len() as u64 + 1;
        }
        // Rules were checked when they were ordered.
        self.terrain.submit(order);
        self.applied = number;
        1
    }

    /// How many edits at the front go into one transaction: all in a row, or where strokes are kept, those of one
    /// stroke.
    fn edits_together(&self, most: u64) -> usize {
        let keeps_strokes = self.settings.undo != UndoPolicy::Nobody;
        let (mut work, mut first) = (0_u64, None);
        let goes_on = |ordered: &&Ordered| {
            let Entry::Order { by: Some((author, _)), order: Order::Edit(_) } = &ordered.entry else {
                return false;
            };
            let stroke = (*author, ordered.labels.1);
            let goes_with = |first| !keeps_strokes || (stroke.1.is_some() && stroke == first);
            let fits = first.is_none_or(|first| goes_with(first) && work + ordered.cost <= most);
            work += ordered.cost;
            first = first.or(Some(stroke));
            fits
        };
        self.waiting.iter().take_while(goes_on).count()
    }

    fn apply_edits(&mut self, count: usize) -> u64 {
        let (mut edits, mut work, mut stroke) = (Vec::with_capacity(count), 0, None);
        let first = self.applied + 1;
        for (number, Ordered { entry, labels: (tag, label), cost }) in
            (first..).zip(self.waiting.drain(..count))
        {
            if let Entry::Order { by: Some((author, sequence)), order: Order::Edit(edit) } = entry {
                self.sequences.apply(author, sequence, number);
                stroke = Some((author, label));
                edits.push(edit.with_labels(tag, label));
                work += cost;
            }
        }
        self.waiting_cost = self.waiting_cost.saturating_sub(work);
        let receipts = self.transact(&edits, stroke.filter(|_| self.settings.undo != UndoPolicy::Nobody));
        self.applied += count as u64;
        for (number, receipt) in (first..).zip(receipts) {
            if receipt.is_local_failure() {
                self.fail(number);
            }
        }
        work.max(1)
    }

    /// Applies edits, and records the touched regions.
    fn transact(&mut self, edits: &[Edit], stroke: Option<(super::ClientId, Option<u64>)>) -> Vec<Receipt> {
        self.terrain.submit_all(edits);
        self.run_submitted(stroke)
    }

    /// Runs what was submitted, as part of a stroke that can be undone.
    fn run_submitted(&mut self, stroke: Option<(super::ClientId, Option<u64>)>) -> Vec<Receipt> {
        let (number, Self { terrain, sums, strokes, .. }) = (self.applied + 1, &mut *self);
        let record = |world: &World, change: &Patch| {
            if let Some((player, label)) = stroke
                && !change.bricks.is_empty()
            {
                strokes.record(player, label, world, change);
            }
        };
        let (receipts, regions) = run_submitted(terrain, sums, record);
        for region in regions {
            self.touched.insert(region);
            self.changed.insert(region, number);
        }
        receipts
    }

    fn put_parts(&mut self, number: u64, change: &Arc<Patch>) {
        self.terrain.submit(Order::parts(Arc::clone(change), None));
        // Where another error comes, nothing changed, and the same holds on all machines.
        if self.run_submitted(None).iter().any(Receipt::is_local_failure) {
            self.fail(number);
        }
    }

    pub(super) fn fail(&mut self, number: u64) {
        self.figures.failed += 1;
        self.failed.insert(number);
        #[cfg(feature = "store")]
        self.saved_log.iter_mut().for_each(|saved| saved.fail(number));
        self.report(ServerEvent::EntryFailed(number));
        self.send_to_all(&ToClient::Failed { number });
    }

    fn send_hashes(&mut self, number: u64) {
        let touched = std::mem::take(&mut self.touched);
        let regions = self.hashes_of(touched);
        self.send_to_all(&ToClient::Hashes { number, regions });
    }

    /// The present hashes of regions.
    pub(super) fn hashes_of(&mut self, regions: BTreeSet<RegionPos>) -> RegionHashes {
        let (world, sums) = (self.terrain.world(), &mut self.sums);
        regions.into_iter().map(|region| (region, sums.hash(world, region))).collect()
    }

    /// Undoes a stroke in the present world, which contains all entries ordered before; returns the work.
    fn undo(&mut self, request: &UndoRequest) -> u64 {
        self.waiting_cost = self.waiting_cost.saturating_sub(UNDO);
        let change = self.strokes.undo(request.of, self.terrain.world()).map_err(|why| match why {
            NoUndo::Nothing => Refusal::Nothing,
            NoUndo::Touched => Refusal::Touched,
        });
        let entry = change.and_then(|change| {
            let entry = Entry::of(request.by, request.sequence, Order::parts(change, None));
            let bytes = entry_bytes(&entry);
            if bytes <= MAX_UNDO_BYTES { Ok((entry, bytes)) } else { Err(Refusal::TooLarge) }
        });
        match entry {
            Ok((entry, bytes)) => {
                let now = self.now;
                self.players.player(request.by).cost.charge(now, bytes as u64 / UNDO_BYTES);
                self.number(Ordered { entry, labels: (0, None), cost: 0 });
                self.apply_some(u64::MAX)
            }
            Err(why) => {
                self.refuse(request.by, request.sequence, why);
                1
            }
        }
    }

    /// Orders the entries that waited for an undo, up to the next undo.
    fn release(&mut self) {
        while let Some(Later::Entry(ordered)) =
            self.later.pop_front_if(|later| matches!(later, Later::Entry(_)))
        {
            self.number(ordered);
        }
    }
}
