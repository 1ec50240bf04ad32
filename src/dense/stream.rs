//! Growing lists that may be written beyond their end.

/// A list with writable slots behind its end. An item that is appended under a condition is always written there, and
/// the condition moves the end: this needs no branch.
#[derive(Debug, Default)]
pub(super) struct Stream<T> {
    slots: Vec<T>,
    len: usize,
}

impl<T: Copy + Default> Stream<T> {
    /// Removes the items and keeps the memory.
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn items(&self) -> &[T] {
        &self.slots[..self.len]
    }

    /// Removes all but the first `len` items.
    pub(super) fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len);
    }

    /// Makes room for `more` items. Memory is cleared when it is first used, and never again.
    pub(super) fn reserve(&mut self, more: usize) {
        if self.slots.len() < self.len + more {
            self.slots.resize(self.len + more, T::default());
        }
    }

    /// Number of items that fit.
    pub(super) fn room(&self) -> usize {
        self.slots.len() - self.len
    }

    /// The next `count` slots behind the end, for which room was made.
    pub(super) fn spare(&mut self, count: usize) -> &mut [T] {
        &mut self.slots[self.len..self.len + count]
    }

    /// Turns the next `count` slots into items.
    pub(super) fn extend(&mut self, count: usize) {
        self.len = self.slots.len().min(self.len + count);
    }

    /// The items, the last one repeated until their number is a multiple of `group`.
    pub(super) fn in_groups_of(&mut self, group: usize) -> &[T] {
        let end = self.len.next_multiple_of(group);
        self.reserve(end - self.len);
        if let Some(&last) = self.items().last() {
            self.slots[self.len..end].fill(last);
        }
        &self.slots[..end]
    }
}
