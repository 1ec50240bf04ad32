//! Sends the player's edits and undos to the server, in order, as fast as its limits allow, so nothing is refused for
//! its cost, even after a long time without a connection.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::super::bucket::{Bucket, Rate};
use super::super::encoding::EditWriter;
use super::super::message::{ClientId, ToServer};
use super::super::price::{MAX_UNDO_BYTES, UNDO, UNDO_BYTES};
use crate::brush::Edit;

/// What is to be sent.
enum Item {
    Edit(Edit),
    Undo(ClientId),
}

/// The cost of an item.
#[derive(Clone, Copy)]
struct Cost {
    /// The cost as soon as the item arrives.
    known: u64,
    /// The most that it can cost.
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
        let (mut messages, mut edits) = (Vec::new(), EditWriter::default());
        while self.waiting.front().map(|(_, cost, _)| *cost).is_some_and(|cost| self.may_send(cost, now))
            && let Some((sequence, cost, what)) = self.waiting.pop_front()
        {
            self.bucket.charge(now, cost.most);
            self.on_the_way.insert(sequence, cost);
            self.sent = self.sent.max(sequence);
            self.cost += cost.known;
            match what {
                Item::Edit(edit) => messages.extend(edits.put(sequence, &edit)),
                Item::Undo(of) => {
                    messages.extend(edits.finish());
                    messages.push(ToServer::Undo { sequence, of }.to_bytes());
                }
            }
        }
        messages.extend(edits.finish());
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

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::super::ContentTable;
    use super::super::super::message::{MAX_EDITS, MAX_TO_SERVER};
    use super::*;
    use crate::brush::{Brush, BrushPath, Corridor, Roughness, Shape};

    /// The longest edits: paths and roads of 256 points that go to and fro, each with other numbers.
    fn long(number: u64) -> Edit {
        let place = |point: u64| {
            let far = ((point + number) * 7919 % 1000) as f32 - 500.0;
            Vec3::new(2.0e5 + far, far * 3.0, 2.0e5 - far)
        };
        let points = (0..256).map(|point| (place(point / 8), 0.25 + (point % 9) as f32));
        let path = BrushPath::polyline(points);
        let brush = match number % 2 {
            0 => Brush::dig(path),
            _ => Brush::road(Corridor::new(path, 3.0, 2.0), 1.0),
        };
        let brush = brush
            .with_roughness(Roughness::new(3.7, 91.3, u32::MAX))
            .with_tag(number * 7)
            .with_stroke(u64::MAX);
        Edit::quantize(&brush).expect("a valid brush")
    }

    #[test]
    fn no_message_of_edits_is_larger_than_a_server_reads() {
        let dig = |x: f32| Edit::quantize(&Brush::dig(Shape::sphere(Vec3::splat(x), 2.0))).expect("valid");
        for count in [1, 20, MAX_EDITS as u64 + 50] {
            let mut outbox = Outbox::new([u64::MAX; 2].map(|most| most >> 1), u64::MAX >> 1, Duration::ZERO);
            let edits: Vec<Edit> = (0..count)
                .map(|number| if number % 5 == 4 { dig(number as f32) } else { long(number) })
                .collect();
            edits.iter().zip(1..).for_each(|(edit, sequence)| outbox.edit(sequence, edit.clone(), 1));
            let (messages, mut next) = (outbox.take(Duration::ZERO), 1);
            for message in &messages {
                assert!(message.len() <= MAX_TO_SERVER, "{} bytes", message.len());
                let read =
                    ToServer::from_bytes(message, &ContentTable::default()).expect("a server reads it");
                let ToServer::Edits { first, edits: part } = read else { panic!("edits") };
                assert_eq!(first, next);
                assert_eq!(part, edits[next as usize - 1..][..part.len()]);
                next += part.len() as u64;
            }
            assert_eq!(next, count + 1, "all of them, in order");
            // As few messages as there may be.
            let bytes: usize = messages.iter().map(Vec::len).sum();
            assert!(messages.len() <= 1 + bytes / (MAX_TO_SERVER / 2) + count as usize / MAX_EDITS);
        }
    }
}
