//! The rules of sky light.

use glam::IVec3;

use super::SkyView;
use super::air::AirMemory;
use super::horizon::{FAR, NEAR, Step, below, capped, light_of, slope};
use crate::lattice::{Column, ONE, SNAP};

/// No light depends on ground that is further away than this, in columns along x or z.
pub(crate) const REACH: i32 = 17;

/// The light of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Light {
    /// The share of the sky that lights it, weighted by the cosine to the vertical.
    pub sky: u8,
    /// That share or, if it is larger, the share of level directions in which a place under a roof sees the open, at
    /// most a third: ground there is lit, and lights what is under the roof.
    pub daylight: u8,
}

impl Light {
    pub const NONE: Self = Self::open(0);

    /// The light of a place under the open sky.
    pub const fn open(sky: u8) -> Self {
        Self { sky, daylight: sky }
    }
}

/// A point of air that has ground above it, or near ground that has.
#[derive(Clone, Copy)]
pub(crate) struct AirLight {
    light: Light,
    is_under_open_sky: bool,
}

/// Columns, as far as light depends on them.
pub(crate) trait SkyLights {
    /// The world.
    fn view(&self) -> SkyView<'_>;
    /// The height of the highest ground over a column, in 1/256 voxel.
    fn top(&mut self, column: Column) -> i32;
    /// Whether that is not the ground's own height.
    fn is_changed(&mut self, column: Column) -> bool;
    /// Whether a sample is solid.
    fn is_solid(&mut self, point: IVec3) -> bool {
        self.view().is_solid(point)
    }
    /// The light on top of a column.
    fn top_light(&mut self, column: Column) -> u8 {
        let y = self.top(column);
        self.open_light(column, y)
    }
    /// The light of points under roofs that is known already; `None` for solid ones.
    fn known(&mut self) -> &mut AirMemory<Option<AirLight>>;

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
            hidden += below(capped(horizon));
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

    /// How far a place in 1/4096 voxel, as [`light`](Self::light) takes it, lies below the surface that was there
    /// before anyone dug, in 1/256 voxel; less than 0 above it.
    fn depth(&mut self, place: IVec3) -> i32 {
        let [column, next] = columns_of(place);
        let part = place.x.rem_euclid(SNAP).max(place.z.rem_euclid(SNAP));
        let here = i64::from(self.undug_height(column));
        let there = if next == column { here } else { i64::from(self.undug_height(next)) };
        let height = here + (there - here) * i64::from(part) / i64::from(SNAP);
        height as i32 - place.y.div_euclid(SNAP / ONE)
    }

    /// The light at a place on the surface, in 1/4096 voxel, that lies on an edge of the lattice or over the diagonal
    /// of a cell. It depends on the place alone.
    fn light(&mut self, place: IVec3) -> Light {
        let columns = columns_of(place);
        let y = place.y.div_euclid(SNAP / ONE);
        let [low, high] = self.by_top(columns);
        if is_covered(y, low.1) {
            return self.covered_light(place, columns);
        }
        Light::open(self.open_light_between(low, high, y))
    }

    /// Two columns and their tops, the lower one first.
    fn by_top(&mut self, columns: [Column; 2]) -> [(Column, i32); 2] {
        let [a, b] = columns.map(|column| (column, self.top(column)));
        if a.1 <= b.1 { [a, b] } else { [b, a] }
    }

    /// The light at a height between the tops of two columns, in 1/256 voxel, or above both.
    fn open_light_between(&mut self, low: (Column, i32), high: (Column, i32), y: i32) -> u8 {
        let ((low, bottom), (high, top)) = (low, high);
        if y > top + ONE {
            return self.open_light(high, y);
        }
        let up = self.top_light(high);
        if y >= top || bottom == top {
            return up;
        }
        let (up, down) = (i64::from(up), i64::from(self.top_light(low)));
        let rise = top - bottom;
        let on_slope = down + (up - down) * i64::from((y - bottom).max(0)) / i64::from(rise);
        if !is_wall(rise, [low, high].map(|column| self.is_changed(column))) {
            return on_slope as u8;
        }
        let on_wall = i64::from(self.open_light(low, y)) - i64::from(hidden_by_wall(top - y));
        let share = i64::from((STEEPEST_SLOPE + ONE - rise).max(0));
        (on_wall + (on_slope - on_wall) * share / i64::from(ONE)).clamp(0, 255) as u8
    }

    /// The light of a place under a roof, between two columns; none inside ground.
    fn covered_light(&mut self, place: IVec3, columns: [Column; 2]) -> Light {
        self.covered_light_by_rays(place, columns)
    }

