//! Edits, sorted by the bricks that they may reach: the work that a [`backend`](crate::backend) does.
//!
//! Each brick takes its edits in their order, on its own: bricks share no samples, so threads share no work, and whatever an
//! edit changed is added up afterwards.

use rayon::prelude::*;

use super::brick_editor::BrickEditor;
use super::delta::EditDelta;
use super::jobs::{Job, jobs};
use super::rule_scope::RunRules;
use crate::brush::{Edit, Evaluator, Kind, SculptKernel};
use crate::lattice::{ChunkGrid, LatticeBox, pieces};
use crate::volume::{DiggingRules, SampleView};

/// From how many jobs on they are spread over threads.
const PARALLEL_JOBS: usize = 64;

/// How many jobs are done before what edits did to bricks is added up: that takes more memory than the bricks when there are
/// many edits, and most bricks of a large cave are given up for a shared one.
const BATCH: usize = 8192;

/// How many jobs a thread takes at a time, at least and at most: few, so that all threads end together; and many, so that
/// there are few ledgers to add up.
const GROUP: [usize; 2] = [16, 64];

/// How often threads should come for more.
const TURNS: usize = 8;

/// An edit with what is derived from it once.
pub(crate) struct PreparedEdit {
    /// The part of the edit's reach that lies in the world.
    pub reach: Option<LatticeBox>,
    pub operation: Kind,
    pub evaluator: Evaluator,
    pub sculptor: Option<SculptKernel>,
    pub power: u8,
    /// May some rule be against it?
    pub is_bound: bool,
}

impl PreparedEdit {
    /// Does the edit look at other samples than those that it changes?
    pub fn looks_around(&self) -> bool {
        self.sculptor.is_some() || self.is_bound
    }

    /// May the edit change some of these samples? Where not, it is certain.
    pub(super) fn reaches(&self, samples: LatticeBox) -> bool {
        let reached = self.reach.and_then(|reach| reach.intersection(samples));
        reached.is_some_and(|samples| !self.evaluator.is_out_of_reach(samples))
    }
}

/// The part of an edit's reach that lies in the world; `None` when it lies outside.
pub fn reach(grid: ChunkGrid, edit: &Edit) -> Option<LatticeBox> {
    edit.reach().intersection(grid.edit_bounds())
}

/// May some rule be against an edit of this reach and power?
pub(super) fn is_bound(rules: Option<&DiggingRules>, reach: Option<LatticeBox>, power: u8) -> bool {
    rules.zip(reach).is_some_and(|(rules, own)| rules.bear_on(own, power))
}

/// Edits, sorted by the bricks that they may reach.
pub struct PreparedEdits<'a> {
    /// What they apply to.
    pub base: SampleView<'a>,
    /// How the world is cut into chunks.
    pub grid: ChunkGrid,
    pub(crate) tools: Vec<PreparedEdit>,
    jobs: Vec<Job>,
    pub(crate) rules: Option<RunRules<'a>>,
}

impl<'a> PreparedEdits<'a> {
    /// Sorts edits.
    pub fn new(base: SampleView<'a>, grid: ChunkGrid, edits: &[&Edit]) -> Self {
        let tool = |edit: &&Edit| PreparedEdit {
            reach: reach(grid, edit),
            operation: edit.kind(),
            evaluator: edit.evaluator(),
            sculptor: edit.sculptor(),
            power: edit.power(),
            is_bound: false,
        };
        let tools: Vec<PreparedEdit> = edits.iter().map(tool).collect();
        let jobs = jobs(&tools);
        Self { base, grid, tools, jobs, rules: None }
    }

    /// The same under rules.
    #[cfg(feature = "cuda")]
    pub(crate) fn under(self, rules: Option<&'a DiggingRules>) -> Self {
        let bound: Vec<bool> =
            self.tools.iter().map(|tool| is_bound(rules, tool.reach, tool.power)).collect();
        self.bound(rules, bound)
    }

    /// The same under rules, which bear on these of the edits.
    pub(super) fn bound(
        mut self,
        rules: Option<&'a DiggingRules>,
        bound: impl IntoIterator<Item = bool>,
    ) -> Self {
        self.tools.iter_mut().zip(bound).for_each(|(tool, is_bound)| tool.is_bound = is_bound);
        self.rules = rules.and_then(|rules| RunRules::new(rules, &self.tools));
        self
    }

    /// Does any edit look at other samples than those that it changes?
    #[cfg(feature = "cuda")]
    pub(crate) fn looks_around(&self) -> bool {
        self.tools.iter().any(PreparedEdit::looks_around)
    }

    /// The jobs of each brick, in order of the edits.
    #[cfg(all(test, feature = "cuda"))]
    pub(crate) fn bricks(&self) -> Vec<&[Job]> {
        self.jobs.chunk_by(Job::is_same_brick).collect()
    }

    /// Applies all edits on the CPU and hands out a ledger for each brick.
    #[cfg(all(test, feature = "cuda"))]
    pub(crate) fn run_each_brick(&self, mut each: impl FnMut(EditDelta)) {
        for jobs in self.bricks() {
            let mut ledger = EditDelta::default();
            finish(self, jobs, &mut ledger);
            each(ledger);
        }
    }

    /// Every brick that some edit may reach, once for each edit.
    pub(crate) fn jobs(&self) -> &[Job] {
        &self.jobs
    }

    /// Applies all edits on the CPU and hands out what they changed, brick by brick. The result does not depend on how
    /// many threads there are.
    pub(crate) fn run(&self, mut each: impl FnMut(&mut [EditDelta])) {
        let work = |jobs: &[Job]| {
            let mut ledger = EditDelta::with_room(jobs.len().min(GROUP[1]));
            jobs.chunk_by(Job::is_same_brick).for_each(|jobs| finish(self, jobs, &mut ledger));
            ledger
        };
        if self.jobs.len() < PARALLEL_JOBS {
            each(&mut [work(&self.jobs)]);
            return;
        }
        for batch in pieces(&self.jobs, BATCH, Job::is_same_brick) {
            let group = (batch.len() / (TURNS * rayon::current_num_threads())).clamp(GROUP[0], GROUP[1]);
            match &pieces(batch, group, Job::is_same_brick)[..] {
                [own] => each(&mut [work(own)]),
                groups => {
                    let mut ledgers: Vec<EditDelta> =
                        groups.par_iter().with_max_len(1).map(|jobs| work(jobs)).collect();
                    each(&mut ledgers);
                }
            }
        }
    }
}

/// Applies all edits of one brick and enters what they changed.
fn finish(work: &PreparedEdits, jobs: &[Job], ledger: &mut EditDelta) {
    let Some(pos) = jobs.first().map(|job| job.pos()) else { return };
    BrickEditor::new(work.base, work.grid, pos).take(&work.tools, work.rules.as_ref(), jobs, ledger);
}
