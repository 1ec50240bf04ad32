//! What a commit changes in the light of a rectangle of columns.
//!
//! Light under the open sky depends on tops, in eight directions. So only the directions in which a column sees a
//! changed top are compared, before and after; where none of them differs, its light is the same.

use std::ops::Range;

use glam::IVec3;

use super::columns::{Run, SkyColumns};
use super::light::{
    FAR, LOWEST_RAY, NEAR, RAY_REACH, REACH, SkyLights, Step, below, columns_of, is_covered, is_wall,
};
use super::{LitWorld, SkyView};
use crate::lattice::{Column, ONE, SNAP};

/// The difference of what eight directions hide that always shows: light counts it in eighths.
const SHOWS: i16 = 8;

/// Marks a column whose own top changes.
const MOVED: i16 = i16::MAX;

/// The columns of a rectangle before and after a commit.
pub(crate) struct LightChange<'a> {
    before: SkyColumns<'a>,
    after: SkyColumns<'a>,
    low: Column,
    /// The columns of the stacks of bricks that change, both ends included.
    stacks: [Column; 2],
    /// Where the highest change ends, of tops and of bricks, in 1/256 voxel; and of tops alone.
    highest: i32,
    highest_top: i32,
    /// For each row of all columns, those between which changed tops lie: counted from the rectangle's first column.
    moved: Vec<Run>,
    /// By how much more or less of the sky is hidden on the tops of the rectangle's columns, x fastest; in rows for
    /// which it was asked.
    hidden: Vec<i16>,
    is_known: Vec<bool>,
}

impl<'a> LightChange<'a> {
    /// The columns from `low` to `high`, both included, where the columns of changed stacks of bricks have these ends,
    /// and the highest changed brick ends at this height, in 1/256 voxel.
    pub fn new(
        lit: &'a LitWorld,
        (low, high): (Column, Column),
        stacks: (Column, Column),
        highest: i32,
    ) -> Self {
        let before = SkyColumns::new(lit.view_before(), low, high);
        let after = before.after(lit);
        let [width, depth] = before.size();
        let mut highest_top = i32::MIN;
        let run = |row: usize| {
            let rows = [before.row(row), after.row(row)];
            if rows[0] == rows[1] {
                return Run::EMPTY;
            }
            let differs = |&at: &usize| rows[0][at] != rows[1][at];
            let all = 0..rows[0].len();
            let (start, end) = (all.clone().find(differs), all.rev().find(differs));
            let (Some(start), Some(end)) = (start, end) else { return Run::EMPTY };
            let tops = rows.iter().flat_map(|row| &row[start..=end]);
            highest_top = tops.fold(highest_top, |highest, &top| highest.max(top));
            Run { start: start as i32 - REACH, end: end as i32 + 1 - REACH }
        };
        let moved = (0..depth + 2 * REACH as usize).map(run).collect();
        Self {
            low,
            stacks: stacks.into(),
            highest: highest.max(highest_top),
            highest_top,
            moved,
            hidden: vec![0; width * depth],
            is_known: vec![false; depth],
            before,
            after,
        }
    }

    /// Whether the light differs on the ground of any column between two, both included, where the ground is what it
    /// was before anyone dug: there, tiles may draw it.
    pub fn shows_on_ground(&mut self, view: SkyView, low: Column, high: Column) -> bool {
        let [width, depth] = self.before.size();
        let within = |from: i32, to: i32, low: i32, count: usize| {
            Run { start: from - low, end: to + 1 - low }.within(count)
        };
        let columns = within(low.x, high.x, self.low.x, width);
        for z in within(low.z, high.z, self.low.z, depth) {
            self.compare_row(z);
            for x in columns.clone() {
                let differs = !matches!(self.hidden[z * width + x], 0 | MOVED);
                if differs && self.is_ground(z, x) && self.shows_on_top([x, z]) {
                    return true;
                }
            }
            // Ground under roofs, or that was under one. Tiles draw no dug ground.
            let changed = self.before.changed_run(z).hull(self.after.changed_run(z)).within(width);
            for x in changed.start.max(columns.start)..changed.end.min(columns.end) {
                if self.is_ground(z, x) {
                    continue;
                }
                let column = self.low.offset(x as i32, z as i32);
                let height = view.ground().height(column);
                if self.before.inner_row(z)[x].max(self.after.inner_row(z)[x]) < height {
                    continue;
                }
                if self.differs((column.at(0) * SNAP).with_y(height * (SNAP / ONE))) {
                    return true;
                }
            }
        }
        false
    }

