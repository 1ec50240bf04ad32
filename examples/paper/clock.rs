//! Two clocks: the time that passes, as the paper took it, and the processor time of this thread, which leaves out what
//! else the machine does meanwhile. On a busy machine the first one makes long edits longer than short ones.

use std::time::Instant;

use serde::{Deserialize, Serialize};

/// Seconds that something took.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Lap {
    /// By the wall clock.
    pub seconds: f64,
    /// Of the processor; those of the wall clock where the system does not tell.
    pub processor: f64,
}

/// Calls `work` and takes its time.
pub fn time<T>(work: impl FnOnce() -> T) -> (Lap, T) {
    let before = processor();
    let start = Instant::now();
    let result = work();
    let seconds = start.elapsed().as_secs_f64();
    let processor = before.zip(processor()).map_or(seconds, |(before, after)| after - before);
    (Lap { seconds, processor }, result)
}

/// Is the processor's time known?
pub const IS_KNOWN: bool = cfg!(target_os = "linux");

/// Seconds that the processor spent on this thread.
#[cfg(target_os = "linux")]
fn processor() -> Option<f64> {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Some(now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9)
}

#[cfg(not(target_os = "linux"))]
fn processor() -> Option<f64> {
    None
}
