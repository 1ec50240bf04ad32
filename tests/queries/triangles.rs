//! Brute force over all drawn triangles.

use bevy_burrow::lattice::SNAP;
use bevy_burrow::terrain::{MeshKey, World};
use glam::DVec3;

/// Tolerance between answers and drawn triangles, in voxels.
pub const TOLERANCE: f64 = 1.0 / 256.0;

/// How far a ray is moved to test whether it runs close to an edge, in voxels.
pub const NUDGE: f64 = 1e-6;

/// All drawn triangles, sorted into squares of `SIDE` x `SIDE` voxels by their bounds.
pub struct Triangles {
    pub triangles: Vec<[DVec3; 3]>,
    /// The number of triangles of tiles; they come first.
    pub tiles: usize,
    squares: Vec<Vec<u32>>,
    width: i32,
    depth: i32,
}

const SIDE: i32 = 4;

impl Triangles {
    pub fn of(world: &World) -> Self {
        let count = |cells: i32| cells / SIDE + 1;
        let (width, depth) = (count(world.grid().width()), count(world.grid().depth()));
        let squares = vec![Vec::new(); (width * depth) as usize];
        let mut triangles = Self { triangles: Vec::new(), tiles: 0, squares, width, depth };
        for (drawn, mesh) in world.drawn() {
            let origin = world.origin(drawn).as_dvec3();
            if matches!(drawn, MeshKey::Tile(_)) {
                triangles.tiles += mesh.indices.len() / 3;
            }
            for triangle in mesh.triangles() {
                triangles.add(triangle.map(|vertex| origin + vertex.position.as_dvec3() / f64::from(SNAP)));
            }
        }
        triangles
    }

    fn add(&mut self, triangle: [DVec3; 3]) {
        let number = self.triangles.len() as u32;
        self.triangles.push(triangle);
        let [a, b, c] = triangle;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for z in self.square(low.z, self.depth)..=self.square(high.z, self.depth) {
            for x in self.square(low.x, self.width)..=self.square(high.x, self.width) {
                self.squares[(z * self.width + x) as usize].push(number);
            }
        }
    }

    fn square(&self, at: f64, end: i32) -> i32 {
        ((at / f64::from(SIDE)).floor() as i32).clamp(0, end - 1)
    }

    /// The triangles of all squares below the ray, with a margin of half a voxel; some occur twice.
    pub fn near(&self, origin: DVec3, direction: DVec3) -> Vec<u32> {
        let mut found = Vec::new();
        for z in 0..self.depth {
            let (low, high) = (f64::from(z * SIDE) - 0.5, f64::from((z + 1) * SIDE) + 0.5);
            // The part of the ray that is over this row of squares.
            let (from, to) = match direction.z {
                dz if dz.abs() < 1e-9 => match (low - 0.5..=high + 0.5).contains(&origin.z) {
                    true => (0.0, 1e7),
                    false => continue,
                },
                dz => {
                    let (a, b) = ((low - origin.z) / dz, (high - origin.z) / dz);
                    (a.min(b).max(0.0), a.max(b).min(1e7))
                }
            };
            if from > to {
                continue;
            }
            let (a, b) = (origin.x + direction.x * from, origin.x + direction.x * to);
            let (left, right) = (a.min(b) - 0.5, a.max(b) + 0.5);
            for x in self.square(left, self.width)..=self.square(right, self.width) {
                found.extend_from_slice(&self.squares[(z * self.width + x) as usize]);
            }
        }
        found
    }

    /// The nearest triangle that a ray hits, and the distance to it.
    pub fn raycast(&self, origin: DVec3, direction: DVec3, max_distance: f64) -> Option<(f64, u32)> {
        let near = self.near(origin, direction).into_iter();
        let hits = near.filter_map(|number| {
            Some((meet(origin, direction, &self.triangles[number as usize], 1e-12)?, number))
        });
        hits.filter(|(t, _)| (0.0..=max_distance).contains(t)).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The crossings of the vertical line through (x, z), lowest first: height, whether the triangle faces up, and
    /// its index.
    pub fn crossings(&self, x: f64, z: f64) -> Vec<(f64, bool, u32)> {
        let square = self.square(z, self.depth) * self.width + self.square(x, self.width);
        let mut found = Vec::new();
        for &number in &self.squares[square as usize] {
            let [a, b, c] = self.triangles[number as usize];
            let side = |p: DVec3, q: DVec3| (p.x - x) * (q.z - z) - (p.z - z) * (q.x - x);
            let (wa, wb, wc) = (side(b, c), side(c, a), side(a, b));
            let area = wa + wb + wc;
            if area != 0.0 && (wa / area).min(wb / area).min(wc / area) >= 0.0 {
                found.push(((wa * a.y + wb * b.y + wc * c.y) / area, area < 0.0, number));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found
    }

    pub fn column(&self, x: f64, z: f64) -> Vec<(f64, bool)> {
        self.crossings(x, z).into_iter().map(|(y, is_floor, _)| (y, is_floor)).collect()
    }

    pub fn normal(&self, number: u32) -> DVec3 {
        let [a, b, c] = self.triangles[number as usize];
        (b - a).cross(c - a).normalize()
    }
}

/// The distance along a ray to a triangle (Moeller and Trumbore), measured from the ray's closest point so that distant
/// origins keep their precision. The triangle is enlarged by the fraction `hair` of itself.
pub fn meet(origin: DVec3, direction: DVec3, [a, b, c]: &[DVec3; 3], hair: f64) -> Option<f64> {
    let shift = (*a - origin).dot(direction);
    let origin = origin + direction * shift;
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from = origin - a;
    let u = from.dot(p) / determinant;
    let q = from.cross(ab);
    let v = direction.dot(q) / determinant;
    (u >= -hair && v >= -hair && u + v <= 1.0 + hair).then(|| ac.dot(q) / determinant + shift)
}

/// The distance of a point from a triangle.
pub fn distance_to(place: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a).normalize();
    let sides = [(a, b), (b, c), (c, a)];
    if sides.into_iter().all(|(p, q)| (q - p).cross(place - p).dot(normal) >= 0.0) {
        return (place - a).dot(normal).abs();
    }
    let to_side = |(p, q): (DVec3, DVec3)| {
        let along = ((place - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
        place.distance(p.lerp(q, along))
    };
    sides.into_iter().map(to_side).fold(f64::INFINITY, f64::min)
}
