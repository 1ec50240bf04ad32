//! Surfaces without repeated vertices, and which triangles are neighbours.

use std::cmp::Ordering;

use avian3d::parry::math::Vector;
use glam::{I64Vec3, IVec3, Vec3};

use crate::surface::SurfaceMesh;

/// A surface without repeated vertices and without triangles that have no area.
pub(super) struct Welded {
    places: Vec<IVec3>,
    normals: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Whether all triangles are seen from above.
    pub is_heightmap: bool,
}

/// Neighbours from here on are indices of the normals across the border.
pub(super) const BORDER: u32 = 1 << 31;

/// No vertex or side.
const NONE: u32 = u32::MAX;

impl Welded {
    pub fn new(surface: &SurfaceMesh) -> Self {
        let count = surface.vertices.len();
        let (mut places, mut normals) = (Vec::with_capacity(count), Vec::with_capacity(count));
        // A hash table of vertices by place.
        let mut table = vec![NONE; (2 * count).next_power_of_two().max(2)];
        let (mask, shift) = (table.len() - 1, 32 - table.len().trailing_zeros().min(31));
        let mut welded = Vec::with_capacity(count);
        for vertex in &surface.vertices {
            let place = vertex.position;
            let mut at = hash(place) as usize >> shift;
            welded.push(loop {
                let found = table[at];
                if found == NONE {
                    let number = places.len() as u32;
                    places.push(place);
                    normals.push(vertex.normal);
                    table[at] = number;
                    break number;
                }
                if places[found as usize] == place {
                    break found;
                }
                at = (at + 1) & mask;
            });
        }
        let corner = |index: u32| welded.get(index as usize).copied();
        let (mut triangles, mut is_heightmap) = (Vec::with_capacity(surface.indices.len() / 3), true);
        for t in surface.indices.triangles() {
            let [Some(a), Some(b), Some(c)] = t.map(corner) else { continue };
            let area = Area::of([a, b, c].map(|corner| places[corner as usize]));
            if area != Area::Nothing {
                is_heightmap &= area == Area::Above;
                triangles.push([a, b, c]);
            }
        }
        Self { places, normals, triangles, is_heightmap }
    }

    /// The vertices in metres, if a voxel has `SNAP * scale` metres.
    pub fn vertices(&self, scale: f32) -> Vec<Vector> {
        self.places.iter().map(|place| place.as_vec3() * scale).collect()
    }

    /// The neighbours across each triangle's sides, and the normals across the border.
    pub fn neighbours(&self, vertices: &[Vector]) -> (Vec<[u32; 3]>, Vec<Vector>) {
        let mut open = OpenSides::new(self);
        // Most triangles share a side with the one before, so those two are compared before anything is looked up.
        for number in 0..self.triangles.len() as u32 {
            if let Some(before) = number.checked_sub(1) {
                open.link_adjacent(before, number);
                open.link(before);
            }
        }
        if let Some(last) = (self.triangles.len() as u32).checked_sub(1) {
            open.link(last);
        }
        let mut neighbours = open.neighbours;
        let mut beyond = Vec::new();
        for (triangle, neighbours) in self.triangles.iter().zip(&mut neighbours) {
            for (neighbour, (from, to)) in neighbours.iter_mut().zip(sides(triangle)) {
                if *neighbour == NONE {
                    *neighbour = BORDER + beyond.len() as u32;
                    beyond.push(self.across(vertices, triangle, from, to));
                }
            }
        }
        (neighbours, beyond)
    }

    /// The normal across a border: the triangle's own, mirrored at the edge's normal as given by its vertices.
    fn across(&self, vertices: &[Vector], triangle: &[u32; 3], from: u32, to: u32) -> Vector {
        let [a, b, c] = triangle.map(|corner| vertices[corner as usize]);
        let face = (b - a).cross(c - a).normalize_or_zero();
        let along = (vertices[to as usize] - vertices[from as usize]).normalize_or_zero();
        let middle = self.normals[from as usize] + self.normals[to as usize];
        // Across an edge, normals only rotate about the edge.
        let middle = (middle - along * middle.dot(along)).normalize_or(face);
        middle * (2.0 * middle.dot(face)) - face
    }
}

