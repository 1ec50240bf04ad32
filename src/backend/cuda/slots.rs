//! Places for records on the device: which of them are taken, and which to give up when they run out.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use super::device::{Device, Fault};
use crate::volume::Brick;

/// Records of one kind on the device.
pub(super) struct Slots {
    /// Bytes of a record.
    record: usize,
    /// Where the first one is.
    base: u64,
    /// Most slots there may be.
    most: usize,
    /// What is in each slot, as a number that is never used again; 0 for nothing.
    stamps: Vec<u64>,
    /// In which round each was used last.
    used: Vec<AtomicU32>,
    free: Vec<u32>,
    round: u32,
    /// Where to look next for a slot that can be given up.
    hand: usize,
}

/// Slots at the start: growing takes half a millisecond of the transaction that needs more, so first digs should not.
const FIRST: usize = 1 << 14;

/// The first of so many numbers that no other record of this process has.
fn stamps(count: usize) -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(count as u64, Ordering::Relaxed)
}

/// Bits of a tag that are the slot; the rest is its stamp.
const SLOT_BITS: u32 = 24;

impl Slots {
    /// No slots yet; all together may take `budget` bytes.
    pub fn new(record: usize, budget: usize) -> Self {
        Self {
            record,
            base: 0,
            most: (budget / record).min(1 << SLOT_BITS),
            stamps: Vec::new(),
            used: Vec::new(),
            free: Vec::new(),
            round: 1,
            hand: 0,
        }
    }

    /// Where the first slot is.
    pub fn base(&self) -> u64 {
        self.base
    }

    /// Where a slot is.
    pub fn address(&self, slot: u32) -> u64 {
        self.base + u64::from(slot) * self.record as u64
    }

    /// Begins a round: what is used from now on stays until the next one.
    pub fn begin(&mut self) {
        self.round = self.round.wrapping_add(1).max(1);
    }

    /// The slot of a tag, if what was put there still is.
    pub fn find(&self, tag: u64) -> Option<u32> {
        let slot = tag as u32 & ((1 << SLOT_BITS) - 1);
        let is_there = tag != 0 && self.stamps.get(slot as usize) == Some(&(tag >> SLOT_BITS));
        is_there.then(|| {
            self.used[slot as usize].store(self.round, Ordering::Relaxed);
            slot
        })
    }

    /// A slot for something new, with its tag. `Budget` where all slots are in use in this round.
    ///
    /// May move the records, and then waits for the device.
    pub fn take(&mut self, device: &mut dyn Device) -> Result<(u32, u64), Fault> {
        let mut taken = Vec::with_capacity(1);
        self.take_many(device, 1, &mut taken)?;
        taken.pop().ok_or(Fault::Budget(self.most * self.record))
    }

    /// So many slots at once, all of them or none.
    pub fn take_many(
        &mut self,
        device: &mut dyn Device,
        count: usize,
        out: &mut Vec<(u32, u64)>,
    ) -> Result<(), Fault> {
        if count > self.most {
            return Err(Fault::Budget(self.most * self.record));
        }
        while self.free.len() < count && self.grow(device, count)? {}
        if self.free.len() < count {
            self.evict(count);
        }
        let Some(rest) = self.free.len().checked_sub(count) else {
            return Err(Fault::Budget(self.most * self.record));
        };
        let first = stamps(count);
        for (stamp, slot) in (first..).zip(self.free.drain(rest..).rev()) {
            self.stamps[slot as usize] = stamp;
            self.used[slot as usize].store(self.round, Ordering::Relaxed);
            out.push((slot, stamp << SLOT_BITS | u64::from(slot)));
        }
        Ok(())
    }

    /// Gives all slots back.
    pub fn clear(&mut self) {
        self.stamps.fill(0);
        self.free.clear();
        self.free.extend((0..self.stamps.len() as u32).rev());
    }

    /// Gives a slot back.
    pub fn give_back(&mut self, slot: u32) {
        self.stamps[slot as usize] = 0;
        self.free.push(slot);
    }

    /// Twice as many slots, and so many more at least, unless that is too many.
    fn grow(&mut self, device: &mut dyn Device, more: usize) -> Result<bool, Fault> {
        let old = self.stamps.len();
        let new = (old * 2).max(old + more).max(FIRST).min(self.most);
        if new <= old {
            return Ok(false);
        }
        let Ok(base) = device.alloc(new * self.record) else { return Ok(false) };
        if old > 0 {
            device.wait()?;
            device.copy(self.base, base, old * self.record)?;
            device.wait()?;
            device.free(self.base);
        }
        self.base = base;
        self.stamps.resize(new, 0);
        self.used.resize_with(new, AtomicU32::default);
        self.free.extend((old as u32..new as u32).rev());
        Ok(true)
    }

    /// Frees slots that were not used in this round: as many as are wanted, and an eighth of all at least.
    fn evict(&mut self, wanted: usize) {
        let all = self.stamps.len();
        for _ in 0..all {
            if self.free.len() >= wanted.max(all / 8) {
                break;
            }
            self.hand = (self.hand + 1) % all;
            let is_taken = self.stamps[self.hand] != 0;
            if is_taken && self.used[self.hand].load(Ordering::Relaxed) != self.round {
                self.give_back(self.hand as u32);
            }
        }
    }
}

/// How kernels refer to a brick in a slot.
pub(super) fn reference(slot: u32, brick: &Brick) -> u32 {
    slot << 1 | u32::from(brick.material_bytes() > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cuda::tests::device;

    #[test]
    fn what_is_given_back_is_not_found_and_makes_room() {
        let Some(mut device) = device() else { return };
        let mut slots = Slots::new(16, 100 * 16);
        let mut taken = Vec::new();
        slots.begin();
        slots.take_many(&mut *device, 100, &mut taken).expect("room for all");
        assert!(taken.iter().all(|&(slot, tag)| slots.find(tag) == Some(slot)));
        assert!(slots.take(&mut *device).is_err(), "all are in use in this round");
        slots.give_back(taken[7].0);
        assert_eq!((slots.find(taken[7].1), slots.find(taken[8].1)), (None, Some(taken[8].0)));
        slots.clear();
        assert!(taken.iter().all(|&(_, tag)| slots.find(tag).is_none()));
        taken.clear();
        slots.take_many(&mut *device, 100, &mut taken).expect("room for all again");
    }
}
