//! Distances to the surface of the ground, which fills and carves need.
//!
//! They are computed for the bricks of those edits and for the bricks around them that ways may lead through: first of
//! the samples next to the surface, then they spread launch by launch. `edits/surface_distance.rs` has the definition.

use glam::IVec3;

use super::super::device::{Fault, Launch};
use super::super::layout::{
    DISTANCE_BYTES, EditJob, MOST_JOBS, NONE, SurfaceJob, SurfaceSpreadParams, SurfaceStartParams,
};
use super::super::lists::{in_pieces, map};
use super::super::session::{Session, Uploads, windows};
use super::super::staging::{InputBuffer, Section, StagingLayout};
use super::super::windows::{KeptSlabs, Windows};
use super::output::LONG;
use crate::edits::{PreparedEdit, PreparedEdits};
use crate::lattice::{BRICK, BrickPos, ChunkGrid, ONE};

/// From this many stacks on, the bricks around theirs are looked up in parallel.
const MANY_STACKS: usize = 64;

/// The distance up to which an edit needs distances, in 1/256 voxel; 0 if it needs none.
fn horizon(edit: &PreparedEdit) -> i32 {
    edit.rounding().map_or(0, |rounding| rounding.horizon())
}

/// The distance up to which any edit needs distances, in 1/256 voxel; 0 if none does.
pub(in super::super) fn greatest_horizon(work: &PreparedEdits) -> i32 {
    work.edits.iter().map(horizon).max().unwrap_or_default()
}

/// The most samples on a way that is shorter than a horizon. A distance is right after as many launches that spread
/// distances, as each of them continues from the bricks around.
pub(in super::super) fn steps(horizon: i32) -> i32 {
    (horizon - 1).max(0) / ONE
}

/// How many bricks away such ways begin.
fn bricks_away(horizon: i32) -> i32 {
    (steps(horizon) + BRICK - 1) / BRICK
}

/// Lists the bricks whose distances to the surface some fill or carve depends on, in order, with their neighbours, and
/// sets the jobs' numbers in the list.
pub(in super::super) fn surface_jobs(work: &PreparedEdits, jobs: &mut [EditJob]) -> Vec<SurfaceJob> {
    let away_of = |job: &EditJob| {
        let own = work.jobs().iter().skip(job.first as usize).take(job.count as usize);
        bricks_away(own.map(|own| horizon(&work.edits[own.edit as usize])).max().unwrap_or_default())
    };
    let own: Vec<(BrickPos, i32)> =
        jobs.iter().map(|job| (job.pos(), away_of(job))).filter(|&(_, away)| away > 0).collect();
    let mut bricks = Vec::new();
    for away in (1..=bricks_away(greatest_horizon(work))).rev() {
        bricks.extend(own.iter().filter(|own| own.1 == away).map(|own| own.0));
        bricks = with_neighbours(&bricks, work.grid);
    }
    in_pieces(jobs, LONG, |_, jobs| {
        for job in jobs.iter_mut().filter(|job| away_of(job) > 0) {
            job.surface = bricks.binary_search(&job.pos()).map_or(NONE, |number| number as u32);
        }
    });
    listed(&bricks)
}

/// Bricks with all bricks around them that lie in the world. Beyond its rim everything continues as at the rim, so no
/// way through there is shorter.
fn with_neighbours(bricks: &[BrickPos], grid: ChunkGrid) -> Vec<BrickPos> {
    let is_inside = |at: i32, last: i32| at * BRICK + BRICK > 0 && at * BRICK <= last;
    let in_world = |pos: &BrickPos| is_inside(pos.0.x, grid.width()) && is_inside(pos.0.z, grid.depth());
    [IVec3::Y, IVec3::Z, IVec3::X].into_iter().fold(bricks.to_vec(), |bricks, axis| {
        let along = bricks.iter().flat_map(|pos| [-1, 0, 1].map(|step| BrickPos(pos.0 + axis * step)));
        let mut all: Vec<BrickPos> = along.filter(in_world).collect();
        all.sort_unstable();
        all.dedup();
        all
    })
}

