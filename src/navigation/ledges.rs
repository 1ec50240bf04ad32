//! Links over ledges, where agents jump down or climb up.
//!
//! A link leads from a walkable cell straight ahead, along x or z, to the first walkable cell beyond the ledge that
//! lies lower. It exists if
//!
//! 1. the cell next to the upper one is not walkable, as far as an agent can walk there;
//! 2. the landing is lower by more than a step, by no more than the agent jumps or climbs, and not farther than it
//!    leaps;
//! 3. no walkable cell as high as the upper one lies between them;
//! 4. the air is free for a box as wide as the cells that the agent touches: from its feet on the ledge to its head all
//!    the way over, and from the landing up to there above the cells that it touches there, but for those towards the
//!    wall. Ground up to the height that it climbs from one column to the next does not count as in the way, and air
//!    lower than the agent counts as none.
//!
//! So the agent leaps as high as it stands and then falls straight down. Links side by side become one, as far as both
//! their edges are straight within the [precision](super::WalkSettings::precision).

use glam::IVec3;

use super::border::FINE;
use super::floors::SKY;
use super::links::Axis;
use super::settings::LedgeRules;
use super::tiles::NavTilePos;
use super::walkable::WalkableTile;
use crate::lattice::{Column, SNAP};

/// A place where agents jump down or climb up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LedgeLink {
    /// The edge on the upper ground, in 1/4096 voxel from the tile's lowest column; heights from 0.
    pub top: [IVec3; 2],
    /// The edge on the lower ground, in the same order.
    pub bottom: [IVec3; 2],
    /// The way of a jump: a unit along x or z.
    pub way: IVec3,
    /// Whether an agent can jump down.
    pub is_jump: bool,
    /// Whether an agent can climb up.
    pub is_climb: bool,
}

/// A link of a single cell.
#[derive(Clone, Copy)]
struct Leap {
    /// The floors at the lowest corners of both cells.
    upper: usize,
    lower: usize,
    cells: i32,
    is_jump: bool,
    is_climb: bool,
}

/// The four ways that an agent leaves a cell.
const WAYS: [(Axis, i32); 4] = [(Axis::X, 1), (Axis::X, -1), (Axis::Z, 1), (Axis::Z, -1)];

impl WalkableTile {
    /// The links over ledges from the walkable cells of the tile; their landings may lie in other tiles. They are in
    /// order of the tile's rows, one way after the other.
    pub fn ledges(&self) -> Vec<LedgeLink> {
        let Some(rules) = self.ledges else { return Vec::new() };
        let mut links = Vec::new();
        for way in WAYS {
            let leaps = self.leaps(&rules, way);
            let mut rest = &leaps[..];
            while let Some(first) = rest.first() {
                let run = self.run(rest, way);
                links.push(self.link(first, &rest[run - 1], way));
                rest = &rest[run..];
            }
        }
        links
    }

    /// The links of single cells, one way; those side by side follow each other.
    fn leaps(&self, rules: &LedgeRules, way: (Axis, i32)) -> Vec<Leap> {
        let (origin, low, side) = (self.pos().origin(), self.floors.low, self.floors.side);
        let column = |cell: Column| (cell.z - low.z) as usize * side + (cell.x - low.x) as usize;
        let mut leaps = Vec::new();
        for across in 0..NavTilePos::SIZE {
            for along in 0..NavTilePos::SIZE {
                // Along the ledge, which runs across the way.
                let cell = match way.0 {
                    Axis::X => origin.offset(across, along),
                    Axis::Z => origin.offset(along, across),
                };
                let floors = self.floors.of(column(cell)).filter(|&floor| self.is_walkable(floor));
                leaps.extend(floors.filter_map(|floor| self.leap(rules, cell, floor, way)));
            }
        }
        leaps
    }

    /// The link from a walkable cell, if there is one.
    fn leap(&self, rules: &LedgeRules, cell: Column, upper: usize, way: (Axis, i32)) -> Option<Leap> {
        let (axis, sign) = way;
        let ahead = if sign > 0 { self.links.next(upper, axis) } else { self.links.last(upper, axis) };
        if ahead.is_some_and(|ahead| self.is_walkable(ahead)) {
            return None;
        }
        let top = self.top_of(upper)?;
        let at = |cells: i32| match axis {
            Axis::X => cell.offset(sign * cells, 0),
            Axis::Z => cell.offset(0, sign * cells),
        };
        for cells in 1..=rules.cells {
            let mut lower: Option<(i32, usize)> = None;
            for floor in self.floors_of(at(cells))?.filter(|&floor| self.is_walkable(floor)) {
                let height = self.top_of(floor)?;
                if (top - height).abs() <= rules.step {
                    return None;
                }
                let is_nearer = lower.is_none_or(|(own, _)| height > own);
                if height < top && is_nearer {
                    lower = Some((height, floor));
                }
            }
            let Some((height, lower)) = lower else { continue };
            let drop = top - height;
            let (is_jump, is_climb) = (drop <= rules.jump, drop <= rules.climb);
            if !is_jump && !is_climb || !self.is_free(rules, (cell, top), (at(cells), height), axis) {
                return None;
            }
            return Some(Leap { upper, lower, cells, is_jump, is_climb });
        }
        None
    }

