//! Predicting densities from neighbours, so that only small differences have to be stored.
//!
//! Densities are distances, nearly linear in space. With a, b, c the neighbours one step lower along each axis, ab the
//! one a step lower along two of them, and so on, a sample is about a + b + c - ab - bc - ac + abc. Where some of them
//! are not known, it is predicted from a plane, from a line, or from a nearby sample.

use crate::brush::{BAND, DEPTH};
use crate::lattice::BRICK;

/// Samples along a side: those of a brick, and two more towards the lower neighbours.
const SIDE: usize = BRICK as usize + 2;

/// A sample that is not known, because it is pristine or comes later.
const UNKNOWN: i16 = i16::MIN;

/// From a sample to the one below it along x, z and y.
const STEPS: [usize; 3] = [1, SIDE, SIDE * SIDE];

/// How a sample was predicted, which says how well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Context {
    /// From all seven neighbours.
    Cube,
    /// From planes through three of them.
    Planes,
    /// From lines through two samples.
    Lines,
    /// From any known sample nearby, or without one.
    Near,
}

impl Context {
    pub const COUNT: usize = 4;
    #[cfg(test)]
    pub const ALL: [Self; Self::COUNT] = [Self::Cube, Self::Planes, Self::Lines, Self::Near];
}

/// A brick's samples as far as they are known, with those next to it in bricks that come before it.
pub struct Known([i16; SIDE * SIDE * SIDE]);

impl Known {
    /// The neighbours are those one brick lower along x (bit 0), z (bit 1) and y (bit 2) of their index. Nothing is
    /// known of the brick itself, which has index 0.
    pub fn new(neighbours: &[Option<&[i16; 512]>; 8]) -> Self {
        let mut known = Self([UNKNOWN; SIDE * SIDE * SIDE]);
        for (number, neighbour) in neighbours.iter().enumerate().skip(1) {
            let Some(samples) = neighbour else { continue };
            // From, to, and how many: its two last layers along each axis on which it is lower, all eight along others.
            let [xs, zs, ys] = [0, 1, 2].map(|axis| match number >> axis & 1 {
                0 => (0, 2, 8),
                _ => (6, 0, 2),
            });
            for (y, z) in (0..ys.2).flat_map(|y| (0..zs.2).map(move |z| (y, z))) {
                let from = (ys.0 + y) << 6 | (zs.0 + z) << 3 | xs.0;
                let to = ((ys.1 + y) * SIDE + zs.1 + z) * SIDE + xs.1;
                known.0[to..to + xs.2].copy_from_slice(&samples[from..from + xs.2]);
            }
        }
        known
    }

    /// Where the sample of a brick with this index is.
    fn place(index: usize) -> usize {
        ((index >> 6) + 2) * STEPS[2] + ((index >> 3 & 7) + 2) * STEPS[1] + (index & 7) + 2
    }

    /// Enters a sample.
    pub fn set(&mut self, index: usize, density: i16) {
        self.0[Self::place(index)] = density;
    }

    /// Predicts a sample from earlier ones.
    pub fn predict(&self, index: usize) -> (Context, i16) {
        let at = Self::place(index);
        let get =
            |back: usize| Some(i32::from(self.0[at - back])).filter(|&density| density != i32::from(UNKNOWN));
        let near = STEPS.map(get);
        let [x, z, y] = STEPS;
        let cube =
            |[a, b, c]: [i32; 3]| Some(a + b + c - get(x + z)? - get(z + y)? - get(x + y)? + get(x + z + y)?);
        let plane = |a: usize, b: usize| Some(near[a]? + near[b]? - get(STEPS[a] + STEPS[b])?);
        let line = |axis: usize| Some(2 * near[axis]? - get(2 * STEPS[axis])?);
        let all =
            || Some([near[0]?, near[1]?, near[2]?]).and_then(cube).map(|density| (Context::Cube, density));
        let planes = || Some((Context::Planes, mean([plane(0, 1), plane(0, 2), plane(1, 2)])?));
        let lines = || Some((Context::Lines, mean([line(0), line(1), line(2)])?));
        let predicted = all().or_else(planes).or_else(lines);
        let (context, density) = predicted.unwrap_or_else(|| (Context::Near, mean(near).unwrap_or(0)));
        // Digs leave no densities beyond, so those that are near the end stay there.
        let known = || near.into_iter().flatten();
        let (low, high) = (known().fold(-BAND, i32::min), known().fold(DEPTH, i32::max));
        (context, density.clamp(low, high) as i16)
    }
}

/// The mean of those that are known.
fn mean(all: [Option<i32>; 3]) -> Option<i32> {
    let count = all.iter().flatten().count() as i32;
    (count > 0).then(|| all.iter().flatten().sum::<i32>().div_euclid(count))
}
