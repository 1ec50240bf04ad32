//! Pairs of edits and the bricks that they may reach.
//!
//! Where there are many, threads share the bricks in slabs, one brick thick along x, whose results stand one
//! after the other in order. Long thin brushes come near few bricks of the box around them, so up to 8x8x8
//! bricks are tested together before each is tested alone; more of them for paths, which may be very long.

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
    // Only paths are longer than some hundred bricks.
    let is_long = (bricks.max - bricks.min).max_element() >= 1 << (2 * TESTED_TOGETHER);
    let level = TESTED_TOGETHER * if is_long { 3 } else { 1 };
    add_within(&edits[edit as usize], edit, bricks, level, jobs);
}

/// Log2 of the sides of boxes, in smaller boxes or bricks, that are tested together.
const TESTED_TOGETHER: u32 = 3;

/// Adds jobs, after boxes with sides of `1 << level` bricks were tested, and smaller ones inside those.
fn add_within(own: &PreparedEdit, edit: u32, bricks: LatticeBox, level: u32, jobs: &mut Vec<Job>) {
    let reaches =
        |bricks: LatticeBox| own.reaches(LatticeBox { min: bricks.min << 3, max: (bricks.max << 3) + 7 });
    if level == 0 {
        let near = bricks.points().filter(|&at| reaches(LatticeBox::point(at)));
        jobs.extend(near.map(|at| Job { pos: BrickPos(at), edit }));
        return;
    }
    let boxes = LatticeBox { min: bricks.min >> level, max: bricks.max >> level };
    for at in boxes.points() {
        let inside = LatticeBox { min: at << level, max: (at << level) + ((1 << level) - 1) };
        if let Some(inside) = bricks.intersection(inside).filter(|&inside| reaches(inside)) {
            add_within(own, edit, inside, level - TESTED_TOGETHER, jobs);
        }
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use glam::Vec3;

    use super::*;
    use crate::brush::{BAND, Brush, BrushPath, Edit, Shape};
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
                let radius = 0.3 + size * 0.2;
                match rng.u8(..3) {
                    0 => Brush::dig(Shape::sphere(a, size)),
                    1 => Brush::dig(Shape::capsule(a, a.lerp(b, 0.3), size * 0.2)),
                    _ => Brush::dig(BrushPath::spline([a, a.lerp(b, 0.2), b].map(|at| (at, radius)))),
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
    fn a_long_path_is_assigned_to_the_bricks_along_it() {
        let path = BrushPath::polyline([
            (Vec3::new(9.0, 0.0, 7.0), 2.0),
            (Vec3::new(6900.0, 40.0, 3000.0), 4.0),
            (Vec3::new(100.0, 0.0, 7900.0), 1.0),
        ]);
        let edit = Edit::quantize(&Brush::dig(path.clone())).unwrap();
        let own = [PreparedEdit::new(ChunkGrid::new(32, 8192, 8192), &edit, None)];
        let jobs = jobs(&own);
        for (step, pair) in (0..=200).flat_map(|step| path.points.windows(2).map(move |pair| (step, pair))) {
            let at = pair[0].0.lerp(pair[1].0, step as f32 / 200.0).as_ivec3() >> 3;
            assert!(jobs.iter().any(|job| job.pos.0 == at), "no job at brick {at}");
        }
        assert!((2000..30_000).contains(&jobs.len()), "{}", jobs.len());
        let around = BrickPos::range(own[0].reach.expect("in the world")).volume();
        assert!(edit.max_bricks().is_some_and(|most| most >= jobs.len() as u64 && most < around / 20));
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
