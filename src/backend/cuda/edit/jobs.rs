//! Lists the jobs of the edit kernels: each brick that edits may reach, with its edits, its ground stack and its
//! current content.

use super::super::cache::reference;
use super::super::device::Fault;
use super::super::layout::{self, EditJob, MOST_JOBS, NONE};
use super::super::lists::{cut, map, map_into};
use super::super::session::{Session, Uploads};
use super::output::{LONG, PIECE};
use crate::edits::{Job, PreparedEdits};
use crate::lattice::{ChunkGrid, pieces};
use crate::volume::Brick;

/// Replaces the list by one job for each brick that edits may reach, in order, with its position, edits and chunk
/// cuts. `complete` gets consecutive jobs and the number of the first; its results are returned in order.
///
/// # Errors
/// [`Fault::TooLarge`] if there are more jobs than a launch may have.
/// More jobs than a launch may have.
pub(super) fn list<R: Send>(
    work: &PreparedEdits,
    list: &mut Vec<EditJob>,
    complete: impl Fn(usize, &mut [EditJob]) -> R + Send + Sync,
) -> Result<Vec<R>, Fault> {
    let length = if work.jobs().len() < LONG { LONG } else { PIECE };
    let pieces = pieces(work.jobs(), length, Job::is_same_brick);
    if let [] | [_] = &pieces[..] {
        list.clear();
        list.extend(list_from(0, work.jobs(), work.grid));
        return Ok(vec![complete(0, list)]);
    }
    let counts = map(&pieces, 2, |piece| piece.chunk_by(Job::is_same_brick).count());
    let count = counts.iter().sum();
    if count > MOST_JOBS {
        return Err(Fault::TooLarge(count));
    }
    list.resize(count, EditJob::default());
    let (mut edit, mut brick) = (0, 0);
    let numbered = pieces.iter().zip(cut(list, counts.into_iter())).map(|(&piece, place)| {
        let own = (edit, brick, piece, place);
        (edit, brick) = (edit + piece.len(), brick + own.3.len());
        own
    });
    Ok(map_into(numbered.collect(), |(edit, brick, piece, place): (usize, usize, &[Job], &mut [EditJob])| {
        place.iter_mut().zip(list_from(edit, piece, work.grid)).for_each(|(place, job)| *place = job);
        complete(brick, place)
    }))
}

/// The jobs for a piece of the list of edits that starts at this number.
fn list_from(first: usize, piece: &[Job], grid: ChunkGrid) -> impl Iterator<Item = EditJob> {
    let mut first = first as u32;
    piece.chunk_by(Job::is_same_brick).map(move |of_brick| {
        let (pos, own, count) = (of_brick[0].pos(), first, of_brick.len() as u32);
        first += count;
        let cuts = layout::cuts(grid, pos);
        EditJob { brick: pos.0.to_array(), first: own, count, cuts, surface: NONE, ..EditJob::default() }
    })
}

/// Data that jobs need and the device does not have, by job number.
#[derive(Default)]
struct Missing<'a> {
    stacks: Vec<usize>,
    bricks: Vec<(usize, &'a Brick)>,
}

impl Session {
    /// Lists jobs with their stacks and, if `with_bricks`, their current bricks. Missing data is queued for upload.
    pub(super) fn list_edits<'a>(
        &mut self,
        work: &PreparedEdits<'a>,
        jobs: &mut Vec<EditJob>,
        with_bricks: bool,
        uploads: &mut Uploads<'a>,
    ) -> Result<(), Fault> {
        let (stacks, slots, base) = (&self.stacks, &self.bricks, work.base);
        let missing = list(work, jobs, |first, jobs| {
            let (mut number, mut missing) = (first, Missing::default());
            for stack in jobs.chunk_by_mut(|a, b| a.place() == b.place()) {
                let slot = stacks.find(base.ground(), stack[0].place());
                if slot.is_none() {
                    missing.stacks.push(number);
                }
                for (number, job) in (number..).zip(&mut *stack) {
                    job.stack = slot.unwrap_or_default();
                    job.base = NONE;
                    let brick = if with_bricks { base.brick(job.pos()) } else { None };
                    let Some(brick) = brick else { continue };
                    match slots.find(brick.tag.get()) {
                        Some(slot) => job.base = reference(slot, brick),
                        None => missing.bricks.push((number, brick)),
                    }
                }
                number += stack.len();
            }
            missing
        })?;
        for Missing { stacks, bricks } in missing {
            for first in stacks {
                let stack = jobs[first].place();
                let slot = self.need_stack(uploads, stack)?;
                let own = jobs[first..].iter_mut().take_while(|job| job.place() == stack);
                own.for_each(|job| job.stack = slot);
            }
            for (number, brick) in bricks {
                jobs[number].base = self.need_brick(uploads, brick)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::{Brush, Edit, Shape};
    use crate::ground::Ground;
    use crate::volume::{Bricks, SampleView};

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
            let work = PreparedEdits::new(samples, grid, &edits.iter().collect::<Vec<_>>());
            let mut jobs = vec![EditJob::default(); 7];
            let pieces = list(&work, &mut jobs, |first, jobs| (first, jobs.len())).expect("few enough");
            assert_eq!(
                pieces.iter().fold(0, |end, &(first, len)| if first == end { end + len } else { 0 }),
                jobs.len()
            );
            assert_eq!(jobs.len(), work.bricks().len());
            let mut next = 0;
            for (job, of_brick) in jobs.iter().zip(work.bricks()) {
                assert_eq!((job.first, job.count), (next, of_brick.len() as u32));
                assert_eq!((job.pos(), job.cuts), (of_brick[0].pos(), layout::cuts(grid, of_brick[0].pos())));
                next += job.count;
            }
        }
    }
}
