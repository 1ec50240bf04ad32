//! Which floors are linked, and which cells between them are passable.

use super::floors::{Floors, SKY};
use super::settings::Walker;

/// No floor.
pub(super) const NONE: u32 = u32::MAX;

/// A direction along x or z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    X,
    Z,
}

/// The floors of neighbouring columns that an agent can go to, and the cells that it can stand on.
#[derive(Debug)]
pub(super) struct Links {
    /// For each floor, the linked one towards +x and the one towards +z; [`NONE`] where there is none.
    next: [Vec<u32>; 2],
    /// For each floor, the linked ones towards -x and -z.
    last: [Vec<u32>; 2],
    /// Whether the cell with this floor at its lowest corner is passable.
    passable: Vec<bool>,
}

impl Links {
    /// The links of floors.
    pub fn new(floors: &Floors, walker: &Walker) -> Self {
        let (side, count) = (floors.side, floors.len());
        let mut links = Self {
            next: [vec![NONE; count], vec![NONE; count]],
            last: [vec![NONE; count], vec![NONE; count]],
            passable: vec![false; count],
        };
        for z in 0..side {
            for x in 0..side {
                let column = z * side + x;
                if x + 1 < side {
                    links.link(floors, walker, column, column + 1, Axis::X);
                }
                if z + 1 < side {
                    links.link(floors, walker, column, column + side, Axis::Z);
                }
            }
        }
        for floor in 0..count {
            links.passable[floor] =
                links.corners(floor).is_some_and(|corners| is_passable(floors, walker, corners));
        }
        links
    }

    /// Links floors of two columns: each to the one that is nearest in height, if that is so for both.
    fn link(&mut self, floors: &Floors, walker: &Walker, from: usize, to: usize, axis: Axis) {
        let (own, others) = (floors.of(from), floors.of(to));
        if own.len() == 1 && others.len() == 1 {
            if is_linked(floors, walker, own.start, others.start) {
                self.next[axis as usize][own.start] = others.start as u32;
                self.last[axis as usize][others.start] = own.start as u32;
            }
            return;
        }
        let nearest = |floor: usize, others: std::ops::Range<usize>| {
            let linked = others.filter(|&other| is_linked(floors, walker, floor, other));
            linked.min_by_key(|&other| floors.floor[floor].abs_diff(floors.floor[other]))
        };
        for floor in own.clone() {
            if let Some(other) = nearest(floor, others.clone())
                && nearest(other, own.clone()) == Some(floor)
            {
                self.next[axis as usize][floor] = other as u32;
                self.last[axis as usize][other] = floor as u32;
            }
        }
    }

    /// The linked floor towards +x or +z.
    pub fn next(&self, floor: usize, axis: Axis) -> Option<usize> {
        let next = self.next[axis as usize][floor];
        (next != NONE).then_some(next as usize)
    }

    /// The linked floor towards -x or -z.
    pub fn last(&self, floor: usize, axis: Axis) -> Option<usize> {
        let last = self.last[axis as usize][floor];
        (last != NONE).then_some(last as usize)
    }

    /// Whether the cell with this floor at its lowest corner is passable.
    pub fn is_passable(&self, floor: usize) -> bool {
        self.passable[floor]
    }

    /// The floors at the corners of a cell, if they are linked all around: at (0, 0), (0, 1), (1, 1) and (1, 0).
    pub fn corners(&self, floor: usize) -> Option<[usize; 4]> {
        let (x, z) = (self.next(floor, Axis::X)?, self.next(floor, Axis::Z)?);
        let opposite = self.next(z, Axis::X)?;
        (self.next(x, Axis::Z) == Some(opposite)).then_some([floor, z, opposite, x])
    }
}

/// Whether an agent can step from one floor to the other, both ways, with its head below both ceilings.
fn is_linked(floors: &Floors, walker: &Walker, a: usize, b: usize) -> bool {
    let (low, high) = (floors.floor[a].min(floors.floor[b]), floors.floor[a].max(floors.floor[b]));
    let ceiling = floors.ceiling[a].min(floors.ceiling[b]);
    high - low <= walker.climb && (ceiling == SKY || ceiling - high >= walker.height)
}

/// Whether a cell between linked floors is flat enough, or no more than a step, and high enough in its middle too.
fn is_passable(floors: &Floors, walker: &Walker, corners: [usize; 4]) -> bool {
    let [a, b, c, d] = corners.map(|corner| i64::from(floors.floor[corner]));
    // Twice the rise in the middle of the cell.
    let (rise_x, rise_z) = (c - b + d - a, b - a + c - d);
    let is_flat = rise_x * rise_x + rise_z * rise_z <= 4 * walker.squared_slope;
    let range = a.max(b).max(c).max(d) - a.min(b).min(c).min(d);
    let is_walkable = is_flat || range <= i64::from(walker.step);
    let ceilings = corners.map(|corner| i64::from(floors.ceiling[corner]));
    if !is_walkable || ceilings == [i64::from(SKY); 4] {
        return is_walkable;
    }
    // However the ground and its ceiling are triangulated.
    let ceiling = (ceilings[0] + ceilings[2]).min(ceilings[1] + ceilings[3]);
    ceiling - (a + c).max(b + d) >= 2 * i64::from(walker.height)
}
