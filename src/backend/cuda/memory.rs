//! Budgets of device memory and of pinned host memory.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use rustc_hash::FxHashMap;

use super::device::{Device, DeviceResult, Fault, HostMemory, Launch, Mark, forward};
use crate::backend::EngineSettings;

/// Default budget: this fraction of the free device memory, as a divisor, up to a maximum.
const SHARE: usize = 4;
const MOST: usize = 2 << 30;

/// Fraction of the budget for bricks and ground, as a divisor. The rest is for input and output of launches.
const RECORDS: usize = 2;

/// Limits of allocations, in bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Device memory; `None` for the default.
    pub device: Option<usize>,
    /// Bricks and ground on the device; `None` for the default share.
    pub records: Option<usize>,
    /// Pinned host memory.
    pub host: usize,
}

impl Limits {
    pub fn new(settings: &EngineSettings) -> Self {
        Self { device: settings.device_memory, records: None, host: settings.pinned_memory }
    }

    /// Wraps a device to enforce the limits. Also returns the bytes for bricks and ground.
    pub fn enforce(self, mut own: Box<dyn Device>, usage: &Arc<Usage>) -> (Box<dyn Device>, usize) {
        let device = self.device.unwrap_or_else(|| (own.free_memory() / SHARE).min(MOST));
        let (usage, sizes) = (Arc::clone(usage), FxHashMap::default());
        let records = self.records.unwrap_or(device / RECORDS);
        (Box::new(Budgeted { own, limits: [device, self.host], usage, sizes }), records)
    }
}

/// Bytes allocated now, readable from any thread.
#[derive(Debug, Default)]
pub(super) struct Usage {
    device: AtomicUsize,
    host: AtomicUsize,
    host_allocations: AtomicU64,
}

impl Usage {
    /// Bytes on the device, and of pinned host memory.
    pub fn bytes(&self) -> [usize; 2] {
        [&self.device, &self.host].map(|bytes| bytes.load(Ordering::Relaxed))
    }

    /// Number of allocations of host memory. An allocation of a few megabytes takes about a millisecond.
    pub fn host_allocations(&self) -> u64 {
        self.host_allocations.load(Ordering::Relaxed)
    }
}

/// A device that stays within its limits.
struct Budgeted {
    own: Box<dyn Device>,
    limits: [usize; 2],
    usage: Arc<Usage>,
    /// Size of each allocation by address.
    sizes: FxHashMap<u64, usize>,
}

/// Whether this many more bytes stay within the limit.
fn check(used: &AtomicUsize, limit: usize, bytes: usize) -> Result<(), Fault> {
    let used = used.load(Ordering::Relaxed).saturating_add(bytes);
    if used > limit { Err(Fault::Budget(limit)) } else { Ok(()) }
}

/// Host memory that is counted in the usage.
struct Counted {
    own: Box<dyn HostMemory>,
    bytes: usize,
    usage: Arc<Usage>,
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.usage.host.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

impl HostMemory for Counted {
    fn bytes(&self) -> &[u8] {
        self.own.bytes()
    }

    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]> {
        self.own.bytes_of(range)
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        self.own.bytes_mut()
    }

    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]> {
        self.own.bytes_of_mut(range)
    }

    fn address(&self) -> Option<u64> {
        self.own.address()
    }
}

impl Device for Budgeted {
    forward!(own: name free_memory upload download copy launch mark times wait);

    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
        check(&self.usage.device, self.limits[0], bytes)?;
        let address = self.own.alloc(bytes)?;
        self.sizes.insert(address, bytes);
        self.usage.device.fetch_add(bytes, Ordering::Relaxed);
        Ok(address)
    }

    fn free(&mut self, address: u64) {
        self.usage.device.fetch_sub(self.sizes.remove(&address).unwrap_or_default(), Ordering::Relaxed);
        self.own.free(address);
    }

    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        check(&self.usage.host, self.limits[1], bytes)?;
        let own = self.own.alloc_host(bytes)?;
        self.usage.host.fetch_add(bytes, Ordering::Relaxed);
        self.usage.host_allocations.fetch_add(1, Ordering::Relaxed);
        Ok(Box::new(Counted { own, bytes, usage: Arc::clone(&self.usage) }))
    }
}

impl Drop for Budgeted {
    fn drop(&mut self) {
        // The inner device frees the remaining allocations.
        self.usage.device.fetch_sub(self.sizes.values().sum(), Ordering::Relaxed);
    }
}
