//! The one vertex function of cubes and ring (rule 4).
//!
//! A vertex belongs to a lattice edge. Every chunk and tile reads the same samples around that edge and so computes the
//! same bits: position, normal and materials.

use glam::{IVec3, Vec3};

use super::mask::MaskView;
use super::mesh::{MaterialMix, Vertex};
use crate::ground::{Ground, MaterialId, OVERLAY_DEPTH};
use crate::lattice::{ChunkGrid, Column, ONE, SNAP};
use crate::volume::SampleView;

/// The part of the world that the vertex function reads.
pub trait Lattice {
    /// Density at a lattice point, 1/256 voxel. Gradients look one point beyond the world's rim.
    fn distance(&self, point: IVec3) -> i32;
    /// Returns `true` if the sample at a lattice point was edited.
    fn is_edited(&self, point: IVec3) -> bool;
    /// The material stored there; [`MaterialId::GROUND`] where it was never changed.
    fn stored_material(&self, point: IVec3) -> MaterialId;
    /// The pristine world.
    fn ground(&self) -> &Ground;
    /// Returns `true` if marching cubes draws the sheet of a cell; `None` outside the world.
    fn is_volumetric(&self, cell: Column) -> Option<bool>;
}

/// The world as the vertex function reads it: samples, mask and the world's rim.
#[derive(Clone, Copy)]
pub struct WorldView<'a> {
    /// Samples and ground.
    pub samples: SampleView<'a>,
    /// Cells of marching cubes.
    pub mask: MaskView<'a>,
    /// Chunks and rim.
    pub grid: ChunkGrid,
}

impl Lattice for WorldView<'_> {
    fn distance(&self, point: IVec3) -> i32 {
        extrapolated(self.grid, point, |point| self.samples.distance(point))
    }
    fn is_edited(&self, point: IVec3) -> bool {
        self.samples.is_edited(point)
    }
    fn stored_material(&self, point: IVec3) -> MaterialId {
        self.samples.stored_material(point)
    }
    fn ground(&self) -> &Ground {
        self.samples.ground()
    }
    fn is_volumetric(&self, cell: Column) -> Option<bool> {
        self.grid.has_cell(cell).then(|| self.mask.contains(cell))
    }
}

/// Density at a point, from those of the world's own points. Points beyond the rim are never edited; there densities
/// are extrapolated linearly, so that ground dug at the rim isn't shaded as a wall.
fn extrapolated(grid: ChunkGrid, point: IVec3, own: impl Fn(IVec3) -> i32) -> i32 {
    let last = IVec3::new(grid.width(), point.y, grid.depth());
    let rim = point.clamp(IVec3::Y * point.y, last);
    if rim == point { own(point) } else { 2 * own(rim) - own(2 * rim - point) }
}

/// The number of a cell's diagonal among the axes: from its lowest corner to the opposite one.
pub(super) const DIAGONAL: usize = 3;

/// Steps along each axis, and along [`DIAGONAL`].
const UNIT: [IVec3; 4] = [IVec3::X, IVec3::Y, IVec3::Z, IVec3::new(1, 0, 1)];

/// Where the surface crosses the lattice edge from `p` along `axis`, in steps of 1/4096 voxel from `p`.
///
/// A pristine vertical edge is crossed exactly at h, its upper end included. Any other crossing is linear, rounded to
/// the nearest step, and at least one step away from both ends. `d = 0` is air.
pub fn crossing(lattice: &impl Lattice, p: IVec3, axis: usize) -> i32 {
    let q = p + UNIT[axis];
    if axis == 1 && !lattice.is_edited(p) && !lattice.is_edited(q) {
        return (lattice.ground().height(Column::of(p)) - p.y * ONE) * (SNAP / ONE);
    }
    linear(lattice.distance(p), lattice.distance(q))
}

/// The crossing between densities `dp` and `dq`, in steps from the first.
pub(super) fn linear(dp: i32, dq: i32) -> i32 {
    linear_over(dp, dq, 1)
}

/// The step of a linear crossing between points that are `length` voxels apart.
#[inline(always)]
pub(super) fn linear_over(dp: i32, dq: i32, length: i32) -> i32 {
    let (dp, dq) = (i64::from(dp).abs(), i64::from(dq).abs());
    let sum = (dp + dq).max(1);
    let end = SNAP * length;
    let steps = (2 * i64::from(end) * dp + sum) / (2 * sum);
    (steps as i32).clamp(1, end - 1)
}

/// The position of the crossing on the edge from `p` along `axis`, in 1/4096 voxel from lattice point `origin`.
pub fn position(lattice: &impl Lattice, p: IVec3, axis: usize, origin: IVec3) -> IVec3 {
    (p - origin) * SNAP + UNIT[axis] * crossing(lattice, p, axis)
}

/// The surface vertex on the lattice edge from `p` along `axis`, which must have one solid end.
pub fn vertex(lattice: &impl Lattice, p: IVec3, axis: usize, origin: IVec3) -> Vertex {
    let q = p + UNIT[axis];
    let pristine = !lattice.is_edited(p) && !lattice.is_edited(q);
    if pristine && (is_on_mask_border(lattice, Column::of(p), axis) || is_stencil_pristine(lattice, p, q)) {
        return sheet_vertex(lattice.ground(), p, axis, origin);
    }
    let step = crossing(lattice, p, axis);
    let solid = if lattice.distance(p) < 0 { p } else { q };
    Vertex {
        position: (p - origin) * SNAP + UNIT[axis] * step,
        normal: lerp_normal(gradient(lattice, p), gradient(lattice, q), step),
        materials: match lattice.stored_material(solid) {
            MaterialId::GROUND => ground_materials(lattice.ground(), [p, q], step, solid),
            stored => MaterialMix::pure(stored),
        },
    }
}