    /// The light of a place under a roof by rays, if ground around it may be low enough to let light in: a mean of the
    /// corners of its cube of 2x2x2 voxels that are air.
    fn covered_light_by_rays(&mut self, place: IVec3, columns: [Column; 2]) -> Light {
        let Some(air) = self.air_beside(place, columns) else { return Light::NONE };
        let first = first_corner(place);
        let part = part_of_cube(place);
        let weights = [IVec3::splat(SIDE) - part, part].map(|near| near.to_array().map(|near| near as u64));
        let (mut sky, mut daylight, mut sum) = (0, 0, 0);
        for side in corners_around(part) {
            let [x, y, z] = side.to_array().map(|side| side as usize);
            let weight = weights[x][0] * weights[y][1] * weights[z][2];
            let point = first + 2 * side;
            let Some(AirLight { light, is_under_open_sky }) = self.air_light(point) else { continue };
            // A corner behind a thin roof or wall is left out.
            let middle = (point + air + (point - air).signum().max(IVec3::ZERO)) >> 1;
            if is_under_open_sky && self.is_solid(middle) {
                continue;
            }
            sky += weight * u64::from(light.sky);
            daylight += weight * u64::from(light.daylight);
            sum += weight;
        }
        if sum == 0 {
            return self.air_light(air).map_or(Light::NONE, |air| air.light);
        }
        Light { sky: (sky / sum) as u8, daylight: (daylight / sum) as u8 }
    }

    /// A point of air next to a place between two columns, if there is one.
    fn air_beside(&mut self, place: IVec3, columns: [Column; 2]) -> Option<IVec3> {
        let low = place.y.div_euclid(SNAP);
        let heights = [low + i32::from(place.y.rem_euclid(SNAP) > 0), low];
        let points = heights.into_iter().flat_map(|y| columns.map(|column| column.at(y)));
        { points }.find(|&point| !self.is_solid(point))
    }

    /// The light at a point, by rays; `None` if it is solid.
    fn air_light(&mut self, point: IVec3) -> Option<AirLight> {
        if let Some(known) = self.known().get(point) {
            return known;
        }
        let is_air = !self.is_solid(point);
        let light = is_air.then(|| AirLight {
            light: self.ray_light(point),
            is_under_open_sky: self.top(Column::of(point)) <= point.y * ONE,
        });
        self.known().keep(point, light);
        light
    }

    /// The share of rays from a point that get out.
    fn ray_light(&mut self, from: IVec3) -> Light {
        let open: u32 = (0..DIRECTION_COUNT).step_by(2).map(|number| self.open_rays(from, number)).sum();
        let sky = open * 255 / (8 * RAYS[0].len() as u32);
        let share = |directions: u32| directions * 255 / DIRECTION_COUNT as u32;
        let mut seen = 0;
        if sky < share(MAX_LEVEL) {
            for number in 0..DIRECTION_COUNT {
                seen += u32::from(self.sees_open(from, number));
                if seen == MAX_LEVEL {
                    break;
                }
            }
        }
        Light { sky: sky as u8, daylight: sky.max(share(seen)) as u8 }
    }

    /// How many rays towards the sky get out in a straight or diagonal direction, given its number in [`AROUND`].
    fn open_rays(&mut self, from: IVec3, number: usize) -> u32 {
        let rays = RAYS[number / 2 % 2].into_iter();
        rays.map(|(steps, rise)| u32::from(self.escapes(from, AROUND[number], steps, rise))).sum()
    }

    /// Whether the open is seen by a level ray or one next to it, given the number of its direction in [`AROUND`].
    fn sees_open(&mut self, from: IVec3, number: usize) -> bool {
        let (direction, (steps, rise)) = (AROUND[number], LEVEL_RAYS[number % 4]);
        let may_escape = from.y * ONE + steps * rise >= self.top(along(from, direction, steps));
        may_escape && [0, rise, -rise].into_iter().any(|rise| self.escapes(from, direction, steps, rise))
    }

    /// Whether a ray leads to the open, given its direction in half columns, its number of steps and its rise in each
    /// of them, in 1/256 voxel.
    #[inline(always)]
    fn escapes(&mut self, from: IVec3, direction: (i32, i32), steps: i32, rise: i32) -> bool {
        // Most rays of a tunnel end in the ground, wherever they enter it.
        from.y * ONE + steps * rise >= self.top(along(from, direction, steps))
            && self.is_free(from, direction, steps, rise)
    }

    /// Whether no ground lies in the way of a ray, which ends above all ground.
    fn is_free(&mut self, from: IVec3, direction: (i32, i32), steps: i32, rise: i32) -> bool {
        let mut y = from.y * ONE;
        let (mut x, mut z) = (2 * from.x, 2 * from.z);
        for _ in 0..steps {
            let before = y;
            y += rise;
            (x, z) = (x + direction.0, z + direction.1);
            let column = Column::new(x >> 1, z >> 1);
            if y < self.top(column) {
                // Steep rays pass several points of a column.
                let high = round(y);
                let low = high.min(round(before) + 1);
                if (low..=high).any(|y| self.is_solid(column.at(y))) {
                    return false;
                }
            }
        }
        true
    }
}

