//! Staging buffers for launches, reused from one launch to the next.

use std::ops::Range;

use bytemuck::Pod;

use super::device::{Device, Fault, HostMemory};
use super::layout::{Address, StrataTable, strata_table};
use crate::ground::Ground;

/// The whole input of a launch in one buffer, so that one copy uploads it.
pub(super) struct InputBuffer {
    host: Box<dyn HostMemory>,
    device: u64,
    len: usize,
    /// Largest size needed since the last trim, in bytes.
    needed: usize,
}

/// A part of an [`InputBuffer`]: offset and length in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Section {
    start: usize,
    len: usize,
}

/// Lays out the sections of an [`InputBuffer`], in order.
#[derive(Debug, Default)]
pub(super) struct StagingLayout(usize);

/// Sections are aligned to this many bytes.
const ALIGNMENT: usize = 16;

impl StagingLayout {
    /// Reserves a section of `count` entries.
    pub fn section<T>(&mut self, count: usize) -> Section {
        let start = self.0;
        let len = count * size_of::<T>();
        self.0 = start + len.next_multiple_of(ALIGNMENT);
        Section { start, len }
    }
}

/// A buffer shrinks if it is at least this many times as large as needed.
const TRIMMED: usize = 4;

/// Rounds a length up to leave spare room.
fn roomy(len: usize) -> usize {
    len.next_power_of_two().max(1 << 16)
}

impl InputBuffer {
    pub fn new(device: &mut dyn Device) -> Result<Self, Fault> {
        let len = roomy(0);
        let host = device.alloc_host(len)?;
        Ok(Self { host, device: device.alloc(len)?, len, needed: 0 })
    }

    /// Shrinks the buffer if it is much larger than was needed since the last trim. No work may be in flight.
    pub fn trim(&mut self, device: &mut dyn Device) -> Result<(), Fault> {
        let len = roomy(std::mem::take(&mut self.needed));
        if len <= self.len / TRIMMED { self.replace(device, len) } else { Ok(()) }
    }

    fn replace(&mut self, device: &mut dyn Device, len: usize) -> Result<(), Fault> {
        let (host, address) = (device.alloc_host(len)?, device.alloc(len)?);
        device.free(self.device);
        (self.host, self.device, self.len) = (host, address, len);
        Ok(())
    }

    /// Makes room for the layout. The previous content is lost.
    pub fn open(&mut self, device: &mut dyn Device, layout: &StagingLayout) -> Result<(), Fault> {
        self.needed = self.needed.max(layout.0);
        if layout.0 > self.len { self.replace(device, roomy(layout.0)) } else { Ok(()) }
    }

    /// Device address of a section.
    pub fn address(&self, section: Section) -> u64 {
        self.device + section.start as u64
    }

    /// Entries of a section, for writing.
    pub fn entries<T: Pod>(&mut self, section: Section) -> &mut [T] {
        let bytes = &mut self.host.bytes_mut()[section.start..section.start + section.len];
        bytemuck::cast_slice_mut(bytes)
    }

    /// Entries of three sections for writing. The sections must be in the order of the layout.
    pub fn entries_of<A: Pod, B: Pod, C: Pod>(
        &mut self,
        a: Section,
        b: Section,
        c: Section,
    ) -> (&mut [A], &mut [B], &mut [C]) {
        let (first, rest) = self.host.bytes_mut().split_at_mut(b.start);
        let (second, third) = rest.split_at_mut(c.start - b.start);
        (
            bytemuck::cast_slice_mut(&mut first[a.start..a.start + a.len]),
            bytemuck::cast_slice_mut(&mut second[..b.len]),
            bytemuck::cast_slice_mut(&mut third[..c.len]),
        )
    }

    /// Copies entries into a section.
    pub fn put<T: Pod>(&mut self, section: Section, entries: &[T]) {
        self.entries(section).copy_from_slice(entries);
    }

    /// Uploads all sections.
    pub fn send(&self, device: &mut dyn Device, layout: &StagingLayout) -> Result<(), Fault> {
        // SAFETY: `open` made the device memory at least as long as the layout, and callers wait before they open
        // it again.
        unsafe { device.upload(&*self.host, 0..layout.0, self.device) }
    }
}

/// The section of a ground's strata; nothing without any.
pub(super) struct StrataInput {
    table: Option<Box<StrataTable>>,
    section: Section,
}

impl StrataInput {
    /// Reserves the section.
    pub fn plan(ground: &Ground, plan: &mut StagingLayout) -> Self {
        let table = strata_table(ground).map(Box::new);
        let section = plan.section::<StrataTable>(table.iter().len());
        Self { table, section }
    }

