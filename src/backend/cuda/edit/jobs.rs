//! Jobs of the edit kernels: the bricks that edits may reach, each with its edits, its stack and what it is now.

use glam::IVec3;

use super::super::device::Fault;
use super::super::layout::{self, EditJob, MOST_JOBS, NONE};
use super::super::lists::{cut, hand_out, in_pieces, map};
use super::super::session::{Session, Uploads};
use super::super::slots::reference;
use super::LONG;
use crate::lattice::{BrickPos, ChunkGrid, pieces};
use crate::volume::{EditWork, Job, SampleView};

/// Which brick a job is about.
pub(super) fn pos(job: &EditJob) -> BrickPos {
    BrickPos(IVec3::from_array(job.brick))
}

/// The stack that a job's brick belongs to.
fn place(job: &EditJob) -> (i32, i32) {
    let [x, _, z] = job.brick;
    (x, z)
}

/// A job for each brick that edits may reach, in order: where the brick is, which edits it takes, how chunks cut it. They
/// take the place of what the list holds.
///
/// # Errors
/// More jobs than a launch may have.
pub(super) fn list(work: &EditWork, list: &mut Vec<EditJob>) -> Result<(), Fault> {
    let pieces = pieces(work.jobs(), LONG, Job::is_same_brick);
    if let [] | [_] = &pieces[..] {
        list.clear();
        list.extend(list_from(0, work.jobs(), work.grid));
        return Ok(());
    }
    let counts = map(&pieces, 2, |piece| piece.chunk_by(Job::is_same_brick).count());
    let count = counts.iter().sum();
    if count > MOST_JOBS {
        return Err(Fault::TooLarge(count));
    }
    list.resize(count, EditJob::default());
    let mut first = 0;
    let numbered = pieces.iter().zip(cut(list, counts.into_iter())).map(|(&piece, place)| {
        let own = first;
        first += piece.len();
        (own, piece, place)
    });
    hand_out(numbered.collect(), |(first, piece, place)| {
        place.iter_mut().zip(list_from(first, piece, work.grid)).for_each(|(place, job)| *place = job);
    });
    Ok(())
}

/// The jobs of a piece of a list of edits, which begins with this number.
fn list_from(first: usize, piece: &[Job], grid: ChunkGrid) -> impl Iterator<Item = EditJob> {
    let mut first = first as u32;
    piece.chunk_by(Job::is_same_brick).map(move |of_brick| {
        let (pos, own, count) = (of_brick[0].pos(), first, of_brick.len() as u32);
        first += count;
        let cuts = layout::cuts(grid, pos);
        EditJob { brick: pos.0.to_array(), first: own, count, cuts, ..EditJob::default() }
    })
}

impl Session {
    /// Enters stacks, which are uploaded where they have to be.
    pub(super) fn enter_stacks(
        &mut self,
        work: &EditWork,
        jobs: &mut [EditJob],
        uploads: &mut Uploads,
    ) -> Result<(), Fault> {
        let (stacks, ground) = (&self.stacks, work.base.ground());
        let missing = in_pieces(jobs, LONG, |first, jobs| {
            let (mut first, mut missing) = (first, Vec::new());
            for stack in jobs.chunk_by_mut(|a, b| place(a) == place(b)) {
                match stacks.find(ground, place(&stack[0])) {
                    Some(slot) => stack.iter_mut().for_each(|job| job.stack = slot),
                    None => missing.push(first),
                }
                first += stack.len();
            }
            missing
        });
        for first in missing.into_iter().flatten() {
            let stack = place(&jobs[first]);
            let slot = self.need_stack(uploads, stack)?;
            let own = jobs[first..].iter_mut().take_while(|job| place(job) == stack);
            own.for_each(|job| job.stack = slot);
        }
        Ok(())
    }

    /// Enters what bricks are now; they are uploaded where they have to be.
    pub(super) fn enter_bricks<'a>(
        &mut self,
        base: SampleView<'a>,
        jobs: &mut [EditJob],
        uploads: &mut Uploads<'a>,
    ) -> Result<(), Fault> {
        let slots = &self.bricks;
        let missing = in_pieces(jobs, LONG, |first, jobs| {
            let mut missing = Vec::new();
            for (number, job) in (first..).zip(jobs) {
                job.base = NONE;
                let Some(brick) = base.brick(pos(job)) else { continue };
                match slots.find(brick.tag.get()) {
                    Some(slot) => job.base = reference(slot, brick),
                    None => missing.push((number, brick)),
                }
            }
            missing
        });
        for (number, brick) in missing.into_iter().flatten() {
            jobs[number].base = self.need_brick(uploads, brick)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::{Brush, Edit, Shape};
    use crate::ground::Ground;
    use crate::volume::Bricks;

    #[test]
    fn every_brick_has_one_job_with_all_of_its_edits() {
        let (ground, bricks) = (Ground::flat(300, 300, 0.0).expect("a ground"), Bricks::default());
        let (samples, grid) = (SampleView::new(&ground, &bricks), ChunkGrid::new(25, 300, 300));
        let edit = |i: i32| {
            let center = glam::Vec3::new((i * 37 % 300) as f32, -20.0, (i * 91 % 300) as f32);
            Edit::quantize(&Brush::dig(Shape::sphere(center, 20.0))).expect("an edit")
        };
        for edits in [0, 1, 90] {
            let edits: Vec<Edit> = (0..edits).map(edit).collect();
            let work = EditWork::new(samples, grid, &edits.iter().collect::<Vec<_>>());
            let mut jobs = vec![EditJob::default(); 7];
            list(&work, &mut jobs).expect("few enough");
            assert_eq!(jobs.len(), work.bricks().len());
            let mut next = 0;
            for (job, of_brick) in jobs.iter().zip(work.bricks()) {
                assert_eq!((job.first, job.count), (next, of_brick.len() as u32));
                assert_eq!((pos(job), job.cuts), (of_brick[0].pos(), layout::cuts(grid, of_brick[0].pos())));
                next += job.count;
            }
        }
    }
}
