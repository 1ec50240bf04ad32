//! Edits on the device: one launch for all bricks that they may reach.

use std::sync::Arc;

use super::device::{Device, Fault, Kernel};
use super::layout::{
    self, EditCount, EditJob, EditParams, EditPart, EditResult, MATERIAL_BYTES, MOST_JOBS, MOST_LIST, NONE,
    RECORD_BYTES,
};
use super::mail::{Outbox, Plan, fill, map};
use super::session::{Session, Uploads};
use super::slots::reference;
use crate::ground::MaterialId;
use crate::lattice::{BrickPos, ChunkGrid};
use crate::volume::{Brick, Count, DraftedBrick, EditWork, Fate, Job, Ledger, PartEffect, Tool};

/// What the edit kernel writes.
pub(super) struct EditOutput {
    results: Outbox,
    records: Outbox,
    materials: Outbox,
    parts: Outbox,
    counts: Outbox,
    totals: Outbox,
}

/// How many entries of each list the kernel wanted to write.
#[derive(Clone, Copy, Debug, Default)]
struct Totals {
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
    fn reserve(&mut self, device: &mut dyn Device, totals: Totals, is_long: bool) -> Result<bool, Fault> {
        let mut grown = self.records.reserve(device, totals.records, is_long)?;
        grown |= self.materials.reserve(device, totals.materials, is_long)?;
        grown |= self.parts.reserve(device, totals.parts, is_long)?;
        grown |= self.counts.reserve(device, totals.counts, is_long)?;
        Ok(grown)
    }

    /// Copies what is not here yet.
    fn fetch(&mut self, device: &mut dyn Device, totals: Totals) -> Result<(), Fault> {
        let mut is_copied = self.records.fetch(device, totals.records)?;
        is_copied |= self.materials.fetch(device, totals.materials)?;
        is_copied |= self.parts.fetch(device, totals.parts)?;
        is_copied |= self.counts.fetch(device, totals.counts)?;
        if is_copied { device.wait() } else { Ok(()) }
    }

