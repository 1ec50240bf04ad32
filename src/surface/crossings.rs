//! Vertices of a block, made from lists of lattice edges: the vertex function (rule 4) for many edges at once.
//!
//! It computes what [`vertex`](super::vertex::vertex) computes, in the same order of operations; the results
//! have equal bits. Here the edges of one axis are taken four at a time (lists are short): their samples are
//! gathered into vectors, one for each place around an edge, and every step is done for all four.

use glam::{IVec3, Vec3};
use wide::{f32x4, i32x4};

use super::layer_bits::{self, LayerBits, PLACES, SIDE};
use super::mesh::{MaterialMix, Vertex};
use super::neighbours::{CornerBricks, Neighbours};
use super::padded_samples::{AREA, Marked, PaddedSamples};
use super::stack::Stack;
use super::vertex::{between, lerp_normal};
use crate::ground::{Ground, MaterialId, OVERLAY_DEPTH};
use crate::lattice::{BrickPos, ONE, SNAP};
use crate::volume::Brick;
use crate::volume::layers::ones;

/// Edges taken together.
const LANES: usize = 4;

/// A lattice edge, by its lower end: layer and corner of a brick's cells.
#[derive(Clone, Copy)]
pub(super) struct Edge {
    pub y: u8,
    pub corner: u8,
}

/// The edges of a block, one list for each axis.
#[derive(Default)]
pub(super) struct Crossings {
    /// Along x, y and z.
    pub lists: [Vec<Edge>; 3],
    /// The solid ends of the edges, layer by layer; only where the ground's materials differ from voxel to voxel.
    pub ends: Option<[LayerBits; 9]>,
}

impl Crossings {
    /// Adds the vertex of each listed edge of the brick whose lowest sample is `low`, relative to `origin`: all along
    /// x, then along y, then along z.
    pub fn make(
        &self,
        samples: &PaddedSamples,
        stack: &mut Stack,
        around: &Neighbours,
        low: IVec3,
        origin: IVec3,
        out: &mut Vec<Vertex>,
    ) {
        let materials = StoredMaterials::new(around);
        let solid;
        let mut own = None;
        if let Some(ends) = &self.ends {
            solid = solid_materials(ends, stack.ground(), low);
            own = Some(&solid);
        }
        let mut site = Site { samples, stack, materials, own, low, base: low - origin };
        let [x, y, z] = &self.lists;
        out.reserve(x.len() + y.len() + z.len());
        site.make::<0>(x, out);
        site.make::<1>(y, out);
        site.make::<2>(z, out);
    }
}

/// The ground's own materials at the solid ends of edges of a block. Several edges end at the same voxel, and
/// neighbours are asked together.
fn solid_materials(ends: &[LayerBits; 9], ground: &Ground, low: IVec3) -> SolidMaterials {
    let mut materials = [[[MaterialId::GROUND; 64]; 4]; 9];
    let brick = BrickPos::of(low).0;
    for (y, (&ends, materials)) in
        ends.iter().zip(&mut materials).enumerate().filter(|(_, (ends, _))| **ends != 0)
    {
        for (number, (voxels, materials)) in layer_bits::split(ends).into_iter().zip(materials).enumerate() {
            let step = IVec3::new((number & 1) as i32, (y >> 3) as i32, (number >> 1) as i32);
            if voxels != 0 {
                ground.for_materials(BrickPos(brick + step), y & 7, voxels, |material, held| {
                    ones(held).for_each(|bit| materials[bit] = material);
                });
            }
        }
    }
    materials
}

/// Materials of the voxels at the corners of a block's cells: for each layer those of four bricks, as bits of
/// [`Layers`](crate::volume::Layers). Only those at solid ends of edges are filled in.
type SolidMaterials = [[[MaterialId; 64]; 4]; 9];

