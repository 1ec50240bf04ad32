//! Token buckets: how much may be spent at once, and how much comes back.

use std::time::Duration;

const SECOND: u128 = 1_000_000_000;

/// How much may be spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate {
    /// What comes back in a second.
    pub per_second: u64,
    /// The most that may be spent at once.
    pub burst: u64,
}

impl Rate {
    /// So many times as much.
    #[must_use]
    pub fn times(self, factor: u64) -> Self {
        Self { per_second: self.per_second.saturating_mul(factor), burst: self.burst.saturating_mul(factor) }
    }
}

/// What is left to spend.
#[derive(Clone, Debug)]
pub struct Bucket {
    rate: Rate,
    /// In billionths.
    left: u128,
    at: Duration,
}

impl Bucket {
    /// A full one.
    pub fn new(rate: Rate, now: Duration) -> Self {
        Self { rate, left: u128::from(rate.burst) * SECOND, at: now }
    }

    /// What may be spent now. Time does not run back: an earlier one counts as the latest.
    pub fn left(&mut self, now: Duration) -> u64 {
        let passed = now.saturating_sub(self.at).as_nanos();
        self.at = self.at.max(now);
        let back = passed.saturating_mul(self.rate.per_second.into());
        self.left = self.left.saturating_add(back).min(u128::from(self.rate.burst) * SECOND);
        (self.left / SECOND) as u64
    }

    /// Spends so much, if it is there.
    pub fn spend(&mut self, now: Duration, amount: u64) -> bool {
        let is_there = amount <= self.left(now);
        if is_there {
            self.left -= u128::from(amount) * SECOND;
        }
        is_there
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn never_more_is_spent_than_the_burst_and_what_came_back() {
        let rate = Rate { per_second: 10, burst: 25 };
        let mut bucket = Bucket::new(rate, Duration::ZERO);
        let mut rng = fastrand::Rng::with_seed(1);
        let (mut now, mut spent) = (Duration::ZERO, 0);
        for _ in 0..10_000 {
            now += Duration::from_micros(rng.u64(0..50_000));
            let amount = rng.u64(0..5);
            spent += if bucket.spend(now, amount) { amount } else { 0 };
            assert!(spent <= 25 + (10.0 * now.as_secs_f64()) as u64);
        }
        // Two are asked for 40 times a second on average, so that none is left for long.
        assert!(spent as f64 > 9.9 * now.as_secs_f64(), "{spent} in {now:?}");
    }

    #[test]
    fn time_does_not_run_back() {
        let mut bucket = Bucket::new(Rate { per_second: 10, burst: 10 }, Duration::from_secs(5));
        assert!(bucket.spend(Duration::from_secs(5), 10));
        assert!(!bucket.spend(Duration::from_secs(1), 1));
        assert!(bucket.spend(Duration::from_millis(5100), 1));
        assert!(!bucket.spend(Duration::from_millis(5100), 1));
    }
}
