//! Applies entries of the log, and reports what they do.

use std::collections::BTreeMap;

use super::super::encoding::entry_bytes;
use super::super::message::{ClientId, Entry};
use super::super::price::{UNDO, UNDO_BYTES};
use super::join::Stage;
use super::repair::Repair;
use super::{Client, ClientEvent};
use crate::lattice::{LatticeBox, RegionPos};
use crate::terrain::{Order, Patch, Receipt};

/// The maximum number of entries that one [`advance`](Client::advance) applies.
const BATCH: usize = 2048;

impl Client {
    /// Applies entries that have come, as many as one call may; returns whether more could be.
    pub(super) fn follow(&mut self) -> bool {
        let mut left = BATCH;
        loop {
            self.finish_repair();
            self.begin_repair();
            let Some(end) = self.applicable() else { return false };
            let batch = self.next_batch(end, left);
            if batch.is_empty() {
                return left == 0;
            }
            left -= batch.len();
            self.apply(batch);
        }
    }

    /// The number up to which entries may be applied now; `None` if none may.
    fn applicable(&self) -> Option<u64> {
        match self.stage {
            Stage::ByLog { to, .. } => Some(to),
            Stage::Following => self.repair.as_ref().map_or(Some(u64::MAX), Repair::number),
            _ => None,
        }
    }

    /// The next entries up to a number, at most `most`. A hash check ends them, and parts are returned alone,
    /// because pieces that they turn into ground have to be found.
    fn next_batch(&mut self, end: u64, most: usize) -> Vec<Entry> {
        let (mut batch, mut number) = (Vec::new(), self.number());
        let is_parts = |entry: Option<&Entry>| entry.is_some_and(|entry| entry.parts().is_some());
        while number < end
            && batch.len() < most
            && (batch.is_empty() || !is_parts(self.waiting.get(&(number + 1))))
            && let Some(entry) = self.waiting.remove(&(number + 1))
        {
            number += 1;
            let entry = self.valid(number, entry);
            let is_compared = matches!((&entry, &self.stage), (Entry::HashCheck, Stage::Following));
            let is_checked = is_compared || entry.parts().is_some();
            batch.push(entry);
            if is_checked {
                break;
            }
        }
        batch
    }

    fn apply(&mut self, batch: Vec<Entry>) {
        let Some(mut epoch) = self.epoch else { return };
        let id = self.id;
        let sequence_of = |entry: &Entry| entry.edit().and_then(|_| entry.number_of(id));
        let is_reported = !self.is_history();
        let tag = |sequence| Some((sequence, self.replica.pending_edit(sequence)?.tag()));
        let tags: BTreeMap<u64, u64> = batch.iter().filter_map(sequence_of).filter_map(tag).collect();
        for entry in &batch {
            if let Some(sequence) = entry.number_of(id) {
                let cost = entry.parts().map(|_| UNDO + entry_bytes(entry) as u64 / UNDO_BYTES);
                self.outbox.answer(sequence, cost, self.now);
            }
        }
        let reach_of_parts = batch.first().and_then(|first| reach(first.parts()?));
        let ground = reach_of_parts.map(|reach| self.ground_pieces(Some(reach))).unwrap_or_default();
        let applied = self.replica.apply(&batch, sequence_of);
        let mut receipts = applied.receipts.into_iter();
        for entry in &batch {
            epoch.number += 1;
            let Entry::Order { by, order } = entry else { continue };
            match order {
                Order::Edit(edit) => {
                    self.reaches.note(epoch.number, edit.reach());
                    let Some(receipt) = receipts.next() else { continue };
                    // Its player may have been here before, in another client.
                    match sequence_of(entry).and_then(|sequence| tags.get(&sequence).copied()) {
                        Some(tag) => {
                            let receipt = Receipt { tag, ..receipt };
                            self.confirm_pieces(sequence_of(entry), &receipt);
                            self.events.push(ClientEvent::Confirmed { tag, receipt: Some(receipt) });
                        }
                        None if is_reported => {
                            self.confirm_pieces(None, &receipt);
                            let author = by.map_or(ClientId::SERVER, |(author, _)| author);
                            self.events.push(ClientEvent::RemoteEdit { author, receipt });
                        }
                        None => {}
                    }
                }
                Order::Parts { change, .. } => {
                    let mut restored = receipts.next().and_then(|receipt| receipt.outcome.ok());
                    let is_missing = restored.is_none();
                    let reach = reach(change);
                    let returned =
                        reach.map(|reach| self.check_pieces(Some(reach), &ground)).unwrap_or_default();
                    restored.iter_mut().for_each(|restored| restored.returned.clone_from(&returned));
                    if entry.number_of(id).is_some_and(|sequence| self.undos.remove(&sequence)) {
                        self.events.push(ClientEvent::Undone(restored));
                    }
                    reach.into_iter().for_each(|reach| self.reaches.note(epoch.number, reach));
                    if applied.failed_locally && is_missing {
                        let regions = change.bricks.iter().map(|(pos, _)| RegionPos::of(*pos));
                        self.doubtful.extend(regions);
                    }
                }
                _ => {}
            }
        }
        self.figures.applied += batch.len() as u64;
        self.epoch = Some(epoch);
        if matches!(self.stage, Stage::Following) {
            self.hash_checks.touch(applied.regions);
            if matches!(batch.last(), Some(Entry::HashCheck)) {
                self.hash_checks.record_ours(epoch.number, &mut self.replica);
            }
        }
        self.finish_log();
    }
}

/// A box around all bricks of a change.
fn reach(change: &Patch) -> Option<LatticeBox> {
    change.bricks.iter().map(|(pos, _)| pos.samples()).reduce(LatticeBox::union)
}
