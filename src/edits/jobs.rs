//! Pairs of edits and the bricks that they may reach.
//!
//! Where there are many, threads share the bricks in slabs, one brick thick along x, whose results stand one
//! after the other in order. Long thin brushes come near few bricks of the box around them, so up to 8x8x8
//! bricks are tested together before each is tested alone.

use rayon::prelude::*;

use super::prepared_edit::PreparedEdit;
use crate::lattice::{BrickPos, ItemCost, LatticeBox, sort_by_place};

/// One edit's work on one brick; sorted by brick, then by edit.
#[derive(Clone, Copy)]
pub(crate) struct Job {
    pos: BrickPos,
    pub edit: u32,
}

impl Job {
    /// The brick's position.
    pub fn pos(self) -> BrickPos {
        self.pos
    }

    /// Returns `true` if both concern the same brick.
    pub fn is_same_brick(a: &Self, b: &Self) -> bool {
        a.pos == b.pos
    }
}

/// Every brick that some edit may reach, once for each edit: by brick, and for each brick in order of the edits.
pub(super) fn jobs(edits: &[PreparedEdit]) -> Vec<Job> {
    let reaches = || (0..).zip(edits).filter_map(|(edit, own)| Some((edit, BrickPos::range(own.reach?))));
    let around = reaches().fold(0, |sum: u64, (_, bricks)| sum.saturating_add(bricks.volume()));
    if !ItemCost::Lookup.is_shared(usize::try_from(around).unwrap_or(usize::MAX)) {
        let mut jobs = Vec::with_capacity(around as usize);
        reaches().for_each(|(edit, bricks)| add(edits, edit, bricks, &mut jobs));
        sort(&mut jobs);
        return jobs;
    }
    let slab = |(edit, bricks): (u32, LatticeBox)| {
        (bricks.min.x..=bricks.max.x)
            .map(move |x| (edit, LatticeBox { min: bricks.min.with_x(x), max: bricks.max.with_x(x) }))
    };
    let mut parts: Vec<(u32, LatticeBox)> = reaches().flat_map(slab).collect();
    parts.sort_by_key(|(_, bricks)| bricks.min.x);
    let slabs: Vec<&[(u32, LatticeBox)]> = parts.chunk_by(|a, b| a.1.min.x == b.1.min.x).collect();
    let of_slab = |parts: &&[(u32, LatticeBox)]| {
        let mut jobs = Vec::new();
        parts.iter().for_each(|&(edit, bricks)| add(edits, edit, bricks, &mut jobs));
        sort(&mut jobs);
        jobs
    };
    slabs.par_iter().with_max_len(1).map(of_slab).collect::<Vec<_>>().concat()
}

/// Jobs of one brick stay in order.
fn sort(jobs: &mut Vec<Job>) {
    sort_by_place(jobs, |job| job.pos.stack_order());
}

/// Adds jobs for those of some bricks that an edit may reach.
fn add(edits: &[PreparedEdit], edit: u32, bricks: LatticeBox, jobs: &mut Vec<Job>) {
    let own = &edits[edit as usize];
    let reaches =
        |bricks: LatticeBox| own.reaches(LatticeBox { min: bricks.min << 3, max: (bricks.max << 3) + 7 });
    let boxes = LatticeBox { min: bricks.min >> 3, max: bricks.max >> 3 };
    for at in boxes.points() {
        let own = bricks.intersection(LatticeBox { min: at << 3, max: (at << 3) + 7 });
        let Some(own) = own.filter(|&own| reaches(own)) else { continue };
        let near = own.points().filter(|&at| reaches(LatticeBox::point(at)));
        jobs.extend(near.map(|at| Job { pos: BrickPos(at), edit }));
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use glam::Vec3;

    use super::*;
    use crate::brush::{BAND, Brush, Edit, Shape};
    use crate::lattice::ChunkGrid;

    fn prepared(brush: &Brush) -> PreparedEdit {
        let edit = Edit::quantize(brush).unwrap();
        PreparedEdit::new(ChunkGrid::new(32, 1024, 1024), &edit, None)
    }

    #[test]
    fn few_and_many_edits_are_assigned_to_the_bricks_that_they_may_reach() {
        let mut rng = Rng::with_seed(8);
        for (count, size) in [(0, 0.0), (1, 3.0), (3, 9.0), (40, 30.0), (1, 150.0), (300, 2.0)] {
            let brush = |rng: &mut Rng| {
                let mut at = || Vec3::new(rng.f32(), rng.f32() * 0.3, rng.f32()) * 300.0 - 40.0;
                let (a, b) = (at(), at());
                match rng.bool() {
                    true => Brush::dig(Shape::sphere(a, size)),
                    false => Brush::dig(Shape::capsule(a, a.lerp(b, 0.3), size * 0.2)),
                }
            };
            let edits: Vec<PreparedEdit> = (0..count).map(|_| prepared(&brush(&mut rng))).collect();
            let jobs = jobs(&edits);
            assert!(jobs.is_sorted_by(|a, b| (a.pos, a.edit) < (b.pos, b.edit)), "{count} of {size}");
            // Bricks that are not among them have no sample in reach.
            for (edit, own) in (0..).zip(&edits) {
                let mut distances = [wide::i16x8::ZERO; 64];
                for brick in own.reach.into_iter().flat_map(BrickPos::covering) {
                    if jobs.binary_search_by_key(&(brick, edit), |job| (job.pos, job.edit)).is_err() {
                        own.evaluator.rows(brick.origin(), 0..8, 0..8, &mut distances);
                        let rows = distances.iter().flat_map(|row| row.to_array());
                        assert!(rows.into_iter().all(|distance| i32::from(distance) > BAND), "{brick:?}");
                    }
                }
            }
            let reached = |job: &Job| edits[job.edit as usize].reaches(job.pos().samples());
            assert!(jobs.iter().all(reached), "{count} of {size}");
        }
    }

    #[test]
    fn a_long_thin_brush_comes_near_few_bricks() {
        let brush = Brush::dig(Shape::capsule(Vec3::ZERO, Vec3::splat(1000.0), 0.25));
        let jobs = jobs(&[prepared(&brush)]);
        let has = |at: i32| jobs.iter().any(|job| job.pos.0.to_array() == [at >> 3; 3]);
        assert!((0..=1000).all(has));
        assert!(jobs.len() < 5000, "{}", jobs.len());
    }
}
