//! Converts the output of the edit kernels to edit deltas.

use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::super::device::{Device, Fault};
use super::super::layout::{
    self, BrickRecord, EditCount, EditJob, EditPart, EditResult, MATERIAL_BYTES, NONE, RECORD_BYTES,
};
use super::super::lists::{map, map_numbers};
use super::super::staging::OutputList;
use crate::edits::{DraftedBrick, EditDelta};
use crate::ground::MaterialId;
use crate::lattice::ChunkGrid;
use crate::volume::{Brick, VoxelOutcome};

/// From this many bricks on, they are processed in parallel.
pub(super) const LONG: usize = 1024;

/// Bricks that a thread takes at a time; few enough to balance the load.
pub(super) const PIECE: usize = 256;

/// The slot for a changed brick, and its tag.
pub(super) type Target = (u32, u64);

/// Entries of each list that are summed in one delta.
const ENTRIES: usize = 1024;

/// The output lists of the edit kernels.
pub(in super::super) struct EditOutput {
    pub results: OutputList,
    pub records: OutputList,
    pub materials: OutputList,
    pub parts: OutputList,
    pub counts: OutputList,
    pub totals: OutputList,
}

/// Number of entries of each list that the kernel needs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Totals {
    records: usize,
    materials: usize,
    parts: usize,
    counts: usize,
}

/// Initial capacity in entries.
const FIRST: usize = 1 << 8;

impl EditOutput {
    pub fn new(device: &mut dyn Device) -> Result<Self, Fault> {
        Ok(Self {
            results: OutputList::new(device, size_of::<EditResult>(), FIRST)?,
            records: OutputList::new(device, RECORD_BYTES, FIRST)?,
            materials: OutputList::new(device, MATERIAL_BYTES, FIRST)?,
            parts: OutputList::new(device, size_of::<EditPart>(), 4 * FIRST)?,
            counts: OutputList::new(device, size_of::<EditCount>(), 4 * FIRST)?,
            totals: OutputList::new(device, size_of::<u32>(), 4)?,
        })
    }

    /// All lists whose length depends on the work.
    pub fn lists_mut(&mut self) -> [&mut OutputList; 5] {
        let Self { results, records, materials, parts, counts, totals: _ } = self;
        [results, records, materials, parts, counts]
    }

    /// Makes room for these totals, and returns whether there was too little.
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

    /// Copies parts and counts to the host unless they are there already.
    pub(super) fn fetch_entries(&mut self, device: &mut dyn Device, totals: Totals) -> Result<(), Fault> {
        let mut is_copied = self.parts.fetch(device, totals.parts)?;
        is_copied |= self.counts.fetch(device, totals.counts)?;
        if is_copied { device.wait() } else { Ok(()) }
    }

    /// Starts to copy brick records and materials unless they are on the host already; returns whether to wait for
    /// them.
    pub(super) fn begin_bricks(&mut self, device: &mut dyn Device, totals: Totals) -> Result<bool, Fault> {
        let mut is_copied = self.records.fetch(device, totals.records)?;
        is_copied |= self.materials.fetch(device, totals.materials)?;
        Ok(is_copied)
    }

