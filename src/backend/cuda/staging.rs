//! Staging buffers of launches, kept from one launch to the next.

use std::ops::Range;

use bytemuck::Pod;

use super::device::{Device, Fault, HostMemory};

/// The input of a launch in one piece, so that it takes one copy.
pub(super) struct InputBuffer {
    host: Box<dyn HostMemory>,
    device: u64,
    len: usize,
    /// Bytes that were needed since it was trimmed.
    needed: usize,
}

/// Where something is in an [`InputBuffer`]: offset and length in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Section {
    start: usize,
    len: usize,
}

/// The sections of an [`InputBuffer`], in order.
#[derive(Debug, Default)]
pub(super) struct StagingLayout(usize);

/// Sections start at multiples of this.
const ALIGNMENT: usize = 16;

impl StagingLayout {
    /// Room for so many entries.
    pub fn section<T>(&mut self, count: usize) -> Section {
        let start = self.0;
        let len = count * size_of::<T>();
        self.0 = start + len.next_multiple_of(ALIGNMENT);
        Section { start, len }
    }
}

/// A buffer shrinks if it is this many times as large as needed.
const TRIMMED: usize = 4;

/// Allocates with room to spare.
fn roomy(len: usize) -> usize {
    len.next_power_of_two().max(1 << 16)
}

impl InputBuffer {
    pub fn new(device: &mut dyn Device) -> Result<Self, Fault> {
        let len = roomy(0);
        let host = device.alloc_host(len)?;
        Ok(Self { host, device: device.alloc(len)?, len, needed: 0 })
    }

    /// Shrinks it if it is much larger than what was needed since the last time. Nothing may be under way.
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

    /// Makes room for these sections. The previous content is lost.
    pub fn open(&mut self, device: &mut dyn Device, layout: &StagingLayout) -> Result<(), Fault> {
        self.needed = self.needed.max(layout.0);
        if layout.0 > self.len { self.replace(device, roomy(layout.0)) } else { Ok(()) }
    }

    /// Where kernels find a section.
    pub fn address(&self, section: Section) -> u64 {
        self.device + section.start as u64
    }

    /// A section's entries, to be written.
    pub fn entries<T: Pod>(&mut self, section: Section) -> &mut [T] {
        let bytes = &mut self.host.bytes_mut()[section.start..section.start + section.len];
        bytemuck::cast_slice_mut(bytes)
    }

    /// The entries of three sections at once, to be written; they must be in the order in which they were planned.
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

    /// Sends all of it.
    pub fn send(&self, device: &mut dyn Device, layout: &StagingLayout) -> Result<(), Fault> {
        // SAFETY: `open` made the device's memory as long as the layout, and callers wait before they open it again.
        unsafe { device.upload(&*self.host, 0..layout.0, self.device) }
    }
}

/// The byte that [`OutputList::wipe`] writes: an invalid entry for kernels and host.
const WIPED: u8 = 0xff;

/// A list that kernels write. Short lists are written directly to the host's memory (zero copy) if the device can; long ones
/// to its own memory, and their used part is copied afterwards.
pub(super) struct OutputList {
    entry: usize,
    /// How many entries there was room for at the start.
    first: usize,
    host: Box<dyn HostMemory>,
    capacity: usize,
    /// Address, and how many entries there is room for, never more than in the host's memory; none at first.
    own: Option<(u64, usize)>,
    is_long: bool,
    /// Entries at the front of the host's memory that are not wiped.
    stale: usize,
    /// Entries that were needed since it was trimmed: in all, and on the device.
    needed: [usize; 2],
}

/// So many entries and a fourth more; kernels count them in 32 bits.
fn with_slack(entries: usize) -> usize {
    entries.saturating_add(entries / 4).min(u32::MAX as usize)
}

impl OutputList {
    /// A list of entries of so many bytes, with room for some.
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

