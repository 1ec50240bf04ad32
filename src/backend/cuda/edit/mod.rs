//! Edits on the device: one launch for all bricks that they may reach.
//!
//! Batches with stencil edits use another kernel, which also reads neighbouring bricks: see
//! [`stencil`](self::stencil). Fills and carves need distances to the surface, which further launches compute before:
//! see [`surface`](self::surface). [`jobs`](self::jobs) lists the work, [`images`](self::images) the images that it
//! reads, and [`output`](self::output) turns the results into deltas.

mod images;
mod jobs;
pub(super) mod output;
mod stencil;
pub(super) mod surface;

use super::cache::RecordCache;
use super::device::{Fault, Launch};
use super::layout::{self, EditJob, EditParams, EditResult, MOST_LIST};
use super::lists::fill;
use super::session::{Session, Uploads};
use super::staging::{Section, StagingLayout, StrataInput};
use crate::edits::{EditDelta, EditEffect, PreparedEdit, PreparedEdits, enter_effects};
use crate::lattice::side_by_side;
use images::ImageInput;
use output::{LONG, Target, Totals};
use stencil::{Look, StencilInput};
use surface::SurfaceInput;

/// From this many entries on, plain lists are copied in parallel.
const LONG_LIST: usize = 1 << 14;

/// From this many edits on, their records are written in parallel.
const MANY: usize = 128;

/// From this many bricks on, kernels write to device memory and results are copied, instead of written to host
/// memory.
const COPIED: usize = 256;

/// [`COPIED`] as a number of jobs: many edits of few bricks also write long lists, whose length only the device
/// knows.
const COPIED_JOBS: usize = 1 << 12;

/// Larger job lists are not kept for the next transaction.
const KEPT_JOBS: usize = 1 << 16;

/// Maximum number of passes. Each one doubles lists whose required length is unknown.
const PASSES: usize = 12;

/// The input of edits, and the sections that it is written to.
struct EditInput<'w, 'a> {
    plan: StagingLayout,
    job_list: Section,
    record_list: Section,
    /// The numbers of the edits of all jobs.
    edit_list: Section,
    counters: Section,
    strata: StrataInput,
    images: ImageInput<'w>,
    surface: Option<SurfaceInput<'a>>,
    stencil: Option<StencilInput<'a>>,
}

impl Session {
    /// Applies edits and returns what they changed, brick by brick. No edit may read what an earlier one may write.
    pub fn edit(&mut self, work: &PreparedEdits) -> Result<EditDelta, Fault> {
        // Stencil edits write twice as many counts.
        let most = if work.looks_around() { MOST_LIST / 2 } else { MOST_LIST };
        if work.jobs().len() > most {
            return Err(Fault::TooLarge(work.jobs().len()));
        }
        let mut jobs = std::mem::take(&mut self.edit_jobs);
        let delta = self.edit_bricks(work, &mut jobs);
        if jobs.capacity() <= KEPT_JOBS {
            self.edit_jobs = jobs;
        }
        delta
    }

    /// Applies edits, with reusable memory for the jobs.
    fn edit_bricks(&mut self, work: &PreparedEdits, jobs: &mut Vec<EditJob>) -> Result<EditDelta, Fault> {
        if !work.looks_around() {
            return self.try_edits(work, jobs, None).map(Option::unwrap_or_default);
        }
        // Most new ground finds its material nearby.
        for look in [Look::Near, Look::Far] {
            if let Some(delta) = self.try_edits(work, jobs, Some(look))? {
                return Ok(delta);
            }
        }
        Err(Fault::Failed("new ground looked too far".into()))
    }

    /// Applies edits with a limited search for material; returns `None` if an edit had to search farther.
    fn try_edits(
        &mut self,
        work: &PreparedEdits,
        jobs: &mut Vec<EditJob>,
        look: Option<Look>,
    ) -> Result<Option<EditDelta>, Fault> {
        self.begin();
        let mut uploads = Uploads::new(work.base.ground());
        let mut targets = Vec::new();
        let delta = self.run_edits(work, jobs, look, &mut uploads, &mut targets);
        if delta.is_err() {
            self.give_up(&uploads);
        }
        if !matches!(delta, Ok(Some(_))) {
            targets.iter().for_each(|&(slot, _)| self.bricks.release_slot(slot));
        }
        delta
    }

