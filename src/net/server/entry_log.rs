//! The latest entries in long messages, for clients that join or reconnect.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use super::FULL_MESSAGE;
use crate::net::ContentId;
use crate::net::encoding::{EntryWriter, pack};
use crate::net::message::Entry;

/// Entries of one message.
struct Block {
    last: u64,
    message: Arc<[u8]>,
    /// The content that its edits name, where a store had the message: the present server may lack it.
    names: BTreeSet<ContentId>,
}

/// The latest entries, within a limit of bytes.
pub struct EntryLog {
    /// The number of the first entry that is kept.
    first: u64,
    blocks: VecDeque<Block>,
    bytes: usize,
    limit: usize,
    /// The entries after those of the last block.
    writer: EntryWriter,
    last: u64,
}

impl EntryLog {
    /// The log that continues after a number.
    pub fn new(limit: usize, number: u64) -> Self {
        let (blocks, writer) = Default::default();
        Self { first: number + 1, blocks, bytes: 0, limit, writer, last: number }
    }

    /// Adds a message before all entries: those from a number up to the first that is kept.
    #[cfg(feature = "store")]
    pub fn push_front(&mut self, first: u64, message: Vec<u8>, names: BTreeSet<ContentId>) {
        self.bytes += message.len();
        self.blocks.push_front(Block { last: self.first - 1, message: message.into(), names });
        self.first = first;
    }

    /// The names of content in messages [after](Self::after) a number that a store had.
    pub fn names_after(&self, number: u64) -> impl Iterator<Item = ContentId> {
        let from = self.blocks.partition_point(|block| block.last <= number);
        self.blocks.iter().skip(from).flat_map(|block| block.names.iter().copied())
    }

    /// Adds the next entry.
    pub fn push(&mut self, entry: &Entry) {
        self.writer.put(entry);
        self.last += 1;
        if self.writer.len() < self.limit.min(FULL_MESSAGE) {
            return;
        }
        if let Some(message) = self.writer.message(self.last) {
            let message: Arc<[u8]> = pack(&message).into();
            self.bytes += message.len();
            self.blocks.push_back(Block { last: self.last, message, names: BTreeSet::new() });
        }
        self.writer = EntryWriter::default();
    }

    /// Drops the oldest entries beyond the limit. Those after `applied` are kept in any case.
    pub fn trim(&mut self, applied: u64) {
        while self.bytes > self.limit
            && let Some(block) = self.blocks.pop_front_if(|block| block.last <= applied)
        {
            self.bytes -= block.message.len();
            self.first = block.last + 1;
        }
    }

    /// The number of the first entry that is kept.
    pub fn first(&self) -> u64 {
        self.first
    }

    /// The first of the messages [after](Self::after) a number, and the number of its last entry.
    pub fn next_after(&self, number: u64) -> Option<(u64, Arc<[u8]>)> {
        if self.first > number.saturating_add(1) || number >= self.last {
            return None;
        }
        match self.blocks.get(self.blocks.partition_point(|block| block.last <= number)) {
            Some(block) => Some((block.last, Arc::clone(&block.message))),
            None => Some((self.last, pack(&self.writer.message(self.last)?).into())),
        }
    }

    /// Messages with all entries after a number, which may hold entries before it too. `None` if some are gone or to
    /// come.
    pub fn after(&self, number: u64) -> Option<Vec<Arc<[u8]>>> {
        if self.first > number.saturating_add(1) || number > self.last {
            return None;
        }
        let from = self.blocks.partition_point(|block| block.last <= number);
        let blocks = self.blocks.iter().skip(from).map(|block| Arc::clone(&block.message));
        let rest = (number < self.last).then(|| self.writer.message(self.last)).flatten();
        Some(blocks.chain(rest.map(|message| pack(&message).into())).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::Ground;
    use crate::net::ContentTable;
    use crate::net::message::{Entries, ToClient};
    use crate::terrain::{LooseSettings, Order};

    /// Every third entry is a hash check, and the others are loose settings.
    fn entry(number: u64) -> Entry {
        let loose = LooseSettings { debris: number as u32, ..LooseSettings::default() };
        if number.is_multiple_of(3) { Entry::HashCheck } else { Entry::of_server(Order::Loose(Some(loose))) }
    }

    /// Twenty thousand entries after the number 7.
    fn log(limit: usize, applied: u64) -> EntryLog {
        let mut log = EntryLog::new(limit, 7);
        (8..=20_007).for_each(|number| log.push(&entry(number)));
        log.trim(applied);
        log
    }

    /// The numbers of all entries after this one; checks that these are unchanged.
    fn numbers(log: &EntryLog, number: u64) -> Option<Vec<u64>> {
        let ground = Ground::flat(8, 8, 4.0).expect("a valid ground");
        let mut numbers = Vec::new();
        for message in log.after(number)? {
            let message =
                ToClient::from_bytes(&message, &ground, &ContentTable::default()).expect("a message");
            let ToClient::Entries(Entries { first, entries }) = message else { panic!("{message:?}") };
            for (number, own) in (first..).zip(entries) {
                assert_eq!(format!("{own:?}"), format!("{:?}", entry(number)));
                numbers.push(number);
            }
        }
        numbers.retain(|other| *other > number);
        Some(numbers)
    }

    #[test]
    fn all_entries_after_a_number() {
        let log = log(1 << 20, 0);
        assert!(log.blocks.len() > 3);
        for number in [7, 8, 5000, 20_006, 20_007] {
            assert_eq!(numbers(&log, number), Some((number + 1..=20_007).collect()), "{number}");
            let (mut at, mut messages) = (number, Vec::new());
            while let Some((last, message)) = log.next_after(at) {
                messages.push(message);
                at = last;
            }
            assert_eq!((at, Some(messages)), (20_007, log.after(number)));
        }
        assert_eq!((numbers(&log, 6), numbers(&log, 20_008), numbers(&log, u64::MAX)), (None, None, None));
    }

    #[test]
    fn the_oldest_are_dropped_unless_they_are_not_applied() {
        let whole = log(0, 7);
        assert_eq!(numbers(&whole, 7).map(|numbers| numbers.len()), Some(20_000));
        let trimmed = log(0, 20_007);
        assert_eq!((numbers(&trimmed, 20_007), numbers(&trimmed, 20_006)), (Some(vec![]), None));
        let half = log(0, 10_000);
        assert_eq!(
            (numbers(&half, 10_000).map(|all| all.len()), numbers(&half, 9_999)),
            (Some(10_007), None)
        );
    }
}