    /// Shrinks it if it is much longer than what was needed since the last time. Nothing may be under way, and what was in it
    /// is gone then.
    pub fn trim(&mut self, device: &mut dyn Device) -> Result<(), Fault> {
        let [room, own] = std::mem::take(&mut self.needed).map(|needed| with_slack(needed).max(self.first));
        if let Some((address, _)) =
            self.own.take_if(|(_, capacity)| *capacity > self.first && own <= *capacity / TRIMMED)
        {
            device.free(address);
        }
        if room <= self.capacity / TRIMMED {
            // Before memory of that length is there, the old one stays.
            let host = device.alloc_host(room * self.entry)?;
            (self.host, self.capacity, self.stale) = (host, room, room);
            // It may not be longer than the host's.
            if let Some((address, _)) = self.own.take_if(|(_, capacity)| *capacity > room) {
                device.free(address);
            }
        }
        Ok(())
    }

    /// Reads entries from elsewhere on the device; they are here after the next [`Device::wait`].
    pub fn read(&mut self, device: &mut dyn Device, from: u64, entries: usize) -> Result<(), Fault> {
        // SAFETY: callers give a list of so many entries, and read it after a wait.
        unsafe { device.download(from, &mut *self.host, 0..entries * self.entry) }
    }

    /// How many entries kernels may write.
    pub fn capacity(&self) -> u32 {
        let own = self.own.map_or(0, |(_, capacity)| capacity);
        (if self.is_own() { own } else { self.capacity }) as u32
    }

    /// Does the next kernel write it straight into the host's memory?
    pub fn is_mapped(&self) -> bool {
        !self.is_own()
    }

    /// Wipes whatever was written, before the next launch, if that writes here.
    pub fn wipe(&mut self) {
        if self.is_own() {
            return;
        }
        self.host.bytes_mut()[..self.stale * self.entry].fill(WIPED);
        self.stale = 0;
    }

    /// So many entries at the front are said to be written.
    pub fn wrote(&mut self, entries: usize) {
        self.stale = self.stale.max(entries.min(self.capacity));
    }

    /// Is it written on the device?
    fn is_own(&self) -> bool {
        self.is_long || self.host.address().is_none()
    }

    /// Room for so many entries, of a list that will be long or not; says whether there was too little. What was in it is
    /// gone then. Where memory ran out, it is as large as it was or, on the device, not there until there is some again.
    pub fn reserve(&mut self, device: &mut dyn Device, entries: usize, is_long: bool) -> Result<bool, Fault> {
        self.is_long = is_long;
        let is_own = usize::from(self.is_own());
        self.needed[..=is_own].iter_mut().for_each(|needed| *needed = entries.max(*needed));
        let is_short = entries > self.capacity() as usize;
        if !is_short && (!self.is_own() || self.own.is_some()) {
            return Ok(false);
        }
        // What the host has room for says nothing of the device, which may have much less.
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

    /// A list on the device. Where there is no room for it beside the one that it takes the place of, that one goes first.
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

    /// Where kernels write.
    pub fn address(&self) -> u64 {
        let own = self.own.map(|(address, _)| address);
        (if self.is_own() { own } else { self.host.address() }).unwrap_or_default()
    }

    /// Ensures that so many entries are on the host after the next [`Device::wait`], and returns whether a wait is needed.
    pub fn fetch(&mut self, device: &mut dyn Device, entries: usize) -> Result<bool, Fault> {
        self.fetch_part(device, 0..entries)
    }

    /// The same for some entries.
    pub fn fetch_part(&mut self, device: &mut dyn Device, entries: Range<usize>) -> Result<bool, Fault> {
        match self.own {
            Some((address, _)) if !entries.is_empty() && self.is_own() => {
                self.wrote(entries.end);
                let bytes = entries.start * self.entry..entries.end * self.entry;
                // SAFETY: the list on the device has as many entries as the host's, and they are read after a wait, or after a
                // mark that follows.
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

    /// Some entries, while others may still be on their way.
    pub fn part<T: Pod>(&self, entries: Range<usize>) -> Option<&[T]> {
        let bytes = entries.start.checked_mul(size_of::<T>())?..entries.end.checked_mul(size_of::<T>())?;
        self.host.bytes_of(bytes).map(bytemuck::cast_slice)
    }
}
