//! How many bytes of a lane may be on their way to a client: as many as its line carries, so that the lane neither leaves the
//! line idle nor fills its queue, in which the edits of the live game would wait.

use std::collections::VecDeque;
use std::time::Duration;

/// Bytes that may be on their way in any case: so few that they show how long a line takes without a queue.
const LEAST: u64 = 4 << 10;

/// Bytes by which what may be on its way grows in a second before anything is acknowledged.
const UNKNOWN: u64 = 96 << 10;

/// The least time over which a rate is measured.
const SPAN: Duration = Duration::from_millis(700);

/// How long measurements count.
const MEMORY: Duration = Duration::from_secs(3);

/// How long bytes may wait in the line's queue, on top of the time that they need without any other bytes.
const QUEUE: Duration = Duration::from_millis(100);

/// Acknowledgements come at intervals of this at most while all goes well.
const STEADY: Duration = Duration::from_millis(300);

/// How much may be on its way, in percent of what was measured: if the line carries it, the next measurement is higher.
const PROBE: u64 = 115;

/// The same while measurements have risen lately.
const FIRST_PROBE: u64 = 150;

/// A rate that rises by less than this in percent of the one before has not risen.
const RISE: u64 = 105;

/// How long a line counts as unknown after the rate has risen.
const LATELY: Duration = Duration::from_millis(1500);

/// The most measurements of a kind that are kept: more often than that, they are skipped.
const MOST: usize = 256;

/// What acknowledgements say about a line.
///
/// A line is described by the rate at which bytes were acknowledged and by the shortest time that an acknowledgement took. Lost
/// packets make an ordered lane stand still and then deliver everything at once: such pauses are told from a queue by their
/// unsteadiness, and are bridged by more bytes.
#[derive(Default)]
pub struct Pace {
    /// When all bytes up to a number were sent, without those that are acknowledged.
    sent: VecDeque<(Duration, u64)>,
    /// When all bytes up to a number had been acknowledged.
    acknowledged: VecDeque<(Duration, u64)>,
    /// Measured bytes a second.
    rates: VecDeque<(Duration, u64)>,
    /// Pauses that are longer than steady ones.
    pauses: VecDeque<(Duration, Duration)>,
    /// When the first bytes were sent.
    began: Option<Duration>,
    /// The shortest time from sending to acknowledgement.
    shortest: Option<Duration>,
    /// The greatest rate while the line was not known, and when it rose.
    most: u64,
    rose: Duration,
    /// Whether the rate has stopped rising.
    is_known: bool,
    /// When something was acknowledged last, or sent after everything had been.
    last: Duration,
}

impl Pace {
    /// Records that bytes up to a number are sent; `acknowledged` of them have arrived.
    pub fn send(&mut self, total: u64, acknowledged: u64, now: Duration) {
        self.began.get_or_insert(now);
        if self.sent.is_empty() {
            if self.acknowledged.is_empty() || now.saturating_sub(self.last) > STEADY {
                // Nothing was to be sent: rates are measured anew.
                self.acknowledged.clear();
                self.acknowledged.push_back((now, acknowledged));
            }
            self.last = now;
        }
        let is_full = self.sent.len() >= MOST;
        match self.sent.back_mut() {
            Some((at, last)) if *at == now || is_full => *last = total,
            _ => self.sent.push_back((now, total)),
        }
    }

    /// Records that bytes up to a number have arrived.
    pub fn acknowledge(&mut self, total: u64, now: Duration) {
        while let Some((at, _)) = self.sent.pop_front_if(|(_, last)| *last <= total) {
            let took = now.saturating_sub(at);
            self.shortest = Some(self.shortest.map_or(took, |shortest| shortest.min(took)));
        }
        forget(&mut self.pauses, now);
        forget(&mut self.rates, now);
        let pause = now.saturating_sub(self.last);
        if pause > STEADY {
            remember(&mut self.pauses, now, pause);
        }
        self.last = now;
        // The latest measurement that is old enough, and none older.
        let is_old = |at: Duration| now.saturating_sub(at) >= SPAN;
        while self.acknowledged.get(1).is_some_and(|(at, _)| is_old(*at)) {
            self.acknowledged.pop_front();
        }
        if let Some(&(at, before)) = self.acknowledged.front()
            && is_old(at)
        {
            let nanos = now.saturating_sub(at).as_nanos().max(1);
            let rate = u128::from(total.saturating_sub(before)) * 1_000_000_000 / nanos;
            let rate = u64::try_from(rate).unwrap_or(u64::MAX);
            if !self.is_known && rate >= self.most.saturating_mul(RISE) / 100 {
                (self.most, self.rose) = (rate, now);
            }
            self.is_known |=
                now.saturating_sub(self.rose) > LATELY.max(2 * self.shortest.unwrap_or_default());
            remember(&mut self.rates, now, rate);
        }
        if self.acknowledged.len() < MOST {
            self.acknowledged.push_back((now, total));
        }
    }

