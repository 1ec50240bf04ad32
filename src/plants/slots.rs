//! Places of plants in the buffers that the vertex shader reads.

use std::collections::{BTreeMap, BTreeSet};

/// What the shader knows of a plant.
pub(super) type Record = [u32; 4];

/// Slots are taken by the word of 32.
const WORD: u32 = 32;

/// The records of all plants that are drawn, and a bit for each that does not stand.
#[derive(Debug, Default)]
pub(super) struct Slots {
    records: Vec<Record>,
    gone: Vec<u32>,
    /// Free stretches by their start.
    free: BTreeMap<u32, u32>,
    /// Words whose records and bits differ from the buffers.
    changed_records: BTreeSet<u32>,
    changed_bits: BTreeSet<u32>,
}

/// A part of a buffer.
#[derive(Debug, PartialEq)]
pub(super) struct Bytes {
    pub offset: u64,
    pub bytes: Vec<u8>,
}

/// Rounds up to whole words.
fn whole(count: u32) -> u32 {
    count.div_ceil(WORD).max(1) * WORD
}

impl Slots {
    /// Number of slots, free ones included.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Takes `count` slots one after the other, all of them absent; returns the first.
    pub fn take(&mut self, count: u32) -> u32 {
        let count = whole(count);
        let found = self.free.iter().find(|(_, room)| **room >= count).map(|(start, room)| (*start, *room));
        let (start, room) = found.unwrap_or_else(|| {
            // Twice as many, so that buffers seldom become others.
            let (start, more) = (self.len() as u32, count.max(self.len() as u32).max(4096));
            self.records.resize((start + more) as usize, [0; 4]);
            self.gone.resize(self.records.len().div_ceil(32), u32::MAX);
            (start, more)
        });
        self.free.remove(&start);
        if room > count {
            self.free.insert(start + count, room - count);
        }
        start
    }

    /// Frees slots that were taken together.
    pub fn give(&mut self, start: u32, count: u32) {
        let (mut start, mut count) = (start, whole(count));
        for word in start / WORD..(start + count) / WORD {
            self.gone[word as usize] = u32::MAX;
            self.changed_bits.insert(word);
        }
        if let Some(after) = self.free.remove(&(start + count)) {
            count += after;
        }
        if let Some((&before, &room)) = self.free.range(..start).next_back()
            && before + room == start
        {
            self.free.remove(&before);
            (start, count) = (before, count + room);
        }
        self.free.insert(start, count);
    }

    /// Writes a plant.
    pub fn write(&mut self, slot: u32, record: Record) {
        self.records[slot as usize] = record;
        self.changed_records.insert(slot / WORD);
    }

    /// Sets whether a plant stands.
    pub fn set(&mut self, slot: u32, stands: bool) {
        let (word, bit) = (&mut self.gone[(slot / WORD) as usize], 1 << (slot % WORD));
        *word = if stands { *word & !bit } else { *word | bit };
        self.changed_bits.insert(slot / WORD);
    }

    /// The sizes of both buffers in bytes.
    pub fn sizes(&self) -> [u64; 2] {
        [self.record_bytes().len() as u64, self.gone_bytes().len() as u64]
    }

    /// What differs from the buffers, in both: from now on they have it.
    pub fn take_changes(&mut self) -> [Vec<Bytes>; 2] {
        let (records, bits) =
            (std::mem::take(&mut self.changed_records), std::mem::take(&mut self.changed_bits));
        [
            stretches(&records, self.record_bytes(), size_of::<Record>() * WORD as usize),
            stretches(&bits, self.gone_bytes(), size_of::<u32>()),
        ]
    }

    /// The bytes of the records.
    pub fn record_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.records)
    }

    /// The bytes of the bits.
    pub fn gone_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.gone)
    }
}

/// Words that follow each other, as bytes.
fn stretches(words: &BTreeSet<u32>, all: &[u8], size: usize) -> Vec<Bytes> {
    let mut ranges: Vec<std::ops::Range<usize>> = Vec::new();
    for &word in words {
        let word = word as usize;
        match ranges.last_mut() {
            Some(last) if last.end == word => last.end += 1,
            _ => ranges.push(word..word + 1),
        }
    }
    let part = |range: std::ops::Range<usize>| Bytes {
        offset: (range.start * size) as u64,
        bytes: all[range.start * size..range.end * size].to_vec(),
    };
    ranges.into_iter().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    #[test]
    fn slots_are_never_taken_twice_and_come_back() {
        let (mut slots, mut rng) = (Slots::default(), Rng::with_seed(1));
        let mut taken: Vec<(u32, u32)> = Vec::new();
        for _ in 0..2000 {
            if rng.bool() && !taken.is_empty() {
                let (start, count) = taken.swap_remove(rng.usize(0..taken.len()));
                slots.give(start, count);
            } else {
                let count = rng.u32(1..300);
                let start = slots.take(count);
                assert!((start + count) as usize <= slots.len());
                let apart = |&(own, room): &(u32, u32)| start + count <= own || own + room <= start;
                assert!(taken.iter().all(apart));
                taken.push((start, count));
                (start..start + count).for_each(|slot| slots.set(slot, true));
            }
        }
        taken.drain(..).for_each(|(start, count)| slots.give(start, count));
        assert_eq!(slots.free.len(), 1, "free stretches join");
        assert!(slots.gone.iter().all(|word| *word == u32::MAX), "free slots are absent");
    }

    #[test]
    fn changes_make_old_buffers_new() {
        let (mut slots, mut rng) = (Slots::default(), Rng::with_seed(2));
        let start = slots.take(5000);
        slots.take_changes();
        let mut copies = [slots.record_bytes().to_vec(), slots.gone_bytes().to_vec()];
        for _ in 0..50 {
            for _ in 0..rng.u32(0..40) {
                let slot = start + rng.u32(0..5000);
                slots.write(slot, [rng.u32(..); 4]);
                slots.set(slot, rng.bool());
            }
            let changes = slots.take_changes();
            let written: usize = changes.iter().flatten().map(|change| change.bytes.len()).sum();
            assert!(written <= 40 * (512 + 4), "only what changed is written: {written} bytes");
            for (copy, changes) in copies.iter_mut().zip(changes) {
                for Bytes { offset, bytes } in changes {
                    copy[offset as usize..][..bytes.len()].copy_from_slice(&bytes);
                }
            }
            assert!(copies[0] == slots.record_bytes() && copies[1] == slots.gone_bytes());
        }
    }
}
