//! The places of edits, for levels of detail: the bricks over a rectangle of columns, stack by stack.

use std::ops::RangeInclusive;

use glam::IVec3;
use rustc_hash::FxHashMap;

use crate::lattice::{BRICK, BrickPos, Column};
use crate::volume::{Brick, SampleView};

/// Where bricks are: those of the world by stacks, and those of a running transaction.
#[derive(Clone, Copy)]
pub struct Stacks<'a> {
    committed: &'a FxHashMap<(i32, i32), Vec<i32>>,
    /// In order. Some of them may be among the others too.
    newer: &'a [BrickPos],
}

impl<'a> Stacks<'a> {
    /// The heights of bricks over each stack (x, z), ascending.
    pub fn new(committed: &'a FxHashMap<(i32, i32), Vec<i32>>) -> Self {
        Self { committed, newer: &[] }
    }

    /// These bricks together with those that a running transaction changes, in order.
    pub fn over(self, newer: &'a [BrickPos]) -> Self {
        debug_assert!(newer.is_sorted());
        Self { newer, ..self }
    }

    /// Calls `each` with every stack of a rectangle, both ends included, and the heights of bricks in it; some twice,
    /// and in no order. Looks at the rectangle's places or at all stacks, whichever are fewer.
    fn for_stacks(&self, low: (i32, i32), high: (i32, i32), mut each: impl FnMut((i32, i32), &[i32])) {
        let along = |low: i32, high: i32| (i64::from(high) - i64::from(low) + 1).max(0);
        let is_inside = |(x, z): (i32, i32)| (low.0..=high.0).contains(&x) && (low.1..=high.1).contains(&z);
        if (self.committed.len() as i64) < along(low.0, high.0).saturating_mul(along(low.1, high.1)) {
            let inside = self.committed.iter().filter(|(stack, _)| is_inside(**stack));
            inside.for_each(|(&stack, heights)| each(stack, heights));
        } else {
            for stack in (low.0..=high.0).flat_map(|x| (low.1..=high.1).map(move |z| (x, z))) {
                if let Some(heights) = self.committed.get(&stack) {
                    each(stack, heights);
                }
            }
        }
        let first = self.newer.partition_point(|brick| brick.0.x < low.0);
        let newer = self.newer[first..].iter().take_while(|brick| brick.0.x <= high.0);
        let inside = newer.filter(|brick| is_inside(brick.stack()));
        inside.for_each(|brick| each(brick.stack(), &[brick.0.y]));
    }

    /// Returns `true` if there is a brick over some of these columns, both ends included.
    pub fn has_any(&self, low: Column, high: Column) -> bool {
        let mut has_any = false;
        self.for_stacks((low.x >> 3, low.z >> 3), (high.x >> 3, high.z >> 3), |_, _| has_any = true);
        has_any
    }
}

/// The bricks over a rectangle of columns that hold samples of a coarser lattice.
#[derive(Default)]
pub(super) struct NearBricks<'a> {
    /// Each stack from below.
    stacks: FxHashMap<(i32, i32), Vec<(i32, &'a Brick)>>,
    /// The world's last columns.
    last: (i32, i32),
}

impl<'a> NearBricks<'a> {
    /// The bricks over the columns from `low` to `high` with samples of a lattice of this step. Columns that lie beyond
    /// the rim, whose last column is `last`, are the rim's.
    pub fn new(
        samples: &SampleView<'a>,
        stacks: &Stacks,
        [low, high]: [Column; 2],
        step: i32,
        last: Column,
    ) -> Self {
        let mut heights: FxHashMap<(i32, i32), Vec<i32>> = FxHashMap::default();
        let (first, end) = ((low.x >> 3, low.z >> 3), (high.x >> 3, high.z >> 3));
        stacks.for_stacks(first, end, |stack, own| {
            let has = |at: i32, last: i32| lattice_in(at, step, last).next().is_some();
            if has(stack.0, last.x) && has(stack.1, last.z) {
                let wanted = own.iter().filter(|&&y| step <= BRICK || (y * BRICK) % step == 0);
                heights.entry(stack).or_default().extend(wanted);
            }
        });
        let with_bricks = |(stack, mut heights): ((i32, i32), Vec<i32>)| {
            heights.sort_unstable();
            heights.dedup();
            let brick = |y: i32| Some((y, samples.brick(BrickPos(IVec3::new(stack.0, y, stack.1)))?));
            let bricks: Vec<_> = heights.into_iter().filter_map(brick).collect();
            (!bricks.is_empty()).then_some((stack, bricks))
        };
        Self { stacks: heights.into_iter().filter_map(with_bricks).collect(), last: (last.x, last.z) }
    }