    /// Number of written entries of each list. Reading counters from the device takes longer than a small
    /// launch. Lists in host memory are therefore wiped before the launch, and end at the first wiped entry.
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
        // A full list may have been too short by an unknown number of entries.
        let wanted = |count: usize, list: &OutputList| match list.capacity() as usize {
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
    /// Whether new ground had to search beyond the windows for its material.
    pub fn is_too_far(&self, results: usize) -> bool {
        let is = |result: &EditResult| result.flags & EditResult::TOO_FAR != 0;
        let results = self.results.entries::<EditResult>(results);
        if results.len() < LONG { results.iter().any(is) } else { results.par_iter().any(is) }
    }

    /// Parts and counts as deltas, each of which sums some entries of any bricks.
    pub(super) fn entries(&self, grid: ChunkGrid, jobs: &[EditJob], totals: Totals) -> Vec<EditDelta> {
        let parts = self.parts.entries::<EditPart>(totals.parts);
        let counts = self.counts.entries::<EditCount>(totals.counts);
        map_numbers(parts.len().max(counts.len()).div_ceil(ENTRIES), 2, |number| {
            let mut delta = EditDelta::default();
            piece(parts, ENTRIES, number).iter().for_each(|part| add_part(grid, jobs, part, &mut delta));
            piece(counts, ENTRIES, number).iter().for_each(|count| add_count(count, &mut delta));
            delta
        })
    }

    /// The bricks that changed.
    pub(super) fn changed(&self, results: usize, totals: Totals) -> Result<Changed, Fault> {
        let results = self.results.entries::<EditResult>(results);
        let found = map_numbers(results.len().div_ceil(PIECE), LONG / PIECE, |number| {
            let mut found = Changed { numbers: Vec::with_capacity(PIECE), ..Changed::default() };
            for (own, result) in ((number * PIECE) as u32..).zip(piece(results, PIECE, number)) {
                if result.flags & EditResult::CHANGED == 0 {
                    continue;
                }
                found.numbers.push(own);
                found.hash = found.hash.wrapping_add(result.hash);
                if result.flags & EditResult::UNIFORM == 0 {
                    is_there(result, totals).then_some(())?;
                } else if !found.uniform.contains(&Uniform::new(result)) {
                    found.uniform.push(Uniform::new(result));
                }
            }
            Some(found)
        });
        let Some(found) = found.into_iter().collect::<Option<Vec<_>>>() else {
            return Err(Fault::Failed("bricks beyond the ends of their lists".into()));
        };
        let mut all = Changed::default();
        for mut found in found {
            all.numbers.append(&mut found.numbers);
            all.hash = all.hash.wrapping_add(found.hash);
            all.uniform.append(&mut found.uniform);
        }
        Ok(all)
    }

    /// Builds these bricks, in order.
    pub(super) fn bricks(
        &self,
        changed: &Changed,
        jobs: &[EditJob],
        targets: &[Target],
        totals: Totals,
    ) -> EditDelta {
        let results = self.results.entries::<EditResult>(jobs.len());
        let records = self.records.entries::<BrickRecord>(totals.records);
        let materials = self.materials.entries::<[u8; MATERIAL_BYTES]>(totals.materials);
        let uniform: FxHashMap<Uniform, Arc<Brick>> =
            changed.uniform.iter().map(|&kind| (kind, kind.brick())).collect();
        let stored = |result: &EditResult, tag: u64| {
            let has_materials = result.flags & EditResult::HAS_MATERIALS != 0;
            let materials = has_materials.then(|| &materials[result.material as usize]);
            let brick = layout::brick_of(&records[result.record as usize], materials);
            brick.tag.set(tag);
            Arc::new(brick)
        };
        let drafted = |&number: &u32| {
            let (job, result) = (&jobs[number as usize], &results[number as usize]);
            let brick = match result.flags & EditResult::UNIFORM {
                0 => stored(result, targets[number as usize].1),
                _ => Arc::clone(&uniform[&Uniform::new(result)]),
            };
            let bounds = layout::unpack_box(result.bounds, job.pos().origin());
            DraftedBrick::new(job.pos(), brick, bounds, result.flags & EditResult::EXTENDED != 0)
        };
        let bricks = map(&changed.numbers, LONG, drafted);
        EditDelta { bricks, hash: changed.hash, ..EditDelta::default() }
    }
}

/// Whether the entries of a result lie within the lists.
fn is_there(result: &EditResult, totals: Totals) -> bool {
    let has_materials = result.flags & EditResult::HAS_MATERIALS != 0;
    (result.record as usize) < totals.records
        && (!has_materials || (result.material as usize) < totals.materials)
}

/// The content of a uniform brick.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Uniform {
    /// Sample and material, in the format of results.
    of: u32,
    has_materials: bool,
}

impl Uniform {
    fn new(result: &EditResult) -> Self {
        Self { of: result.uniform, has_materials: result.flags & EditResult::HAS_MATERIALS != 0 }
    }

    fn brick(self) -> Arc<Brick> {
        let [low, high, material, _] = self.of.to_le_bytes();
        let material = self.has_materials.then_some(MaterialId(material));
        Arc::new(Brick::of_one(i16::from_le_bytes([low, high]), material))
    }
}

/// Bricks that changed.
#[derive(Default)]
pub(super) struct Changed {
    numbers: Vec<u32>,
    /// Change of the world's hash.
    hash: u64,
    /// The kinds of uniform bricks, possibly with duplicates.
    uniform: Vec<Uniform>,
}