/// The input for the vertices of a block.
struct Site<'a, 'b> {
    samples: &'a PaddedSamples,
    stack: &'a mut Stack<'b>,
    materials: StoredMaterials<'a>,
    /// The ground's own materials at solid ends, if they differ from voxel to voxel.
    own: Option<&'a SolidMaterials>,
    /// The brick's lowest sample.
    low: IVec3,
    /// The brick's lowest sample, relative to the origin of positions.
    base: IVec3,
}

/// From an end of an edge to the next sample along the edge, and along both other axes.
const STEPS: [[usize; 3]; 3] = [[1, AREA, SIDE], [AREA, 1, SIDE], [SIDE, 1, AREA]];

/// Which of the three steps of an axis runs along x, along y, along z.
const AXES: [[usize; 3]; 3] = [[0, 1, 2], [1, 0, 2], [1, 2, 0]];

/// From a corner to the next along an axis, in the numbering of corners.
const NEXT_CORNER: [usize; 3] = [1, 0, 9];

impl Site<'_, '_> {
    fn make<const AXIS: usize>(&mut self, edges: &[Edge], out: &mut Vec<Vertex>) {
        for edges in edges.chunks(LANES) {
            let batch = Batch::new::<AXIS>(self.samples, edges);
            let vertices = edges.iter().enumerate();
            out.extend(vertices.map(|(lane, &edge)| self.vertex::<AXIS>(&batch, lane, edge)));
        }
    }

    #[inline(always)]
    fn vertex<const AXIS: usize>(&mut self, batch: &Batch, lane: usize, edge: Edge) -> Vertex {
        let (lane, corner, y) = (lane % LANES, usize::from(edge.corner), i32::from(edge.y));
        let place = &PLACES[corner];
        let other = corner + NEXT_CORNER[AXIS];
        let step = batch.steps[lane];
        let flags = 1 << lane;
        let is_pristine = batch.edited & flags == 0;
        let normal =
            if is_pristine && (batch.stencil_edited & flags == 0 || self.stack.is_border(corner, AXIS)) {
                match AXIS {
                    1 => self.stack.normal(corner),
                    _ => lerp_normal(self.stack.normal(corner), self.stack.normal(other), step),
                }
            } else {
                Vec3::new(batch.normals[0][lane], batch.normals[1][lane], batch.normals[2][lane])
            };
        let mut position = (self.base + IVec3::new(place.x, y, place.z)) * SNAP;
        position[AXIS] += step;
        let is_lower = batch.lower_solid & flags != 0;
        let stored = if self.materials.is_any {
            self.materials.at::<AXIS>(edge, is_lower)
        } else {
            MaterialId::GROUND
        };
        let materials = match (stored, self.stack.single_mix()) {
            (MaterialId::GROUND, Some(mix)) => mix,
            (MaterialId::GROUND, None) => match self.own {
                Some(own) => {
                    let (solid, y) = solid_end::<AXIS>(edge, is_lower);
                    MaterialMix::pure(own[y][PLACES[solid].brick][PLACES[solid].index])
                }
                None => self.ground_materials::<AXIS>(corner, self.low.y + y, step),
            },
            _ => MaterialMix::pure(stored),
        };
        Vertex { position, normal, materials }
    }

    /// Materials where the ground shows its own, those of both columns blended as the tile does.
    fn ground_materials<const AXIS: usize>(&mut self, corner: usize, y: i32, step: i32) -> MaterialMix {
        let between = |low, high| between(low, high, step);
        let other = corner + NEXT_CORNER[AXIS];
        let depth = match AXIS {
            1 => self.stack.height(corner) - between(y * ONE, (y + 1) * ONE),
            _ => between(self.stack.height(corner), self.stack.height(other)) - y * ONE,
        };
        let variant = usize::from(depth > OVERLAY_DEPTH);
        let own = self.stack.mixes(corner)[variant];
        match AXIS {
            1 => own,
            _ => MaterialMix::lerp(own, self.stack.mixes(other)[variant], step),
        }
    }
}

