//! Walkable cells, found voxel by voxel from their definition.

use std::collections::{HashMap, HashSet};

use bevy_burrow::lattice::{Column, ONE};
use bevy_burrow::navigation::{WalkSettings, WalkableCell};
use bevy_burrow::terrain::World;

/// A floor: its column and height in 1/256 voxel.
type Floor = (Column, i64);

/// The floors of a world and their ceilings.
struct Reference<'a> {
    settings: &'a WalkSettings,
    floors: HashMap<Column, Vec<(i64, Option<i64>)>>,
}

fn whole(length: f32, round: fn(f32) -> f32) -> i64 {
    round(length * ONE as f32) as i64
}

impl<'a> Reference<'a> {
    fn new(world: &World, settings: &'a WalkSettings) -> Self {
        let (ground, samples) = (world.ground(), world.samples());
        let (mut low, mut high) = (i32::MAX, i32::MIN);
        let columns: Vec<Column> =
            (0..=ground.depth()).flat_map(|z| (0..=ground.width()).map(move |x| Column::new(x, z))).collect();
        for &column in &columns {
            let height = ground.height(column).div_euclid(ONE);
            (low, high) = (low.min(height), high.max(height));
        }
        for (pos, _) in world.bricks() {
            (low, high) = (low.min(pos.samples().min.y), high.max(pos.samples().max.y));
        }
        let mut floors = HashMap::new();
        for column in columns {
            let mut own: Vec<(i64, Option<i64>)> = Vec::new();
            for y in low - 2..high + 3 {
                let (below, above) = (column.at(y), column.at(y + 1));
                let (solid_below, solid_above) = (samples.is_solid(below), samples.is_solid(above));
                let [a, b] = [below, above].map(|point| i64::from(samples.distance(point).abs()));
                if solid_below != solid_above {
                    let crossing = i64::from(y) * i64::from(ONE) + a * i64::from(ONE) / (a + b);
                    match solid_below {
                        true => own.push((crossing, None)),
                        false => own.last_mut().expect("the deep is solid").1 = Some(crossing),
                    }
                }
            }
            let height = whole(settings.height, f32::ceil);
            own.retain(|(floor, ceiling)| ceiling.is_none_or(|ceiling| ceiling - floor >= height));
            floors.insert(column, own);
        }
        Self { settings, floors }
    }

    fn ceiling(&self, floor: Floor) -> Option<i64> {
        self.floors[&floor.0].iter().find(|own| own.0 == floor.1).expect("a floor").1
    }

    /// The floor of the neighbouring column that an agent can go to.
    fn step(&self, from: Floor, to: Column) -> Option<Floor> {
        let nearest = |from: Floor, to: Column| {
            let climb = whole(self.settings.step.max(self.settings.slope), f32::floor);
            let height = whole(self.settings.height, f32::ceil);
            let others = self.floors.get(&to)?.iter().map(|&(floor, _)| (to, floor));
            let can_go = |&other: &Floor| {
                let roofs = [self.ceiling(from), self.ceiling(other)].into_iter().flatten();
                (from.1 - other.1).abs() <= climb
                    && roofs.min().is_none_or(|roof| roof - from.1.max(other.1) >= height)
            };
            others.filter(can_go).min_by_key(|other| (from.1 - other.1).abs())
        };
        nearest(from, to).filter(|&other| nearest(other, from.0) == Some(from))
    }

    /// The floors at the corners of a passable cell.
    fn passable(&self, floor: Floor) -> Option<[Floor; 4]> {
        let [a, b, c, d] = floor.0.corners();
        let floors = [floor, self.step(floor, b)?, self.step(self.step(floor, b)?, c)?, self.step(floor, d)?];
        if self.step(floors[3], c) != Some(floors[2]) {
            return None;
        }
        debug_assert_eq!(a, floor.0);
        let [a, b, c, d] = floors.map(|floor| floor.1);
        let slope = whole(self.settings.slope, f32::floor).pow(2);
        let is_flat = ((c - b) + (d - a)).pow(2) + ((b - a) + (c - d)).pow(2) <= 4 * slope;
        let range = [a, b, c, d].iter().max().unwrap() - [a, b, c, d].iter().min().unwrap();
        let far = 1i64 << 40;
        let [ra, rb, rc, rd] = floors.map(|floor| self.ceiling(floor).unwrap_or(far));
        let middle = (ra + rc).min(rb + rd) - (a + c).max(b + d);
        let is_high = middle >= 2 * whole(self.settings.height, f32::ceil);
        ((is_flat || range <= whole(self.settings.step, f32::floor)) && is_high).then_some(floors)
    }

    /// Whether all cells around that the agent touches can be reached over such cells, and are passable.
    fn is_walkable(&self, floor: Floor, touched: &HashSet<(i32, i32)>) -> bool {
        let mut found = HashMap::from([((0, 0), floor)]);
        let mut open = vec![(0, 0)];
        while let Some((x, z)) = open.pop() {
            let at = found[&(x, z)];
            if self.passable(at).is_none() {
                return false;
            }
            for (dx, dz) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let next = (x + dx, z + dz);
                if touched.contains(&next) && !found.contains_key(&next) {
                    let Some(floor) = self.step(at, at.0.offset(dx, dz)) else { return false };
                    found.insert(next, floor);
                    open.push(next);
                }
            }
        }
        found.len() == touched.len()
    }
}

