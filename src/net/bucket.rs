//! Token buckets: how much may be spent at once, and how fast they refill.

use std::time::Duration;

const SECOND: i128 = 1_000_000_000;

/// How much may be spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate {
    /// The refill in a second.
    pub per_second: u64,
    /// The most that may be spent at once.
    pub burst: u64,
}

impl Rate {
    /// This rate and burst multiplied by `factor`.
    #[must_use]
    pub fn times(self, factor: u64) -> Self {
        Self { per_second: self.per_second.saturating_mul(factor), burst: self.burst.saturating_mul(factor) }
    }
}

/// What is left to spend.
#[derive(Clone, Debug)]
pub struct Bucket {
    rate: Rate,
    /// In billionths; less than 0 where more was charged than was there.
    left: i128,
    at: Duration,
}

impl Bucket {
    /// A full one.
    pub fn new(rate: Rate, now: Duration) -> Self {
        Self { rate, left: i128::from(rate.burst) * SECOND, at: now }
    }

    /// Lets it refill at another rate from now on.
    pub fn set_rate(&mut self, now: Duration, rate: Rate) {
        if rate != self.rate {
            self.left(now);
            self.rate = rate;
            self.left(now);
        }
    }

    /// The amount that may be spent now. Times before the latest one count as the latest.
    pub fn left(&mut self, now: Duration) -> u64 {
        let passed = now.saturating_sub(self.at).as_nanos();
        self.at = self.at.max(now);
        let back = i128::try_from(passed).unwrap_or(i128::MAX).saturating_mul(self.rate.per_second.into());
        self.left = self.left.saturating_add(back).min(i128::from(self.rate.burst) * SECOND);
        (self.left / SECOND).max(0) as u64
    }

    /// Spends `amount` if the bucket holds it. Returns whether it did.
    pub fn spend(&mut self, now: Duration, amount: u64) -> bool {
        let is_there = amount <= self.left(now);
        if is_there {
            self.left -= i128::from(amount) * SECOND;
        }
        is_there
    }

    /// Returns an amount that was spent but not needed.
    pub fn refund(&mut self, now: Duration, amount: u64) {
        self.left = self.left.saturating_add(i128::from(amount) * SECOND);
        self.left(now);
    }

    /// Removes `amount` even if the bucket holds less: then nothing can be spent until it has refilled.
    pub fn charge(&mut self, now: Duration, amount: u64) {
        self.left(now);
        self.left -= i128::from(amount) * SECOND;
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
    fn what_is_charged_has_to_come_back() {
        let at = Duration::from_secs;
        let mut bucket = Bucket::new(Rate { per_second: 10, burst: 10 }, at(5));
        bucket.charge(at(5), 30);
        assert!(!bucket.spend(at(6), 1) && bucket.left(at(7)) == 0);
        assert!(bucket.spend(at(8), 10) && !bucket.spend(at(8), 1));
    }

    #[test]
    fn another_rate_begins_with_what_is_left() {
        let at = Duration::from_secs;
        let mut bucket = Bucket::new(Rate { per_second: 10, burst: 10 }, at(5));
        assert!(bucket.spend(at(5), 10));
        bucket.set_rate(at(6), Rate { per_second: 100, burst: 300 });
        assert_eq!((bucket.left(at(6)), bucket.left(at(8))), (10, 210));
        bucket.set_rate(at(8), Rate { per_second: 1, burst: 5 });
        assert_eq!((bucket.left(at(8)), bucket.left(at(20))), (5, 5));
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
