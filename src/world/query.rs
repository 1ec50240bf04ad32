//! Queries about the ground, answered from the triangles that are drawn, without a physics engine.

use glam::{DVec3, IVec3, Vec3};

use super::ray::{NEAR, Ray, Triangle};
use super::state::World;
use super::triangles::for_triangles;
use crate::ground::MaterialId;
use crate::lattice::{Column, LIMIT, LatticeBox, REACH};

/// The point where a ray meets the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Voxels from the ray's origin.
    pub distance: f64,
    /// The position, in voxels.
    pub position: DVec3,
    /// Unit normal of the triangle, towards the air.
    pub normal: Vec3,
    /// The material of the ground there.
    pub material: MaterialId,
    /// Whether the ray came from inside the ground.
    pub from_inside: bool,
}

/// A stretch of air above a point: in voxels from a `World`, in metres from `Terrains`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The ground below it.
    pub floor: f64,
    /// The ground above it; `None` under the open sky.
    pub ceiling: Option<f64>,
}

/// Where a vertical line crosses the surface.
struct Crossing {
    y: f64,
    normal: Vec3,
}

impl World {
    /// The first triangle that a ray meets within `max_distance` voxels, from outside, inside a cave or inside the
    /// ground. `None` for a ray that meets none, and for one whose numbers are not finite or whose direction is
    /// zero.
    pub fn raycast(&self, origin: DVec3, direction: DVec3, max_distance: f64) -> Option<RayHit> {
        // Scaled first, so that very long and very short vectors work too.
        let direction = (direction / direction.abs().max_element()).try_normalize()?;
        if !origin.is_finite() || max_distance.is_nan() || max_distance < 0.0 {
            return None;
        }
        let view = self.view();
        // From where the ray enters the world on: small numbers keep their digits.
        let (skipped, end) = self.clip(origin, direction, max_distance)?;
        let (origin, leave) = (origin + direction * skipped, end - skipped);
        let limit = max_distance - skipped;
        let (start, mut enter) = (origin, 0.0);
        let ray = Ray::new(origin, direction);
        let mut cell = Column::new(
            (start.x.floor() as i32).clamp(0, self.grid.width() - 1),
            (start.z.floor() as i32).clamp(0, self.grid.depth() - 1),
        );
        let step = |along: f64| if along > 0.0 { 1 } else { -1 };
        let (step_x, step_z) = (step(direction.x), step(direction.z));
        // Distance along the ray at which it leaves the cell through its side in x or z.
        let side = |at: i32, from: f64, along: f64| match along {
            0.0 => f64::INFINITY,
            _ => (f64::from(at + i32::from(along > 0.0)) - from) / along,
        };
        while self.grid.has_cell(cell) {
            let (out_x, out_z) = (side(cell.x, origin.x, direction.x), side(cell.z, origin.z, direction.z));
            let out = out_x.min(out_z).min(leave);
            let (y0, y1) = (origin.y + direction.y * enter, origin.y + direction.y * out);
            // Through a corner of cells, rounding decides which way round it the ray goes: look at both.
            let is_at_corner = (out_x - out_z).abs() <= NEAR;
            let beside = [cell.offset(step_x, 0), cell.offset(0, step_z)];
            let beside = beside.into_iter().filter(|&cell| is_at_corner && self.grid.has_cell(cell));
            let mut best: Option<(f64, Triangle)> = None;
            for cell in std::iter::once(cell).chain(beside) {
                for_triangles(self, &view, cell, y0.min(y1) - NEAR, y0.max(y1) + NEAR, |triangle| {
                    if let Some(t) = ray.meet(&triangle)
                        && (0.0..=limit).contains(&t)
                        && best.is_none_or(|(nearest, _)| t < nearest)
                    {
                        best = Some((t, triangle));
                    }
                });
            }
            if let Some((distance, triangle)) = best {
                let mut hit = self.hit(origin, direction, distance, &triangle);
                hit.distance += skipped;
                return Some(hit);
            }
            if out >= leave {
                return None;
            }
            enter = out;
            cell = match (is_at_corner, out_x <= out_z) {
                (true, _) => cell.offset(step_x, step_z),
                (false, true) => cell.offset(step_x, 0),
                (false, false) => cell.offset(0, step_z),
            };
        }
        None
    }

    fn hit(&self, origin: DVec3, direction: DVec3, distance: f64, triangle: &Triangle) -> RayHit {
        let [a, b, c] = triangle;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let position = origin + direction * distance;
        RayHit {
            distance,
            position,
            normal: normal.as_vec3(),
            material: self.material_under(position),
            from_inside: normal.dot(direction) > 0.0,
        }
    }

