//! What kernels say of edits, as ledgers.

use std::sync::Arc;

use super::super::device::{Device, Fault};
use super::super::layout::{self, EditCount, EditPart, EditResult, MATERIAL_BYTES, NONE, RECORD_BYTES};
use super::super::mail::{Outbox, map};
use super::Target;
use crate::ground::MaterialId;
use crate::lattice::ChunkGrid;
use crate::volume::{Brick, Count, DraftedBrick, EditWork, Fate, Job, Ledger, PartEffect};

/// Bricks that one thread makes of what came back.
const GROUP: usize = 64;

/// What the edit kernel writes.
pub(in super::super) struct EditOutput {
    pub results: Outbox,
    pub records: Outbox,
    pub materials: Outbox,
    pub parts: Outbox,
    pub counts: Outbox,
    pub totals: Outbox,
}

/// How many entries of each list the kernel wanted to write.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Totals {
    records: usize,
    materials: usize,
    parts: usize,
    counts: usize,
}

/// Entries that there is room for at the start.
const FIRST: usize = 1 << 8;

impl EditOutput {
    pub fn new(device: &mut dyn Device) -> Result<Self, Fault> {
        Ok(Self {
            results: Outbox::new(device, size_of::<EditResult>(), FIRST)?,
            records: Outbox::new(device, RECORD_BYTES, FIRST)?,
            materials: Outbox::new(device, MATERIAL_BYTES, FIRST)?,
            parts: Outbox::new(device, size_of::<EditPart>(), 4 * FIRST)?,
            counts: Outbox::new(device, size_of::<EditCount>(), 4 * FIRST)?,
            totals: Outbox::new(device, size_of::<u32>(), 4)?,
        })
    }

    /// Room for all that; says whether there was too little.
    pub(super) fn reserve(
        &mut self,
        device: &mut dyn Device,
        totals: Totals,
        is_long: bool,
    ) -> Result<bool, Fault> {
        let mut grown = self.records.reserve(device, totals.records, is_long)?;
        grown |= self.materials.reserve(device, totals.materials, is_long)?;
        grown |= self.parts.reserve(device, totals.parts, is_long)?;
        grown |= self.counts.reserve(device, totals.counts, is_long)?;
        Ok(grown)
    }

    /// Copies what is not here yet.
    pub(super) fn fetch(&mut self, device: &mut dyn Device, totals: Totals) -> Result<(), Fault> {
        let mut is_copied = self.records.fetch(device, totals.records)?;
        is_copied |= self.materials.fetch(device, totals.materials)?;
        is_copied |= self.parts.fetch(device, totals.parts)?;
        is_copied |= self.counts.fetch(device, totals.counts)?;
        if is_copied { device.wait() } else { Ok(()) }
    }

    /// How much of each list was written. Asking the device takes longer than a small launch; so where lists are in the
    /// host's memory, they are wiped before, and end where no entry stands.
    pub(super) fn totals(&mut self, results: usize) -> Totals {
        if !self.parts.is_mapped() {
            let mut totals = [0; 4];
            totals.copy_from_slice(self.totals.entries::<u32>(4));
            let [records, materials, parts, counts] = totals.map(|count: u32| count as usize);
            return Totals { records, materials, parts, counts };
        }
        let (parts, counts) = (self.parts.capacity() as usize, self.counts.capacity() as usize);
        let parts = self.parts.entries::<EditPart>(parts).iter().take_while(|part| part.job != NONE).count();
        let counts =
            self.counts.entries::<EditCount>(counts).iter().take_while(|count| count.edit != NONE).count();
        self.parts.wrote(parts);
        self.counts.wrote(counts);
        // A list that is full may have been too short; nobody knows by how much.
        let wanted = |count: usize, list: &Outbox| match list.capacity() as usize {
            full if full == count => 2 * count,
            _ => count,
        };
        let mut totals = Totals {
            records: 0,
            materials: 0,
            parts: wanted(parts, &self.parts),
            counts: wanted(counts, &self.counts),
        };
        for result in self.results.entries::<EditResult>(results) {
            let is = |flag: u32| result.flags & flag != 0;
            let is_stored = is(EditResult::CHANGED) && !is(EditResult::UNIFORM);
            totals.records += usize::from(is_stored);
            totals.materials += usize::from(is_stored && is(EditResult::HAS_MATERIALS));
        }
        totals
    }
}