/// The cells around a cell that an agent touches: those where something may be nearer than its radius, be it all of the cell, or,
/// for one that is diagonally apart, the half of it behind the line between its nearer corners. Measured point by point.
fn touched_cells(radius: f64) -> HashSet<(i32, i32)> {
    let reach = radius.ceil() as i32 + 1;
    let around = (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |z| (x, z)));
    let is_touched = |&(x, z): &(i32, i32)| {
        let steps = 64;
        let parts = (0..=steps).map(|part| f64::from(part) / f64::from(steps));
        let points: Vec<(f64, f64)> =
            parts.clone().flat_map(|u| parts.clone().map(move |v| (u, v))).collect();
        let apart = |low: f64| (low - low.clamp(0.0, 1.0)).abs();
        points.into_iter().any(|(u, v)| {
            // From the corner nearest to the cell at the origin.
            let along = |cell: i32, part: f64| {
                if cell < 0 { f64::from(cell) + 1.0 - part } else { f64::from(cell) + part }
            };
            let is_possible = x == 0 || z == 0 || u + v >= 1.0;
            is_possible && apart(along(x, u)).hypot(apart(along(z, v))) < radius - 1e-9
        })
    };
    around.filter(|place| *place == (0, 0) || is_touched(place)).collect()
}

/// A place where an agent jumps down or climbs up: its upper cell, the way, how many cells it leads, and whether it is for
/// jumps and for climbs.
pub type Leap = (Column, (i32, i32), i32, bool, bool);

/// All leaps of a world, in order.
pub fn leaps(world: &World, settings: &WalkSettings) -> Vec<Leap> {
    let reference = Reference::new(world, settings);
    let touched = touched_cells(f64::from((settings.radius * 256.0).ceil()) / 256.0);
    let wide = touched.iter().map(|&(x, z)| x.max(z)).max().expect("its own cell");
    let most = settings.leap as i32 + 2 * wide + 2;
    let climb = whole(settings.step.max(settings.slope), f32::floor);
    let mut tops: HashMap<Column, Vec<i64>> = HashMap::new();
    let mut uppers: Vec<(Floor, i64)> = Vec::new();
    for cell in walkable_cells(world, settings) {
        let top = i64::from(*cell.heights.iter().max().expect("four"));
        tops.entry(cell.cell).or_default().push(top);
        uppers.push(((cell.cell, cell.heights[0].into()), top));
    }
    let is_walkable = |floor: Floor| reference.is_walkable(floor, &touched);
    let has_air = |at: Column, from: i64, to: i64| {
        reference.floors.get(&at).is_some_and(|floors| {
            floors.iter().any(|&(floor, roof)| floor <= from && roof.is_none_or(|roof| roof >= to))
        })
    };
    let mut leaps = Vec::new();
    for (floor, top) in uppers {
        for (dx, dz) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            if reference.step(floor, floor.0.offset(dx, dz)).is_some_and(is_walkable) {
                continue;
            }
            let at = |cells: i32| floor.0.offset(dx * cells, dz * cells);
            // The first cell with ground that is walkable, as high or lower.
            let others = |cells: i32| tops.get(&at(cells)).into_iter().flatten().copied();
            let Some(cells) = (1..=most).find(|&cells| others(cells).any(|other| other <= top + climb))
            else {
                continue;
            };
            if others(cells).any(|other| (other - top).abs() <= climb) {
                continue;
            }
            let bottom = others(cells).filter(|&other| other < top).max().expect("a lower one");
            let [jump, ledge] =
                [settings.jump_down, settings.climb_up].map(|most| top - bottom <= whole(most, f32::floor));
            let head = top + whole(settings.height, f32::ceil);
            let air = |from: i64| (from + climb).min(head - 1);
            // In cells ahead of the upper one and to its side.
            let column = |ahead: i32, aside: i32| {
                let along = if dx + dz > 0 { ahead } else { 1 - ahead };
                if dx != 0 { floor.0.offset(along, aside) } else { floor.0.offset(aside, along) }
            };
            let is_free = (0..=cells + wide + 1).all(|ahead| {
                (-wide..=wide + 1).all(|aside| {
                    let at = column(ahead, aside);
                    if ahead >= cells { has_air(at, air(bottom), head) } else { has_air(at, air(top), head) }
                })
            });
            if (jump || ledge) && is_free {
                leaps.push((floor.0, (dx, dz), cells, jump, ledge));
            }
        }
    }
    leaps.sort_unstable();
    leaps
}

/// All walkable cells of a world, in order.
pub fn walkable_cells(world: &World, settings: &WalkSettings) -> Vec<WalkableCell> {
    let reference = Reference::new(world, settings);
    let touched = touched_cells(f64::from((settings.radius * 256.0).ceil()) / 256.0);
    let mut cells = Vec::new();
    for (&column, floors) in &reference.floors {
        for &(floor, _) in floors {
            if let Some(corners) = reference.passable((column, floor))
                && reference.is_walkable((column, floor), &touched)
            {
                cells.push(WalkableCell { cell: column, heights: corners.map(|(_, height)| height as i32) });
            }
        }
    }
    cells.sort_unstable();
    cells
}
