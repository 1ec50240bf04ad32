//! Vertices of a block, made from lists of lattice edges: the vertex function (rule 4) for many edges at once.
//!
//! What it computes, and in which order of operations, is what [`vertex`](super::vertex::vertex) says; the results have
//! the same bits. Here the edges of one axis are taken eight at a time, their samples gathered into arrays, and each
//! step is a loop over an array, so that the compiler uses vectors.

use glam::{IVec3, Vec3};

use super::apron::{AREA, Apron, Marked, Neighbours, SIDE};
use super::mesh::{MaterialMix, Vertex};
use super::stack::Stack;
use super::vertex::lerp_normal;
use crate::ground::{MaterialId, OVERLAY_DEPTH};
use crate::lattice::{ONE, SNAP};
use crate::volume::Brick;

/// Edges taken together.
const LANES: usize = 8;

/// Lattice edges along one axis, by their lower ends: layer and corner of a brick's cells.
#[derive(Default)]
pub(super) struct EdgeList(Vec<u16>);

impl EdgeList {
    #[inline]
    pub fn push(&mut self, y: usize, corner: usize) {
        self.0.push((y << 7 | corner) as u16);
    }
}

/// The edges of a block, one list for each axis.
#[derive(Default)]
pub(super) struct Crossings {
    lists: [EdgeList; 3],
}

/// From an end of an edge to the next sample along the edge, and along both other axes.
const STEPS: [[usize; 3]; 3] = [[1, AREA, SIDE], [AREA, 1, SIDE], [SIDE, 1, AREA]];

/// Which of the three steps of an axis runs along x, along y, along z.
const AXES: [[usize; 3]; 3] = [[0, 1, 2], [1, 0, 2], [1, 2, 0]];

impl Crossings {
    pub fn clear(&mut self) {
        self.lists.iter_mut().for_each(|list| list.0.clear());
    }

    pub fn list(&mut self, axis: usize) -> &mut EdgeList {
        &mut self.lists[axis]
    }

    /// Adds the vertex of each listed edge of the brick whose lowest sample is `low`, relative to `origin`: all along x,
    /// then along y, then along z.
    pub fn make(
        &self,
        apron: &Apron,
        stack: &mut Stack,
        around: &Neighbours,
        low: IVec3,
        origin: IVec3,
        out: &mut Vec<Vertex>,
    ) {
        let materials = StoredMaterials::new(around);
        for (axis, list) in self.lists.iter().enumerate() {
            for edges in list.0.chunks(LANES) {
                let batch = Batch::new(apron, axis, edges);
                for (lane, &edge) in edges.iter().enumerate() {
                    let (y, corner) = (usize::from(edge >> 7), usize::from(edge & 0x7f));
                    let place = Place { axis, y, corner };
                    let p = IVec3::new((corner % 9) as i32, y as i32, (corner / 9) as i32);
                    out.push(batch.vertex(lane, place, p + low, stack, &materials, origin));
                }
            }
        }
    }
}

/// A lattice edge within a block.
#[derive(Clone, Copy)]
struct Place {
    axis: usize,
    y: usize,
    corner: usize,
}

impl Place {
    /// The corner over the edge's upper end.
    fn other_corner(self) -> usize {
        self.corner + [1, 0, 9][self.axis]
    }
}

/// Crossings of up to eight edges along one axis.
struct Batch {
    /// Steps of 1/4096 voxel from the lower end.
    steps: [i32; LANES],
    normals: [[f32; LANES]; 3],
    is_pristine: [bool; LANES],
    is_stencil_pristine: [bool; LANES],
    is_lower_solid: [bool; LANES],
}

