//! The light of a rectangle of columns, computed together.

use std::cell::OnceCell;
use std::ops::Range;

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::light::{
    AirLight, FAR, HIGHEST_RISE, Light, NEAR, REACH, SkyLights, Step, below, hide, light_of, raise,
    raise_where, slope,
};
use super::{LitWorld, SkyView};
use crate::lattice::{Column, ONE, SNAP};

/// Columns of a row next to each other: the first, and where they end. Empty if they end before they begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub start: i32,
    pub end: i32,
}

impl Run {
    pub const EMPTY: Self = Self { start: i32::MAX, end: i32::MIN };

    pub fn is_empty(self) -> bool {
        self.start >= self.end
    }

    /// The shortest run that holds both.
    pub fn hull(self, other: Self) -> Self {
        if other.is_empty() {
            return self;
        }
        if self.is_empty() {
            return other;
        }
        Self { start: self.start.min(other.start), end: self.end.max(other.end) }
    }

    pub fn moved(self, by: i32) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        Self { start: self.start + by, end: self.end + by }
    }

    /// Those of its columns that an array of this length holds.
    pub fn within(self, length: usize) -> Range<usize> {
        let [start, end] = [self.start, self.end].map(|at| at.clamp(0, length as i32) as usize);
        start..end.max(start)
    }
}

/// The columns of a rectangle and those around it that its light depends on.
pub(crate) struct SkyColumns<'a> {
    view: SkyView<'a>,
    /// The rectangle's lowest column, and how many it has along x and along z.
    low: Column,
    size: [usize; 2],
    /// The first of all columns, those around included, and how many there are along x.
    first: Column,
    width: usize,
    /// In 1/256 voxel, x fastest; eight more follow after the last row.
    tops: Vec<i32>,
    /// -1 for columns whose top is not the ground's own height, others 0. Empty if there are none.
    changed: Vec<i16>,
    /// For each row of all columns, those between which such columns lie. Empty if there are none.
    runs: Vec<Run>,
    lowest: OnceCell<i32>,
    /// On the tops of the rectangle's columns, for those rows for which it was asked.
    lights: Vec<u8>,
    is_lit: Vec<bool>,
    known: FxHashMap<IVec3, Option<AirLight>>,
}

impl<'a> SkyColumns<'a> {
    /// Those from `low` to `high`, both included.
    pub fn new(view: SkyView<'a>, low: Column, high: Column) -> Self {
        let first = low.offset(-REACH, -REACH);
        let last = high.offset(REACH, REACH);
        let [width, depth] = [last.x - first.x + 1, last.z - first.z + 1].map(|count| count.max(1) as usize);
        let size = [high.x - low.x + 1, high.z - low.z + 1].map(|count| count.max(1) as usize);
        // Room for eight columns from any of the last row on.
        let mut tops = vec![0; width * depth + 8];
        view.ground().fill_heights(first, width, &mut tops[..width * depth]);
        let mut all = Self {
            view,
            low,
            size,
            first,
            width,
            tops,
            changed: Vec::new(),
            runs: Vec::new(),
            lowest: OnceCell::new(),
            lights: Vec::new(),
            is_lit: vec![false; size[1]],
            known: FxHashMap::default(),
        };
        for z in first.z >> 3..=last.z >> 3 {
            for x in first.x >> 3..=last.x >> 3 {
                view.with_tops((x, z), |own| all.fill((x, z), &own.tops, own.changed));
            }
        }
        all.repeat_rim();
        all
    }

