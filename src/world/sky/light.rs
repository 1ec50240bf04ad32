//! The rules of sky light.

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::SkyView;
use crate::lattice::{Column, ONE, SNAP};

/// No light depends on ground that is further away than this, in columns along x or z.
pub(crate) const REACH: i32 = 17;

/// A column at some distance, and what its top counts.
#[derive(Clone, Copy)]
pub(super) struct Step {
    pub dx: i32,
    pub dz: i32,
    /// Multiplied by a rise in 1/128 voxel, and divided by 65,536, it gives the slope in 1/32.
    pub factor: i16,
    /// That factor eight times, one for each of eight columns: from an array, compilers multiply all of them at once.
    pub factors: [i16; 8],
}

const fn step((x, z): (i32, i32), columns: i32, factor: i16) -> Step {
    Step { dx: x * columns, dz: z * columns, factor, factors: [factor; 8] }
}

/// The directions in which horizons are looked for.
const DIRECTIONS: [(i32, i32); 8] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// A straight direction has 16,384 / distance, a diagonal one that over the square root of 2.
const fn steps<const N: usize>(straight: [i32; N], diagonal: [i32; N]) -> [[Step; N]; 8] {
    let mut all = [[step((0, 0), 0, 0); N]; 8];
    let mut direction = 0;
    while direction < 8 {
        let mut at = 0;
        while at < N {
            let is_straight = direction % 2 == 0;
            let columns = if is_straight { straight[at] } else { diagonal[at] };
            let factor = if is_straight { 16_384 } else { 11_585 } / columns;
            all[direction][at] = step(DIRECTIONS[direction], columns, factor as i16);
            at += 1;
        }
        direction += 1;
    }
    all
}

/// Where ground counts everywhere. Few columns, as coarse nodes have to look at all of them too.
pub(super) const FAR: [[Step; 2]; 8] = steps([4, 16], [4, 12]);

/// Where ground also counts if it was dug or built, or if it is seen from ground that was.
pub(super) const NEAR: [[Step; 6]; 8] = steps([1, 2, 3, 6, 8, 11], [1, 2, 3, 5, 7, 9]);

/// The slope, in 1/32, from height `y` to a top, both in 1/256 voxel.
#[inline(always)]
pub(super) fn slope(top: i32, y: i32, factor: i16) -> i16 {
    let rise = ((top - y) >> 1).clamp(i16::MIN.into(), i16::MAX.into()) as i16;
    ((i32::from(rise) * i32::from(factor)) >> 16) as i16
}

/// Raises the horizons of eight columns, whose heights are `ys`, to the tops that lie a step away.
#[inline(always)]
pub(super) fn raise(horizons: &mut [i16; 8], tops: &[i32; 8], ys: &[i32; 8], step: &Step) {
    for at in 0..8 {
        horizons[at] = horizons[at].max(slope(tops[at], ys[at], step.factors[at]));
    }
}

/// Raises the horizons of eight columns like [`raise`], where a bit of one of two masks is set.
#[inline(always)]
pub(super) fn raise_where(
    masks: [&[i16; 8]; 2],
    horizons: &mut [i16; 8],
    tops: &[i32; 8],
    ys: &[i32; 8],
    step: &Step,
) {
    for at in 0..8 {
        let slope = slope(tops[at], ys[at], step.factors[at]) & (masks[0][at] | masks[1][at]);
        horizons[at] = horizons[at].max(slope);
    }
}

/// Horizons of this slope or less, in 1/32, hide nothing.
const LOWEST_HORIZON: i16 = 2;

/// Adds what eight horizons hide.
#[inline(always)]
pub(super) fn hide(hidden: &mut [u16; 8], horizons: &[i16; 8]) {
    if horizons.iter().fold(0, |highest, &horizon| horizon.max(highest)) > LOWEST_HORIZON {
        hidden.iter_mut().zip(horizons).for_each(|(sum, &horizon)| *sum += below(horizon));
    }
}

/// For each slope of a horizon, in 1/32, the share of the sky in its direction that lies below: the square of its sine.
static BELOW: [u8; 256] = {
    let mut table = [0; 256];
    let mut slope = 0;
    while slope < 256 {
        let squared = (slope * slope) as u32;
        table[slope] = (255 * squared / (squared + 32 * 32)) as u8;
        slope += 1;
    }
    table
};

/// Of a direction with this horizon, the share of the sky that lies below it, 0..=255.
#[inline(always)]
pub(super) fn below(slope: i16) -> u16 {
    BELOW[slope.clamp(0, 255) as usize].into()
}

/// The light where these shares of the sky are hidden in all directions together.
#[inline(always)]
pub(super) fn light_of(hidden: u16) -> u8 {
    255 - (hidden / 8) as u8
}

/// Columns, as far as light depends on them.
pub(crate) trait SkyLights {
    /// The world.
    fn view(&self) -> SkyView<'_>;
    /// The height of the highest ground over a column, in 1/256 voxel.
    fn top(&mut self, column: Column) -> i32;
    /// Whether that is not the ground's own height.
    fn is_changed(&mut self, column: Column) -> bool;
    /// The light on top of a column.
    fn top_light(&mut self, column: Column) -> u8 {
        let y = self.top(column);
        self.open_light(column, y)
    }
    /// The light under roofs that is known already.
    fn known(&mut self) -> &mut FxHashMap<IVec3, u8>;