/// The jobs of bricks, which are in order.
fn listed(bricks: &[BrickPos]) -> Vec<SurfaceJob> {
    let stacks: Vec<&[BrickPos]> = bricks.chunk_by(|a, b| (a.0.x, a.0.z) == (b.0.x, b.0.z)).collect();
    let of_stack = |stack: &&[BrickPos]| -> Vec<SurfaceJob> {
        let ways = [-1, 0, 1].into_iter().flat_map(|z| [-1, 0, 1].map(|x| IVec3::new(x, -1, z)));
        // Of each stack around, the first brick that is not below those around the current one.
        let mut firsts: Vec<(IVec3, usize)> =
            ways.map(|way| (way, bricks.partition_point(|pos| *pos < BrickPos(stack[0].0 + way)))).collect();
        let job = |pos: &BrickPos| {
            let mut around = [NONE; 27];
            for (way, first) in &mut firsts {
                let lowest = BrickPos(pos.0 + *way);
                *first += bricks[*first..].iter().take_while(|other| **other < lowest).count();
                for (number, other) in (*first as u32..).zip(&bricks[*first..]).take(3) {
                    let step = other.0 - lowest.0;
                    if (step.x, step.z) == (0, 0) && step.y < 3 {
                        let place = (step.y * 3 + way.z + 1) * 3 + way.x + 1;
                        around[place as usize] = number;
                    }
                }
            }
            SurfaceJob { brick: pos.0.to_array(), around, ..SurfaceJob::default() }
        };
        stack.iter().map(job).collect()
    };
    map(&stacks, MANY_STACKS, of_stack).concat()
}

/// Input of the launches that compute distances to the surface.
pub(super) struct SurfaceInput<'a> {
    jobs: Vec<SurfaceJob>,
    windows: Windows<'a>,
    horizon: i32,
    /// The last columns of the world along x and z.
    last: [i32; 2],
    job_list: Section,
    ref_list: Section,
}

impl SurfaceInput<'_> {
    /// Reserves staging sections for the input.
    pub fn plan(&mut self, plan: &mut StagingLayout) {
        self.job_list = plan.section::<SurfaceJob>(self.jobs.len());
        self.ref_list = plan.section::<u32>(self.windows.len());
    }

    /// Writes the input, and returns the memory of the windows for reuse.
    pub fn put(&mut self, input: &mut InputBuffer, kept: &mut KeptSlabs) {
        input.put(self.job_list, &self.jobs);
        self.windows.write(input.entries(self.ref_list));
        kept.put(std::mem::take(&mut self.windows));
    }

    /// Bytes of the distances of all bricks.
    fn bytes(&self) -> usize {
        self.jobs.len() * DISTANCE_BYTES
    }
}