    /// Whether the light of a vertex at a place, in 1/4096 voxel, differs.
    pub fn shows_at(&mut self, place: IVec3) -> bool {
        let columns = columns_of(place);
        if self.before.place(columns[0]).is_none() {
            return false;
        }
        let y = place.y.div_euclid(SNAP / ONE);
        let [(low, bottom), (high, top)] = self.before.by_top(columns);
        if self.after.top(low) != bottom || self.after.top(high) != top {
            return self.differs(place);
        }
        if is_covered(y, bottom) {
            let [first, last] = self.stacks;
            let is_near =
                |at: i32, first: i32, last: i32| (first - RAY_REACH..=last + RAY_REACH).contains(&at);
            return y - LOWEST_RAY < self.highest
                && is_near(columns[0].x, first.x, last.x)
                && is_near(columns[0].z, first.z, last.z)
                && self.differs(place);
        }
        // Light comes from above, and a slope is lit as its foot and its edge are.
        if y.min(bottom) >= self.highest {
            return false;
        }
        let may_differ = if y > top + ONE {
            self.sees_moved(high)
        } else {
            let are_changed = [low, high].map(|column| self.before.is_changed(column));
            columns.iter().any(|&column| self.may_show_on_top(column))
                || is_wall(top - bottom, are_changed) && self.sees_moved(low)
        };
        may_differ && self.differs(place)
    }

    /// Whether the light on top of a column may differ; the top stays.
    fn may_show_on_top(&mut self, column: Column) -> bool {
        match self.before.place(column) {
            Some(at) => self.shows_on_top(at),
            None => self.sees_moved(column),
        }
    }

    /// Compares the light of a place.
    fn differs(&mut self, place: IVec3) -> bool {
        self.before.light(place) != self.after.light(place)
    }

    /// Whether the top of a column of the rectangle is the ground's own height, before and after.
    fn is_ground(&self, z: usize, x: usize) -> bool {
        !self.before.is_changed_at([x, z]) && !self.after.is_changed_at([x, z])
    }

    /// Whether the light on top of a column differs; the top stays.
    fn shows_on_top(&mut self, [x, z]: [usize; 2]) -> bool {
        self.compare_row(z);
        let at = z * self.before.size()[0] + x;
        let hidden = self.hidden[at];
        if (1 - SHOWS..SHOWS).contains(&hidden) && hidden != 0 {
            let (column, y) = (self.low.offset(x as i32, z as i32), self.before.inner_row(z)[x]);
            let differs = self.before.open_light(column, y) != self.after.open_light(column, y);
            self.hidden[at] = if differs { SHOWS } else { 0 };
        }
        self.hidden[at] != 0
    }

    /// Whether a column sees one whose top changes.
    fn sees_moved(&self, column: Column) -> bool {
        let at = [column.x - self.low.x, column.z - self.low.z];
        let steps = FAR.as_flattened().iter().chain(NEAR.as_flattened());
        { steps }.any(|step| {
            let row = usize::try_from(at[1] + REACH + step.dz).ok().and_then(|row| self.moved.get(row));
            row.is_some_and(|run| (run.start..run.end).contains(&(at[0] + step.dx)))
        })
    }

    /// Compares how much of the sky is hidden on the tops of a row, unless that is known.
    fn compare_row(&mut self, z: usize) {
        if self.is_known[z] {
            return;
        }
        self.is_known[z] = true;
        let width = self.before.size()[0];
        let rows = [self.before.inner_row(z), self.after.inner_row(z)];
        let own = self.moved[z + REACH as usize].within(width);
        // Only higher ground hides anything.
        if rows[0].iter().fold(i32::MAX, |lowest, &top| lowest.min(top)) >= self.highest_top && own.is_empty()
        {
            return;
        }
        let hidden = &mut self.hidden[z * width..][..width];
        let moved_by = |step: &Step| self.moved[(z as i32 + REACH + step.dz) as usize].moved(-step.dx);
        let near = [&self.before, &self.after].map(|all| all.near_run(z).within(width));
        for (direction, (far, near_steps)) in FAR.iter().zip(&NEAR).enumerate() {
            let seen = far.iter().chain(near_steps).map(moved_by).fold(Run::EMPTY, Run::hull).within(width);
            for x in seen.clone().step_by(8) {
                let horizons = |all: &SkyColumns, near: &Range<usize>| {
                    all.horizons([x, z], direction, near.start < x + 8 && near.end > x)
                };
                let [before, after] = [horizons(&self.before, &near[0]), horizons(&self.after, &near[1])];
                if before != after {
                    for (hidden, (before, after)) in hidden[x..].iter_mut().zip(before.into_iter().zip(after))
                    {
                        *hidden += below(after) as i16 - below(before) as i16;
                    }
                }
            }
        }
        for x in own.filter(|&x| rows[0][x] != rows[1][x]) {
            hidden[x] = MOVED;
        }
    }
}
