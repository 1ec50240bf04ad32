//! A network on a virtual clock: reliable, ordered lanes over a line that is slow and loses packets.

use std::collections::VecDeque;
use std::time::Duration;

use fastrand::Rng;

/// The properties of a line.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    pub latency: Duration,
    /// The latency varies by at most this much.
    pub jitter: Duration,
    /// Lost packets of a hundred.
    pub lost: u32,
    /// Lost packets are sent again after this time.
    pub timeout: Duration,
    /// Bytes a second, all lanes of a direction together.
    pub rate: u64,
}

impl Line {
    /// 200 +- 50 ms, 5 % loss.
    pub const BAD: Self = Self {
        latency: Duration::from_millis(200),
        jitter: Duration::from_millis(50),
        lost: 5,
        timeout: Duration::from_millis(600),
        rate: 4 << 20,
    };

    /// The time that a packet takes, including repetitions.
    fn delay(&self, rng: &mut Rng) -> Duration {
        let jitter = 2.0 * self.jitter.as_secs_f64() * rng.f64();
        let mut delay = self.latency - self.jitter + Duration::from_secs_f64(jitter);
        while rng.u32(0..100) < self.lost {
            delay += self.timeout;
        }
        delay
    }
}

/// Messages in transit in one lane, with their times of arrival.
#[derive(Default)]
pub struct Way {
    messages: VecDeque<(Duration, Vec<u8>)>,
    last: Duration,
    pub bytes: usize,
    /// The most bytes that were in transit at once.
    pub most: usize,
}

impl Way {
    /// Sends a message; `free` is the time at which the line is free.
    pub fn send(&mut self, message: Vec<u8>, now: Duration, free: &mut Duration, line: &Line, rng: &mut Rng) {
        *free = (*free).max(now) + Duration::from_secs_f64(message.len() as f64 / line.rate as f64);
        // Later packets wait for repeated ones.
        self.last = self.last.max(*free + line.delay(rng));
        self.bytes += message.len();
        self.most = self.most.max(self.bytes);
        self.messages.push_back((self.last, message));
    }

    /// The next message that has arrived, and when it did.
    pub fn next(&mut self, now: Duration) -> Option<(Duration, Vec<u8>)> {
        let (at, message) = self.messages.pop_front_if(|(at, _)| *at <= now)?;
        self.bytes -= message.len();
        Some((at, message))
    }
}

#[test]
fn messages_arrive_in_order_and_some_late() {
    let (mut rng, mut way, mut free) = (Rng::with_seed(1), Way::default(), Duration::ZERO);
    let sent = |number: u32| Duration::from_millis(u64::from(number) * 20);
    let (mut arrived, mut late) = (Vec::new(), 0);
    for number in 0..2000_u32 {
        way.send(number.to_le_bytes().to_vec(), sent(number), &mut free, &Line::BAD, &mut rng);
        while let Some((at, message)) = way.next(sent(number)) {
            arrived.push(u32::from_le_bytes(message.try_into().expect("four bytes")));
            let took = at - sent(arrived.len() as u32 - 1);
            assert!(took >= Duration::from_millis(150));
            late += u32::from(took > Duration::from_millis(251));
        }
    }
    assert!(arrived.len() > 1900 && arrived.iter().copied().eq(0..arrived.len() as u32));
    assert!((200..1800).contains(&late), "{late} are late");
}
