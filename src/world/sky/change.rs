//! What a commit changes in the light of a rectangle of columns.
//!
//! Light under the open sky depends on tops, in eight directions. So only the directions in which a column sees a
//! changed top are compared, before and after; where none of them differs, its light is the same. Light under roofs
//! depends on rays, so only those that may meet a change are cast, before and after.

use std::ops::Range;

use glam::IVec3;

use super::air::AirMemory;
use super::columns::{Run, SkyColumns};
use super::horizon::{FAR, NEAR, below, capped};
use super::light::{
    DIRECTION_COUNT, HIGHEST_RISE, LOWEST_RAY, RAY_REACH, REACH, SkyLights, columns_of, corners_around,
    first_corner, is_covered, is_wall, last_of_rays, part_of_cube,
};
use super::{LitWorld, SkyView};
use crate::lattice::{BRICK, ChunkGrid, Column, ONE, SNAP};

/// The difference of what eight directions hide that always shows: light counts it in eighths.
const SHOWS: i16 = 8;

/// Marks a column whose own top changes.
const MOVED: i16 = i16::MAX;

/// A box around what changes of all that light depends on: tops, and which samples are solid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChangedBox {
    /// The lowest and the highest column, both included.
    pub low: Column,
    pub high: Column,
    /// The lowest and the highest point, in 1/256 voxel.
    pub bottom: i32,
    pub top: i32,
}

impl ChangedBox {
    pub const NONE: Self = Self {
        low: Column::new(i32::MAX, i32::MAX),
        high: Column::new(i32::MIN, i32::MIN),
        bottom: i32::MAX,
        top: i32::MIN,
    };

    pub fn is_empty(&self) -> bool {
        self.bottom > self.top
    }

    /// Adds columns of a stack of bricks, a bit for each, between two heights.
    pub(super) fn add(&mut self, stack: (i32, i32), columns: u64, (bottom, top): (i32, i32)) {
        if columns == 0 {
            return;
        }
        let row = (0..8).fold(0, |row, z| row | columns >> (8 * z)) as u8;
        let low = [row.trailing_zeros(), columns.trailing_zeros() / 8].map(|at| at as i32);
        let high = [7 - row.leading_zeros(), 7 - columns.leading_zeros() / 8].map(|at| at as i32);
        let at = Column::new(stack.0 * BRICK, stack.1 * BRICK);
        let own = Self { low: at.offset(low[0], low[1]), high: at.offset(high[0], high[1]), bottom, top };
        *self = self.union(own);
    }

    pub fn union(self, other: Self) -> Self {
        Self {
            low: Column::new(self.low.x.min(other.low.x), self.low.z.min(other.low.z)),
            high: Column::new(self.high.x.max(other.high.x), self.high.z.max(other.high.z)),
            bottom: self.bottom.min(other.bottom),
            top: self.top.max(other.top),
        }
    }

    /// The columns whose light may change, both ends included.
    pub fn lit(&self) -> (Column, Column) {
        (self.low.offset(-REACH, -REACH), self.high.offset(REACH, REACH))
    }

    /// Together with all columns beyond the rim that are as its columns on the rim are.
    fn with_rim(mut self, grid: ChunkGrid) -> Self {
        let far = |is_rim: bool| if is_rim { 2 * REACH } else { 0 };
        self.low = self.low.offset(-far(self.low.x <= 0), -far(self.low.z <= 0));
        self.high = self.high.offset(far(self.high.x >= grid.width()), far(self.high.z >= grid.depth()));
        self
    }

    /// Whether some column between two, in any order, is one of its columns.
    fn meets(&self, a: Column, b: Column) -> bool {
        a.x.min(b.x) <= self.high.x
            && a.x.max(b.x) >= self.low.x
            && a.z.min(b.z) <= self.high.z
            && a.z.max(b.z) >= self.low.z
    }
}

/// The columns of a rectangle before and after a commit.
pub(crate) struct LightChange<'a> {
    before: SkyColumns<'a>,
    after: SkyColumns<'a>,
    low: Column,
    /// What changes, with columns beyond the rim.
    changed: ChangedBox,
    /// The highest top of those that change, before or after, in 1/256 voxel.
    highest_top: i32,
    /// For each row of all columns, those between which changed tops lie: counted from the rectangle's first column.
    moved: Vec<Run>,
    /// Between which of these rows those lie that hold any.
    moved_rows: Run,
    /// By how much more or less of the sky is hidden on the tops of the rectangle's columns, x fastest; in rows for
    /// which it was asked.
    hidden: Vec<i16>,
    is_known: Vec<bool>,
    /// Whether the light of points under roofs may differ; `None` for solid ones.
    may_differ: AirMemory<Option<bool>>,
}

