//! A cache of records on the device: assigns slots, and evicts old ones when they run out.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use rayon::prelude::*;

use super::device::{Device, Fault};
use crate::volume::Brick;

/// Slots for records of one kind.
pub(super) struct RecordCache {
    /// Size of a record in bytes.
    record: usize,
    /// Device address of the first slot.
    base: u64,
    /// The largest number of slots.
    most: usize,
    slots: Vec<Slot>,
    free: Vec<u32>,
    round: u32,
    /// Where the search for slots to evict continues.
    hand: usize,
}

/// A slot. Atomics, as several threads fill slots at once.
#[derive(Default)]
struct Slot {
    /// The unique stamp of its content, which is never reused; 0 if empty.
    stamp: AtomicU64,
    /// The round in which it was last used.
    used: AtomicU32,
}

/// Number of slots that eviction examines before it checks whether enough are free.
const PIECE: usize = 1 << 14;

/// Initial number of slots. Growing takes half a millisecond, which the first digs should not pay.
const FIRST: usize = 1 << 14;

/// From this many slots on, they are taken in parallel.
const LONG: usize = 1 << 10;

/// Reserves unique stamps, and returns the first.
fn stamps(count: usize) -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(count as u64, Ordering::Relaxed)
}

/// A tag is a slot number in this many low bits, and a stamp above.
const SLOT_BITS: u32 = 24;

impl RecordCache {
    /// An empty cache that may use up to `budget` bytes.
    pub fn new(record: usize, budget: usize) -> Self {
        Self {
            record,
            base: 0,
            most: (budget / record).min(1 << SLOT_BITS),
            slots: Vec::new(),
            free: Vec::new(),
            round: 1,
            hand: 0,
        }
    }

    /// Device address of the first slot.
    pub fn base(&self) -> u64 {
        self.base
    }

    /// Device address of a slot.
    pub fn address(&self, slot: u32) -> u64 {
        self.base + u64::from(slot) * self.record as u64
    }

    /// Begins a round. Slots used in it are not evicted before the next one.
    pub fn begin(&mut self) {
        self.round = self.round.wrapping_add(1).max(1);
    }

    /// The slot of a tag, if it still has that content.
    pub fn find(&self, tag: u64) -> Option<u32> {
        let number = tag as u32 & ((1 << SLOT_BITS) - 1);
        let slot = self.slots.get(number as usize)?;
        if tag == 0 || slot.stamp.load(Ordering::Relaxed) != tag >> SLOT_BITS {
            return None;
        }
        // Store only if the round changed: threads find the same bricks, and needless writes would contend for
        // cache lines.
        if slot.used.load(Ordering::Relaxed) != self.round {
            slot.used.store(self.round, Ordering::Relaxed);
        }
        Some(number)
    }

    /// Takes a slot, and returns it with its tag.
    ///
    /// May move the records, which waits for the device.
    ///
    /// # Errors
    /// [`Fault::Budget`] if all slots are in use in this round.
    pub fn take(&mut self, device: &mut dyn Device) -> Result<(u32, u64), Fault> {
        self.make_room(device, 1)?;
        let slot = self.free.pop().ok_or(Fault::Budget(self.most * self.record))?;
        Ok((slot, self.put(slot, stamps(1))))
    }

    /// Takes slots for all entries of a list, or for none. Appends slots and tags to `taken`, and writes the result
    /// of `with` for each entry and its slot to `out`.
    pub fn take_many<T: Sync, R: Send>(
        &mut self,
        device: &mut dyn Device,
        list: &[T],
        out: &mut [R],
        taken: &mut Vec<(u32, u64)>,
        with: impl Fn(&T, u32) -> R + Sync,
    ) -> Result<(), Fault> {
        let rest = self.make_room(device, list.len())?;
        let (free, first) = (&self.free[rest..], stamps(list.len()));
        let put = |((number, &slot), (entry, out)): ((usize, &u32), (&T, &mut R))| {
            *out = with(entry, slot);
            (slot, self.put(slot, first + number as u64))
        };
        if list.len() < LONG {
            taken.extend(free.iter().rev().enumerate().zip(list.iter().zip(out)).map(put));
        } else {
            let entries = list.par_iter().zip(out);
            taken.par_extend(free.par_iter().rev().enumerate().zip(entries).map(put));
        }
        self.free.truncate(rest);
        Ok(())
    }

    /// Ensures that `count` slots are free; returns how many more are.
    fn make_room(&mut self, device: &mut dyn Device, count: usize) -> Result<usize, Fault> {
        let full = Fault::Budget(self.most * self.record);
        if count > self.most {
            return Err(full);
        }
        while self.free.len() < count && self.grow(device, count)? {}
        if self.free.len() < count {
            self.evict(count);
        }
        self.free.len().checked_sub(count).ok_or(full)
    }

    /// Marks a slot as filled, and returns its tag.
    fn put(&self, number: u32, stamp: u64) -> u64 {
        let slot = &self.slots[number as usize];
        slot.stamp.store(stamp, Ordering::Relaxed);
        slot.used.store(self.round, Ordering::Relaxed);
        stamp << SLOT_BITS | u64::from(number)
    }

    /// Empties all slots.
    pub fn clear(&mut self) {
        self.slots.iter_mut().for_each(|slot| *slot.stamp.get_mut() = 0);
        self.free.clear();
        self.free.extend((0..self.slots.len() as u32).rev());
    }