    /// Writes the table.
    pub fn put(&self, input: &mut InputBuffer) {
        if let Some(table) = &self.table {
            input.put(self.section, std::slice::from_ref(&**table));
        }
    }

    /// The address of the table; 0 without strata.
    pub fn address(&self, input: &InputBuffer) -> Address {
        if self.table.is_some() { input.address(self.section) } else { 0 }
    }
}

/// Memory on the device that kernels write for later launches.
#[derive(Default)]
pub(super) struct DeviceBuffer {
    /// Address and length, if allocated.
    own: Option<(u64, usize)>,
    /// Largest size needed since the last trim, in bytes.
    needed: usize,
}

impl DeviceBuffer {
    /// Makes room. The previous content is lost, and no work may be in flight.
    pub fn reserve(&mut self, device: &mut dyn Device, bytes: usize) -> Result<(), Fault> {
        self.needed = self.needed.max(bytes);
        if self.own.is_some_and(|(_, len)| bytes <= len) {
            return Ok(());
        }
        self.release(device);
        let len = roomy(bytes);
        self.own = Some((device.alloc(len)?, len));
        Ok(())
    }

    /// The buffer's address, once there is [room](Self::reserve).
    pub fn address(&self) -> u64 {
        self.own.map_or(0, |(address, _)| address)
    }

    /// Frees the memory if it is much larger than was needed since the last trim. No work may be in flight.
    pub fn trim(&mut self, device: &mut dyn Device) {
        let needed = std::mem::take(&mut self.needed);
        if self.own.is_some_and(|(_, len)| needed == 0 || roomy(needed) <= len / TRIMMED) {
            self.release(device);
        }
    }

    fn release(&mut self, device: &mut dyn Device) {
        if let Some((address, _)) = self.own.take() {
            device.free(address);
        }
    }
}

/// The byte that [`OutputList::wipe`] writes: an invalid entry for kernels and host.
const WIPED: u8 = 0xff;

/// A list that kernels write. A short list is written directly to host memory (zero copy) if the device supports
/// that. A long list is written to device memory, and its used part is copied afterwards.
pub(super) struct OutputList {
    entry: usize,
    /// The initial capacity, in entries.
    first: usize,
    host: Box<dyn HostMemory>,
    capacity: usize,
    /// Address and capacity in device memory, if allocated. The capacity never exceeds that of the host memory.
    own: Option<(u64, usize)>,
    is_long: bool,
    /// Entries at the front of the host memory that have been written since they were wiped.
    stale: usize,
    /// Largest numbers of entries needed since the last trim: in total, and on the device.
    needed: [usize; 2],
}

/// Adds slack of a fourth. Kernels count entries in 32 bits.
fn with_slack(entries: usize) -> usize {
    entries.saturating_add(entries / 4).min(u32::MAX as usize)
}

impl OutputList {
    /// A list of entries of `entry` bytes.
    pub fn new(device: &mut dyn Device, entry: usize, capacity: usize) -> Result<Self, Fault> {
        let host = device.alloc_host(entry * capacity)?;
        Ok(Self {
            entry,
            first: capacity,
            host,
            capacity,
            own: None,
            is_long: false,
            stale: capacity,
            needed: [0; 2],
        })
    }

    /// Shrinks the list if it is much longer than was needed since the last trim. No work may be in flight, and the
    /// content is lost.
    pub fn trim(&mut self, device: &mut dyn Device) -> Result<(), Fault> {
        let [room, own] = std::mem::take(&mut self.needed).map(|needed| with_slack(needed).max(self.first));
        if let Some((address, _)) =
            self.own.take_if(|(_, capacity)| *capacity > self.first && own <= *capacity / TRIMMED)
        {
            device.free(address);
        }
        if room <= self.capacity / TRIMMED {
            // Keep the old memory until the new one is allocated.
            let host = device.alloc_host(room * self.entry)?;
            (self.host, self.capacity, self.stale) = (host, room, room);
            // The device list must not be longer than the host's.
            if let Some((address, _)) = self.own.take_if(|(_, capacity)| *capacity > room) {
                device.free(address);
            }
        }
        Ok(())
    }

    /// Starts to read entries from another device address. They arrive with the next [`Device::wait`].
    pub fn read(&mut self, device: &mut dyn Device, from: u64, entries: usize) -> Result<(), Fault> {
        // SAFETY: callers pass the address of at least this many entries, and read them after a wait.
        unsafe { device.download(from, &mut *self.host, 0..entries * self.entry) }
    }