/// The columns at the ends of the edge or diagonal on which a place in 1/4096 voxel lies; the same one twice over a
/// column.
pub(super) fn columns_of(place: IVec3) -> [Column; 2] {
    let cell = Column::new(place.x.div_euclid(SNAP), place.z.div_euclid(SNAP));
    [cell, cell.offset(i32::from(place.x.rem_euclid(SNAP) > 0), i32::from(place.z.rem_euclid(SNAP) > 0))]
}

/// The side of the cubes at whose corners the light under roofs is computed, in 1/4096 voxel: a power of two.
const SIDE: i32 = 2 * SNAP;

/// The lowest corner of the cube that holds a place in 1/4096 voxel.
pub(super) fn first_corner(place: IVec3) -> IVec3 {
    (place >> SIDE.ilog2()) << 1
}

/// How far a place lies from there.
pub(super) fn part_of_cube(place: IVec3) -> IVec3 {
    place & (SIDE - 1)
}

/// The corners of its cube that light a place which lies this far from the lowest of them, 0 or 1 along each axis: on a
/// side of the cube, a place has none of the light of the other side.
pub(super) fn corners_around(part: IVec3) -> impl Iterator<Item = IVec3> {
    let [x, y, z] = part.signum().to_array();
    let all = x | y << 1 | z << 2;
    let corners = (0..8).filter(move |corner| corner & !all == 0);
    corners.map(|corner| IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2))
}

/// Whether the surface at a height is under a roof, given the lower top of its columns, both in 1/256 voxel: what is
/// open has air up to the sky in one of them. The heights of places and tops are rounded separately.
pub(super) fn is_covered(y: i32, lower_top: i32) -> bool {
    y + 2 < lower_top
}

/// The largest rise from one column to the next, in 1/256 voxel, that is a slope where ground was dug; a voxel more is
/// a wall.
const STEEPEST_SLOPE: i32 = 2 * ONE;

/// Whether ground that rises this high from one column to the next is lit as a wall, given which of them were dug or
/// built: ground that is neither is lit as its tile is, whose triangles reach from column to column.
pub(super) fn is_wall(rise: i32, are_changed: [bool; 2]) -> bool {
    rise > STEEPEST_SLOPE && are_changed != [false; 2]
}

/// What a wall hides that rises this high above a place on it, in 1/256 voxel, in addition to what it hides over the
/// column in front, from which it is half a column farther away: in three of eight directions.
fn hidden_by_wall(rise: i32) -> u16 {
    let slope = (rise >> 3).min(255) as i16;
    3 * (below(capped(2 * slope)) - below(capped(slope))) / 8
}

/// The column that a ray from a point reaches with a step, given its direction in half columns.
fn along(from: IVec3, (dx, dz): (i32, i32), step: i32) -> Column {
    Column::of(from).offset((dx * step) >> 1, (dz * step) >> 1)
}

/// The column in which the longest ray from a point ends in a direction, given its number.
pub(super) fn last_of_rays(from: IVec3, number: usize) -> Column {
    along(from, AROUND[number], LEVEL_RAYS[number % 4].0)
}

/// The lattice point nearest to a height in 1/256 voxel.
fn round(y: i32) -> i32 {
    (y + ONE / 2).div_euclid(ONE)
}

/// In how many directions rays are cast.
pub(super) const DIRECTION_COUNT: usize = 16;

/// The directions of rays, in half columns: the even ones are straight and diagonal.
const AROUND: [(i32, i32); DIRECTION_COUNT] = [
    (2, 0),
    (2, 1),
    (2, 2),
    (1, 2),
    (0, 2),
    (-1, 2),
    (-2, 2),
    (-2, 1),
    (-2, 0),
    (-2, -1),
    (-2, -2),
    (-1, -2),
    (0, -2),
    (1, -2),
    (2, -2),
    (2, -1),
];

/// Rays that stand for equal shares of the sky: their steps, and by how much each rises, for straight and for diagonal
/// directions. Their slopes are 0.45, 1 and 2.24.
const RAYS: [[(i32, i32); 3]; 2] = [[(13, 114), (9, 256), (5, 572)], [(9, 162), (7, 362), (4, 810)]];

/// Rays of some 14 voxels that rise or fall slightly, with a slope of 0.25 at most, for every fourth direction: no
/// other ray in their directions goes farther.
const LEVEL_RAYS: [(i32, i32); 4] = [(14, 64), (12, 72), (10, 90), (12, 72)];

/// The maximum number of level directions with a view of the open that count: a place with as much light of the
/// sky, which has more rays that get out and so take long, needs none.
const MAX_LEVEL: u32 = 5;

/// How far from the column of a place, along x or z, ground may be on which its light under a roof depends: rays start
/// at the corners of its cube of 2x2x2 voxels.
pub(super) const RAY_REACH: i32 = 16;

/// How far above a place, in 1/256 voxel, nothing is light where all ground around is higher; and how far below, ground
/// may be on which its light under a roof depends.
pub(super) const HIGHEST_RISE: i32 = 15 * ONE;
pub(super) const LOWEST_RAY: i32 = 6 * ONE;