    /// How many bytes may be on their way.
    pub fn window(&self, now: Duration) -> u64 {
        let greatest = |list: &VecDeque<(Duration, u64)>| list.iter().map(|(_, value)| *value).max();
        let Some(shortest) = self.shortest else {
            let millis = now.saturating_sub(self.began.unwrap_or(now)).as_millis();
            return LEAST
                .saturating_add(u64::try_from(millis).unwrap_or(u64::MAX).saturating_mul(UNKNOWN) / 1000);
        };
        let Some(rate) = greatest(&self.rates) else { return LEAST };
        let pause = self.pauses.iter().map(|(_, pause)| *pause).max().unwrap_or_default();
        let millis = u64::try_from((shortest + QUEUE + pause).as_millis()).unwrap_or(u64::MAX);
        let probe = if self.is_known { PROBE } else { FIRST_PROBE };
        LEAST.max(rate.saturating_mul(millis) / 1000 * probe / 100)
    }
}

/// Forgets old measurements.
fn forget<T>(list: &mut VecDeque<(Duration, T)>, now: Duration) {
    while list.pop_front_if(|(at, _)| now.saturating_sub(*at) > MEMORY).is_some() {}
}

/// Adds a measurement.
fn remember<T>(list: &mut VecDeque<(Duration, T)>, now: Duration, value: T) {
    if list.len() >= MOST {
        list.pop_front();
    }
    list.push_back((now, value));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line with a rate in bytes a second, a time there and back, and every so many packets one that is lost and comes this
    /// much later.
    struct Line {
        rate: u64,
        way: Duration,
        lost: Option<(u64, Duration)>,
    }

    /// Sends as much as is allowed for some seconds; returns the acknowledged bytes of the second half a second, and how long the
    /// line's queue was at most then.
    fn play(line: &Line, seconds: u64) -> (u64, Duration) {
        let (mut pace, mut now, mut free) = (Pace::default(), Duration::ZERO, Duration::ZERO);
        let (mut sent, mut acknowledged, mut packets) = (0_u64, 0, 0);
        let mut arriving = VecDeque::new();
        let (mut last, mut half, mut queue) = (Duration::ZERO, 0, Duration::ZERO);
        while now < Duration::from_secs(seconds) {
            now += Duration::from_millis(33);
            let mut arrived = None;
            while let Some((_, total)) = arriving.pop_front_if(|(at, _)| *at <= now) {
                arrived = Some(total);
            }
            if let Some(total) = arrived {
                acknowledged = total;
                pace.acknowledge(total, now);
            }
            while sent - acknowledged + 1024 <= pace.window(now) {
                (sent, packets) = (sent + 1024, packets + 1);
                pace.send(sent, acknowledged, now);
                free = free.max(now) + Duration::from_secs_f64(1024.0 / line.rate as f64);
                let lost = line.lost.filter(|(every, _)| packets % every == 0).map(|(_, more)| more);
                last = last.max(free + line.way + lost.unwrap_or_default());
                arriving.push_back((last, sent));
            }
            if now * 2 >= Duration::from_secs(seconds) {
                half = if half == 0 { acknowledged.max(1) } else { half };
                queue = queue.max(free.saturating_sub(now));
            }
        }
        ((acknowledged - half) * 2 / seconds, queue)
    }

    #[test]
    fn lines_are_used_and_their_queues_stay_short() {
        for rate in [64 << 10, 256 << 10, 1_250_000, 8 << 20] {
            for way in [20, 100, 400].map(Duration::from_millis) {
                let (used, queue) = play(&Line { rate, way, lost: None }, 40);
                println!("{rate} bytes/s, {way:?}: {used} bytes/s, queue {queue:?}");
                assert!(used * 10 >= rate * 8, "{used} of {rate} bytes a second are used, {way:?}");
                let most = QUEUE * 2 + way / 4;
                assert!(queue <= most, "{queue:?} in the queue of {rate} bytes a second, {way:?}");
            }
        }
    }

    #[test]
    fn lost_packets_do_not_slow_it_down() {
        for rate in [256 << 10, 1_250_000] {
            let lost = Some((20, Duration::from_millis(600)));
            let (used, queue) = play(&Line { rate, way: Duration::from_millis(400), lost }, 60);
            println!("{rate} bytes/s with losses: {used} bytes/s, queue {queue:?}");
            assert!(used * 10 >= rate * 7, "{used} of {rate} bytes a second are used");
        }
    }
}
