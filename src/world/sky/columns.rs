//! The light of a rectangle of columns, computed together.

use std::cell::OnceCell;

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::light::{FAR, HIGHEST_RISE, NEAR, REACH, SkyLights, Step, below, light_of, slope};
use super::tops::stack_tops;
use super::{LitWorld, SkyView};
use crate::lattice::{Column, ONE};

/// The columns of a rectangle and those around it that its light depends on.
pub(crate) struct SkyColumns<'a> {
    view: SkyView<'a>,
    /// The rectangle's lowest column, and how many it has along x and along z.
    low: Column,
    size: [usize; 2],
    /// The first of all columns, those around included, and how many there are along x.
    first: Column,
    width: usize,
    /// In 1/256 voxel, x fastest.
    tops: Vec<i32>,
    /// -1 for columns whose top is not the ground's own height, others 0. Empty if there are none.
    changed: Vec<i16>,
    lowest: i32,
    /// On the tops of the rectangle's columns.
    lights: OnceCell<Vec<u8>>,
    known: FxHashMap<IVec3, u8>,
}

impl<'a> SkyColumns<'a> {
    /// Those from `low` to `high`, both included.
    pub fn new(view: SkyView<'a>, low: Column, high: Column) -> Self {
        let first = low.offset(-REACH, -REACH);
        let last = high.offset(REACH, REACH);
        let [width, depth] = [last.x - first.x + 1, last.z - first.z + 1].map(|count| count.max(1) as usize);
        let size = [high.x - low.x + 1, high.z - low.z + 1].map(|count| count.max(1) as usize);
        let mut all = Self {
            view,
            low,
            size,
            first,
            width,
            tops: vec![0; width * depth],
            changed: Vec::new(),
            lowest: 0,
            lights: OnceCell::new(),
            known: FxHashMap::default(),
        };
        for stack_z in first.z >> 3..=last.z >> 3 {
            for stack_x in first.x >> 3..=last.x >> 3 {
                all.fill((stack_x, stack_z));
            }
        }
        all.finish();
        all
    }