impl Session {
    /// Builds the input for the distances to the surface, and sets the jobs' numbers in it; `None` if no edit needs
    /// distances.
    pub(super) fn surface_input<'a>(
        &mut self,
        work: &PreparedEdits<'a>,
        jobs: &mut [EditJob],
        uploads: &mut Uploads<'a>,
    ) -> Result<Option<SurfaceInput<'a>>, Fault> {
        let horizon = greatest_horizon(work);
        if horizon == 0 {
            return Ok(None);
        }
        let mut own = surface_jobs(work, jobs);
        if own.len() > MOST_JOBS {
            return Err(Fault::TooLarge(own.len()));
        }
        let place = |job: &SurfaceJob| (job.brick[0], job.brick[2]);
        for stack in own.chunk_by_mut(|a, b| place(a) == place(b)) {
            let slot = self.need_stack(uploads, place(&stack[0]))?;
            stack.iter_mut().for_each(|job| job.stack = slot);
        }
        let mut windows = windows(&self.bricks, work.base, &own, SurfaceJob::pos, 1, &mut self.kept);
        self.complete(uploads, &mut windows)?;
        for (number, job) in own.iter_mut().enumerate() {
            let entry = windows.entry(number);
            (job.window, job.strides) = (entry.number, entry.strides);
        }
        let [job_list, ref_list] = [Section::default(); 2];
        let last = [work.grid.width(), work.grid.depth()];
        Ok(Some(SurfaceInput { jobs: own, windows, horizon, last, job_list, ref_list }))
    }

    /// Makes room for the distances of the input.
    pub(super) fn reserve_surface(&mut self, input: &SurfaceInput) -> Result<(), Fault> {
        self.surface.reserve(&mut *self.device, 2 * input.bytes())
    }

    /// Computes distances on the device, once the input is sent, and returns their address.
    pub(super) fn launch_surface(&mut self, of: &SurfaceInput) -> Result<u64, Fault> {
        let (blocks, jobs) = (of.jobs.len() as u32, self.input.address(of.job_list));
        let mut places = [self.surface.address(), self.surface.address() + of.bytes() as u64];
        let start = SurfaceStartParams {
            bricks: self.bricks.base(),
            stacks: self.stacks.base(),
            windows: self.input.address(of.ref_list),
            jobs,
            distances: places[0],
            horizon: of.horizon,
            last: of.last,
            pad: 0,
        };
        // SAFETY: the parameters are sections of the input, and memory that was reserved for twice the distances of all
        // jobs. None of it is accessed before the caller waits.
        unsafe { self.device.launch(Launch::new(blocks, &start)) }?;
        for _ in 0..steps(of.horizon) {
            let spread = SurfaceSpreadParams { jobs, from: places[0], to: places[1] };
            // SAFETY: as above. The jobs refer to each other by numbers in their list.
            unsafe { self.device.launch(Launch::new(blocks, &spread)) }?;
            places.reverse();
        }
        Ok(places[0])
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;

    use super::*;

    fn brick(x: i32, y: i32, z: i32) -> BrickPos {
        BrickPos(IVec3::new(x, y, z))
    }

    #[test]
    fn the_bricks_around_are_those_next_to_it_in_the_list() {
        for (seed, side) in [(1, 3), (2, 6), (3, 14)] {
            let mut rng = Rng::with_seed(seed);
            let mut bricks: Vec<BrickPos> =
                (0..400).map(|_| brick(rng.i32(-1..side), rng.i32(-side..side), rng.i32(0..side))).collect();
            bricks.sort_unstable();
            bricks.dedup();
            let jobs = listed(&bricks);
            assert!(jobs.iter().map(SurfaceJob::pos).eq(bricks.iter().copied()));
            for job in &jobs {
                for (place, step) in (0..27).map(|i| (i as usize, IVec3::new(i % 3, i / 9, i / 3 % 3) - 1)) {
                    let expected = bricks.binary_search(&BrickPos(job.pos().0 + step));
                    assert_eq!(
                        job.around[place],
                        expected.map_or(NONE, |number| number as u32),
                        "{job:?} {step}"
                    );
                }
            }
        }
    }

    #[test]
    fn neighbours_lie_in_the_world() {
        let grid = ChunkGrid::new(32, 40, 39);
        let corner = with_neighbours(&[brick(5, -7, 4)], grid);
        assert_eq!(corner.len(), 2 * 3 * 2, "{corner:?}");
        assert!(corner.iter().all(|pos| pos.0.x <= 5 && pos.0.z <= 4));
        assert_eq!(with_neighbours(&[brick(2, 0, 2)], grid).len(), 27);
    }

    #[test]
    fn ways_are_as_long_as_their_horizon_allows() {
        for (horizon, samples, away) in
            [(0, 0, 0), (1024, 3, 1), (1025, 4, 1), (2304, 8, 1), (2305, 9, 2), (4096, 15, 2)]
        {
            assert_eq!((steps(horizon), bricks_away(horizon)), (samples, away), "{horizon}");
        }
    }
}
