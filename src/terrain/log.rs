//! The commit log: records of commits that wait to be taken, within a bound of bytes.

use std::collections::VecDeque;
#[cfg(feature = "store")]
use std::ops::Range;
use std::sync::Arc;

use super::edit_settings::EditSettings;
use super::order::Order;
use super::queue::Submission;
use super::receipt::Receipt;
use super::record::CommitRecord;
use crate::world::{Patch, World, brick_bytes};

/// A record as its transaction makes it: all but what only the commit knows.
#[derive(Default)]
pub(super) struct RecordDraft {
    /// The settings of the first and of the last edit that was applied. Orders set how those in between differ.
    edit_settings: Option<[EditSettings; 2]>,
    /// With room for the orders that are added when the record is entered.
    orders: Vec<Order>,
    /// Whether its order was a step through history or replaced parts: then the change is its only order.
    is_parts: bool,
    change: Patch,
    /// Bytes that the record may hold alone.
    bytes: usize,
}

impl RecordDraft {
    /// The record of a commit, by the orders, their receipts, and what changes.
    pub fn new(submissions: &[Submission], receipts: &[Receipt], change: Patch) -> Self {
        // With room for the first settings, if those before were others.
        let mut orders: Vec<Order> = Vec::with_capacity(submissions.len() + 2);
        let (mut edit_settings, mut is_parts) = (None::<[EditSettings; 2]>, false);
        for (submission, receipt) in submissions.iter().zip(receipts) {
            let (Ok(order), Ok(_)) = (&submission.order, &receipt.outcome) else { continue };
            if order.kind().is_logged_as_parts() {
                // A transaction of its own, so there is no other order.
                is_parts = true;
                continue;
            }
            if let Order::Edit(_) = order {
                let current = submission.edit_settings.clone();
                let first = match edit_settings.take() {
                    Some([first, last]) => {
                        orders.extend(current.orders_after(Some(&last)));
                        first
                    }
                    None => current.clone(),
                };
                edit_settings = Some([first, current]);
            }
            orders.push(order.clone());
        }
        let room = (orders.capacity() - orders.len()) * size_of::<Order>();
        let bytes = bytes_of(&orders, &change) + room;
        Self { edit_settings, orders, is_parts, change, bytes }
    }

    /// What changes.
    pub fn change(&self) -> &Patch {
        &self.change
    }
}

/// Bytes that a record of these may hold alone, its change once. Looks at all samples of uniform bricks, so it is not
/// for the main thread.
fn bytes_of(orders: &[Order], change: &Patch) -> usize {
    let rules = orders.iter().map(rule_bytes);
    let bricks = change.bricks.iter().flat_map(|(_, brick)| brick).map(|brick| brick_bytes(brick));
    let fields = change.fields.iter().map(|(_, fields)| fields.bytes());
    // The change is behind an `Arc`, with its two counters.
    size_of::<CommitRecord>()
        + 2 * size_of::<usize>()
        + size_of::<Patch>()
        + size_of_val(orders)
        + size_of_val(&change.bricks[..])
        + size_of_val(&change.fields[..])
        + rules.chain(bricks).chain(fields).sum::<usize>()
}

/// Bytes of the rules that an order holds.
fn rule_bytes(order: &Order) -> usize {
    match order {
        Order::Rules(Some(rules)) => rules.bytes(),
        _ => 0,
    }
}

/// Records that wait to be taken.
pub(super) struct CommitLog {
    records: VecDeque<CommitRecord>,
    /// Bytes of each of them.
    sizes: VecDeque<usize>,
    /// Bytes of all of them.
    bytes: usize,
    limit: usize,
    /// The number of the next record.
    next: u64,
    /// The settings that hold after the last record; `None` if nothing is known of them.
    edit_settings: Option<EditSettings>,
    /// Whether a commit was dropped after the last record that was taken. The first waiting record is a
    /// commit then: any other kind has the same revision as the dropped one, and would hide the gap.
    has_gap: bool,
    /// Of the records since the last time that some were taken, dropped ones included: the revision before the first, and
    /// whether one of them sets another ground.
    since: Option<(u64, bool)>,
}

