//! The rate of a client's bulk lane: as fast as its connection allows, according to acknowledgements.

use std::time::Duration;

use super::settings::ServerSettings;
use crate::net::bucket::Rate;

/// The rate at which a lane begins, in bytes a second. It is also the least rate: however little is acknowledged, a
/// lane is never slower, so a wrong measurement cannot delay a client.
const FIRST: u64 = 256 << 10;

/// The shortest time over which acknowledged bytes are counted.
const SPAN: Duration = Duration::from_millis(500);

/// A line carries a rate if it delivers at least this percentage of what was sent in the same time.
const CARRIED: u64 = 92;

/// Measurements in a row that must show that the line does not carry a rate. A single one may only have met a lost
/// packet.
const FAILURES: u32 = 2;

/// What the rate becomes, in percent: of itself while the line carries it, before and after the line's limit was met
/// for the first time, and of what was delivered where the line does not carry it.
const GROWTH: u64 = 150;
const LATER_GROWTH: u64 = 110;
const BACK: u64 = 85;

/// The rate of a lane: it grows as long as the connection delivers everything that is sent, and otherwise falls below
/// the rate of delivery, so that queues in the connection drain again.
///
/// Delays are not looked at, because lanes are reliable: a lost packet delays all later ones, but after it has been
/// sent again they arrive together, so it hardly changes what arrives in a longer time.
pub struct Pace {
    /// The greatest rate.
    most: Rate,
    /// Bytes that may be on their way at the first rate.
    window: u64,
    rate: u64,
    phase: Phase,
    /// Measurements in a row that show that the line does not carry the rate, and the most bytes a second among these
    /// and the one before them: a lost packet makes one of them small.
    failures: u32,
    delivered: u64,
    has_met_limit: bool,
}

/// The progress of a measurement.
enum Phase {
    /// Nothing is on its way.
    Idle,
    /// Bytes up to `sent` left before the rate was what it is.
    Waiting { sent: u64, since: Duration },
    /// The bytes that were acknowledged and sent when counting began, and whether the window has held bytes back since.
    Counting { acknowledged: u64, sent: u64, since: Duration, span: Duration, is_held: bool },
}

impl Pace {
    pub fn new(settings: &ServerSettings) -> Self {
        Self {
            most: settings.bulk,
            window: settings.window,
            rate: Self::first(settings.bulk),
            phase: Phase::Idle,
            failures: 0,
            delivered: 0,
            has_met_limit: false,
        }
    }

    fn first(most: Rate) -> u64 {
        FIRST.min(most.per_second)
    }

    /// The present rate. Its burst is in proportion, but at least an eighth of the first rate.
    pub fn rate(&self) -> Rate {
        let share = scaled(self.most.burst, self.rate, self.most.per_second);
        Rate { per_second: self.rate, burst: share.max(FIRST / 8).min(self.most.burst) }
    }

    /// How many bytes may be on their way: at each rate, those of the same time.
    pub fn window(&self) -> u64 {
        scaled(self.window, self.rate, Self::first(self.most)).max(self.window)
    }

    /// Records that bytes up to this number are sent.
    pub fn send(&mut self, sent: u64, now: Duration) {
        if let Phase::Idle = self.phase {
            self.phase = Phase::Waiting { sent, since: now };
        }
    }

    /// Records that the window held bytes back.
    pub fn hold(&mut self) {
        if let Phase::Counting { is_held, .. } = &mut self.phase {
            *is_held = true;
        }
    }

    /// Records that there is nothing to send: what is acknowledged meanwhile says nothing about the line.
    pub fn stop(&mut self) {
        self.phase = Phase::Idle;
    }