    /// Whether the way from a cell to its landing is free.
    fn is_free(
        &self,
        rules: &LedgeRules,
        (from, top): (Column, i32),
        (to, bottom): (Column, i32),
        axis: Axis,
    ) -> bool {
        let head = top.saturating_add(rules.height);
        let (low, high) = (
            Column::new(from.x.min(to.x), from.z.min(to.z)),
            Column::new(from.x.max(to.x), from.z.max(to.z)),
        );
        let wide = rules.wide;
        let (across_x, across_z) = if axis == Axis::X { (0, wide) } else { (wide, 0) };
        // Corners of the cells of the way, and of those around the landing.
        let over = (low.offset(-across_x, -across_z), high.offset(across_x + 1, across_z + 1));
        let around = (to.offset(-wide, -wide), to.offset(wide + 1, wide + 1));
        let is_in = |at: Column, (low, high): (Column, Column)| {
            (low.x..=high.x).contains(&at.x) && (low.z..=high.z).contains(&at.z)
        };
        // Towards the wall, the agent falls past it.
        let beside_wall = |at: Column| match axis {
            Axis::X => (at.x - to.x) * (from.x - to.x).signum() > if from.x > to.x { 1 } else { 0 },
            Axis::Z => (at.z - to.z) * (from.z - to.z).signum() > if from.z > to.z { 1 } else { 0 },
        };
        let (first, last) = (
            Column::new(over.0.x.min(around.0.x), over.0.z.min(around.0.z)),
            Column::new(over.1.x.max(around.1.x), over.1.z.max(around.1.z)),
        );
        (first.z..=last.z).flat_map(|z| (first.x..=last.x).map(move |x| Column::new(x, z))).all(|at| {
            let lands = is_in(at, around) && !beside_wall(at);
            let from = match (lands, is_in(at, over)) {
                (true, _) => bottom,
                (false, true) => top,
                (false, false) => return true,
            };
            self.has_air(at, from.saturating_add(rules.step).min(head - 1), head)
        })
    }

    /// Whether a column is air from one height to another.
    fn has_air(&self, at: Column, from: i32, to: i32) -> bool {
        self.floors_of(at).is_some_and(|mut floors| {
            floors.any(|floor| {
                let ceiling = self.floors.ceiling[floor];
                self.floors.floor[floor] <= from && (ceiling == SKY || ceiling >= to)
            })
        })
    }

    /// The floors of a column; `None` beyond those that the tile knows.
    fn floors_of(&self, at: Column) -> Option<std::ops::Range<usize>> {
        let (low, side) = (self.floors.low, self.floors.side as i32);
        let (x, z) = (at.x - low.x, at.z - low.z);
        let is_known = (0..side).contains(&x) && (0..side).contains(&z);
        is_known.then(|| self.floors.of((z * side + x) as usize))
    }

    /// The height of the highest corner of a cell.
    fn top_of(&self, floor: usize) -> Option<i32> {
        self.links.corners(floor)?.into_iter().map(|corner| self.floors.floor[corner]).max()
    }

    /// How many leaps from the first on belong to one link; at least 1.
    fn run(&self, rest: &[Leap], (axis, sign): (Axis, i32)) -> usize {
        let along = if axis == Axis::X { Axis::Z } else { Axis::X };
        let follows = |pair: &[Leap]| {
            let (a, b) = (&pair[0], &pair[1]);
            (a.cells, a.is_jump, a.is_climb) == (b.cells, b.is_jump, b.is_climb)
                && self.links.next(a.upper, along) == Some(b.upper)
                && self.links.next(a.lower, along) == Some(b.lower)
        };
        let most = 1 + rest.windows(2).take_while(|pair| follows(pair)).count();
        // Along the edge of the cells.
        let heights = |cells: Vec<usize>, is_far: bool| -> Vec<i64> {
            let end = cells.last().and_then(|&last| self.links.next(last, along));
            let on_edge = |floor: usize| if is_far { self.links.next(floor, axis) } else { Some(floor) };
            let corners = cells.into_iter().chain(end).filter_map(on_edge);
            corners.map(|corner| self.floors.floor[corner].into()).collect()
        };
        let is_straight = |count: usize| {
            let cells = |floor: fn(&Leap) -> usize| rest[..count].iter().map(floor).collect::<Vec<_>>();
            [(cells(|leap| leap.upper), sign > 0), (cells(|leap| leap.lower), sign < 0)].into_iter().all(
                |(cells, is_far)| {
                    let heights = heights(cells, is_far);
                    let (first, last, span) =
                        (heights[0], heights[heights.len() - 1], heights.len() as i64 - 1);
                    (0..).zip(&heights).all(|(place, height)| {
                        let line = (first * (span - place) + last * place) / span.max(1);
                        (height - line).abs() <= i64::from(self.precision)
                    })
                },
            )
        };
        (1..=most).take_while(|count| is_straight(*count)).last().unwrap_or(1)
    }

    /// The link from the first to the last of some leaps side by side.
    fn link(&self, first: &Leap, last: &Leap, (axis, sign): (Axis, i32)) -> LedgeLink {
        let along = if axis == Axis::X { Axis::Z } else { Axis::X };
        // The edge of a cell that is nearer to the other one.
        let edge = |first: usize, last: usize, is_far: bool| {
            let on_edge = |floor: usize| if is_far { self.links.next(floor, axis) } else { Some(floor) };
            let (begin, end) = (on_edge(first), self.links.next(last, along).and_then(on_edge));
            [begin.unwrap_or(first), end.unwrap_or(last)].map(|floor| {
                let height = self.floors.floor[floor] * FINE;
                self.position(floor).with_y(height)
            })
        };
        LedgeLink {
            top: edge(first.upper, last.upper, sign > 0),
            bottom: edge(first.lower, last.lower, sign < 0),
            way: if axis == Axis::X { IVec3::X * sign } else { IVec3::Z * sign },
            is_jump: first.is_jump,
            is_climb: first.is_climb,
        }
    }
}

impl LedgeLink {
    /// How far it leads down, in voxels, where it begins.
    pub fn drop(&self) -> f32 {
        (self.top[0].y - self.bottom[0].y) as f32 / SNAP as f32
    }
}
