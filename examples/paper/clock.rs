//! Two clocks: the wall clock, as in the paper, and the CPU time of this thread, which excludes other load. On
//! a busy machine, long edits lose more wall-clock time to other processes than short ones.

use std::time::Instant;

use serde::{Deserialize, Serialize};

/// Seconds measured by both clocks.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Lap {
    /// By the wall clock.
    pub seconds: f64,
    /// CPU time; the wall-clock time where the system does not report it.
    pub processor: f64,
}

/// Calls `work` and measures its time.
pub fn time<T>(work: impl FnOnce() -> T) -> (Lap, T) {
    let before = processor();
    let start = Instant::now();
    let result = work();
    let seconds = start.elapsed().as_secs_f64();
    let processor = before.zip(processor()).map_or(seconds, |(before, after)| after - before);
    (Lap { seconds, processor }, result)
}

/// Whether CPU time is available.
pub const IS_KNOWN: bool = cfg!(target_os = "linux");

/// CPU time of this thread in seconds.
#[cfg(target_os = "linux")]
fn processor() -> Option<f64> {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Some(now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9)
}

#[cfg(not(target_os = "linux"))]
fn processor() -> Option<f64> {
    None
}
