//! Edits, sorted by the bricks that they may reach: the work that a [`backend`](crate::backend) does.
//!
//! Each brick takes its edits in their order, on its own: bricks share no samples, so threads share no work, and whatever an
//! edit changed is added up afterwards.

use glam::IVec3;
use rayon::prelude::*;

use super::bearing::RunRules;
use super::ledger::Ledger;
use super::workpiece::Workpiece;
use super::{DiggingRules, SampleView};
use crate::brush::{Edit, Evaluator, Kind, Sculptor};
use crate::lattice::{BrickPos, ChunkGrid, LatticeBox, sort_by_place};

/// From how many bricks on they are spread over threads.
const PARALLEL_BRICKS: usize = 64;

/// From how many boxes of 8x8x8 bricks on threads look which of the bricks an edit comes near.
const PARALLEL_BOXES: usize = 64;

/// How many bricks are worked on before what edits did to them is added up: that takes more memory than the bricks when
/// there are many edits, and most bricks of a large cave are given up for a shared one.
const BATCH: usize = 8192;

/// How many bricks a thread takes at a time.
const GROUP: usize = 16;

/// One edit's work on one brick; sorted by brick, then by edit.
#[derive(Clone, Copy)]
pub(crate) struct Job {
    /// The brick's position as (x, z, y).
    brick: [i32; 3],
    pub edit: u32,
}

impl Job {
    /// The brick's position.
    pub fn pos(self) -> BrickPos {
        let [x, z, y] = self.brick;
        BrickPos(IVec3::new(x, y, z))
    }
}

/// An edit with what is derived from it once.
pub(crate) struct Tool {
    /// The part of the edit's reach that lies in the world.
    pub reach: Option<LatticeBox>,
    pub operation: Kind,
    pub evaluator: Evaluator,
    pub sculptor: Option<Sculptor>,
    pub power: u8,
    /// May some rule be against it?
    pub is_bound: bool,
}

impl Tool {
    /// Does the edit look at other samples than those that it changes?
    pub fn looks_around(&self) -> bool {
        self.sculptor.is_some() || self.is_bound
    }

    /// May the edit change some of these samples? Where not, it is certain.
    fn reaches(&self, samples: LatticeBox) -> bool {
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
pub struct EditWork<'a> {
    /// What they apply to.
    pub base: SampleView<'a>,
    /// How the world is cut into chunks.
    pub grid: ChunkGrid,
    pub(crate) tools: Vec<Tool>,
    jobs: Vec<Job>,
    pub(crate) rules: Option<RunRules<'a>>,
}

impl<'a> EditWork<'a> {
    /// Sorts edits.
    pub fn new(base: SampleView<'a>, grid: ChunkGrid, edits: &[&Edit]) -> Self {
        let tool = |edit: &&Edit| Tool {
            reach: reach(grid, edit),
            operation: edit.kind(),
            evaluator: edit.evaluator(),
            sculptor: edit.sculptor(),
            power: edit.power(),
            is_bound: false,
        };
        let tools: Vec<Tool> = edits.iter().map(tool).collect();
        let jobs = jobs(&tools);
        Self { base, grid, tools, jobs, rules: None }
    }

    /// The same under rules.
    #[cfg(feature = "cuda")]
    pub(crate) fn under(self, rules: Option<&'a DiggingRules>) -> Self {
        let bound: Vec<bool> =
            self.tools.iter().map(|tool| is_bound(rules, tool.reach, tool.power)).collect();
        self.bound(rules, &bound)
    }

    /// The same under rules, which bear on these of the edits.
    pub(super) fn bound(mut self, rules: Option<&'a DiggingRules>, bound: &[bool]) -> Self {
        self.tools.iter_mut().zip(bound).for_each(|(tool, &is_bound)| tool.is_bound = is_bound);
        self.rules = rules.and_then(|rules| RunRules::new(rules, &self.tools));
        self
    }

    /// Does any edit look at other samples than those that it changes?
    #[cfg(feature = "cuda")]
    pub(crate) fn looks_around(&self) -> bool {
        self.tools.iter().any(Tool::looks_around)
    }