    /// How much of each list was written. Asking the device takes longer than a small launch; so where lists are in the
    /// host's memory, they are wiped before, and end where no entry stands.
    fn totals(&mut self, results: usize) -> Totals {
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

/// From how many bricks on they are dealt with side by side.
const LONG: usize = 1024;

/// From how many bricks on they are copied, instead of written to the host's memory by the kernel.
const COPIED: usize = 256;

/// Most passes: each gives twice the room where it is not known how much is needed.
const PASSES: usize = 12;

/// Bricks that one thread makes of what came back.
const GROUP: usize = 64;

/// A slot that is to hold a changed brick, with its tag.
type Target = (u32, u64);

/// A brick that edits may reach: what it is now, its stack, and where its edits begin in the list.
struct Site {
    pos: BrickPos,
    base: u32,
    stack: u32,
    first: u32,
}

impl Session {
    /// Applies edits: what they changed, brick by brick.
    pub fn edit(&mut self, work: &EditWork) -> Result<Vec<Ledger>, Fault> {
        self.begin();
        let (bricks, mut uploads) = (work.bricks_in_reach(), Uploads::new(work.base.ground()));
        let mut targets = Vec::with_capacity(bricks.len());
        let ledgers = self.run_edits(work, &bricks, &mut uploads, &mut targets);
        if ledgers.is_err() {
            self.give_up(&uploads);
            targets.iter().for_each(|&(slot, _)| self.bricks.give_back(slot));
        }
        ledgers
    }

    fn run_edits<'a>(
        &mut self,
        work: &EditWork<'a>,
        bricks: &[&[Job]],
        uploads: &mut Uploads<'a>,
        targets: &mut Vec<Target>,
    ) -> Result<Vec<Ledger>, Fault> {
        if bricks.len() > MOST_JOBS || work.jobs().len() > MOST_LIST {
            return Err(Fault::TooLarge(work.jobs().len()));
        }
        let sites = self.sites(work, bricks, uploads)?;
        self.bricks.take_many(&mut *self.device, sites.len(), targets)?;
        let mut plan = Plan::default();
        uploads.plan(&mut plan);
        let job_list = plan.section::<EditJob>(sites.len());
        let tool_list = plan.section::<layout::Tool>(work.tools.len());
        let edits = plan.section::<u32>(bricks.iter().map(|jobs| jobs.len()).sum());
        let counters = plan.section::<u32>(4);
        self.inbox.open(&mut *self.device, &plan)?;
        let list = self.inbox.entries::<u32>(edits).iter_mut();
        list.zip(bricks.iter().copied().flatten()).for_each(|(entry, job)| *entry = job.edit);
        let targets_of = &*targets;
        fill(&sites, self.inbox.entries(job_list), LONG, |number, site| EditJob {
            brick: site.pos.0.to_array(),
            base: site.base,
            target: targets_of[number].0,
            stack: site.stack,
            first: site.first,
            count: bricks[number].len() as u32,
            cuts: layout::cuts(work.grid, site.pos),
            pad: [0; 3],
        });
        let tools: Vec<layout::Tool> = work.tools.iter().map(tool).collect();
        self.inbox.put(tool_list, &tools);
        self.inbox.entries::<u32>(counters).fill(0);
        let is_long = sites.len() >= COPIED;
        self.edits.results.reserve(&mut *self.device, sites.len(), is_long)?;
        self.edits.reserve(&mut *self.device, Totals::default(), is_long)?;

        for _ in 0..PASSES {
            self.edits.parts.wipe();
            self.edits.counts.wipe();
            self.send(&plan, uploads)?;
            let params = EditParams {
                bricks: self.bricks.base(),
                stacks: self.stacks.base(),
                jobs: self.inbox.address(job_list),
                list: self.inbox.address(edits),
                tools: self.inbox.address(tool_list),
                results: self.edits.results.address(),
                records: self.edits.records.address(),
                materials: self.edits.materials.address(),
                parts: self.edits.parts.address(),
                counts: self.edits.counts.address(),
                counters: self.inbox.address(counters),
                record_capacity: self.edits.records.capacity(),
                material_capacity: self.edits.materials.capacity(),
                part_capacity: self.edits.parts.capacity(),
                count_capacity: self.edits.counts.capacity(),
            };
            self.device.launch(Kernel::Edit, sites.len() as u32, bytemuck::bytes_of(&params))?;
            self.edits.results.fetch(&mut *self.device, sites.len())?;
            if !self.edits.parts.is_mapped() {
                self.edits.totals.read(&mut *self.device, self.inbox.address(counters), 4)?;
            }
            self.device.wait()?;
            self.times = self.device.times();
            let totals = self.edits.totals(sites.len());
            if !self.edits.reserve(&mut *self.device, totals, is_long)? {
                self.edits.fetch(&mut *self.device, totals)?;
                self.free_targets(targets);
                return Ok(self.edits.ledgers(work, bricks, targets, totals));
            }
            // Once more, with room for all.
        }
        Err(Fault::Failed("results changed from one pass to the next".into()))
    }

    /// The bricks that edits may reach, as the device knows them.
    fn sites<'a>(
        &mut self,
        work: &EditWork<'a>,
        bricks: &[&[Job]],
        uploads: &mut Uploads<'a>,
    ) -> Result<Vec<Site>, Fault> {
        let slots = &self.bricks;
        let stored = map(bricks, LONG, |jobs| {
            let brick = work.base.brick(jobs.first()?.pos())?;
            Some((brick, slots.find(brick.tag.get())))
        });
        let (mut sites, mut first) = (Vec::with_capacity(bricks.len()), 0);
        let mut last = None;
        for (jobs, stored) in bricks.iter().zip(stored) {
            let Some(pos) = jobs.first().map(|job| job.pos()) else { continue };
            let place = (pos.0.x, pos.0.z);
            let stack = match last {
                Some((same, stack)) if same == place => stack,
                _ => self.need_stack(uploads, place)?,
            };
            last = Some((place, stack));
            let base = match stored {
                None => NONE,
                Some((brick, Some(slot))) => reference(slot, brick),
                Some((brick, None)) => self.need_brick(uploads, brick)?,
            };
            sites.push(Site { pos, base, stack, first });
            first += jobs.len() as u32;
        }
        Ok(sites)
    }

    /// Gives slots back that no brick of its own will be in: of bricks that did not change, or are all alike.
    fn free_targets(&mut self, targets: &[Target]) {
        let results = self.edits.results.entries::<EditResult>(targets.len());
        for (result, &(slot, _)) in results.iter().zip(targets) {
            if result.flags & EditResult::CHANGED == 0 || result.flags & EditResult::UNIFORM != 0 {
                self.bricks.give_back(slot);
            }
        }
    }
}

impl EditOutput {
    /// What came back, as ledgers.
    fn ledgers(&self, work: &EditWork, bricks: &[&[Job]], targets: &[Target], totals: Totals) -> Vec<Ledger> {
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

fn tool(tool: &Tool) -> layout::Tool {
    layout::tool(tool.reach, tool.operation, &tool.evaluator)
}

fn count(count: &EditCount) -> Count {
    let [fate, material, ..] = count.fate.to_le_bytes();
    let fate = match fate {
        0 => Fate::Removed,
        1 => Fate::Added,
        _ => Fate::Painted,
    };
    Count { edit: count.edit as usize, fate, material: MaterialId(material), voxels: count.voxels.into() }
}
