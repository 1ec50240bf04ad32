//! Watertight intersection of rays and triangles.

use glam::DVec3;

/// How near to a lattice plane or an edge a place counts as on it, in voxels.
pub(crate) const NEAR: f64 = 1e-6;

/// A drawn triangle, in voxels.
pub(crate) type Triangle = [DVec3; 3];

/// A ray prepared for watertight intersection tests, by *Watertight Ray/Triangle Intersection* (Woop, Benthin and Wald
/// 2013). Triangles that share an edge compute the same number for it, and a distance is always a mean of those of the
/// corners.
pub(crate) struct Ray {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

impl Ray {
    pub(crate) fn new(origin: DVec3, direction: DVec3) -> Self {
        let steps = direction.abs();
        let z = (0..3).max_by(|&a, &b| steps[a].total_cmp(&steps[b])).unwrap_or(1);
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let shear = DVec3::new(direction[x], direction[y], 1.0) / direction[z];
        Self { origin, axes: [x, y, z], shear }
    }

    /// Distance along the ray to a triangle, its edges included.
    pub(crate) fn meet(&self, triangle: &Triangle) -> Option<f64> {
        let [x, y, z] = self.axes;
        let [a, b, c] = triangle.map(|p| {
            let p = p - self.origin;
            DVec3::new(p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z], self.shear.z * p[z])
        });
        let edge = |p: DVec3, q: DVec3| p.x * q.y - p.y * q.x;
        let (u, v, w) = (edge(b, c), edge(c, a), edge(a, b));
        let sum = u + v + w;
        let is_inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        // Seen edge-on, a triangle is what rounding makes of it: then the ray meets one of its edges, or passes by.
        let size = ((b - a).abs() + (c - a).abs()).max_element();
        if !is_inside || sum == 0.0 {
            None
        } else if sum.abs() > 4.0 * f64::EPSILON * size * (a.abs().max_element() + size) {
            Some((u * a.z + v * b.z + w * c.z) / sum)
        } else {
            let edges = [(a, b), (b, c), (c, a)].into_iter();
            let nearest = edges.map(|(p, q)| {
                let (from, along) = (p.truncate(), (q - p).truncate());
                p + (q - p)
                    * (-from.dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
            });
            nearest.filter(|place| place.truncate().length() <= NEAR).map(|place| place.z).reduce(f64::min)
        }
    }
}