    /// The same columns after a commit to their world.
    pub fn after<'b>(&self, lit: &'b LitWorld) -> SkyColumns<'b> {
        let mut all = SkyColumns {
            view: lit.view(),
            tops: self.tops.clone(),
            changed: self.changed.clone(),
            lights: OnceCell::new(),
            known: FxHashMap::default(),
            ..*self
        };
        let last = all.last();
        for (x, z) in lit.changed_stacks() {
            let is_near = |at: i32, first: i32, last: i32| first >> 3 <= at && at <= last >> 3;
            if is_near(x, all.first.x, last.x) && is_near(z, all.first.z, last.z) {
                all.fill((x, z));
            }
        }
        all.finish();
        all
    }

    /// The last of all columns.
    fn last(&self) -> Column {
        let depth = self.tops.len() / self.width;
        self.first.offset(self.width as i32 - 1, depth as i32 - 1)
    }

    /// Fills in the columns of a stack of bricks.
    fn fill(&mut self, stack: (i32, i32)) {
        let (first, last, width, view) = (self.first, self.last(), self.width, self.view);
        let at = Column::new(stack.0 * 8, stack.1 * 8);
        let own = stack_tops(view, stack);
        let pristine;
        let (all, bits) = match &own {
            Some(own) => (own.tops.as_slice(), own.changed),
            None => {
                pristine = view.ground().heights::<8>(at);
                (pristine.as_flattened(), 0)
            }
        };
        let (from, to) = ((first.x - at.x).max(0), (last.x - at.x).min(7));
        let rows = (first.z - at.z).max(0)..=(last.z - at.z).min(7);
        let place = |z: i32| (at.z + z - first.z) as usize * width + (at.x + from - first.x) as usize;
        for z in rows.clone() {
            let row = &all[(z * 8 + from) as usize..=(z * 8 + to) as usize];
            self.tops[place(z)..place(z) + row.len()].copy_from_slice(row);
        }
        if bits != 0 {
            self.changed.resize(self.tops.len(), 0);
        }
        if !self.changed.is_empty() {
            for z in rows {
                for x in from..=to {
                    self.changed[place(z) + (x - from) as usize] = -((bits >> (z * 8 + x) & 1) as i16);
                }
            }
        }
    }

    fn finish(&mut self) {
        self.repeat_rim(self.last());
        self.lowest = self.tops.iter().copied().min().unwrap_or_default();
    }

    /// Beyond the rim, columns are those on it.
    fn repeat_rim(&mut self, last: Column) {
        let (first, view) = (self.first, self.view);
        if self.changed.is_empty() || (view.clamped(first) == first && view.clamped(last) == last) {
            return;
        }
        for z in first.z..=last.z {
            for x in first.x..=last.x {
                let column = Column::new(x, z);
                let rim = view.clamped(column);
                if rim != column && self.holds(rim) {
                    let (to, from) = (self.index(column), self.index(rim));
                    self.tops[to] = self.tops[from];
                    self.changed[to] = self.changed[from];
                }
            }
        }
    }

    fn holds(&self, column: Column) -> bool {
        let (x, z) = (column.x - self.first.x, column.z - self.first.z);
        let depth = self.tops.len() / self.width;
        (0..self.width as i32).contains(&x) && (0..depth as i32).contains(&z)
    }

    fn index(&self, column: Column) -> usize {
        (column.z - self.first.z) as usize * self.width + (column.x - self.first.x) as usize
    }

    /// The lowest top of the rectangle's columns.
    pub fn lowest_inside(&self) -> i32 {
        let row = |z: usize| {
            let start = self.index(self.low.offset(0, z as i32));
            &self.tops[start..start + self.size[0]]
        };
        (0..self.size[1]).flat_map(row).copied().min().unwrap_or_default()
    }

    /// Whether the light differs on any of the rectangle's columns that neither was changed in.
    pub fn shows_other_lights(&self, other: &SkyColumns) -> bool {
        let (own, others) = (self.lights(), other.lights());
        if own == others {
            return false;
        }
        let is_changed =
            |all: &SkyColumns, column: Column| !all.changed.is_empty() && all.changed[all.index(column)] != 0;
        let width = self.size[0];
        (0..own.len()).filter(|&at| own[at] != others[at]).any(|at| {
            let column = self.low.offset((at % width) as i32, (at / width) as i32);
            !is_changed(self, column) && !is_changed(other, column)
        })
    }

    /// Whether any column's top is not the ground's own height.
    pub fn has_changes(&self) -> bool {
        !self.changed.is_empty()
    }

    /// The light on the tops of the rectangle's columns, x fastest.
    pub fn lights(&self) -> &[u8] {
        self.lights.get_or_init(|| {
            let [width, depth] = self.size;
            let mut hidden = vec![0u16; width * depth];
            let mut horizons = vec![0i16; width];
            for z in 0..depth {
                let start = self.index(self.low.offset(0, z as i32));
                let own = &self.tops[start..start + width];
                let sums = &mut hidden[z * width..(z + 1) * width];
                let moved = |step: &Step| {
                    start.wrapping_add_signed(step.dz as isize * self.width as isize + step.dx as isize)
                };
                for (far, near) in FAR.iter().zip(&NEAR) {
                    horizons.fill(0);
                    for step in far {
                        let others = &self.tops[moved(step)..][..width];
                        for ((horizon, &top), &y) in horizons.iter_mut().zip(others).zip(own) {
                            *horizon = (*horizon).max(slope(top, y, step.factor));
                        }
                    }
                    for step in near.iter().filter(|_| !self.changed.is_empty()) {
                        let others = &self.tops[moved(step)..][..width];
                        let (changed, before) =
                            (&self.changed[moved(step)..][..width], &self.changed[start..][..width]);
                        let masks = changed.iter().zip(before);
                        for (((horizon, &top), &y), (a, b)) in
                            horizons.iter_mut().zip(others).zip(own).zip(masks)
                        {
                            *horizon = (*horizon).max(slope(top, y, step.factor) & (a | b));
                        }
                    }
                    for (sum, &horizon) in sums.iter_mut().zip(&horizons) {
                        *sum += below(horizon);
                    }
                }
            }
            hidden.into_iter().map(light_of).collect()
        })
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

    fn top_light(&mut self, column: Column) -> u8 {
        let (x, z) = (column.x - self.low.x, column.z - self.low.z);
        let [width, depth] = self.size;
        if (0..width as i32).contains(&x) && (0..depth as i32).contains(&z) {
            return self.lights()[z as usize * width + x as usize];
        }
        let y = self.top(column);
        self.open_light(column, y)
    }

    fn known(&mut self) -> &mut FxHashMap<IVec3, u8> {
        &mut self.known
    }

    fn covered_light(&mut self, air: IVec3) -> u8 {
        if (air.y + 1) * ONE + HIGHEST_RISE < self.lowest {
            return 0;
        }
        self.covered_light_by_rays(air)
    }
}