    /// These columns after a commit to their world.
    pub fn after<'b>(&self, lit: &'b LitWorld) -> SkyColumns<'b> {
        let view = lit.view();
        let mut all = SkyColumns {
            view,
            tops: self.tops.clone(),
            changed: self.changed.clone(),
            runs: self.runs.clone(),
            lowest: OnceCell::new(),
            lights: Vec::new(),
            is_lit: vec![false; self.size[1]],
            known: FxHashMap::default(),
            ..*self
        };
        let last = all.last();
        for (stack, _) in lit.changed_stacks() {
            let is_near = |at: i32, first: i32, last: i32| first - 8 < at && at <= last;
            if is_near(stack.x, all.first.x, last.x) && is_near(stack.z, all.first.z, last.z) {
                let at = (stack.x >> 3, stack.z >> 3);
                if view.with_tops(at, |own| all.fill(at, &own.tops, own.changed)).is_none() {
                    all.fill(at, view.ground().heights::<8>(stack).as_flattened(), 0);
                }
            }
        }
        all.repeat_rim();
        all
    }

    /// The last of all columns.
    fn last(&self) -> Column {
        self.first.offset(self.width as i32 - 1, self.row_count() as i32 - 1)
    }

    /// How many rows all columns have.
    fn row_count(&self) -> usize {
        self.tops.len() / self.width
    }

    /// Fills in the tops of a stack of bricks, and which of them are not the ground's own height.
    fn fill(&mut self, stack: (i32, i32), tops: &[i32], changed: u64) {
        let (first, last, width) = (self.first, self.last(), self.width);
        let at = Column::new(stack.0 * 8, stack.1 * 8);
        let (from, to) = ((first.x - at.x).max(0), (last.x - at.x).min(7));
        if from > to {
            return;
        }
        if changed != 0 && self.changed.is_empty() {
            self.changed.resize(self.tops.len(), 0);
            self.runs.resize(self.row_count(), Run::EMPTY);
        }
        let start = at.x + from - first.x;
        for z in (first.z - at.z).max(0)..=(last.z - at.z).min(7) {
            let row = (at.z + z - first.z) as usize;
            let place = row * width + start as usize;
            let own = (z * 8 + from) as usize..(z * 8 + to + 1) as usize;
            self.tops[place..][..own.len()].copy_from_slice(&tops[own.clone()]);
            if !self.changed.is_empty() {
                let flags = self.changed[place..][..own.len()].iter_mut();
                flags.zip(own).for_each(|(flag, bit)| *flag = -((changed >> bit & 1) as i16));
                if changed >> (z * 8) & 0xff != 0 {
                    let run = Run { start, end: start + to - from + 1 };
                    self.runs[row] = self.runs[row].hull(run);
                }
            }
        }
    }

    /// Beyond the rim, columns are those on it.
    fn repeat_rim(&mut self) {
        let (first, last, width) = (self.first, self.last(), self.width);
        let [low, high] = [first, last].map(|column| self.view.clamped(column));
        let is_inside = low == first && high == last;
        if self.changed.is_empty() || is_inside || low.x > last.x || low.z > last.z {
            return;
        }
        let [low, high] = [low, high].map(|at| ((at.x - first.x) as usize, (at.z - first.z) as usize));
        if high.0 >= width || high.1 >= self.row_count() {
            return;
        }
        fn repeat<T: Copy>(all: &mut [T], width: usize, low: (usize, usize), high: (usize, usize)) {
            for row in all.chunks_exact_mut(width).take(high.1 + 1).skip(low.1) {
                let ends = (row[low.0], row[high.0]);
                row[..low.0].fill(ends.0);
                row[high.0 + 1..].fill(ends.1);
            }
            let depth = all.len() / width;
            (0..low.1).for_each(|row| all.copy_within(low.1 * width..(low.1 + 1) * width, row * width));
            (high.1 + 1..depth)
                .for_each(|row| all.copy_within(high.1 * width..(high.1 + 1) * width, row * width));
        }
        repeat(&mut self.tops, width, low, high);
        repeat(&mut self.changed, width, low, high);
        for run in self.runs.iter_mut().filter(|run| !run.is_empty()) {
            if run.start <= low.0 as i32 {
                run.start = 0;
            }
            if run.end > high.0 as i32 {
                run.end = width as i32;
            }
        }
        repeat(&mut self.runs, 1, (0, low.1), (0, high.1));
    }

    fn index(&self, column: Column) -> usize {
        (column.z - self.first.z) as usize * self.width + (column.x - self.first.x) as usize
    }

    /// Where a column lies in the rectangle; `None` outside.
    pub(super) fn place(&self, column: Column) -> Option<[usize; 2]> {
        let [x, z] = [column.x - self.low.x, column.z - self.low.z].map(|at| usize::try_from(at).ok());
        let place = [x?, z?];
        (place[0] < self.size[0] && place[1] < self.size[1]).then_some(place)
    }

    /// How many columns the rectangle has along x and along z.
    pub(super) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The tops of a row of all columns, which begins [`REACH`] before the rectangle's.
    pub(super) fn row(&self, row: usize) -> &[i32] {
        &self.tops[row * self.width..][..self.width]
    }

    /// The tops of a row of the rectangle.
    pub(super) fn inner_row(&self, z: usize) -> &[i32] {
        &self.row(z + REACH as usize)[REACH as usize..][..self.size[0]]
    }

    /// Whether the top of a column of the rectangle is not the ground's own height.
    pub(super) fn is_changed_at(&self, [x, z]: [usize; 2]) -> bool {
        self.changed.get(self.inner_index([x, z])).is_some_and(|&flag| flag != 0)
    }

    fn inner_index(&self, [x, z]: [usize; 2]) -> usize {
        (z + REACH as usize) * self.width + x + REACH as usize
    }

    /// The horizons of eight columns of a row of the rectangle in a direction; some of them may lie beyond it.
    #[inline]
    pub(super) fn horizons(&self, [x, z]: [usize; 2], direction: usize, is_near: bool) -> [i16; 8] {
        let mut horizons = [0; 8];
        let own = self.inner_index([x, z]);
        let at =
            |step: &Step| own.wrapping_add_signed(step.dz as isize * self.width as isize + step.dx as isize);
        let Some(ys) = eight(&self.tops, own) else { return horizons };
        for step in &FAR[direction] {
            if let Some(tops) = eight(&self.tops, at(step)) {
                raise(&mut horizons, tops, ys, step);
            }
        }
        if !is_near {
            return horizons;
        }
        let Some(own_flags) = eight(&self.changed, own) else { return horizons };
        let row = z as i32 + REACH;
        let start = x as i32 + REACH;
        let holds_any = |row: i32, start: i32| {
            let run = self.runs[row as usize];
            run.start < start + 8 && run.end > start
        };
        let is_own = holds_any(row, start);
        for step in &NEAR[direction] {
            if !is_own && !holds_any(row + step.dz, start + step.dx) {
                continue;
            }
            let at = at(step);
            if let (Some(tops), Some(flags)) = (eight(&self.tops, at), eight(&self.changed, at)) {
                raise_where([flags, own_flags], &mut horizons, tops, ys, step);
            }
        }
        horizons
    }

    /// Columns of a row of the rectangle, counted from its first, that may see changed tops near them, or are changed.
    pub(super) fn near_run(&self, z: usize) -> Run {
        let row = z + REACH as usize;
        let by = NEAR_REACH as usize;
        let rows = self.runs.get(row - by..=row + by).unwrap_or_default();
        let all = rows.iter().copied().fold(Run::EMPTY, Run::hull);
        if all.is_empty() {
            return all;
        }
        Run { start: all.start - REACH - NEAR_REACH, end: all.end - REACH + NEAR_REACH }
    }

    /// Columns of a row of the rectangle, counted from its first, between which those lie whose top is not the ground's
    /// own height.
    pub(super) fn changed_run(&self, z: usize) -> Run {
        self.runs.get(z + REACH as usize).map_or(Run::EMPTY, |run| run.moved(-REACH))
    }

    /// The light on the tops of the rectangle's columns, x fastest.
    pub fn lights(&mut self) -> &[u8] {
        (0..self.size[1]).for_each(|z| self.light_row(z));
        &self.lights
    }

    /// The light over the rectangle's columns at the ground's own height, x fastest: that of a tile's vertices.
    pub fn ground_lights(&mut self) -> Vec<Light> {
        let mut lights: Vec<Light> = self.lights().iter().map(|&sky| Light::open(sky)).collect();
        let width = self.size[0];
        for z in 0..self.size[1] {
            for x in self.changed_run(z).within(width) {
                let column = self.low.offset(x as i32, z as i32);
                if self.is_changed(column) {
                    let height = self.view.ground().height(column) * (SNAP / ONE);
                    lights[z * width + x] = self.light((column.at(0) * SNAP).with_y(height));
                }
            }
        }
        lights
    }

    /// Lights a row of the rectangle, unless it is lit.
    fn light_row(&mut self, z: usize) {
        if self.is_lit[z] {
            return;
        }
        self.is_lit[z] = true;
        let width = self.size[0];
        let mut row = std::mem::take(&mut self.lights);
        row.resize(width * self.size[1], 0);
        let near = self.near_run(z).within(width);
        for (block, lights) in row[z * width..][..width].chunks_mut(8).enumerate() {
            let x = block * 8;
            let is_near = near.start < x + 8 && near.end > x;
            let mut hidden = [0; 8];
            for direction in 0..8 {
                hide(&mut hidden, &self.horizons([x, z], direction, is_near));
            }
            lights.iter_mut().zip(hidden).for_each(|(light, hidden)| *light = light_of(hidden));
        }
        self.lights = row;
    }
}