/// The vertex where the sheet has no edited sample near, or meets the heightmap: the tile's own normals and materials.
/// Also on a cell's diagonal.
pub fn sheet_vertex(ground: &Ground, p: IVec3, axis: usize, origin: IVec3) -> Vertex {
    let (q, distance) = (p + UNIT[axis], ground.distance(p));
    let step = match axis {
        1 => (ground.height(Column::of(p)) - p.y * ONE) * (SNAP / ONE),
        _ => linear(distance, ground.distance(q)),
    };
    Vertex {
        position: (p - origin) * SNAP + UNIT[axis] * step,
        normal: heightmap_normal(ground, Column::of(p), Column::of(q), step),
        materials: ground_materials(ground, [p, q], step, if distance < 0 { p } else { q }),
    }
}

/// The heightmap's own vertex over a column.
pub fn height_vertex(ground: &Ground, column: Column, origin: IVec3) -> Vertex {
    let base = (column.at(0) - origin) * SNAP;
    Vertex {
        position: base + IVec3::Y * (ground.height(column) * (SNAP / ONE)),
        normal: ground.normal(column),
        materials: MaterialMix::column(ground.surface_material(column)),
    }
}

/// No sample that the gradients at both ends of an edge look at is edited.
fn is_stencil_pristine(lattice: &impl Lattice, p: IVec3, q: IVec3) -> bool {
    [p, q].iter().all(|&end| {
        UNIT[..DIAGONAL].iter().all(|&u| !lattice.is_edited(end + u) && !lattice.is_edited(end - u))
    })
}

/// Returns `true` if the edge lies in the border of the mask: between a volumetric cell and one that stays
/// heightmap.
fn is_on_mask_border(lattice: &impl Lattice, column: Column, axis: usize) -> bool {
    let Column { x, z } = column;
    let cells: &[Column] = match axis {
        0 => &[Column::new(x, z - 1), Column::new(x, z)],
        1 => &[Column::new(x - 1, z - 1), Column::new(x, z - 1), Column::new(x - 1, z), Column::new(x, z)],
        _ => &[Column::new(x - 1, z), Column::new(x, z)],
    };
    let volumetric = |wanted| cells.iter().any(|&cell| lattice.is_volumetric(cell) == Some(wanted));
    volumetric(true) && volumetric(false)
}

/// The tile's normal on the heightmap edge between two columns (or at one).
fn heightmap_normal(ground: &Ground, a: Column, b: Column, step: i32) -> Vec3 {
    if a == b { ground.normal(a) } else { lerp_normal(ground.normal(a), ground.normal(b), step) }
}

/// Central differences of the density, 1/512 voxel per voxel: they point to the air.
fn gradient(lattice: &impl Lattice, p: IVec3) -> Vec3 {
    let along = |u: IVec3| (lattice.distance(p + u) - lattice.distance(p - u)) as f32;
    Vec3::new(along(IVec3::X), along(IVec3::Y), along(IVec3::Z))
}

/// Linear between `a` and `b`, of unit length; only + - * / sqrt, each in a fixed order, so all machines agree.
pub(super) fn lerp_normal(a: Vec3, b: Vec3, step: i32) -> Vec3 {
    lerp_normal_over(a, b, step, 1)
}

/// The unit normal between points that are `length` voxels apart.
#[inline(always)]
pub(super) fn lerp_normal_over(a: Vec3, b: Vec3, step: i32, length: i32) -> Vec3 {
    let t = step as f32 / (SNAP * length) as f32;
    let [x, y, z] = std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t);
    let length = (x * x + y * y + z * z).sqrt();
    if length > 0.0 { Vec3::new(x / length, y / length, z / length) } else { Vec3::Y }
}

/// The integer at `step` of [`SNAP`] steps from `low` to `high`.
pub(super) fn between(low: i32, high: i32, step: i32) -> i32 {
    low + ((i64::from(high) - i64::from(low)) * i64::from(step) / i64::from(SNAP)) as i32
}

/// Materials at a crossing where the ground shows its own. With strata, that of the solid end: what a dig there yields.
/// Otherwise those of both columns, blended as the tile does: the overlay within its depth below the pristine surface,
/// the base below.
pub(super) fn ground_materials(ground: &Ground, [p, q]: [IVec3; 2], step: i32, solid: IVec3) -> MaterialMix {
    if ground.has_own_materials() {
        return MaterialMix::pure(ground.material(solid));
    }
    let (a, b) = (Column::of(p), Column::of(q));
    let depth = between(ground.height(a), ground.height(b), step) - between(p.y * ONE, q.y * ONE, step);
    let own = |column| {
        let material = ground.column_material(column);
        if depth <= OVERLAY_DEPTH { MaterialMix::column(material) } else { MaterialMix::pure(material.base) }
    };
    MaterialMix::lerp(own(a), own(b), step)
}