/// The piece with this number; shorter or empty at the end of the list.
fn piece<T>(list: &[T], length: usize, number: usize) -> &[T] {
    list.chunks(length).nth(number).unwrap_or_default()
}

/// Adds the bounds that an edit changed in one chunk's part of a brick.
fn add_part(grid: ChunkGrid, jobs: &[EditJob], part: &EditPart, delta: &mut EditDelta) {
    let Some(pos) = jobs.get(part.job as usize).map(EditJob::pos) else { return };
    let bounds = layout::unpack_box(part.bounds, pos.origin());
    delta.reach(part.edit as usize, layout::part_chunk(grid, pos, part.part), bounds);
}

/// Adds a count of voxels.
fn add_count(count: &EditCount, delta: &mut EditDelta) {
    let [outcome, material, ..] = count.outcome.to_le_bytes();
    let outcome = match outcome {
        0 => VoxelOutcome::Removed,
        1 => VoxelOutcome::Added,
        2 => VoxelOutcome::Painted,
        3 => VoxelOutcome::Protected,
        4 => VoxelOutcome::Unbreakable,
        5 => VoxelOutcome::TooHard,
        _ => VoxelOutcome::Slowed,
    };
    delta.counts(count.edit as usize).add(outcome, MaterialId(material), count.voxels.into());
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use fastrand::Rng;
    use glam::IVec3;

    use super::*;
    use crate::lattice::LatticeBox;

    #[test]
    fn adjacent_parts_are_merged_and_nothing_is_left_out() {
        let (mut rng, grid) = (Rng::with_seed(4), ChunkGrid::new(20, 300, 300));
        let job = |x: i32| EditJob { brick: [x, x % 3, 2], ..EditJob::default() };
        let jobs: Vec<EditJob> = (0..30).map(job).collect();
        let (mut delta, mut expected) = (EditDelta::default(), BTreeMap::new());
        for number in 0..600 {
            let (job, edit, part) = (number / 20, rng.u32(0..3), rng.u32(0..2));
            let pos = jobs[job as usize].pos();
            let point = pos.origin() + IVec3::new(rng.i32(0..8), 3, 4);
            let bounds = layout::pack_box(LatticeBox::point(point), pos.origin());
            add_part(grid, &jobs, &EditPart { job, edit, part, bounds }, &mut delta);
            let key = (edit as usize, layout::part_chunk(grid, pos, part));
            LatticeBox::include(expected.entry(key).or_default(), LatticeBox::point(point));
        }
        // A part of an unknown job is ignored.
        add_part(grid, &jobs, &EditPart { job: 30, ..EditPart::default() }, &mut delta);
        let mut found = BTreeMap::new();
        for part in &delta.parts {
            LatticeBox::include(found.entry((part.edit, part.chunk)).or_default(), part.bounds);
        }
        assert_eq!(found, expected);
        assert!(delta.parts.len() < 150, "{} parts", delta.parts.len());
    }

    #[test]
    fn adjacent_counts_are_merged_and_no_voxel_is_left_out() {
        let (mut rng, mut delta, mut expected) = (Rng::with_seed(5), EditDelta::default(), BTreeMap::new());
        for number in 0..900 {
            let (edit, outcome, voxels) = (number / 300, rng.u32(0..7) | rng.u32(0..2) << 8, rng.u32(1..500));
            add_count(&EditCount { edit, outcome, voxels, pad: 0 }, &mut delta);
            *expected.entry((edit as usize, outcome)).or_insert(0) += u64::from(voxels);
        }
        let mut found = BTreeMap::new();
        for count in &delta.counts {
            let outcome = count.outcome as u32 | u32::from(count.material.0) << 8;
            *found.entry((count.edit, outcome)).or_insert(0) += count.voxels;
        }
        assert_eq!(found, expected);
        assert!(delta.counts.len() < 600, "{} counts", delta.counts.len());
    }

    #[test]
    fn pieces_of_a_list_are_all_of_it() {
        let list: Vec<u32> = (0..10).collect();
        let all = [0, 1, 2, 3].map(|number| piece(&list, 4, number));
        assert_eq!(all, [&list[..4], &list[4..8], &list[8..], &[]]);
    }
}
