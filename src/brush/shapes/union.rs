//! The union of many small pieces. Only the CPU computes it.
//!
//! Its distance is the least of the distances to its pieces. Neighbours in the list are expected to lie near each
//! other, as the pieces of a path do: boxes around runs of them, in a tree, leave out those that are farther away than
//! others.

use std::ops::Range;

use super::distance::{Distance, larger, length, smaller};

/// Pieces of a leaf, and children of a node.
const WIDTH: usize = 8;

/// A piece of a [`Union`].
pub trait Piece: Copy {
    /// Distance of the point (x, y, z); it changes no faster than the point moves.
    fn at(&self, x: f32, y: f32, z: f32) -> f32;

    /// A box around it.
    fn bounds(&self) -> Bounds;
}

/// A box, in 1/256 voxel relative to the shape's origin.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub low: [f32; 3],
    pub high: [f32; 3],
}

impl Bounds {
    /// The box around a ball.
    pub fn around(at: [f32; 3], radius: f32) -> Self {
        Self { low: at.map(|v| v - radius), high: at.map(|v| v + radius) }
    }

    /// The box around both.
    pub fn union(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| smaller(self.low[axis], other.low[axis])),
            high: std::array::from_fn(|axis| larger(self.high[axis], other.high[axis])),
        }
    }

    /// How far a point is outside along one axis; negative inside.
    #[inline(always)]
    pub fn beyond(&self, axis: usize, at: f32) -> f32 {
        larger(self.low[axis] - at, at - self.high[axis])
    }

    /// At most the distance of a point to what is inside.
    #[inline(always)]
    fn least(&self, x: f32, y: f32, z: f32) -> f32 {
        larger(larger(self.beyond(0, x), self.beyond(1, y)), self.beyond(2, z))
    }
}

/// What rounding may take from a distance, generously; more far away.
fn rounding(distance: f32) -> f32 {
    larger(64.0, distance.abs() / 4096.0)
}

/// The union of pieces.
#[derive(Clone, Debug)]
pub struct Union<P> {
    pieces: Vec<P>,
    /// Boxes around runs of pieces: of [`WIDTH`] pieces each in the first list, of [`WIDTH`] boxes of the list before
    /// in each further one.
    levels: Vec<Vec<Bounds>>,
}

impl<P: Piece> Union<P> {
    /// The union of at least one piece.
    pub fn new(pieces: Vec<P>) -> Self {
        let around = |boxes: &[Bounds]| boxes.iter().copied().reduce(Bounds::union);
        let own: Vec<Bounds> = pieces.iter().map(P::bounds).collect();
        let mut levels: Vec<Vec<Bounds>> = vec![own.chunks(WIDTH).filter_map(around).collect()];
        while let Some(last) = levels.last().filter(|last| last.len() > WIDTH) {
            levels.push(last.chunks(WIDTH).filter_map(around).collect());
        }
        Self { pieces, levels }
    }

    /// Visits the pieces of all boxes that `is_near`, in order.
    #[inline]
    pub fn visit(&self, mut is_near: impl FnMut(&Bounds) -> bool, mut each: impl FnMut(usize, &P) -> bool) {
        // A place in each level, from the top down; the stack holds ranges that are still to be visited.
        let top = self.levels.len() - 1;
        let mut stack = [(0, 0); 12];
        stack[top] = (0, self.levels[top].len());
        let mut level = top;
        loop {
            let (next, end) = &mut stack[level];
            if next == end {
                level += 1;
                if level > top {
                    return;
                }
                continue;
            }
            let index = *next;
            *next += 1;
            if !is_near(&self.levels[level][index]) {
                continue;
            }
            let first = index * WIDTH;
            if level > 0 {
                level -= 1;
                stack[level] = (first, (first + WIDTH).min(self.levels[level].len()));
                continue;
            }
            let own = (first..).zip(&self.pieces[first..(first + WIDTH).min(self.pieces.len())]);
            for (index, piece) in own {
                if !each(index, piece) {
                    return;
                }
            }
        }
    }

    /// The distance to the nearest piece.
    fn nearest(&self, x: f32, y: f32, z: f32) -> f32 {
        let best = std::cell::Cell::new(f32::MAX);
        self.visit(
            |bounds| {
                let least = bounds.least(x, y, z);
                least - rounding(least) <= best.get()
            },
            |_, piece| {
                best.set(smaller(best.get(), piece.at(x, y, z)));
                true
            },
        );
        best.get()
    }

    /// The pieces that may be the nearest one to some point of a box: all others are farther away there than one of
    /// these.
    fn near(&self, [xs, ys, zs]: &[[f32; 8]; 3]) -> Vec<P> {
        let middle = |all: &[f32; 8]| (all[0] + all[7]) / 2.0;
        let half = |all: &[f32; 8]| (all[7] - all[0]) / 2.0;
        let radius = length(half(xs), half(ys), half(zs));
        let (x, y, z) = (middle(xs), middle(ys), middle(zs));
        let nearest = self.nearest(x, y, z);
        // Distances change no faster than the point moves.
        let most = nearest + 2.0 * radius + rounding(nearest);
        let mut near = Vec::new();
        self.visit(
            |bounds| bounds.least(x, y, z) - rounding(most) <= most,
            |_, piece| {
                if piece.at(x, y, z) <= most {
                    near.push(*piece);
                }
                true
            },
        );
        near
    }
}

impl<P: Piece> Distance for Union<P> {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        self.nearest(x, y, z)
    }

    fn constants(&self) -> Vec<f32> {
        Vec::new()
    }

    fn rows(
        &self,
        points: &[[f32; 8]; 3],
        y: Range<usize>,
        z: Range<usize>,
        mut each: impl FnMut(usize, usize, [f32; 8]),
    ) {
        let (near, [xs, ys, zs]) = (self.near(points), points);
        for y in y {
            for z in z.clone() {
                let mut distances = [f32::MAX; 8];
                for piece in &near {
                    for (distance, &x) in distances.iter_mut().zip(xs) {
                        *distance = smaller(*distance, piece.at(x, ys[y], zs[z]));
                    }
                }
                each(y, z, distances);
            }
        }
    }
}