impl CommitLog {
    pub fn new(limit: usize) -> Self {
        let (records, sizes) = Default::default();
        Self { records, sizes, bytes: 0, limit, next: 0, edit_settings: None, has_gap: false, since: None }
    }

    /// Records the commit that led to this world. Records that no longer fit are moved to `dropped`.
    pub fn enter(&mut self, world: &World, draft: RecordDraft, dropped: &mut Vec<CommitRecord>) {
        let RecordDraft { edit_settings, mut orders, is_parts, change, mut bytes } = draft;
        let change = Arc::new(Patch { next_field: world.next_field, ..change });
        if is_parts {
            orders.push(Order::parts(Arc::clone(&change), Some(world.hash())));
        }
        if let Some([first, last]) = edit_settings {
            let changes = first.orders_after(self.edit_settings.as_ref());
            drop(orders.splice(0..0, changes.inspect(|order| bytes += rule_bytes(order))));
            self.edit_settings = Some(last);
        }
        self.push(world, orders, change, bytes, dropped);
    }

    /// Records new settings, if they differ from the previous ones.
    pub fn enter_settings(&mut self, world: &World, edit_settings: EditSettings) {
        // The next edit logs them.
        if self.has_gap && self.records.is_empty() {
            return;
        }
        let orders: Vec<Order> = edit_settings.orders_after(self.edit_settings.as_ref()).collect();
        if !orders.is_empty() {
            self.edit_settings = Some(edit_settings);
            let change = Arc::new(Patch { next_field: world.next_field, ..Patch::default() });
            let bytes = bytes_of(&orders, &change);
            self.push(world, orders, change, bytes, &mut Vec::new());
        }
    }

    /// Sets the most bytes that records may hold; the oldest are dropped if they hold more.
    pub fn set_limit(&mut self, limit: usize) {
        self.limit = limit;
        self.trim(&mut Vec::new());
    }

    /// The records since the last call, in order. A gap shows in their revisions.
    pub fn take(&mut self) -> Vec<CommitRecord> {
        self.has_gap &= self.records.is_empty();
        self.since = None;
        self.sizes.clear();
        self.bytes = 0;
        std::mem::take(&mut self.records).into()
    }

    /// The numbers of the records that wait.
    #[cfg(feature = "store")]
    pub fn numbers(&self) -> Range<u64> {
        self.next - self.records.len() as u64..self.next
    }

    /// The rules and loose settings that hold after the last record; `None` if the next record says them.
    #[cfg(feature = "store")]
    pub fn edit_settings(&self) -> Option<&EditSettings> {
        self.edit_settings.as_ref()
    }

    /// Whether no record waits.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Whether the records since the last [`take`](Self::take) follow this revision, and one of them sets another
    /// ground. Dropped records count.
    #[cfg(feature = "store")]
    pub fn sets_ground_after(&self, revision: u64) -> bool {
        self.since == Some((revision, true))
    }

    fn push(
        &mut self,
        world: &World,
        orders: Vec<Order>,
        change: Arc<Patch>,
        bytes: usize,
        dropped: &mut Vec<CommitRecord>,
    ) {
        let (number, revision, hash) = (self.next, world.revision(), world.hash());
        self.next += 1;
        let record = CommitRecord { number, revision, hash, orders, change };
        let before = revision.saturating_sub(record.is_commit().into());
        self.since.get_or_insert((before, false)).1 |= record.sets_ground();
        self.records.push_back(record);
        self.sizes.push_back(bytes);
        self.bytes += bytes;
        self.trim(dropped);
    }

    /// Drops the oldest records until the others are within the limit, and the gap shows in their revisions.
    fn trim(&mut self, dropped: &mut Vec<CommitRecord>) {
        let mut has_lost = false;
        while let Some(first) = self.records.front() {
            let hides_gap = if self.has_gap { !first.is_commit() } else { has_lost };
            if self.bytes <= self.limit && !hides_gap {
                return;
            }
            self.has_gap |= first.is_commit();
            has_lost = true;
            self.bytes -= self.sizes.pop_front().unwrap_or_default();
            dropped.extend(self.records.pop_front());
        }
        // The dropped records may have held the current settings, so these are logged again.
        self.edit_settings = None;
    }
}