    /// Number of entries that the next kernel may write.
    pub fn capacity(&self) -> u32 {
        let own = self.own.map_or(0, |(_, capacity)| capacity);
        (if self.is_own() { own } else { self.capacity }) as u32
    }

    /// Whether the next kernel writes directly to host memory.
    pub fn is_mapped(&self) -> bool {
        !self.is_own()
    }

    /// Marks entries as unwritten before the next launch, if that writes to host memory.
    pub fn wipe(&mut self) {
        if self.is_own() {
            return;
        }
        self.host.bytes_mut()[..self.stale * self.entry].fill(WIPED);
        self.stale = 0;
    }

    /// Notes that this many entries at the front are written.
    pub fn wrote(&mut self, entries: usize) {
        self.stale = self.stale.max(entries.min(self.capacity));
    }

    /// Whether it is written to device memory.
    fn is_own(&self) -> bool {
        self.is_long || self.host.address().is_none()
    }

    /// Makes room for `entries`, in device memory if `is_long`, and returns whether there was too little; then the
    /// content is lost. If memory runs out, the host list keeps its size; the device list may be freed until a
    /// later call succeeds.
    pub fn reserve(&mut self, device: &mut dyn Device, entries: usize, is_long: bool) -> Result<bool, Fault> {
        self.is_long = is_long;
        let is_own = usize::from(self.is_own());
        self.needed[..=is_own].iter_mut().for_each(|needed| *needed = entries.max(*needed));
        let is_short = entries > self.capacity() as usize;
        if !is_short && (!self.is_own() || self.own.is_some()) {
            return Ok(false);
        }
        // The host's capacity says nothing about the device, which may have much less memory.
        let room = with_slack(entries).max(self.first);
        let own = if self.is_own() { Some(self.alloc_own(device, room)?) } else { None };
        if room > self.capacity {
            match device.alloc_host(room * self.entry) {
                Ok(host) => (self.host, self.capacity, self.stale) = (host, room, room),
                Err(fault) => {
                    if let Some(address) = own {
                        device.free(address);
                    }
                    return Err(fault);
                }
            }
        }
        if let Some(address) = own
            && let Some((former, _)) = self.own.replace((address, room))
        {
            device.free(former);
        }
        Ok(is_short)
    }

    /// Allocates device memory. If it does not fit in addition to the present allocation, frees that one
    /// first.
    fn alloc_own(&mut self, device: &mut dyn Device, room: usize) -> Result<u64, Fault> {
        match device.alloc(room * self.entry) {
            Err(Fault::Memory(_) | Fault::Budget(_)) if self.own.is_some() => {
                if let Some((former, _)) = self.own.take() {
                    device.free(former);
                }
                device.alloc(room * self.entry)
            }
            allocated => allocated,
        }
    }

    /// Address that the next kernel writes to.
    pub fn address(&self) -> u64 {
        let own = self.own.map(|(address, _)| address);
        (if self.is_own() { own } else { self.host.address() }).unwrap_or_default()
    }

    /// Ensures that these entries are on the host after the next [`Device::wait`]; returns whether a wait is
    /// needed.
    pub fn fetch(&mut self, device: &mut dyn Device, entries: usize) -> Result<bool, Fault> {
        self.fetch_part(device, 0..entries)
    }

    /// Fetches a range of entries.
    pub fn fetch_part(&mut self, device: &mut dyn Device, entries: Range<usize>) -> Result<bool, Fault> {
        match self.own {
            Some((address, _)) if !entries.is_empty() && self.is_own() => {
                self.wrote(entries.end);
                let bytes = entries.start * self.entry..entries.end * self.entry;
                // SAFETY: the device list has no more entries than the host's. They are read after a wait, or after
                // a mark that follows.
                unsafe { device.download(address + bytes.start as u64, &mut *self.host, bytes) }
                    .map(|()| true)
            }
            _ => Ok(false),
        }
    }

    /// The first entries.
    pub fn entries<T: Pod>(&self, count: usize) -> &[T] {
        bytemuck::cast_slice(&self.host.bytes()[..count * size_of::<T>()])
    }

    /// A range of entries, while others may still be in flight.
    pub fn part<T: Pod>(&self, entries: Range<usize>) -> Option<&[T]> {
        let bytes = entries.start.checked_mul(size_of::<T>())?..entries.end.checked_mul(size_of::<T>())?;
        self.host.bytes_of(bytes).map(bytemuck::cast_slice)
    }
}
