//! The horizons of columns next to each other, eight at once.

use std::ops::Range;

use super::{Run, SkyColumns};
use crate::world::sky::horizon::{
    FAR, Height, NEAR, Step, below, capped, light_of, raise, raise_where, slope,
};
use crate::world::sky::light::REACH;

/// Tops that all lie within 256 voxels, counted from a height below them.
pub(super) struct LowTops {
    pub base: i32,
    pub tops: Vec<u16>,
}

/// How far ahead of a column others lie in arrays of columns, for each direction and step: wrapping around below 0.
#[derive(Clone, Copy)]
pub(super) struct Ahead {
    far: [[usize; FAR[0].len()]; 8],
    near: [[usize; NEAR[0].len()]; 8],
}

impl Ahead {
    /// For rows of some width.
    pub fn new(width: usize) -> Self {
        let ahead = |step: Step| (step.dz as usize).wrapping_mul(width).wrapping_add(step.dx as usize);
        Self { far: FAR.map(|steps| steps.map(ahead)), near: NEAR.map(|steps| steps.map(ahead)) }
    }
}

impl SkyColumns<'_> {
    pub(super) fn low_tops(&self) -> Option<&LowTops> {
        let find = || {
            let base = self.tops.first()? - i32::from(u16::MAX / 2);
            let all = self.tops.iter().fold(0, |all, top| all | top.wrapping_sub(base));
            let tops = || self.tops.iter().map(|top| (top - base) as u16).collect();
            (all >> 16 == 0).then(|| LowTops { base, tops: tops() })
        };
        self.low_tops.get_or_init(find).as_ref()
    }

    /// The horizons of eight columns of a row of the rectangle in a direction; some of them may lie beyond it.
    pub(in crate::world::sky) fn horizons(
        &self,
        place: [usize; 2],
        direction: usize,
        is_near: bool,
    ) -> [i16; 8] {
        match self.low_tops() {
            Some(low) => self.horizons_of(&low.tops, place, direction, is_near),
            None => self.horizons_of(&self.tops, place, direction, is_near),
        }
    }

    #[inline(always)]
    fn horizons_of<T: Height>(
        &self,
        tops: &[T],
        [x, z]: [usize; 2],
        direction: usize,
        is_near: bool,
    ) -> [i16; 8] {
        let mut horizons = [0; 8];
        let own = self.inner_index([x, z]);
        let Some(ys) = eight(tops, own) else { return horizons };
        for (step, ahead) in FAR[direction].iter().zip(&self.ahead.far[direction]) {
            if let Some(tops) = eight(tops, own.wrapping_add(*ahead)) {
                raise(&mut horizons, tops, ys, step);
            }
        }
        if is_near {
            self.raise_near(&mut horizons, (tops, ys), [x, z], direction);
        }
        horizons
    }

    /// Raises the horizons of eight columns to the tops near them that were dug or built, or are seen from such
    /// columns.
    #[inline(always)]
    fn raise_near<T: Height>(
        &self,
        horizons: &mut [i16; 8],
        (tops, ys): (&[T], &[T; 8]),
        [x, z]: [usize; 2],
        direction: usize,
    ) {
        let own = self.inner_index([x, z]);
        let Some(own_flags) = eight(&self.changed, own) else { return };
        let row = z as i32 + REACH;
        let start = x as i32 + REACH;
        let holds_any = |row: i32, start: i32| {
            let run = self.runs.get(row as usize).copied().unwrap_or(Run::EMPTY);
            run.start < start + 8 && run.end > start
        };
        let is_own = holds_any(row, start);
        for (step, ahead) in NEAR[direction].iter().zip(&self.ahead.near[direction]) {
            if !is_own && !holds_any(row + step.dz, start + step.dx) {
                continue;
            }
            let at = own.wrapping_add(*ahead);
            if let (Some(tops), Some(flags)) = (eight(tops, at), eight(&self.changed, at)) {
                raise_where([flags, own_flags], horizons, tops, ys, step);
            }
        }
    }

    /// Columns of a row of the rectangle, counted from its first, that may see changed tops near them, or are changed.
    pub(in crate::world::sky) fn near_run(&self, z: usize) -> Run {
        let row = z + REACH as usize;
        let by = NEAR_REACH as usize;
        let rows = self.runs.get(row - by..=row + by).unwrap_or_default();
        let all = rows.iter().copied().fold(Run::EMPTY, Run::hull);
        if all.is_empty() {
            return all;
        }
        Run { start: all.start - REACH - NEAR_REACH, end: all.end - REACH + NEAR_REACH }
    }

    /// The run of columns that see changed tops near them in a direction, or are changed.
    fn near_run_ahead(&self, z: usize, direction: usize) -> Run {
        let row = z as i32 + REACH;
        let run = |dx: i32, dz: i32| match self.runs.get((row + dz) as usize) {
            Some(run) => run.moved(-REACH - dx),
            None => Run::EMPTY,
        };
        NEAR[direction].iter().fold(run(0, 0), |all, step| all.hull(run(step.dx, step.dz)))
    }

    /// Lights a row of the rectangle, unless it is lit.
    pub(super) fn light_row(&mut self, z: usize) {
        if self.is_lit[z] {
            return;
        }
        self.is_lit[z] = true;
        let width = self.size[0];
        let mut lights = std::mem::take(&mut self.lights);
        lights.resize(width * self.size[1], 0);
        let row = &mut lights[z * width..][..width];
        match self.low_tops() {
            Some(low) => self.light_row_of(&low.tops, z, row),
            None => self.light_row_of(&self.tops, z, row),
        }
        self.lights = lights;
    }

    fn light_row_of<T: Height>(&self, tops: &[T], z: usize, lights: &mut [u8]) {
        let near = self.near_run(z).within(lights.len());
        let near: [Range<usize>; 8] = std::array::from_fn(|direction| match near.is_empty() {
            true => 0..0,
            false => self.near_run_ahead(z, direction).within(lights.len()),
        });
        for (block, lights) in lights.chunks_mut(8).enumerate() {
            let x = block * 8;
            let (mut horizons, mut highest) = ([[0; 8]; 8], [0; 8]);
            for (direction, own) in horizons.iter_mut().enumerate() {
                let is_near = near[direction].start < x + 8 && near[direction].end > x;
                *own =
                    self.horizons_of(tops, [x, z], direction, is_near).map(|horizon| capped(horizon).into());
                for at in 0..8 {
                    highest[at] = own[at].max(highest[at]);
                }
            }
            if highest.into_iter().fold(0, i16::max) <= LOWEST_HORIZON {
                lights.fill(light_of(0));
                continue;
            }
            for (at, light) in lights.iter_mut().enumerate() {
                *light = light_of(horizons.iter().map(|horizons| below(horizons[at] as u8)).sum());
            }
        }
    }

    /// The light over a column at a height: of the eight directions together.
    #[inline(always)]
    pub(super) fn open_light_of<T: Height>(&self, tops: &[T], own: usize, y: T) -> u8 {
        let mut horizons = [0; 8];
        let steps = FAR.iter().zip(&self.ahead.far);
        for (horizon, (steps, ahead)) in horizons.iter_mut().zip(steps) {
            for (step, ahead) in steps.iter().zip(ahead) {
                *horizon = slope(tops[own.wrapping_add(*ahead)], y, step.factor).max(*horizon);
            }
        }
        if let Some(&is_own) = self.changed.get(own) {
            let steps = NEAR.iter().zip(&self.ahead.near);
            for (horizon, (steps, ahead)) in horizons.iter_mut().zip(steps) {
                for (step, ahead) in steps.iter().zip(ahead) {
                    let at = own.wrapping_add(*ahead);
                    if (is_own | self.changed[at]) != 0 {
                        *horizon = slope(tops[at], y, step.factor).max(*horizon);
                    }
                }
            }
        }
        light_of(horizons.into_iter().map(|horizon| below(capped(horizon))).sum())
    }
}

/// Horizons of this slope or less, in 1/32, hide nothing.
const LOWEST_HORIZON: i16 = 2;

/// The furthest of the steps at which only changed columns count.
const NEAR_REACH: i32 = 11;

/// Eight columns next to each other.
#[inline(always)]
fn eight<T>(all: &[T], at: usize) -> Option<&[T; 8]> {
    all.get(at..at.checked_add(8)?)?.first_chunk()
}