impl<'a> LightChange<'a> {
    /// The columns from `low` to `high`, both included, near what a commit changes.
    pub fn new(lit: &'a LitWorld, (low, high): (Column, Column), changed: ChangedBox) -> Self {
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
        let moved: Vec<Run> = (0..depth + 2 * REACH as usize).map(run).collect();
        let rows = (0..).zip(&moved).filter(|(_, run)| !run.is_empty());
        let moved_rows = rows.fold(Run::EMPTY, |all, (row, _)| all.hull(Run { start: row, end: row + 1 }));
        Self {
            low,
            changed: changed.with_rim(lit.before().grid()),
            highest_top,
            moved,
            moved_rows,
            hidden: vec![0; width * depth],
            is_known: vec![false; depth],
            may_differ: AirMemory::new(5),
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
                if self.shows_at((column.at(0) * SNAP).with_y(height * (SNAP / ONE))) {
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
            return self.may_show_under_roof(place, columns) && self.differs(place);
        }
        // Light comes from above, and a slope is lit as its foot and its edge are.
        if y.min(bottom) >= self.highest_top {
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

    /// Whether the light of a place under a roof, between two columns, may differ.
    fn may_show_under_roof(&mut self, place: IVec3, columns: [Column; 2]) -> bool {
        let (y, reach) = (place.y.div_euclid(SNAP / ONE), RAY_REACH);
        let is_near = y - LOWEST_RAY < self.changed.top
            && y + HIGHEST_RISE >= self.changed.bottom
            && self.changed.meets(columns[0].offset(-reach, -reach), columns[0].offset(reach, reach));
        if !is_near || [&self.before, &self.after].iter().all(|sky| sky.is_dark(place)) {
            return false;
        }
        let first = first_corner(place);
        let last = first + 2;
        if self.changed.meets(Column::of(first), Column::of(last)) {
            return true;
        }
        let mut is_lit_by_corners = false;
        for side in corners_around(part_of_cube(place)) {
            let point = first + 2 * side;
            match self.may_differ(point) {
                Some(true) => return true,
                Some(false) => {
                    is_lit_by_corners |= self.before.top(Column::of(point)) > point.y * ONE;
                }
                None => {}
            }
        }
        // Without corners that are lit, it has the light of the air next to it.
        !is_lit_by_corners
            && self.before.air_beside(place, columns).is_some_and(|air| self.may_differ(air) == Some(true))
    }

    /// Whether the light of a point whose own column stays may differ, as some of its rays do; `None` if it is solid.
    fn may_differ(&mut self, from: IVec3) -> Option<bool> {
        if let Some(known) = self.may_differ.get(from) {
            return known;
        }
        let rays_differ = |change: &mut Self| {
            (0..DIRECTION_COUNT).any(|number| {
                change.changed.meets(Column::of(from), last_of_rays(from, number))
                    && (change.before.sees_open(from, number) != change.after.sees_open(from, number)
                        || number % 2 == 0
                            && change.before.open_rays(from, number) != change.after.open_rays(from, number))
            })
        };
        let may_differ = if self.before.is_solid(from) { None } else { Some(rays_differ(self)) };
        self.may_differ.keep(from, may_differ);
        may_differ
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
        let near = [&self.before, &self.after].map(|all| all.near_run(z).within(width));
        for (direction, (far, near_steps)) in FAR.iter().zip(&NEAR).enumerate() {
            let (row, side) = (z as i32 + REACH, far[0].dz);
            let is_ahead = match side.signum() {
                1 => self.moved_rows.end > row,
                -1 => self.moved_rows.start < row,
                _ => self.moved_rows.start <= row && row < self.moved_rows.end,
            };
            if !is_ahead {
                continue;
            }
            let mut seen = Run::EMPTY;
            for step in far.iter().chain(near_steps) {
                let moved = self.moved[(z as i32 + REACH + step.dz) as usize];
                if !moved.is_empty() {
                    seen = seen.hull(moved.moved(-step.dx));
                }
            }
            let seen = seen.within(width);
            for x in seen.clone().step_by(8) {
                let horizons = |all: &SkyColumns, near: &Range<usize>| {
                    all.horizons([x, z], direction, near.start < x + 8 && near.end > x)
                };
                let [before, after] = [horizons(&self.before, &near[0]), horizons(&self.after, &near[1])];
                if before != after {
                    for (hidden, (before, after)) in hidden[x..].iter_mut().zip(before.into_iter().zip(after))
                    {
                        *hidden += below(capped(after)) as i16 - below(capped(before)) as i16;
                    }
                }
            }
        }
        for x in own.filter(|&x| rows[0][x] != rows[1][x]) {
            hidden[x] = MOVED;
        }
    }
}
