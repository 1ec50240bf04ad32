//! Edits on the device: one launch for all bricks that they may reach.
//!
//! Those that look around take another kernel, which knows the bricks around too: see [`careful`](self::careful).

mod careful;
mod output;

use super::device::{Fault, Kernel};
use super::layout::{self, EditJob, EditParams, EditResult, MOST_JOBS, MOST_LIST, NONE};
use super::mail::{Plan, fill, map};
use super::session::{Session, Uploads};
use super::slots::reference;
use crate::lattice::BrickPos;
use crate::volume::{EditWork, Job, Ledger, Tool};
use careful::{Care, Look};
pub(super) use output::EditOutput;
use output::Totals;

/// From how many bricks on they are dealt with side by side.
const LONG: usize = 1024;

/// From how many bricks on they are copied, instead of written to the host's memory by the kernel.
const COPIED: usize = 256;

/// The same by jobs: many edits of few bricks write long lists too, and how long they got only the device can say.
const COPIED_JOBS: usize = 1 << 12;

/// Most passes: each gives twice the room where it is not known how much is needed.
const PASSES: usize = 12;

/// A slot that is to hold a changed brick, with its tag.
type Target = (u32, u64);

/// A brick that edits may reach: what it is now, its stack, where its edits begin in the list, and where it is in the
/// windows, with the way to its neighbours there.
struct Site {
    pos: BrickPos,
    base: u32,
    stack: u32,
    first: u32,
    window: u32,
    strides: u32,
}

impl Session {
    /// Applies edits: what they changed, brick by brick. They must be such that none reads what an earlier one may change.
    pub fn edit(&mut self, work: &EditWork) -> Result<Vec<Ledger>, Fault> {
        let bricks = work.bricks();
        if !work.looks_around() {
            return self.try_edits(work, &bricks, None).map(Option::unwrap_or_default);
        }
        // Most new ground finds its material close by.
        for look in [Look::Near, Look::Far] {
            if let Some(ledgers) = self.try_edits(work, &bricks, Some(look))? {
                return Ok(ledgers);
            }
        }
        Err(Fault::Failed("new ground looked too far".into()))
    }

    /// The same, where edits look no farther than that; `None` where they did.
    fn try_edits(
        &mut self,
        work: &EditWork,
        bricks: &[&[Job]],
        look: Option<Look>,
    ) -> Result<Option<Vec<Ledger>>, Fault> {
        self.begin();
        let mut uploads = Uploads::new(work.base.ground());
        let mut targets = Vec::with_capacity(bricks.len());
        let ledgers = self.run_edits(work, bricks, look, &mut uploads, &mut targets);
        if ledgers.is_err() {
            self.give_up(&uploads);
        }
        if !matches!(ledgers, Ok(Some(_))) {
            targets.iter().for_each(|&(slot, _)| self.bricks.give_back(slot));
        }
        ledgers
    }

    fn run_edits<'a>(
        &mut self,
        work: &EditWork<'a>,
        bricks: &[&[Job]],
        look: Option<Look>,
        uploads: &mut Uploads<'a>,
        targets: &mut Vec<Target>,
    ) -> Result<Option<Vec<Ledger>>, Fault> {
        // Edits that look around enter twice as many counts.
        let most = if look.is_some() { MOST_LIST / 2 } else { MOST_LIST };
        if bricks.len() > MOST_JOBS || work.jobs().len() > most {
            return Err(Fault::TooLarge(work.jobs().len()));
        }
        let mut care = look.map(|look| Care::new(work, bricks, look)).transpose()?;
        let sites = match &mut care {
            Some(care) => self.careful_sites(bricks, care, uploads)?,
            None => self.sites(work, bricks, uploads)?,
        };
        self.bricks.take_many(&mut *self.device, sites.len(), targets)?;
        let mut plan = Plan::default();
        uploads.plan(&mut plan);
        let job_list = plan.section::<EditJob>(sites.len());
        let tool_list = plan.section::<layout::Tool>(work.tools.len());
        let edits = plan.section::<u32>(bricks.iter().map(|jobs| jobs.len()).sum());
        let counters = plan.section::<u32>(4);
        care.iter_mut().for_each(|care| care.plan(&mut plan));
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
            window: site.window,
            strides: site.strides,
            pad: 0,
        });
        let tools: Vec<layout::Tool> = work.tools.iter().map(tool).collect();
        self.inbox.put(tool_list, &tools);
        self.inbox.entries::<u32>(counters).fill(0);
        care.iter().for_each(|care| care.put(&mut self.inbox));
        let is_long = sites.len() >= COPIED || work.jobs().len() >= COPIED_JOBS;
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
            let blocks = sites.len() as u32;
            match &care {
                None => self.device.launch(Kernel::Edit, blocks, bytemuck::bytes_of(&params))?,
                Some(care) => {
                    let params = care.params(params, &self.inbox);
                    self.device.launch(Kernel::Careful, blocks, bytemuck::bytes_of(&params))?;
                }
            }
            self.edits.results.fetch(&mut *self.device, sites.len())?;
            if !self.edits.parts.is_mapped() {
                self.edits.totals.read(&mut *self.device, self.inbox.address(counters), 4)?;
            }
            self.device.wait()?;
            self.times = self.device.times();
            let totals = self.edits.totals(sites.len());
            if care.is_some() && self.edits.is_too_far(sites.len()) {
                return Ok(None);
            }
            if !self.edits.reserve(&mut *self.device, totals, is_long)? {
                self.edits.fetch(&mut *self.device, totals)?;
                self.free_targets(targets);
                return Ok(Some(self.edits.ledgers(work, bricks, targets, totals)));
            }
            // Once more, with room for all.
        }
        // The device is fine: lists that double each time were still too short.
        Err(Fault::TooLarge(work.jobs().len()))
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
            sites.push(Site { pos, base, stack, first, window: 0, strides: 0 });
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

fn tool(tool: &Tool) -> layout::Tool {
    layout::tool(tool.reach, tool.operation, &tool.evaluator)
}
