//! Stretches of a row of columns.

use std::ops::Range;

/// Columns of a row next to each other: the first, and where they end. Empty if they end before they begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::world::sky) struct Run {
    pub start: i32,
    pub end: i32,
}

impl Run {
    /// An empty run. Its ends are half the range apart, so it stays empty wherever it is moved.
    pub const EMPTY: Self = Self { start: i32::MAX / 2, end: i32::MIN / 2 };

    pub fn is_empty(self) -> bool {
        self.start >= self.end
    }

    /// The shortest run that holds both.
    pub fn hull(self, other: Self) -> Self {
        Self { start: self.start.min(other.start), end: self.end.max(other.end) }
    }

    pub fn moved(self, by: i32) -> Self {
        Self { start: self.start + by, end: self.end + by }
    }

    /// The part of the run that an array of this length holds.
    pub fn within(self, length: usize) -> Range<usize> {
        let [start, end] = [self.start, self.end].map(|at| at.clamp(0, length as i32) as usize);
        start..end.max(start)
    }
}