    /// Frees the memory of all slots. Their content has to be uploaded again.
    pub fn release(&mut self, device: &mut dyn Device) {
        if !self.slots.is_empty() {
            device.free(self.base);
            *self = Self { base: 0, hand: 0, slots: Vec::new(), free: Vec::new(), ..*self };
        }
    }

    /// Gives a slot back.
    pub fn release_slot(&mut self, slot: u32) {
        *self.slots[slot as usize].stamp.get_mut() = 0;
        self.free.push(slot);
    }

    /// At least doubles the number of slots, and adds at least `more`, within the budget. Returns whether it grew.
    fn grow(&mut self, device: &mut dyn Device, more: usize) -> Result<bool, Fault> {
        let old = self.slots.len();
        let new = (old * 2).max(old + more).max(FIRST).min(self.most);
        if new <= old {
            return Ok(false);
        }
        let base = match device.alloc(new * self.record) {
            Ok(base) => base,
            Err(Fault::Memory(_) | Fault::Budget(_)) => return Ok(false),
            Err(fault) => return Err(fault),
        };
        if old > 0 {
            device.wait()?;
            // SAFETY: both are allocations of at least this many records, and they are distinct.
            unsafe { device.copy(self.base, base, old * self.record) }?;
            device.wait()?;
            device.free(self.base);
        }
        self.base = base;
        self.slots.resize_with(new, Slot::default);
        self.free.extend((old as u32..new as u32).rev());
        Ok(true)
    }

    /// Evicts slots that were not used in this round: as many as wanted, and at least an eighth of all.
    fn evict(&mut self, wanted: usize) {
        let all = self.slots.len();
        let (mut looked, round) = (0, self.round);
        while self.free.len() < wanted.max(all / 8) && looked < all {
            let first = self.hand;
            let end = (first + PIECE.min(all.div_ceil(8))).min(all).min(first + all - looked);
            let freed = |(number, slot): (usize, &mut Slot)| {
                let (stamp, used) = (slot.stamp.get_mut(), *slot.used.get_mut());
                let is_old = *stamp != 0 && used != round;
                is_old.then(|| {
                    *stamp = 0;
                    (first + number) as u32
                })
            };
            self.free.par_extend(self.slots[first..end].par_iter_mut().enumerate().filter_map(freed));
            looked += end - first;
            self.hand = end % all;
        }
    }
}

/// A kernel's reference to a brick in a slot.
pub(super) fn reference(slot: u32, brick: &Brick) -> u32 {
    slot << 1 | u32::from(brick.material_bytes() > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cuda::tests::device;

    /// Takes many slots at once.
    fn take(slots: &mut RecordCache, device: &mut dyn Device, count: usize, out: &mut Vec<(u32, u64)>) {
        let (list, mut found) = (vec![7; count], vec![0; count]);
        let taken = slots.take_many(device, &list, &mut found, out, |entry, slot| slot + entry);
        taken.expect("room for all");
        assert!(found.iter().zip(&*out).all(|(found, (slot, _))| *found == slot + 7));
    }

    #[test]
    fn what_was_not_used_lately_makes_room_and_the_rest_stays() {
        let Some(mut device) = device() else { return };
        let most = 3 * FIRST + 77;
        let mut slots = RecordCache::new(16, most * 16);
        let mut rounds: Vec<Vec<(u32, u64)>> = Vec::new();
        for round in 0..40 {
            slots.begin();
            // Some of the previous round's slots are used again.
            let again = rounds.last().map(|taken| taken[..2000].to_vec()).unwrap_or_default();
            let kept: Vec<_> = again.into_iter().filter(|&(_, tag)| slots.find(tag).is_some()).collect();
            let mut taken = Vec::new();
            take(&mut slots, &mut *device, 9000 + round, &mut taken);
            let mut all: Vec<u32> = taken.iter().chain(&kept).map(|&(slot, _)| slot).collect();
            assert!(taken.iter().chain(&kept).all(|&(slot, tag)| slots.find(tag) == Some(slot)));
            all.sort_unstable();
            all.dedup();
            assert_eq!(all.len(), taken.len() + kept.len(), "no slot is given twice");
            assert_eq!(kept.len(), if round == 0 { 0 } else { 2000 });
            rounds.push(taken);
        }
    }

    #[test]
    fn what_is_given_back_is_not_found_and_makes_room() {
        // Sequentially, and in parallel.
        for count in [100, LONG] {
            let Some(mut device) = device() else { return };
            let mut slots = RecordCache::new(16, count * 16);
            let mut taken = Vec::new();
            slots.begin();
            take(&mut slots, &mut *device, count, &mut taken);
            assert!(taken.iter().map(|&(slot, _)| slot).eq(0..count as u32));
            assert!(taken.iter().all(|&(slot, tag)| slots.find(tag) == Some(slot)));
            assert!(slots.take(&mut *device).is_err(), "all are in use in this round");
            slots.release_slot(taken[7].0);
            assert_eq!((slots.find(taken[7].1), slots.find(taken[8].1)), (None, Some(taken[8].0)));
            let (again, tag) = slots.take(&mut *device).expect("room for one");
            assert_eq!((again, slots.find(tag), slots.find(taken[7].1)), (taken[7].0, Some(again), None));
            slots.clear();
            assert!(taken.iter().all(|&(_, tag)| slots.find(tag).is_none()));
            taken.clear();
            take(&mut slots, &mut *device, count, &mut taken);
        }
    }
}