    /// Applies edits in as many passes as their lists need. Slots for bricks are added to `targets`.
    fn run_edits<'a>(
        &mut self,
        work: &PreparedEdits<'a>,
        jobs: &mut Vec<EditJob>,
        look: Option<Look>,
        uploads: &mut Uploads<'a>,
        targets: &mut Vec<Target>,
    ) -> Result<Option<EditDelta>, Fault> {
        // Stencil edits look up their bricks in the windows instead.
        self.list_edits(work, jobs, look.is_none(), uploads)?;
        let mut input = self.plan_edits(work, jobs, look, uploads)?;
        self.stage_edits(work, jobs, &mut input, targets)?;
        if let Some(surface) = &input.surface {
            self.reserve_surface(surface)?;
        }
        let is_long = jobs.len() >= COPIED || work.jobs().len() >= COPIED_JOBS;
        self.edits.results.reserve(&mut *self.device, jobs.len(), is_long)?;
        self.edits.reserve(&mut *self.device, Totals::default(), is_long)?;

        for _ in 0..PASSES {
            self.launch_edits(jobs.len(), &input, uploads)?;
            let totals = self.edits.totals(jobs.len());
            if input.stencil.is_some() && self.edits.is_too_far(jobs.len()) {
                return Ok(None);
            }
            if !self.edits.reserve(&mut *self.device, totals, is_long)? {
                // `take_edits` gives unused slots back itself. If it fails, the device is lost, and all slots with
                // it.
                let targets = std::mem::take(targets);
                return self.take_edits(work, jobs, &targets, totals).map(Some);
            }
            // Another pass, with enough room.
        }
        // The device works, but lists that doubled in each pass were still too short.
        Err(Fault::TooLarge(work.jobs().len()))
    }

    /// Collects the input of the jobs, and lays it out.
    fn plan_edits<'w, 'a>(
        &mut self,
        work: &'w PreparedEdits<'a>,
        jobs: &mut [EditJob],
        look: Option<Look>,
        uploads: &mut Uploads<'a>,
    ) -> Result<EditInput<'w, 'a>, Fault> {
        let mut images = ImageInput::new(work);
        let mut surface = self.surface_input(work, jobs, uploads)?;
        let stencil = look.map(|look| self.stencil_input(work, look, jobs, uploads, &mut images));
        let mut stencil = stencil.transpose()?;
        if images.is_full() {
            return Err(Fault::TooLarge(work.jobs().len()));
        }
        let mut plan = StagingLayout::default();
        uploads.plan(&mut plan);
        let job_list = plan.section::<EditJob>(jobs.len());
        let record_list = plan.section::<layout::EditRecord>(work.edits.len());
        let edit_list = plan.section::<u32>(work.jobs().len());
        let counters = plan.section::<u32>(4);
        let strata = StrataInput::plan(work.base.ground(), &mut plan);
        images.plan(&mut plan);
        surface.iter_mut().for_each(|surface| surface.plan(&mut plan));
        stencil.iter_mut().for_each(|stencil| stencil.plan(&mut plan));
        Ok(EditInput { plan, job_list, record_list, edit_list, counters, strata, images, surface, stencil })
    }

    /// Takes slots for the bricks of the jobs, and writes the input.
    fn stage_edits(
        &mut self,
        work: &PreparedEdits,
        jobs: &[EditJob],
        of: &mut EditInput,
        targets: &mut Vec<Target>,
    ) -> Result<(), Fault> {
        self.input.open(&mut *self.device, &of.plan)?;
        let (all_jobs, edit_records, list) = self.input.entries_of(of.job_list, of.record_list, of.edit_list);
        let are_many = jobs.len() >= LONG;
        let (bricks, device, grids) = (&mut self.bricks, &mut self.device, &of.images.numbers);
        let take = || {
            bricks.take_many(&mut **device, jobs, all_jobs, targets, |job, target| EditJob { target, ..*job })
        };
        let write_lists = || {
            fill(&work.edits, edit_records, MANY, |number, own| record(own, grids.of(number)));
            fill(work.jobs(), list, LONG_LIST, |_, job| job.edit);
        };
        side_by_side(are_many, take, write_lists).0?;
        self.input.entries::<u32>(of.counters).fill(0);
        of.strata.put(&mut self.input);
        of.images.put(&mut self.input);
        of.surface.iter_mut().for_each(|surface| surface.put(&mut self.input, &mut self.kept));
        of.stencil.iter_mut().for_each(|stencil| stencil.put(&mut self.input, &mut self.kept));
        Ok(())
    }

    /// Launches one pass of the staged jobs, of which there are this many, and waits for its results.
    fn launch_edits(&mut self, jobs: usize, of: &EditInput, uploads: &Uploads) -> Result<(), Fault> {
        self.edits.parts.wipe();
        self.edits.counts.wipe();
        self.send(&of.plan, uploads)?;
        let distances = of.surface.as_ref().map(|surface| self.launch_surface(surface)).transpose()?;
        let params = self.edit_params(of);
        let blocks = jobs as u32;
        match &of.stencil {
            // SAFETY: the parameters are sections of the input, which `stage_edits` wrote for this many jobs, and lists
            // of the session with their capacities. None of them is accessed before the wait below.
            None => unsafe { self.device.launch(Launch::new(blocks, &params)) }?,
            Some(stencil) => {
                let params = stencil.params(params, distances.unwrap_or_default(), &self.input);
                // SAFETY: as above.
                unsafe { self.device.launch(Launch::new(blocks, &params)) }?;
            }
        }
        self.edits.results.fetch(&mut *self.device, jobs)?;
        if !self.edits.parts.is_mapped() {
            self.edits.totals.read(&mut *self.device, self.input.address(of.counters), 4)?;
        }
        self.device.wait()?;
        self.times = self.device.times();
        Ok(())
    }

    /// The kernel's parameters, for the present lists of the session.
    fn edit_params(&self, of: &EditInput) -> EditParams {
        let [grids, images] = of.images.addresses(&self.input);
        EditParams {
            bricks: self.bricks.base(),
            stacks: self.stacks.base(),
            jobs: self.input.address(of.job_list),
            list: self.input.address(of.edit_list),
            edit_records: self.input.address(of.record_list),
            results: self.edits.results.address(),
            records: self.edits.records.address(),
            materials: self.edits.materials.address(),
            parts: self.edits.parts.address(),
            counts: self.edits.counts.address(),
            counters: self.input.address(of.counters),
            record_capacity: self.edits.records.capacity(),
            material_capacity: self.edits.materials.capacity(),
            part_capacity: self.edits.parts.capacity(),
            count_capacity: self.edits.counts.capacity(),
            strata: of.strata.address(&self.input),
            grids,
            images,
        }
    }

    /// Converts the results to a delta. Bricks are copied while everything else is processed.
    fn take_edits(
        &mut self,
        work: &PreparedEdits,
        jobs: &[EditJob],
        targets: &[Target],
        totals: Totals,
    ) -> Result<EditDelta, Fault> {
        let are_many = jobs.len() >= LONG;
        self.edits.fetch_entries(&mut *self.device, totals)?;
        let are_coming = self.edits.begin_bricks(&mut *self.device, totals)?;
        let changed = || self.edits.changed(jobs.len(), totals);
        let (changed, entries) =
            side_by_side(are_many, changed, || self.edits.entries(work.grid, jobs, totals));
        let Self { bricks, edits, device, .. } = self;
        let drafted = || {
            if are_coming {
                device.wait()?;
            }
            Ok(edits.bricks(&changed?, jobs, targets, totals))
        };
        let finish = || {
            free_targets(bricks, edits.results.entries(jobs.len()), targets);
            let mut effects = vec![EditEffect::default(); work.edits.len()];
            enter_effects(&entries, &mut effects);
            effects
        };
        let (drafted, effects) = side_by_side(are_many, drafted, finish);
        Ok(EditDelta { effects, ..drafted? })
    }
}

/// Releases the slots of bricks that did not change or are uniform, and so need none.
fn free_targets(slots: &mut RecordCache, results: &[EditResult], targets: &[Target]) {
    for (result, &(slot, _)) in results.iter().zip(targets) {
        if result.flags & EditResult::CHANGED == 0 || result.flags & EditResult::UNIFORM != 0 {
            slots.release_slot(slot);
        }
    }
}

fn record(record: &PreparedEdit, grid: u32) -> layout::EditRecord {
    layout::record(record.reach, record.operation, &record.evaluator, grid)
}