    /// The stretch of a ray that may meet ground, as distances.
    fn clip(&self, origin: DVec3, direction: DVec3, max_distance: f64) -> Option<(f64, f64)> {
        let (mut enter, mut leave) = (0.0f64, max_distance);
        let rim = f64::from(LIMIT + 2);
        for (from, along, low, high) in [
            (origin.x, direction.x, 0.0, f64::from(self.grid.width())),
            (origin.y, direction.y, -rim, rim),
            (origin.z, direction.z, 0.0, f64::from(self.grid.depth())),
        ] {
            if along == 0.0 {
                if !(low..=high).contains(&from) {
                    return None;
                }
            } else {
                let (a, b) = ((low - from) / along, (high - from) / along);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
        }
        (enter <= leave).then_some((enter, leave))
    }

    /// The stretches of air over (x, z), lowest first; empty outside the world. Coordinates are taken to the nearest
    /// 2^-20 voxel.
    pub fn spans(&self, x: f64, z: f64) -> Vec<Span> {
        // The deep is solid and the surface closed: floors and ceilings take turns, whatever rounding does to equal
        // heights.
        let crossings = self.crossings(x, z);
        let span =
            |pair: &[Crossing]| Span { floor: pair[0].y, ceiling: pair.get(1).map(|ceiling| ceiling.y) };
        crossings.chunks(2).map(span).collect()
    }

    /// The topmost ground over (x, z) in voxels, `None` outside the world.
    pub fn height(&self, x: f64, z: f64) -> Option<f64> {
        self.spans(x, z).last().map(|span| span.floor)
    }

    /// Whether the place is inside the ground. False outside the world, and for NaN.
    pub fn is_solid(&self, place: DVec3) -> bool {
        let spans = self.spans(place.x, place.z);
        let is_open = |span: &Span| span.floor <= place.y && span.ceiling.is_none_or(|top| place.y <= top);
        !place.y.is_nan() && !spans.is_empty() && !spans.iter().any(is_open)
    }

    /// Whether all samples around the place are solid. Faster than [`is_solid`](Self::is_solid), which is also true
    /// nearer to the surface.
    pub fn is_buried(&self, place: DVec3) -> bool {
        let limit = DVec3::splat(f64::from(LIMIT)).with_x(f64::from(REACH)).with_z(f64::from(REACH));
        let cell = place.clamp(-limit, limit).floor().as_ivec3();
        let samples = self.samples();
        let mut corners = LatticeBox { min: cell, max: cell + 1 }.points();
        place.is_finite()
            && self.grid.has_cell(Column::of(cell))
            && corners.all(|corner| samples.is_solid(corner))
    }

    /// The surface's unit normal where it is nearest to `place` along y, `None` outside the world.
    pub fn normal(&self, place: DVec3) -> Option<Vec3> {
        let apart = |crossing: &Crossing| (crossing.y - place.y).abs();
        let crossings = self.crossings(place.x, place.z).into_iter();
        crossings.min_by(|a, b| apart(a).total_cmp(&apart(b))).map(|crossing| crossing.normal)
    }

    /// The material of the solid lattice point nearest to a place on the surface.
    pub fn material_under(&self, place: DVec3) -> MaterialId {
        let samples = self.samples();
        let far = DVec3::splat(2.0 * f64::from(REACH));
        let place = place.clamp(-far, far);
        // The corners of the cell around it; of all cells around it, where it lies between them.
        let (low, high) = ((place - NEAR).ceil().as_ivec3() - 1, (place + NEAR).floor().as_ivec3() + 1);
        let around = LatticeBox { min: low, max: high };
        let apart = |point: &IVec3| point.as_dvec3().distance_squared(place);
        let solid = around.points().filter(|&point| samples.is_solid(point));
        let nearest = solid.min_by(|a, b| apart(a).total_cmp(&apart(b)));
        nearest.map_or_else(
            || self.ground.material(place.round().as_ivec3() - IVec3::Y),
            |point| samples.material(point),
        )
    }

    /// Heights at which the vertical line through (x, z) crosses the surface, lowest first.
    ///
    /// Exact in integers, with the line moved by an infinitesimal step off every edge, so each crossing counts once.
    fn crossings(&self, x: f64, z: f64) -> Vec<Crossing> {
        const FINE: i64 = 1 << 20;
        let (width, depth) = (f64::from(self.grid.width()), f64::from(self.grid.depth()));
        if !((0.0..=width).contains(&x) && (0.0..=depth).contains(&z)) {
            return Vec::new();
        }
        let fine = |at: f64, end: f64| ((at * FINE as f64).round() as i64).min(end as i64 * FINE - 1);
        let (px, pz) = (fine(x, width), fine(z, depth));
        let cell = Column::new((px / FINE) as i32, (pz / FINE) as i32);
        let mut found = Vec::new();
        for_triangles(self, &self.view(), cell, f64::NEG_INFINITY, f64::INFINITY, |triangle| {
            let [a, b, c] =
                triangle.map(|p| ((p.x * FINE as f64) as i64 - px, (p.z * FINE as f64) as i64 - pz));
            let (ab, bc, ca) = (turn(a, b), turn(b, c), turn(c, a));
            if ab == bc && bc == ca {
                let area = |p: (i64, i64), q: (i64, i64)| (p.0 * q.1 - p.1 * q.0) as f64;
                let (wc, wa, wb) = (area(a, b), area(b, c), area(c, a));
                let sum = wa + wb + wc;
                let [ya, yb, yc] = triangle.map(|p| p.y);
                if sum != 0.0 {
                    let [p, q, r] = triangle;
                    let normal = (q - p).cross(r - p).normalize_or_zero().as_vec3();
                    found.push(Crossing { y: (wa * ya + wb * yb + wc * yc) / sum, normal });
                }
            }
        });
        found.sort_by(|a: &Crossing, b| a.y.total_cmp(&b.y));
        found
    }
}

/// The side of the edge p-q on which the origin lies, once it is moved by (e, e * e) for an infinitesimal e.
fn turn(p: (i64, i64), q: (i64, i64)) -> bool {
    let cross = p.0 * q.1 - p.1 * q.0;
    let (dx, dz) = (q.0 - p.0, q.1 - p.1);
    (cross, -dz, dx) > (0, 0, 0)
}
