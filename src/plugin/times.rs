//! The latest durations of repeated work, for percentiles.

use std::collections::VecDeque;
use std::time::Duration;

use bevy::prelude::*;

/// How many durations are kept.
const KEPT: usize = 256;

/// The latest 256 durations of repeated work.
#[derive(Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Default)]
pub struct Times {
    latest: VecDeque<Duration>,
}

impl Times {
    /// Adds a duration; the oldest is dropped when there are too many.
    pub fn push(&mut self, took: Duration) {
        if self.latest.len() == KEPT {
            self.latest.pop_front();
        }
        self.latest.push_back(took);
    }

    /// All durations that are kept, the oldest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Duration> {
        self.latest.iter().copied()
    }

    /// How many are kept.
    pub fn len(&self) -> usize {
        self.latest.len()
    }

    /// Whether nothing was measured yet.
    pub fn is_empty(&self) -> bool {
        self.latest.is_empty()
    }

    /// The duration that this percentage of the kept ones does not exceed; `None` if none is kept. Percentages over 100
    /// count as 100.
    ///
    /// ```
    /// # use bevy_burrow::plugin::Times;
    /// # use std::time::Duration;
    /// let mut times = Times::default();
    /// (1..=200).for_each(|ms| times.push(Duration::from_millis(ms)));
    /// assert_eq!([50, 95, 99].map(|p| times.percentile(p).unwrap().as_millis()), [100, 190, 198]);
    /// ```
    pub fn percentile(&self, percent: u32) -> Option<Duration> {
        let mut sorted: Vec<Duration> = self.iter().collect();
        sorted.sort_unstable();
        let rank = (sorted.len() * percent.min(100) as usize).div_ceil(100).saturating_sub(1);
        sorted.get(rank).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_latest_count() {
        let mut times = Times::default();
        assert_eq!(times.percentile(50), None);
        (0..1000).for_each(|ms| times.push(Duration::from_millis(ms)));
        assert_eq!(times.len(), KEPT);
        let ends = [0, 100, 250].map(|percent| times.percentile(percent).map(|time| time.as_millis()));
        assert_eq!(ends, [Some(744), Some(999), Some(999)]);
        assert_eq!(times.iter().next(), Some(Duration::from_millis(744)));
    }
}
