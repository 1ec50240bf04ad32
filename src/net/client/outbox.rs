//! Sends the player's edits and undos to the server, in order, as fast as its limits allow, so nothing is refused for
//! its cost, even after a long time without a connection.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::super::bucket::{Bucket, Rate};
use super::super::message::{ClientId, MAX_EDITS, ToServer};
use super::super::price::{MAX_UNDO_BYTES, UNDO, UNDO_BYTES};
use crate::brush::Edit;

/// What is to be sent.
enum Item {
    Edit(Edit),
    Undo(ClientId),
}

/// What it costs.
#[derive(Clone, Copy)]
struct Cost {
    /// As soon as it arrives.
    known: u64,
    /// At most.
    most: u64,
}

/// Edits and undos that wait to be sent, and those that the server has not answered.
///
/// It mirrors the server's bucket, less the possible cost of messages in transit: even if these are delayed and arrive
/// at once, the server's bucket holds enough.
pub struct Outbox {
    waiting: VecDeque<(u64, Cost, Item)>,
    bucket: Bucket,
    burst: u64,
    /// The most that the part of the bucket holds that is mirrored.
    mirrored: u64,
    /// The costs of edits and undos in transit, by sequence number.
    on_the_way: BTreeMap<u64, Cost>,
    /// The cost of everything in transit, without the parts that undos restore.
    cost: u64,
    /// The greatest sequence number that was handed over to be sent.
    sent: u64,
}

impl Outbox {
    /// For a server that has just sent the refill, capacity and content of its bucket.
    pub fn new([per_second, burst]: [u64; 2], left: u64, now: Duration) -> Self {
        let mirrored = burst - burst / 4;
        // Clocks differ.
        let rate = Rate { per_second: per_second - per_second / 32, burst: mirrored };
        let mut bucket = Bucket::new(rate, now);
        bucket.charge(now, burst.saturating_sub(left));
        let (waiting, on_the_way) = Default::default();
        Self { waiting, bucket, burst, mirrored, on_the_way, cost: 0, sent: 0 }
    }

    /// Adds an edit with its cost.
    pub fn edit(&mut self, sequence: u64, edit: Edit, cost: u64) {
        // An edit that costs more than the burst is refused in any case.
        let counted = if cost <= self.burst { cost } else { 0 };
        self.waiting.push_back((sequence, Cost { known: counted, most: counted }, Item::Edit(edit)));
    }

    /// Adds an undo.
    pub fn undo(&mut self, sequence: u64, of: ClientId) {
        let known = if UNDO <= self.burst { UNDO } else { 0 };
        // What it restores is charged too, and not known yet.
        let most = (known + MAX_UNDO_BYTES as u64 / UNDO_BYTES).min(self.burst);
        self.waiting.push_back((sequence, Cost { known, most }, Item::Undo(of)));
    }

    /// Records that the server has answered the edit or undo with this number, and its cost if that is known.
    pub fn answer(&mut self, sequence: u64, cost: Option<u64>, now: Duration) {
        if let Some(Cost { known, most }) = self.on_the_way.remove(&sequence) {
            self.cost -= known;
            self.bucket.refund(now, most.saturating_sub(cost.unwrap_or(known)));
        }
    }

    /// The greatest sequence number that was handed over to be sent; 0 before the first one.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Messages that may be sent now.
    pub fn take(&mut self, now: Duration) -> Vec<Vec<u8>> {
        let (mut messages, mut first, mut edits) = (Vec::new(), 0, Vec::new());
        while self.waiting.front().map(|(_, cost, _)| *cost).is_some_and(|cost| self.may_send(cost, now))
            && let Some((sequence, cost, what)) = self.waiting.pop_front()
        {
            self.bucket.charge(now, cost.most);
            self.on_the_way.insert(sequence, cost);
            self.sent = self.sent.max(sequence);
            self.cost += cost.known;
            if edits.len() == MAX_EDITS
                || sequence != first + edits.len() as u64
                || matches!(what, Item::Undo(_))
            {
                messages.extend(edits_message(first, &mut edits));
                first = sequence;
            }
            match what {
                Item::Edit(edit) => edits.push(edit),
                Item::Undo(of) => {
                    messages.push(ToServer::Undo { sequence, of }.to_bytes());
                    first = sequence + 1;
                }
            }
        }
        messages.extend(edits_message(first, &mut edits));
        messages
    }

    fn may_send(&mut self, Cost { known, most }: Cost, now: Duration) -> bool {
        let left = self.bucket.left(now);
        if most > self.mirrored {
            // All of the server's bucket has to be there.
            return left == self.mirrored && self.on_the_way.is_empty();
        }
        most <= left && (self.on_the_way.is_empty() || self.cost + known <= self.burst - self.mirrored)
    }
}

fn edits_message(first: u64, edits: &mut Vec<Edit>) -> Option<Vec<u8>> {
    let edits = std::mem::take(edits);
    (!edits.is_empty()).then(|| ToServer::Edits { first, edits }.to_bytes())
}