impl EditOutput {
    /// Did new ground look farther for its material than windows reach?
    pub fn is_too_far(&self, results: usize) -> bool {
        let is = |result: &EditResult| result.flags & EditResult::TOO_FAR != 0;
        self.results.entries::<EditResult>(results).iter().any(is)
    }

    /// What came back, as ledgers.
    pub(super) fn ledgers(
        &self,
        work: &EditWork,
        bricks: &[&[Job]],
        targets: &[Target],
        totals: Totals,
    ) -> Vec<Ledger> {
        let results = self.results.entries::<EditResult>(bricks.len());
        let group = |((bricks, results), targets): &((&[&[Job]], &[EditResult]), &[Target])| {
            let mut ledger = Ledger::default();
            for ((jobs, result), &(_, tag)) in bricks.iter().zip(*results).zip(*targets) {
                let Some(job) = jobs.first().filter(|_| result.flags & EditResult::CHANGED != 0) else {
                    continue;
                };
                let (pos, Some(brick)) = (job.pos(), self.brick(result, tag)) else { continue };
                ledger.hash = ledger.hash.wrapping_add(result.hash);
                let changed = layout::unpack_box(result.bounds, pos.origin());
                let is_extended = result.flags & EditResult::EXTENDED != 0;
                ledger.bricks.push(DraftedBrick::new(pos, Arc::new(brick), changed, is_extended));
            }
            ledger
        };
        let groups: Vec<_> =
            bricks.chunks(GROUP).zip(results.chunks(GROUP)).zip(targets.chunks(GROUP)).collect();
        let mut ledgers = map(&groups, 2, group);
        if let Some(first) = ledgers.first_mut() {
            let parts = self.parts.entries::<EditPart>(totals.parts).iter();
            first.parts = parts.filter_map(|part| effect(work.grid, bricks, part)).collect();
            first.counts = self.counts.entries::<EditCount>(totals.counts).iter().map(count).collect();
        }
        ledgers
    }

    /// The brick of a result, whose place on the device has this tag.
    fn brick<'a>(&'a self, result: &EditResult, tag: u64) -> Option<Brick> {
        let has_materials = result.flags & EditResult::HAS_MATERIALS != 0;
        if result.flags & EditResult::UNIFORM != 0 {
            let [low, high, material, _] = result.uniform.to_le_bytes();
            let material = has_materials.then_some(MaterialId(material));
            return Some(Brick::of_one(i16::from_le_bytes([low, high]), material));
        }
        let entry = |list: &'a Outbox, number: u32, bytes: usize| {
            list.entries::<u8>((number as usize + 1) * bytes).get(number as usize * bytes..)
        };
        let record = entry(&self.records, result.record, RECORD_BYTES).unwrap_or_default();
        let materials = has_materials.then(|| entry(&self.materials, result.material, MATERIAL_BYTES));
        let brick = layout::brick_of(record, materials.flatten())?;
        brick.tag.set(tag);
        Some(brick)
    }
}

/// What an edit changed in a chunk's part of a brick.
fn effect(grid: ChunkGrid, bricks: &[&[Job]], part: &EditPart) -> Option<PartEffect> {
    let pos = bricks.get(part.job as usize)?.first()?.pos();
    let bounds = layout::unpack_box(part.bounds, pos.origin());
    Some(PartEffect { edit: part.edit as usize, chunk: layout::part_chunk(grid, pos, part.part), bounds })
}

fn count(count: &EditCount) -> Count {
    let [fate, material, ..] = count.fate.to_le_bytes();
    let fate = match fate {
        0 => Fate::Removed,
        1 => Fate::Added,
        2 => Fate::Painted,
        3 => Fate::Protected,
        4 => Fate::Unbreakable,
        5 => Fate::TooHard,
        _ => Fate::Slowed,
    };
    Count { edit: count.edit as usize, fate, material: MaterialId(material), voxels: count.voxels.into() }
}