    /// Records that bytes up to a number have arrived, of those that are `sent`.
    pub fn acknowledge(&mut self, acknowledged: u64, sent: u64, now: Duration) {
        match self.phase {
            Phase::Waiting { sent: before, since } if acknowledged >= before => {
                let span = SPAN.max(now.saturating_sub(since));
                self.phase = Phase::Counting { acknowledged, sent, since: now, span, is_held: false };
            }
            Phase::Counting { acknowledged: first, sent: before, since, span, is_held } => {
                let took = now.saturating_sub(since);
                if took >= span {
                    let delivered = acknowledged.saturating_sub(first);
                    let is_carried =
                        !is_held && delivered >= scaled(sent.saturating_sub(before), CARRIED, 100);
                    self.judge(is_carried, per_second(delivered, took));
                    self.phase = Phase::Waiting { sent, since: now };
                }
            }
            _ => {}
        }
    }

    fn judge(&mut self, is_carried: bool, delivered: u64) {
        if is_carried {
            let growth = if self.has_met_limit { LATER_GROWTH } else { GROWTH };
            (self.failures, self.delivered) = (0, delivered);
            self.rate = scaled(self.rate, growth, 100).min(self.most.per_second);
            return;
        }
        (self.failures, self.delivered) = (self.failures + 1, self.delivered.max(delivered));
        if self.failures >= FAILURES {
            let back = scaled(self.delivered, BACK, 100).min(self.rate);
            self.rate = back.max(Self::first(self.most));
            (self.failures, self.delivered, self.has_met_limit) = (0, 0, true);
        }
    }
}

/// `amount * by / of`, without overflow.
fn scaled(amount: u64, by: u64, of: u64) -> u64 {
    u64::try_from(u128::from(amount) * u128::from(by) / u128::from(of.max(1))).unwrap_or(u64::MAX)
}

