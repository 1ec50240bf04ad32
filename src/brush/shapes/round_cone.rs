//! The hull of two balls, of which tubes are made.

use super::distance::{Axis, length};
use super::union::{Bounds, Piece};
use crate::brush::quantize::difference;

/// The hull of two balls.
#[derive(Clone, Copy, Debug)]
pub struct RoundCone {
    /// Middle of the first ball.
    from: [f32; 3],
    unit: [f32; 3],
    length: f32,
    radii: [f32; 2],
    /// Sine and cosine of the slope of its side.
    slope: [f32; 2],
}

impl RoundCone {
    pub fn new((from, from_radius): ([i32; 3], f32), (to, to_radius): ([i32; 3], f32)) -> Self {
        let Axis { unit, length } = Axis::of(difference(to, from));
        let floats = |at: [i32; 3]| at.map(|v| v as f32);
        if length <= (from_radius - to_radius).abs() {
            // One ball holds the other.
            let (at, radius) = if from_radius > to_radius { (from, from_radius) } else { (to, to_radius) };
            return Self {
                from: floats(at),
                unit: [0.0; 3],
                length: 0.0,
                radii: [radius; 2],
                slope: [0.0, 1.0],
            };
        }
        let sine = (from_radius - to_radius) / length;
        let slope = [sine, (1.0 - sine * sine).sqrt()];
        Self { from: floats(from), unit, length, radii: [from_radius, to_radius], slope }
    }
}

impl Piece for RoundCone {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let (x, y, z) = (x - self.from[0], y - self.from[1], z - self.from[2]);
        let [ux, uy, uz] = self.unit;
        let along = x * ux + (y * uy + z * uz);
        let off = length(x - along * ux, y - along * uy, z - along * uz);
        let [sine, cosine] = self.slope;
        let foot = cosine * along - sine * off;
        let end = self.length;
        if foot < 0.0 {
            length(x, y, z) - self.radii[0]
        } else if foot > cosine * end {
            length(x - end * ux, y - end * uy, z - end * uz) - self.radii[1]
        } else {
            (cosine * off + sine * along) - self.radii[0]
        }
    }

    fn bounds(&self) -> Bounds {
        let to = std::array::from_fn(|axis| self.from[axis] + self.unit[axis] * self.length);
        Bounds::around(self.from, self.radii[0]).union(Bounds::around(to, self.radii[1]))
    }
}

/// Distance to the hull of two balls, by the best of many balls between them.
#[cfg(test)]
pub(super) fn to_balls(p: glam::DVec3, from: (glam::DVec3, f64), to: (glam::DVec3, f64)) -> f64 {
    let ball = |t: f64| p.distance(from.0.lerp(to.0, t)) - (from.1 + (to.1 - from.1) * t);
    // The distance is convex in t.
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if ball(a) < ball(b) { high = b } else { low = a }
    }
    ball(low.midpoint(high))
}
