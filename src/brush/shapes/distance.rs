//! Signed Euclidean distances in `f32`, in one written order of exactly rounded operations.
//!
//! Distances take a point relative to the shape's origin, in 1/256 voxel, and are in 1/256 voxel, negative inside. All
//! are exact distances to the shape's surface up to rounding, so none changes faster than the point moves. Sums are
//! written `x + (y + z)`, so that along a row of samples the bracket is computed once.

use std::ops::Range;

/// Signed distance to one shape, its constants derived once.
pub trait Distance {
    /// Distance of the point (x, y, z).
    fn at(&self, x: f32, y: f32, z: f32) -> f32;

    /// At most the distance of the point, changing no faster than the point moves.
    #[inline]
    fn least(&self, x: f32, y: f32, z: f32) -> f32 {
        self.at(x, y, z)
    }

    /// At most twelve numbers that the distance is computed from, as `kernels/shapes.cuh` reads them.
    #[cfg_attr(not(feature = "cuda"), expect(dead_code))]
    fn constants(&self) -> Vec<f32>;

    /// Distances of a run of points along x.
    #[inline(always)]
    fn run(&self, xs: &[f32], y: f32, z: f32, out: &mut [f32]) {
        for (out, &x) in out.iter_mut().zip(xs) {
            *out = self.at(x, y, z);
        }
    }

    /// Hands out the rows of eight points along x at `ys[y]` and `zs[z]`. Compiled for each shape, so that rows are
    /// vectorised.
    #[inline(never)]
    fn rows(
        &self,
        [xs, ys, zs]: &[[f32; 8]; 3],
        y: Range<usize>,
        z: Range<usize>,
        mut each: impl FnMut(usize, usize, [f32; 8]),
    ) where
        Self: Sized,
    {
        for y in y {
            for z in z.clone() {
                let mut distances = [0.0; 8];
                self.run(xs, ys[y], zs[z], &mut distances);
                each(y, z, distances);
            }
        }
    }
}

/// A line segment from the origin.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Direction, of length 1; zero for a segment of length 0.
    pub unit: [f32; 3],
    pub length: f32,
}

impl Axis {
    pub fn of(axis: [i32; 3]) -> Self {
        let squared: i64 = axis.iter().map(|&v| i64::from(v) * i64::from(v)).sum();
        let length = (squared as f32).sqrt();
        Self { unit: axis.map(|v| if squared == 0 { 0.0 } else { v as f32 / length }), length }
    }

    /// Where on the axis the point's foot is.
    #[inline(always)]
    pub fn along(&self, x: f32, y: f32, z: f32) -> f32 {
        dot(x, y, z, &self.unit)
    }

    /// Distance from the point to the place `along` the axis. The difference of vectors is formed before squaring: a
    /// difference of squares would lose half the digits close to the axis.
    #[inline(always)]
    pub fn off(&self, x: f32, y: f32, z: f32, along: f32) -> f32 {
        let [ux, uy, uz] = self.unit;
        length(x - along * ux, y - along * uy, z - along * uz)
    }

    /// Direction and length, and what else a shape has.
    pub fn constants(&self, more: &[f32]) -> Vec<f32> {
        [&self.unit[..], &[self.length], more].concat()
    }
}

#[inline(always)]
pub fn length(x: f32, y: f32, z: f32) -> f32 {
    (x * x + (y * y + z * z)).sqrt()
}

#[inline(always)]
pub fn dot(x: f32, y: f32, z: f32, v: &[f32; 3]) -> f32 {
    x * v[0] + (y * v[1] + z * v[2])
}

/// The larger number, written as the one machine instruction that it is.
#[inline(always)]
pub fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller number.
#[inline(always)]
pub fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