/// Crossings of up to four edges along one axis. Of flags, each edge has one bit.
struct Batch {
    /// Steps of 1/4096 voxel from the lower end.
    steps: [i32; LANES],
    /// Unit gradients at the crossings: x, y, z.
    normals: [[f32; LANES]; 3],
    /// Whether an end is edited.
    edited: u32,
    /// Whether any sample that the gradients at both ends read is edited.
    stencil_edited: u32,
    lower_solid: u32,
}

/// Samples from one layer before an edge's lower end to two after it.
const NEAR: usize = 3 * AREA + 1;

impl Batch {
    #[inline(always)]
    fn new<const AXIS: usize>(samples: &PaddedSamples, edges: &[Edge]) -> Self {
        let [along, b, c] = STEPS[AXIS];
        let (p, q) = (AREA, AREA + along);
        // Lanes beyond the last edge repeat it.
        let near: [&[Marked; NEAR]; LANES] = std::array::from_fn(|lane| {
            let edge = edges[lane.min(edges.len() - 1)];
            let first = usize::from(edge.y) * AREA + PLACES[usize::from(edge.corner)].padded;
            samples.all()[first..].first_chunk().unwrap_or(&[0; NEAR])
        });
        let at = |place: usize| {
            let [a, b, c, d] = near;
            i32x4::new([a[place], b[place], c[place], d[place]])
        };
        let around = |end: usize, step: usize| [at(end - step), at(end + step)];
        // Both ends, one before and one after them along the edge, and around both ends along the other two axes.
        let ([before, _], [_, after]) = (around(p, along), around(q, along));
        let ([pb, pb2], [qb, qb2]) = (around(p, b), around(q, b));
        let ([pc, pc2], [qc, qc2]) = (around(p, c), around(q, c));
        let (p, q) = (at(p), at(q));
        let is_edited = p | q;
        let stencil = is_edited | before | after | pb | pb2 | qb | qb2 | pc | pc2 | qc | qc2;
        let flags = |marked: i32x4| (marked << 31u32).to_bitmask();

        let mut steps = linear_steps(p >> 1u32, q >> 1u32);
        if AXIS == 1 {
            // A pristine vertical edge is crossed at the height itself, its upper end included.
            let exact = -(p >> 1u32) * i32x4::splat(SNAP / ONE);
            steps = ((is_edited << 31u32) >> 31u32).select(steps, exact);
        }
        let t = steps.round_float() / f32x4::splat(SNAP as f32);
        let rise = |low: i32x4, high: i32x4| ((high >> 1u32) - (low >> 1u32)).round_float();
        // a + (b - a) * t, in this order; no fused operation.
        let blend = |a: f32x4, b: f32x4| a + (b - a) * t;
        let own = [
            blend(rise(before, q), rise(p, after)),
            blend(rise(pb, pb2), rise(qb, qb2)),
            blend(rise(pc, pc2), rise(qc, qc2)),
        ];
        let [x, y, z] = AXES[AXIS].map(|component| own[component]);
        let length = (x * x + y * y + z * z).sqrt();
        // Where the gradient vanishes, up.
        let is_sloped = length.simd_gt(f32x4::splat(0.0));
        let unit = |v: f32x4, flat: f32| is_sloped.select(v / length, f32x4::splat(flat)).to_array();
        Self {
            steps: steps.to_array(),
            normals: [unit(x, 0.0), unit(y, 1.0), unit(z, 0.0)],
            edited: flags(is_edited),
            stencil_edited: flags(stencil),
            lower_solid: p.to_bitmask(),
        }
    }
}

