//! Edits, sorted by the bricks that they may reach: the work that a [`backend`](crate::backend) does.
//!
//! Each brick applies its edits in order, independently of other bricks: bricks share no samples, so threads
//! share no work. The changes of each edit are summed afterwards.

use rayon::prelude::*;
use wide::i16x8;

use super::brick_editor::BrickEditor;
use super::delta::EditDelta;
use super::jobs::{Job, jobs};
use super::padded_brick::PaddedBrick;
use super::prepared_edit::PreparedEdit;
use super::rule_scope::{BatchRules, BrickRules};
use crate::lattice::{ChunkGrid, ItemCost, pieces};
use crate::volume::{DiggingRules, SampleView};

/// Number of jobs that are done before their deltas are summed. With many edits deltas take more memory than bricks,
/// and most bricks of a large cave are replaced by a shared one.
const JOBS_AT_ONCE: usize = 8192;

/// The minimum and maximum number of jobs of a delta: few, so that all threads end together, but not so few that there
/// are many deltas to add up.
const GROUP: [usize; 2] = [16, 64];

/// Desired number of groups for each thread.
const GROUPS_PER_THREAD: usize = 8;

/// A batch of edits, sorted by the bricks that they may reach.
pub(crate) struct PreparedEdits<'a> {
    /// The samples that they apply to.
    pub base: SampleView<'a>,
    /// The grid of chunks and tiles.
    pub grid: ChunkGrid,
    pub edits: Vec<PreparedEdit>,
    jobs: Vec<Job>,
    pub rules: Option<BatchRules<'a>>,
}

impl<'a> PreparedEdits<'a> {
    /// Sorts edits, which were prepared under these rules.
    pub(super) fn of(
        base: SampleView<'a>,
        grid: ChunkGrid,
        edits: Vec<PreparedEdit>,
        rules: Option<&'a DiggingRules>,
    ) -> Self {
        let (jobs, rules) = (jobs(&edits), rules.and_then(|rules| BatchRules::new(rules, &edits)));
        Self { base, grid, edits, jobs, rules }
    }

    /// Sorts edits that no rules restrict.
    #[cfg(feature = "cuda")]
    pub fn new(base: SampleView<'a>, grid: ChunkGrid, edits: &[&crate::brush::Edit]) -> Self {
        let edits = edits.iter().map(|edit| PreparedEdit::new(grid, edit, None)).collect();
        Self::of(base, grid, edits, None)
    }

    /// These edits, restricted by rules.
    #[cfg(feature = "cuda")]
    pub fn under(mut self, rules: Option<&'a DiggingRules>) -> Self {
        self.edits.iter_mut().for_each(|edit| edit.set_rules(rules));
        Self::of(self.base, self.grid, self.edits, rules)
    }

    /// Returns `true` if any edit reads other samples than those that it changes.
    #[cfg(feature = "cuda")]
    pub fn looks_around(&self) -> bool {
        self.edits.iter().any(PreparedEdit::looks_around)
    }

    /// The jobs of each brick, in order of the edits.
    #[cfg(all(test, feature = "cuda"))]
    pub fn bricks(&self) -> Vec<&[Job]> {
        self.jobs.chunk_by(Job::is_same_brick).collect()
    }

    /// Applies all edits on the CPU and calls `each` with a delta for each brick.
    #[cfg(all(test, feature = "cuda"))]
    pub fn run_each_brick(&self, mut each: impl FnMut(EditDelta)) {
        for jobs in self.bricks() {
            let mut delta = EditDelta::default();
            apply_jobs(self, jobs, &mut delta);
            each(delta);
        }
    }

    /// Every brick that some edit may reach, once for each edit.
    pub fn jobs(&self) -> &[Job] {
        &self.jobs
    }

    /// Applies all edits on the CPU and calls `each` with their changes, brick by brick. The result does not depend
    /// on how many threads there are.
    pub fn run(&self, mut each: impl FnMut(&mut [EditDelta])) {
        let work = |jobs: &[Job]| {
            let mut delta = EditDelta::with_room(jobs.len().min(GROUP[1]));
            jobs.chunk_by(Job::is_same_brick).for_each(|jobs| apply_jobs(self, jobs, &mut delta));
            delta
        };
        if !ItemCost::Brick.is_shared(self.jobs.len()) {
            each(&mut [work(&self.jobs)]);
            return;
        }
        for batch in pieces(&self.jobs, JOBS_AT_ONCE, Job::is_same_brick) {
            let group =
                (batch.len() / (GROUPS_PER_THREAD * rayon::current_num_threads())).clamp(GROUP[0], GROUP[1]);
            match &pieces(batch, group, Job::is_same_brick)[..] {
                [own] => each(&mut [work(own)]),
                groups => {
                    let mut deltas: Vec<EditDelta> =
                        groups.par_iter().with_max_len(1).map(|jobs| work(jobs)).collect();
                    each(&mut deltas);
                }
            }
        }
    }
}

/// Applies all edits of one brick and enters what they changed.
fn apply_jobs(work: &PreparedEdits, jobs: &[Job], delta: &mut EditDelta) {
    let Some(pos) = jobs.first().map(|job| job.pos()) else { return };
    let mut editor = BrickEditor::new(work.base, pos);
    let mut distances = [i16x8::ZERO; 64];
    let low = pos.origin();
    let rules = work.rules.as_ref().map(|rules| BrickRules::new(rules, pos));
    for job in jobs {
        let (number, edit) = (job.edit as usize, &work.edits[job.edit as usize]);
        let Some(reached) = edit.reach.and_then(|reach| reach.intersection(pos.samples())) else { continue };
        let (from, to) = (reached.min - low, reached.max - low);
        edit.evaluator.rows(low, from.y..to.y + 1, from.z..to.z + 1, &mut distances);
        if edit.looks_around() {
            let rules = rules.as_ref().filter(|_| edit.is_ruled);
            let around = PaddedBrick::for_edit(&editor.view, pos, edit);
            editor.change(work.grid, reached, number, delta, |editor, samples, counts| {
                editor.apply_stencil(edit, rules, samples, &distances, &around, counts)
            });
        } else {
            editor.change(work.grid, reached, number, delta, |editor, samples, counts| {
                editor.apply_plain(edit.operation, samples, &distances, counts)
            });
        }
    }
    editor.finish(delta);
}