    /// The jobs of each brick, in order of the edits.
    pub(crate) fn bricks(&self) -> Vec<&[Job]> {
        self.jobs.chunk_by(|a, b| a.brick == b.brick).collect()
    }

    /// Every brick that some edit may reach, once for each edit.
    pub(crate) fn jobs(&self) -> &[Job] {
        &self.jobs
    }

    /// Applies all edits on the CPU and hands out what they changed, brick by brick. The result does not depend on how
    /// many threads there are.
    pub(crate) fn run(&self, mut each: impl FnMut(Ledger)) {
        let bricks = self.bricks();
        let work = |bricks: &[&[Job]]| {
            let mut ledger = Ledger::with_room(bricks.len());
            bricks.iter().for_each(|jobs| finish(self, jobs, &mut ledger));
            ledger
        };
        if bricks.len() < PARALLEL_BRICKS {
            each(work(&bricks));
            return;
        }
        for batch in bricks.chunks(BATCH) {
            let ledgers: Vec<Ledger> = batch.par_chunks(GROUP).map(work).collect();
            ledgers.into_iter().for_each(&mut each);
        }
    }
}

/// Which edit may reach which brick. Long thin brushes come near few bricks of the box around them, so boxes are looked at
/// before bricks.
fn jobs(tools: &[Tool]) -> Vec<Job> {
    let reaches = (0..).zip(tools).filter_map(|(edit, tool)| Some((edit, tool.reach?)));
    let boxes = reaches.flat_map(|(edit, reach)| {
        let bricks = LatticeBox { min: reach.min >> 3, max: reach.max >> 3 };
        let boxes = LatticeBox { min: bricks.min >> 3, max: bricks.max >> 3 };
        let own = move |at: IVec3| bricks.intersection(LatticeBox { min: at << 3, max: (at << 3) + 7 });
        boxes.points().filter_map(move |at| Some((edit, own(at)?)))
    });
    // Small brushes lie in at most eight.
    let mut all: Vec<(u32, LatticeBox)> = Vec::with_capacity(tools.len() * 8);
    all.extend(boxes);
    let near = |&(edit, bricks): &(u32, LatticeBox)| {
        let tool = &tools[edit as usize];
        let samples = LatticeBox { min: bricks.min << 3, max: (bricks.max << 3) + 7 };
        let bricks = tool.reaches(samples).then(|| bricks.points()).into_iter().flatten();
        let jobs = bricks.map(move |at| Job { brick: [at.x, at.z, at.y], edit });
        jobs.filter(move |job| tool.reaches(job.pos().samples()))
    };
    let mut jobs: Vec<Job> = if all.len() < PARALLEL_BOXES {
        let room = all.iter().map(|(_, bricks)| bricks.volume() as usize).sum();
        let mut jobs = Vec::with_capacity(room);
        jobs.extend(all.iter().flat_map(near));
        jobs
    } else {
        all.par_iter().flat_map_iter(near).collect()
    };
    // They stand in order of the edits, and stay so for each brick.
    sort_by_place(&mut jobs, |job| job.brick);
    jobs
}

/// Applies all edits of one brick and enters what they changed.
fn finish(work: &EditWork, jobs: &[Job], ledger: &mut Ledger) {
    let Some(pos) = jobs.first().map(|job| job.pos()) else { return };
    Workpiece::new(work.base, work.grid, pos).take(&work.tools, work.rules.as_ref(), jobs, ledger);
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};

    #[test]
    fn a_long_thin_brush_comes_near_few_bricks() {
        let brush = Brush::dig(Shape::capsule(Vec3::ZERO, Vec3::splat(1000.0), 0.25));
        let edit = Edit::quantize(&brush).unwrap();
        let tool = |edit: &Edit| Tool {
            reach: reach(ChunkGrid::new(32, 1024, 1024), edit),
            operation: edit.kind(),
            evaluator: edit.evaluator(),
            sculptor: None,
            power: edit.power(),
            is_bound: false,
        };
        let jobs = jobs(&[tool(&edit)]);
        let has = |at: i32| jobs.iter().any(|job| job.brick == [at >> 3; 3]);
        assert!((0..=1000).all(has));
        assert!(jobs.len() < 5000, "{}", jobs.len());
    }
}
