//! The light of a rectangle of columns, computed together.

mod horizons;
mod run;

use std::cell::OnceCell;

use glam::IVec3;

use self::horizons::{Ahead, LowTops};
pub(super) use self::run::Run;
use super::air::AirMemory;
use super::bricks::NearBricks;
use super::light::{AirLight, HIGHEST_RISE, Light, REACH, SkyLights};
use super::{LitWorld, SkyView};
use crate::lattice::{BrickPos, Column, ONE, SNAP};
use crate::volume::layers;

/// The columns of a rectangle and those around it that its light depends on.
pub(crate) struct SkyColumns<'a> {
    view: SkyView<'a>,
    /// The rectangle's lowest column, and how many it has along x and along z.
    low: Column,
    size: [usize; 2],
    /// The first of all columns, those around included, and how many there are along x.
    first: Column,
    width: usize,
    ahead: Ahead,
    /// In 1/256 voxel, x fastest; eight more follow after the last row.
    tops: Vec<i32>,
    /// -1 for columns whose top is not the ground's own height, others 0. Empty if there are none.
    changed: Vec<i16>,
    /// For each row of all columns, the run that holds such columns. Empty if there are none.
    runs: Vec<Run>,
    /// The tops once more, if they lie within 256 voxels: computed when they are first needed.
    low_tops: OnceCell<Option<LowTops>>,
    lowest: OnceCell<i32>,
    /// Light on the tops of the rectangle's columns, for the rows for which it was asked.
    lights: Vec<u8>,
    is_lit: Vec<bool>,
    known: AirMemory<Option<AirLight>>,
    /// Looked up when light under a roof is first asked for.
    bricks: Option<NearBricks<'a>>,
}

impl<'a> SkyColumns<'a> {
    /// The columns from `low` to `high`, both included.
    pub fn new(view: SkyView<'a>, low: Column, high: Column) -> Self {
        let first = low.offset(-REACH, -REACH);
        let last = high.offset(REACH, REACH);
        let [width, depth] = [last.x - first.x + 1, last.z - first.z + 1].map(|count| count.max(1) as usize);
        let size = [high.x - low.x + 1, high.z - low.z + 1].map(|count| count.max(1) as usize);
        // Room for eight columns from any of the last row on.
        let mut tops = vec![0; width * depth + 8];
        let (own, room) = tops.split_at_mut(width * depth);
        view.ground().fill_heights(first, width, own);
        room.fill(own[0]);
        let mut all = Self {
            view,
            low,
            size,
            first,
            width,
            ahead: Ahead::new(width),
            tops,
            changed: Vec::new(),
            runs: Vec::new(),
            low_tops: OnceCell::new(),
            lowest: OnceCell::new(),
            lights: Vec::new(),
            is_lit: vec![false; size[1]],
            known: AirMemory::new(5),
            bricks: None,
        };
        for at in view.stacks_within((first.x >> 3, first.z >> 3), (last.x >> 3, last.z >> 3)) {
            view.with_tops(at, |own| all.fill(at, &own.tops, own.changed));
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
            low_tops: OnceCell::new(),
            lowest: OnceCell::new(),
            lights: Vec::new(),
            is_lit: vec![false; self.size[1]],
            known: AirMemory::new(5),
            bricks: None,
            ..*self
        };
        let last = all.last();
        for at in lit.changed_stacks() {
            let stack = Column::new(at.0 << 3, at.1 << 3);
            let is_near = |at: i32, first: i32, last: i32| first - 8 < at && at <= last;
            if !is_near(stack.x, all.first.x, last.x) || !is_near(stack.z, all.first.z, last.z) {
                continue;
            }
            if view.with_tops(at, |own| all.fill(at, &own.tops, own.changed)).is_none() {
                all.fill(at, view.ground().heights::<8>(stack).as_flattened(), 0);
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
                let flags = &mut self.changed[place..][..own.len()];
                let bits = (changed >> (z * 8)) as u8;
                if bits == 0 {
                    flags.fill(0);
                } else {
                    flags.iter_mut().zip(own).for_each(|(flag, bit)| *flag = -((changed >> bit & 1) as i16));
                    let [before, after] =
                        [bits.trailing_zeros(), bits.leading_zeros()].map(|count| count as i32);
                    let run = Run { start: before.max(from), end: (8 - after).min(to + 1) };
                    if !run.is_empty() {
                        self.runs[row] = self.runs[row].hull(run.moved(at.x - first.x));
                    }
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

    /// Whether a place under a roof lies so deep that no ray from there gets out.
    pub(super) fn is_dark(&self, place: IVec3) -> bool {
        let highest = place.y.div_euclid(SNAP / ONE) + HIGHEST_RISE;
        let find = || self.tops.iter().fold(i32::MAX, |lowest, &top| lowest.min(top));
        // Mostly, the first column will do.
        highest < self.tops[0] && highest < *self.lowest.get_or_init(find)
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

    /// The light over the rectangle's columns at the ground's own height, x fastest: that of a tile's vertices. Where
    /// that was dug, it is the light on the ground below.
    pub fn ground_lights(&mut self) -> Vec<Light> {
        let mut lights: Vec<Light> = self.lights().iter().map(|&sky| Light::open(sky)).collect();
        let width = self.size[0];
        for z in 0..self.size[1] {
            for x in self.changed_run(z).within(width) {
                let column = self.low.offset(x as i32, z as i32);
                if !self.is_changed(column) {
                    continue;
                }
                let height = self.view.ground().height(column);
                // No triangle uses the vertices of ground that was dug.
                if self.top(column) >= height {
                    lights[z * width + x] = self.light((column.at(0) * SNAP).with_y(height * (SNAP / ONE)));
                }
            }
        }
        lights
    }
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

    #[inline(always)]
    fn is_solid(&mut self, point: IVec3) -> bool {
        let column = self.view.clamped(Column::of(point));
        let point = column.at(point.y);
        let bricks = match &mut self.bricks {
            Some(bricks) => bricks,
            None => {
                let [low, high] = [self.first, self.last()].map(|column| (column.x >> 3, column.z >> 3));
                self.bricks.insert(NearBricks::new(self.view, low, high))
            }
        };
        match bricks.get(BrickPos::of(point)) {
            Some(brick) => layers::contains(brick.solid(), BrickPos::index(point)),
            None => self.undug_height(column) > point.y * ONE,
        }
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
        let own = self.index(column);
        match self.low_tops() {
            Some(low) => {
                let y = (y - low.base).clamp(0, u16::MAX.into()) as u16;
                self.open_light_of(&low.tops, own, y)
            }
            None => self.open_light_of(&self.tops, own, y),
        }
    }

    fn known(&mut self) -> &mut AirMemory<Option<AirLight>> {
        &mut self.known
    }

    fn covered_light(&mut self, place: IVec3, columns: [Column; 2]) -> Light {
        if self.is_dark(place) {
            return Light::NONE;
        }
        self.covered_light_by_rays(place, columns)
    }
}