/// Bytes a second.
fn per_second(bytes: u64, took: Duration) -> u64 {
    u64::try_from(u128::from(bytes) * 1_000_000_000 / took.as_nanos().max(1)).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::super::sender::{BulkSender, Encodings};
    use super::*;
    use crate::net::bucket::Bucket;

    const TICK: Duration = Duration::from_millis(33);

    /// A line that delivers in order.
    #[derive(Clone, Copy, Debug)]
    struct Line {
        /// In bytes a second.
        rate: u64,
        /// The time there and back.
        way: Duration,
        /// Lost packets of a hundred, and the time after which they are sent again.
        lost: u32,
        again: Duration,
    }

    /// How a transfer went.
    #[derive(Debug)]
    struct Transfer {
        took: Duration,
        /// The most bytes on their way.
        most: u64,
        /// The longest time that the line needed for what it had not carried yet.
        queue: Duration,
    }

    fn settings(most: u64) -> ServerSettings {
        let bulk = Rate { per_second: most, burst: most / 8 };
        ServerSettings { bulk, ..ServerSettings::default() }
    }

    /// Sends bytes over a line. What happens to a packet depends on its position alone, so that rates can be compared.
    fn transfer(bytes: usize, line: &Line, settings: &ServerSettings) -> Transfer {
        let mut sender = BulkSender::new(settings);
        sender.push(vec![7; bytes].into());
        let mut bucket = Bucket::new(sender.rate(), Duration::ZERO);
        let mut encodings = Encodings::default();
        let (mut now, mut free, mut last) = (Duration::ZERO, Duration::ZERO, Duration::ZERO);
        let (mut sent, mut acknowledged, mut most, mut queue) = (0, 0, 0, Duration::ZERO);
        let mut arriving = VecDeque::new();
        let mut rng = fastrand::Rng::with_seed(5);
        loop {
            now += TICK;
            let mut arrived = None;
            while let Some((_, total)) = arriving.pop_front_if(|(at, _)| *at <= now) {
                arrived = Some(total);
            }
            if let Some(total) = arrived {
                acknowledged = total;
                assert!(sender.acknowledge(total, now));
                bucket.set_rate(now, sender.rate());
            }
            while let Some(piece) = sender.next_piece(&mut bucket, now, &mut encodings) {
                sent += piece.len() as u64;
                free = free.max(now) + Duration::from_secs_f64(piece.len() as f64 / line.rate as f64);
                let mut delay = line.way;
                while rng.u32(0..100) < line.lost {
                    delay += line.again;
                }
                last = last.max(free + delay);
                arriving.push_back((last, sent));
            }
            most = most.max(sent - acknowledged);
            queue = queue.max(free.saturating_sub(now));
            if acknowledged >= bytes as u64 && arriving.is_empty() {
                return Transfer { took: now, most, queue };
            }
            assert!(now < Duration::from_secs(3600), "it does not end");
        }
    }

    fn random_line(rng: &mut fastrand::Rng) -> Line {
        Line {
            rate: (16_000.0 * 500_f64.powf(rng.f64())) as u64,
            way: Duration::from_millis(rng.u64(5..800)),
            lost: [0, 0, 1, 5, 20][rng.usize(0..5)],
            again: Duration::from_millis(rng.u64(50..900)),
        }
    }

    #[test]
    fn on_no_line_is_a_lane_slower_than_at_the_first_rate() {
        let mut rng = fastrand::Rng::with_seed(1);
        for _ in 0..60 {
            let (line, bytes) = (random_line(&mut rng), rng.usize(1..6 << 20));
            let [adapted, first] = [2 << 20, FIRST].map(|most| transfer(bytes, &line, &settings(most)));
            assert!(
                adapted.took <= first.took,
                "{adapted:?} instead of {first:?} for {bytes} bytes, {line:?}"
            );
        }
    }

    #[test]
    fn most_of_what_a_line_carries_is_used_after_some_seconds() {
        for (rate, way, lost) in [
            (1_250_000, 40, 0),
            (1_250_000, 100, 1),
            (1_250_000, 400, 5),
            (600_000, 200, 2),
            (8_000_000, 60, 0),
        ] {
            let (way, again) = (Duration::from_millis(way), Duration::from_millis(way + 200));
            let line = Line { rate, way, lost, again };
            let [small, large] = [12 << 20, 24 << 20].map(|bytes| transfer(bytes, &line, &settings(2 << 20)));
            let used = (12 << 20) as f64 / (large.took - small.took).as_secs_f64();
            println!("{line:?}: 12 MiB in {:?}, then {used:.0} bytes a second; {large:?}", small.took);
            assert!(used >= rate.min(2 << 20) as f64 * 0.7, "{used} bytes a second, {line:?}");
        }
    }

    #[test]
    fn a_queue_holds_at_most_what_the_line_carries_in_a_few_seconds() {
        let mut rng = fastrand::Rng::with_seed(2);
        for _ in 0..40 {
            let line = Line { lost: 0, ..random_line(&mut rng) };
            let settings = settings(2 << 20);
            let Transfer { most, queue, .. } = transfer(12 << 20, &line, &settings);
            let first = Duration::from_secs_f64(settings.window as f64 / line.rate as f64);
            assert!(queue <= first.max(Duration::from_secs(3)), "{queue:?} of queue, {line:?}");
            assert!(most <= settings.window * 8, "{most} bytes on their way, {line:?}");
        }
    }

    #[test]
    fn the_rate_stays_within_its_limits_whatever_is_acknowledged() {
        let mut rng = fastrand::Rng::with_seed(3);
        for most in [1, 1000, FIRST, 3 << 20, u64::MAX] {
            let settings = settings(most);
            let mut pace = Pace::new(&settings);
            let (mut sent, mut acknowledged, mut now) = (0_u64, 0, Duration::ZERO);
            for _ in 0..3000 {
                now += Duration::from_millis(rng.u64(0..400));
                match rng.u32(0..6) {
                    0 => pace.stop(),
                    1 => pace.hold(),
                    2 => {
                        acknowledged = rng.u64(acknowledged..=sent);
                        pace.acknowledge(acknowledged, sent, now);
                    }
                    _ => {
                        sent += rng.u64(1..1 << 20);
                        pace.send(sent, now);
                    }
                }
                let Rate { per_second, burst } = pace.rate();
                assert!((FIRST.min(most)..=most).contains(&per_second) && burst <= most / 8);
                assert!(pace.window() >= settings.window);
            }
        }
    }
}