    /// The light over a column at a height, in 1/256 voxel, that is not below its top.
    fn open_light(&mut self, column: Column, y: i32) -> u8 {
        let is_changed = self.is_changed(column);
        let mut hidden = 0;
        for (far, near) in FAR.iter().zip(&NEAR) {
            let mut horizon = 0;
            for &Step { dx, dz, factor, .. } in far {
                horizon = horizon.max(slope(self.top(column.offset(dx, dz)), y, factor));
            }
            for &Step { dx, dz, factor, .. } in near {
                let other = column.offset(dx, dz);
                if is_changed || self.is_changed(other) {
                    horizon = horizon.max(slope(self.top(other), y, factor));
                }
            }
            hidden += below(horizon);
        }
        light_of(hidden)
    }

    /// The height of a column before anyone dug, in 1/256 voxel.
    fn undug_height(&mut self, column: Column) -> i32 {
        match self.is_changed(column) {
            true => self.view().ground().lone_height(column),
            false => self.top(column),
        }
    }

    /// How far a place in 1/4096 voxel, as [`light`](Self::light) takes it, lies below the surface that was there before
    /// anyone dug, in 1/256 voxel; less than 0 above it.
    fn depth(&mut self, place: IVec3) -> i32 {
        let column = Column::new(place.x.div_euclid(SNAP), place.z.div_euclid(SNAP));
        let (x, z) = (place.x.rem_euclid(SNAP), place.z.rem_euclid(SNAP));
        let next = column.offset(i32::from(x > 0), i32::from(z > 0));
        let here = i64::from(self.undug_height(column));
        let there = if next == column { here } else { i64::from(self.undug_height(next)) };
        let height = here + (there - here) * i64::from(x.max(z)) / i64::from(SNAP);
        height as i32 - place.y.div_euclid(SNAP / ONE)
    }

    /// The light at a place on the surface, in 1/4096 voxel, that lies on an edge of the lattice or over the diagonal of a
    /// cell. It depends on the place alone.
    fn light(&mut self, place: IVec3) -> u8 {
        let cell = Column::new(place.x.div_euclid(SNAP), place.z.div_euclid(SNAP));
        let (x, z) = (place.x.rem_euclid(SNAP), place.z.rem_euclid(SNAP));
        let ends = [cell, cell.offset(i32::from(x > 0), i32::from(z > 0))];
        let columns = &ends[..if ends[0] == ends[1] { 1 } else { 2 }];
        let y = place.y.div_euclid(SNAP / ONE);
        // Of a wall's two columns, the one in front of it is open, and it counts.
        let mut light = None;
        for &column in columns {
            let top = self.top(column);
            if y + ONE >= top {
                let own = if y <= top + ONE { self.top_light(column) } else { self.open_light(column, y) };
                light = light.max(Some(own));
            }
        }
        light.unwrap_or_else(|| {
            let low = place.y.div_euclid(SNAP);
            let high = low + i32::from(place.y.rem_euclid(SNAP) > 0);
            let points = columns.iter().flat_map(|column| [column.at(high), column.at(low)]);
            let view = self.view();
            let air = { points }.find(|&point| !view.is_solid(point));
            air.map_or(0, |air| self.covered_light(air))
        })
    }

    /// The light at a point of air that has ground above it.
    fn covered_light(&mut self, air: IVec3) -> u8 {
        self.covered_light_by_rays(air)
    }

    /// The same, where some ground around may be low enough.
    fn covered_light_by_rays(&mut self, air: IVec3) -> u8 {
        // One of eight points counts for all of them, if it is air too.
        let shared = air & !1;
        let point = if shared == air || !self.view().is_solid(shared) { shared } else { air };
        if let Some(&known) = self.known().get(&point) {
            return known;
        }
        let light = self.ray_light(point);
        self.known().insert(point, light);
        light
    }

    /// The share of rays from a point that get out.
    fn ray_light(&mut self, from: IVec3) -> u8 {
        let mut open = 0;
        for (number, &(dx, dz)) in DIRECTIONS.iter().enumerate() {
            for (steps, rise) in RAYS[number % 2] {
                open += u32::from(self.is_open(from, (dx, dz), steps, rise));
            }
        }
        (open * 255 / (8 * RAYS[0].len() as u32)) as u8
    }

    /// Whether a ray leads to the open sky, given its rise in 1/256 voxel in each step and its number of steps.
    fn is_open(&mut self, from: IVec3, (dx, dz): (i32, i32), steps: i32, rise: i32) -> bool {
        let mut y = from.y * ONE;
        // Most rays of a tunnel end in the ground, wherever they enter it.
        if y + steps * rise < self.top(Column::of(from).offset(dx * steps, dz * steps)) {
            return false;
        }
        for step in 1..=steps {
            let before = y;
            y += rise;
            let column = Column::of(from).offset(dx * step, dz * step);
            if y < self.top(column) {
                // Steep rays pass several points of a column.
                let (low, high) = (round(before) + 1, round(y));
                if (low.min(high)..=high).any(|y| self.view().is_solid(column.at(y))) {
                    return false;
                }
            }
        }
        true
    }
}

/// The lattice point nearest to a height in 1/256 voxel.
fn round(y: i32) -> i32 {
    (y + ONE / 2).div_euclid(ONE)
}

/// Rays that stand for equal shares of the sky: their steps, and by how much each rises, for straight and for diagonal
/// directions. Their slopes are 0.45, 1 and 2.24.
const RAYS: [[(i32, i32); 3]; 2] = [[(13, 114), (9, 256), (5, 572)], [(9, 162), (7, 362), (4, 810)]];

/// No ray rises further than this, in 1/256 voxel: where all ground around is higher, nothing is light.
pub(super) const HIGHEST_RISE: i32 = 13 * ONE;