/// The furthest of the steps at which only changed columns count.
const NEAR_REACH: i32 = 11;

/// Eight columns next to each other.
#[inline(always)]
fn eight<T>(all: &[T], at: usize) -> Option<&[T; 8]> {
    all.get(at..)?.first_chunk()
}

impl SkyLights for SkyColumns<'_> {
    fn view(&self) -> SkyView<'_> {
        self.view
    }

    fn top(&mut self, column: Column) -> i32 {
        self.tops[self.index(column)]
    }

    fn is_changed(&mut self, column: Column) -> bool {
        !self.changed.is_empty() && self.changed[self.index(column)] != 0
    }

    fn top_light(&mut self, column: Column) -> u8 {
        if let Some([x, z]) = self.place(column) {
            self.light_row(z);
            return self.lights[z * self.size[0] + x];
        }
        let y = self.top(column);
        self.open_light(column, y)
    }

    fn open_light(&mut self, column: Column, y: i32) -> u8 {
        let (own, width) = (self.index(column), self.width as isize);
        let at = |step: &Step| own.wrapping_add_signed(step.dz as isize * width + step.dx as isize);
        let is_changed = |at: usize| self.changed.get(at).is_some_and(|&flag| flag != 0);
        let is_own = is_changed(own);
        let mut hidden = 0;
        for (far, near) in FAR.iter().zip(&NEAR) {
            let tops = far.iter().map(|step| slope(self.tops[at(step)], y, step.factor));
            let mut horizon = tops.fold(0, i16::max);
            if !self.changed.is_empty() {
                for step in near.iter().filter(|step| is_own || is_changed(at(step))) {
                    horizon = horizon.max(slope(self.tops[at(step)], y, step.factor));
                }
            }
            hidden += below(horizon);
        }
        light_of(hidden)
    }

    fn known(&mut self) -> &mut FxHashMap<IVec3, Option<AirLight>> {
        &mut self.known
    }

    fn covered_light(&mut self, place: IVec3, columns: [Column; 2]) -> Light {
        let tops = || self.tops[..self.row_count() * self.width].iter();
        let lowest = *self.lowest.get_or_init(|| tops().copied().min().unwrap_or_default());
        if place.y.div_euclid(SNAP / ONE) + HIGHEST_RISE < lowest {
            return Light::NONE;
        }
        self.covered_light_by_rays(place, columns)
    }
}