/// Where the surface crosses edges between densities `p` and `q`, one of them negative: linear, to the nearest step of
/// 1/4096, halves up, and not at the ends.
#[inline(always)]
fn linear_steps(p: i32x4, q: i32x4) -> i32x4 {
    // Next to 1.5 * 2^52, floats are the integers. A quotient that is not a half is 2^-26 away from one at least, as
    // its divisor is below 2^25; so the bias decides halves and nothing else.
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    const BIAS: f64 = 1.0 / (1 << 28) as f64;
    let (p, sum) = (p.abs(), p.abs() + q.abs());
    let (p, sum) = (p.to_array(), sum.to_array());
    let mut steps = [0; LANES];
    for lane in 0..LANES {
        let share = f64::from(SNAP) * f64::from(p[lane]) / f64::from(sum[lane]);
        steps[lane] = (share + BIAS + SHIFT).to_bits() as i32;
    }
    i32x4::new(steps).max(i32x4::splat(1)).min(i32x4::splat(SNAP - 1))
}

/// The solid end of an edge: corner and layer.
fn solid_end<const AXIS: usize>(edge: Edge, is_lower: bool) -> (usize, usize) {
    let corner = usize::from(edge.corner) + if is_lower { 0 } else { NEXT_CORNER[AXIS] };
    (corner, usize::from(edge.y) + usize::from(AXIS == 1 && !is_lower))
}

/// The stored materials around a block's corners.
struct StoredMaterials<'a> {
    bricks: CornerBricks<'a>,
    /// Whether any brick stores materials at all.
    is_any: bool,
}

impl<'a> StoredMaterials<'a> {
    fn new(around: &Neighbours<'a>) -> Self {
        let bricks = around.near();
        let stores = |brick: &Option<&Brick>| brick.is_some_and(|brick| brick.material_bytes() > 0);
        Self { is_any: bricks.0.iter().flatten().any(stores), bricks }
    }

    /// What is stored at the solid end of an edge.
    fn at<const AXIS: usize>(&self, edge: Edge, is_lower: bool) -> MaterialId {
        let (corner, y) = solid_end::<AXIS>(edge, is_lower);
        let place = &PLACES[corner];
        let brick = self.bricks.0[y / 8][place.brick];
        brick.map_or(MaterialId::GROUND, |brick| brick.material_at(y % 8 * 64 + place.index))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::vertex::linear;
    use super::*;

    /// The steps from air of one density to ground of another one, and the other way round, which are those of the
    /// vertex function.
    fn steps(air: i32, ground: i32) -> [i32; 2] {
        let [there, back] = [[air, -ground], [-ground, air]];
        let lanes = |end: usize| i32x4::new([there[end], back[end], there[end], back[end]]);
        let steps = linear_steps(lanes(0), lanes(1)).to_array();
        let expected = [there, back].map(|[p, q]| linear(p, q));
        assert_eq!(steps, [expected[0], expected[1], expected[0], expected[1]], "{air} and -{ground}");
        expected
    }

    proptest! {
        #[test]
        fn edges_are_crossed_where_the_vertex_function_says(air in 0..1i32 << 24, ground in 1..1i32 << 24, near in 1i32..999) {
            steps(air, ground);
            steps(air % 1000, near);
            steps(air, near);
            steps(near, ground);
        }

        #[test]
        fn halves_are_rounded_up(step in 0..SNAP, part in 1i32..4096) {
            // `step` and a half of all steps: (2 step + 1) / 8192.
            let (from, to) = ((2 * step + 1) * part, (2 * (SNAP - step) - 1) * part);
            let most = SNAP - 1;
            prop_assert_eq!(steps(from, to), [step + 1, SNAP - step].map(|step| step.clamp(1, most)));
        }

        #[test]
        fn near_halves_are_rounded_to_the_nearest_step(step in 1..SNAP - 1, sum in (1i32 << 24)..(1i32 << 25) - 1, by in -2i32..3) {
            let half = (i64::from(2 * step + 1) * i64::from(sum) / (2 * i64::from(SNAP))) as i32;
            let from = (half + by).clamp(0, sum - 1);
            steps(from, sum - from);
        }
    }
}