impl Batch {
    #[inline]
    fn new(apron: &Apron, axis: usize, edges: &[u16]) -> Self {
        let samples = apron.samples();
        let [along, b, c] = STEPS[axis];
        // Twelve samples of each edge: both ends, one before and one after them along the edge, and around both ends
        // along the other two axes.
        let mut ends = [[0; LANES]; 4];
        let mut sides = [[[0; LANES]; 4]; 2];
        for (lane, &edge) in edges.iter().enumerate() {
            let p = Apron::place(usize::from(edge >> 7), usize::from(edge & 0x7f));
            let q = p + along;
            for (end, at) in ends.iter_mut().zip([p - along, p, q, q + along]) {
                end[lane] = samples[at];
            }
            for (side, step) in sides.iter_mut().zip([b, c]) {
                for (side, at) in side.iter_mut().zip([p - step, p + step, q - step, q + step]) {
                    side[lane] = samples[at];
                }
            }
        }
        let [before, p, q, after] = &ends;
        let each = |lane| p[lane] | q[lane];
        let is_edited: [Marked; LANES] = std::array::from_fn(each);
        let stencil: [Marked; LANES] = std::array::from_fn(|lane| {
            let around = |side: &[[Marked; LANES]; 4]| side[0][lane] | side[1][lane] | side[2][lane] | side[3][lane];
            is_edited[lane] | before[lane] | after[lane] | around(&sides[0]) | around(&sides[1])
        });
        let mut steps = steps(p, q);
        if axis == 1 {
            // A pristine vertical edge is crossed at the height itself, its upper end included.
            let exact = |lane: usize| -(p[lane] >> 1) * (SNAP / ONE);
            steps = std::array::from_fn(|i| if is_edited[i] & 1 == 0 { exact(i) } else { steps[i] });
        }

        let rise = |low: &[Marked; LANES], high: &[Marked; LANES]| -> [f32; LANES] {
            std::array::from_fn(|lane| ((high[lane] >> 1) - (low[lane] >> 1)) as f32)
        };
        let t: [f32; LANES] = std::array::from_fn(|lane| steps[lane] as f32 / SNAP as f32);
        let blend = |a: [f32; LANES], b: [f32; LANES]| -> [f32; LANES] {
            std::array::from_fn(|lane| a[lane] + (b[lane] - a[lane]) * t[lane])
        };
        let along = blend(rise(before, q), rise(p, after));
        let [b, c] = [&sides[0], &sides[1]].map(|side| blend(rise(&side[0], &side[1]), rise(&side[2], &side[3])));
        let own = [along, b, c];
        let [x, y, z] = AXES[axis].map(|component| own[component]);
        let length: [f32; LANES] =
            std::array::from_fn(|i| (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt());
        let unit = |v: [f32; LANES], flat: f32| -> [f32; LANES] {
            std::array::from_fn(|i| if length[i] > 0.0 { v[i] / length[i] } else { flat })
        };
        Self {
            steps,
            normals: [unit(x, 0.0), unit(y, 1.0), unit(z, 0.0)],
            is_pristine: is_edited.map(|marked| marked & 1 == 0),
            is_stencil_pristine: stencil.map(|marked| marked & 1 == 0),
            is_lower_solid: p.map(|marked| marked < 0),
        }
    }

    #[inline]
    fn vertex(
        &self,
        lane: usize,
        place: Place,
        p: IVec3,
        stack: &mut Stack,
        materials: &StoredMaterials,
        origin: IVec3,
    ) -> Vertex {
        let Place { axis, corner, .. } = place;
        let (other, is_pristine) = (place.other_corner(), self.is_pristine[lane]);
        let step = self.steps[lane];
        let normal = if is_pristine && (self.is_stencil_pristine[lane] || stack.is_border(corner, axis)) {
            if axis == 1 {
                stack.normal(corner)
            } else {
                lerp_normal(stack.normal(corner), stack.normal(other), step)
            }
        } else {
            Vec3::from_array(self.normals.map(|component| component[lane]))
        };
        let mut position = (p - origin) * SNAP;
        position[axis] += step;
        let stored = materials.at(place, self.is_lower_solid[lane]);
        let materials = if stored == MaterialId::GROUND {
            own_materials(stack, place, p.y, step)
        } else {
            MaterialMix::pure(stored)
        };
        Vertex { position, normal, materials }
    }
}

/// Where the surface crosses edges between samples `p` and `q`: linear, to the nearest step, and not at the ends.
#[inline]
fn steps(p: &[Marked; LANES], q: &[Marked; LANES]) -> [i32; LANES] {
    std::array::from_fn(|lane| {
        let (p, q) = (f64::from((p[lane] >> 1).abs()), f64::from((q[lane] >> 1).abs()));
        let sum = (p + q).max(1.0);
        // Whole numbers below 2^38: a quotient that is none is farther from one than f64 rounds.
        let steps = (f64::from(2 * SNAP) * p + sum) / (2.0 * sum);
        (steps as i32).clamp(1, SNAP - 1)
    })
}

/// Materials where the ground shows its own, those of both columns blended as the tile does.
fn own_materials(stack: &mut Stack, place: Place, y: i32, step: i32) -> MaterialMix {
    let (corner, other) = (place.corner, place.other_corner());
    let between = |low: i32, high: i32| {
        low + ((i64::from(high) - i64::from(low)) * i64::from(step) / i64::from(SNAP)) as i32
    };
    let top = if place.axis == 1 { y + 1 } else { y };
    let depth = between(stack.height(corner), stack.height(other)) - between(y * ONE, top * ONE);
    let variant = usize::from(depth > OVERLAY_DEPTH);
    let a = stack.mixes(corner)[variant];
    if corner == other {
        return a;
    }
    MaterialMix::lerp(a, stack.mixes(other)[variant], step)
}

/// The stored materials around a block's corners.
struct StoredMaterials<'a> {
    bricks: [[Option<&'a Brick>; 4]; 2],
    /// Does any brick store materials at all?
    is_any: bool,
}

impl<'a> StoredMaterials<'a> {
    fn new(around: &Neighbours<'a>) -> Self {
        let bricks = [around.corners(0), around.corners(1)];
        let stores = |brick: &Option<&Brick>| brick.is_some_and(|brick| brick.material_bytes() > 0);
        Self { bricks, is_any: bricks.iter().flatten().any(stores) }
    }

    /// What is stored at the solid end of an edge.
    #[inline]
    fn at(&self, place: Place, is_lower: bool) -> MaterialId {
        if !self.is_any {
            return MaterialId::GROUND;
        }
        let corner = if is_lower { place.corner } else { place.other_corner() };
        let y = place.y + usize::from(place.axis == 1 && !is_lower);
        let (x, z) = (corner % 9, corner / 9);
        let brick = self.bricks[y / 8][x / 8 + z / 8 * 2];
        brick.map_or(MaterialId::GROUND, |brick| brick.material_at(y % 8 * 64 + z % 8 * 8 + x % 8))
    }
}