/// A triangle's sides: from which vertex to which.
fn sides(t: &[u32; 3]) -> [(u32, u32); 3] {
    [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]
}

fn hash(place: IVec3) -> u32 {
    let [x, y, z] = place.to_array().map(|part| u64::from(part as u32));
    let product = u128::from((x << 32 | z) ^ 0x9e37_79b9_7f4a_7c15) * u128::from(y ^ 0xc2b2_ae3d_27d4_eb4f);
    ((product >> 64) as u64 ^ product as u64) as u32
}

/// Whether a triangle has an area, and whether it is seen from above.
#[derive(PartialEq)]
enum Area {
    Nothing,
    Above,
    Other,
}

impl Area {
    fn of([a, b, c]: [IVec3; 3]) -> Self {
        let [b, c] = [b, c].map(|corner| corner.as_i64vec3() - a.as_i64vec3());
        match (b.z * c.x).cmp(&(b.x * c.z)) {
            Ordering::Greater => Self::Above,
            Ordering::Less => Self::Other,
            Ordering::Equal if b.cross(c) != I64Vec3::ZERO => Self::Other,
            Ordering::Equal => Self::Nothing,
        }
    }
}

/// Finds neighbours: triangles with the same side, in opposite directions.
struct OpenSides<'a> {
    triangles: &'a [[u32; 3]],
    neighbours: Vec<[u32; 3]>,
    /// For each vertex, the side without a neighbour that was added last among those that start there. Side `s` of
    /// triangle `t` has the number `3 t + s`.
    first: Vec<u32>,
    /// For each side, the one that starts at the same vertex and was added before.
    next: Vec<u32>,
}

impl<'a> OpenSides<'a> {
    fn new(welded: &'a Welded) -> Self {
        let count = welded.triangles.len();
        Self {
            triangles: &welded.triangles,
            neighbours: vec![[NONE; 3]; count],
            first: vec![NONE; welded.places.len()],
            next: vec![NONE; 3 * count],
        }
    }

    /// Links two triangles if they share a side that has no neighbour yet.
    fn link_adjacent(&mut self, one: u32, other: u32) {
        let (ours, theirs) = (sides(&self.triangles[one as usize]), sides(&self.triangles[other as usize]));
        for (own, (from, to)) in ours.into_iter().enumerate() {
            let found = theirs.iter().position(|&side| side == (to, from));
            if let Some(side) = found.filter(|_| self.neighbours[one as usize][own] == NONE) {
                self.neighbours[one as usize][own] = other;
                self.neighbours[other as usize][side] = one;
                return;
            }
        }
    }

    /// Finds the neighbours of a triangle among those before. Sides without one wait for those that follow.
    fn link(&mut self, number: u32) {
        for (own, (from, to)) in sides(&self.triangles[number as usize]).into_iter().enumerate() {
            if self.neighbours[number as usize][own] != NONE {
                continue;
            }
            match self.take(to, from) {
                Some(side) => {
                    let (triangle, side) = (side / 3, side % 3);
                    self.neighbours[number as usize][own] = triangle;
                    self.neighbours[triangle as usize][side as usize] = number;
                }
                None => {
                    let side = 3 * number + own as u32;
                    self.next[side as usize] = std::mem::replace(&mut self.first[from as usize], side);
                }
            }
        }
    }

    /// Removes a side from those without a neighbour.
    fn take(&mut self, from: u32, to: u32) -> Option<u32> {
        let (mut before, mut side) = (NONE, self.first[from as usize]);
        while side != NONE {
            let next = self.next[side as usize];
            if self.triangles[side as usize / 3][(side as usize + 1) % 3] == to {
                match before {
                    NONE => self.first[from as usize] = next,
                    before => self.next[before as usize] = next,
                }
                return Some(side);
            }
            (before, side) = (side, next);
        }
        None
    }
}
