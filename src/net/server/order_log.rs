//! The latest entries as they were sent, for clients that come back.

use std::collections::VecDeque;
use std::sync::Arc;

/// Entries of one message.
struct Block {
    first: u64,
    last: u64,
    message: Arc<[u8]>,
}

/// The latest messages with entries, within a limit of bytes.
pub struct OrderLog {
    blocks: VecDeque<Block>,
    bytes: usize,
    limit: usize,
}

impl OrderLog {
    pub fn new(limit: usize) -> Self {
        Self { blocks: VecDeque::new(), bytes: 0, limit }
    }

    /// Adds the message with the entries from `first` to `last`. Those after `applied` are kept in any case.
    pub fn push(&mut self, first: u64, last: u64, message: Arc<[u8]>, applied: u64) {
        self.bytes += message.len();
        self.blocks.push_back(Block { first, last, message });
        while self.bytes > self.limit && self.blocks.front().is_some_and(|block| block.last <= applied) {
            self.bytes -= self.blocks.pop_front().map_or(0, |block| block.message.len());
        }
    }

    /// The messages with all entries after a number, which may hold entries before it too. `None` if some are gone; `next` is the
    /// number of the entry that will be added next.
    pub fn after(&self, number: u64, next: u64) -> Option<impl Iterator<Item = &Arc<[u8]>>> {
        let kept = self.blocks.front().map_or(next, |block| block.first);
        let from = self.blocks.partition_point(|block| block.last <= number);
        (kept <= number.saturating_add(1) && number < next)
            .then(|| self.blocks.iter().skip(from).map(|block| &block.message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(limit: usize) -> OrderLog {
        let mut log = OrderLog::new(limit);
        for (first, last) in [(1, 3), (4, 4), (5, 9)] {
            log.push(first, last, Arc::from([first as u8; 10]), 4);
        }
        log
    }

    fn firsts(log: &OrderLog, number: u64) -> Option<Vec<u8>> {
        Some(log.after(number, 10)?.map(|message| message[0]).collect())
    }

    #[test]
    fn messages_after_a_number() {
        let log = log(100);
        assert_eq!(firsts(&log, 0), Some(vec![1, 4, 5]));
        assert_eq!(firsts(&log, 2), Some(vec![1, 4, 5]));
        assert_eq!(firsts(&log, 3), Some(vec![4, 5]));
        assert_eq!(firsts(&log, 7), Some(vec![5]));
        assert_eq!(firsts(&log, 9), Some(vec![]));
        assert_eq!(firsts(&log, 10), None);
    }

    #[test]
    fn the_oldest_are_dropped_unless_they_are_not_applied() {
        let log = log(0);
        assert_eq!((firsts(&log, 3), firsts(&log, 4)), (None, Some(vec![5])));
        assert_eq!(log.bytes, 10);
    }
}