    /// Returns `true` if nothing is edited.
    pub fn is_empty(&self) -> bool {
        self.stacks.is_empty()
    }

    fn stack_of(&self, column: Column) -> (&[(i32, &'a Brick)], u32) {
        let (x, z) = (column.x.min(self.last.0), column.z.min(self.last.1));
        let bit = ((z & 7) << 3 | x & 7) as u32;
        (self.stacks.get(&(x >> 3, z >> 3)).map_or(&[], Vec::as_slice), bit)
    }

    /// Returns `true` if any sample of a column is edited, of every `step`-th one in `rows`, beginning at the
    /// first.
    pub fn is_any_edited(&self, column: Column, rows: RangeInclusive<i32>, step: i32) -> bool {
        if self.is_empty() {
            return false;
        }
        let (bricks, bit) = self.stack_of(column);
        let first = bricks.partition_point(|(y, _)| y * BRICK + (BRICK - 1) < *rows.start());
        let reached = bricks[first..].iter().take_while(|(y, _)| y * BRICK <= *rows.end());
        reached.into_iter().any(|(y, brick)| {
            let (low, end) = ((y * BRICK).max(*rows.start()), (y * BRICK + BRICK - 1).min(*rows.end()));
            let mut ys = multiples(low, end, step);
            ys.any(|y| brick.edited()[(y & 7) as usize] >> bit & 1 == 1)
        })
    }

    /// Adds the heights of a column's edited samples that are multiples of `step`, from below.
    pub fn edited_rows(&self, column: Column, step: i32, rows: &mut Vec<i32>) {
        let (bricks, bit) = self.stack_of(column);
        for (y, brick) in bricks {
            let ys = multiples(y * BRICK, y * BRICK + BRICK - 1, step);
            rows.extend(ys.filter(|y| brick.edited()[(y & 7) as usize] >> bit & 1 == 1));
        }
    }

    /// Positions of the bricks, in no order.
    pub fn positions(&self) -> impl Iterator<Item = BrickPos> {
        let at = |(x, z): (i32, i32), y: i32| BrickPos(IVec3::new(x, y, z));
        self.stacks.iter().flat_map(move |(&stack, bricks)| bricks.iter().map(move |(y, _)| at(stack, *y)))
    }

    /// The lattice columns of a step under which samples may be edited, in no order. Those beyond the rim are there,
    /// too.
    pub fn columns(&self, step: i32) -> impl Iterator<Item = Column> {
        let (last_x, last_z) = self.last;
        self.stacks.keys().flat_map(move |&(x, z)| {
            lattice_in(z, step, last_z)
                .flat_map(move |z| lattice_in(x, step, last_x).map(move |x| Column::new(x, z)))
        })
    }
}

/// Multiples of a step from `low` to `end`.
fn multiples(low: i32, end: i32, step: i32) -> impl Iterator<Item = i32> {
    let first = (low + step - 1).div_euclid(step) * step;
    (first..=end).step_by(step as usize)
}

/// The coordinates of a lattice of this step in the bricks at `at`, where `last` is the rim: beyond it, the next one is
/// the rim's.
fn lattice_in(at: i32, step: i32, last: i32) -> impl Iterator<Item = i32> {
    let (low, high) = (at * BRICK, at * BRICK + BRICK - 1);
    let beyond = (last + step - 1).div_euclid(step) * step;
    let is_rim_here = (low..=high).contains(&last) && beyond != last;
    multiples(low, high.min(last), step).chain(is_rim_here.then_some(beyond))
}
