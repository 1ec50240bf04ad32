//! Grids of signed distances to closed triangle meshes.
//!
//! A sample is inside where the mesh's winding number around it is not 0. In a closed mesh this is the number of
//! triangles that a ray leaves through, less those that it enters through. Vertices are rounded to a fine lattice, and
//! a ray through an edge belongs to exactly one of its triangles, so no ray slips through and every number is exact.

use glam::{DVec3, I64Vec3, IVec3, Quat, UVec3, Vec3};
use rustc_hash::FxHashMap;

use super::grid::GridShape;
use super::shape_grid::{SIDES, ShapeGrid, points};
use crate::brush::BrushError;
use crate::ground::MaterialId;
use crate::lattice::ONE;

/// Steps of the lattice of vertices in a cell.
const FINE: i64 = 4096;

/// Cells around the mesh on every side.
const MARGIN: u32 = 2;

/// Cells around a triangle in which distances are exact.
const NEAR: f64 = 2.0;

/// The grid of a mesh, and where it lies.
#[derive(Clone, Debug)]
pub struct MeshGrid {
    /// The distances.
    pub grid: ShapeGrid,
    /// The middle of the grid, in the space of the mesh.
    pub middle: Vec3,
    /// Side of a cell, in units of the mesh: the [scale](super::GridShape::scale) at which a unit is a voxel.
    pub cell: f32,
}

impl MeshGrid {
    /// The shape that the mesh has after every point p of it moved to `rotation * (p * scale) + place`. In metres, as
    /// in a message, a scale of 1 makes a unit of the mesh a metre; in voxels, a voxel.
    pub fn placed(&self, place: Vec3, rotation: Quat, scale: f32) -> GridShape {
        GridShape::new(self.grid.clone(), place + rotation * (self.middle * scale))
            .with_rotation(rotation)
            .with_scale(self.cell * scale)
    }
}

impl ShapeGrid {
    /// The grid of a closed mesh, with this many samples along its longest side: 8 to 128.
    ///
    /// Points are inside where the mesh's winding number is not 0, so parts may overlap if they face the same way; a
    /// part inside another that faces the other way is a hole. Vertices with equal positions count as one. Distances
    /// are exact within two cells of the surface, and roughly right beyond.
    ///
    /// ```
    /// use bevy_burrow::prelude::*;
    /// use glam::{Quat, Vec3};
    ///
    /// // A tetrahedron.
    /// let corners = [Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 9.0, Vec3::Z * 9.0];
    /// let mesh = ShapeGrid::from_mesh(&corners, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], 24)?;
    /// let shape = mesh.placed(Vec3::splat(20.0), Quat::from_rotation_y(0.5), 1.0);
    /// assert!(Brush::dig(shape).voxel_count()? > 30);
    /// # Ok::<(), BrushError>(())
    /// ```
    ///
    /// # Errors
    /// [`BrushError::OpenMesh`] if an edge has not as many triangles on the one side as on the other,
    /// [`BrushError::NoTriangles`], [`BrushError::NotFinite`], or [`BrushError::GridSize`].
    pub fn from_mesh(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        samples: u32,
    ) -> Result<MeshGrid, BrushError> {
        Self::of_mesh(positions, triangles, samples).map(|(mesh, _)| mesh)
    }

    /// The grid of a closed mesh like [`from_mesh`](Self::from_mesh), with a material for each triangle: a sample has
    /// that of the triangle nearest to it. A [fill](crate::brush::Brush::fill) builds with them.
    ///
    /// # Errors
    /// Those of `from_mesh`, and [`BrushError::MeshMaterials`] if there are not as many materials as triangles.
    pub fn from_painted_mesh(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        materials: &[MaterialId],
        samples: u32,
    ) -> Result<MeshGrid, BrushError> {
        if materials.len() != triangles.len() {
            let (materials, triangles) = (materials.len(), triangles.len());
            return Err(BrushError::MeshMaterials { materials, triangles });
        }
        let (MeshGrid { grid, middle, cell }, nearest) = Self::of_mesh(positions, triangles, samples)?;
        let mut nearest = nearest.into_iter();
        // In the order of the samples.
        let mut material = |_| nearest.next().and_then(|triangle| materials.get(triangle as usize).copied());
        let grid = grid.with_materials(|at| material(at).unwrap_or(MaterialId::GROUND));
        Ok(MeshGrid { grid, middle, cell })
    }

    /// The grid of a mesh, and the triangle nearest to each sample.
    fn of_mesh(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        samples: u32,
    ) -> Result<(MeshGrid, Vec<u32>), BrushError> {
        let least = 2 * MARGIN + 4;
        if !(least..=SIDES.1).contains(&samples) {
            return Err(BrushError::GridSize { size: [samples; 3], least, most: SIDES.1 });
        }
        let (mut low, mut high) = (Vec3::splat(f32::MAX), Vec3::splat(f32::MIN));
        for corner in triangles.iter().flatten() {
            let Some(&at) = positions.get(*corner as usize) else { return Err(BrushError::NoTriangles) };
            if let Some(value) = at.to_array().into_iter().find(|value| !value.is_finite()) {
                return Err(BrushError::NotFinite { what: "positions", value });
            }
            (low, high) = (low.min(at), high.max(at));
        }
        let cell = (high - low).max_element() / (samples - 1 - 2 * MARGIN) as f32;
        let middle = low.midpoint(high);
        if !(cell.is_normal() && cell > 0.0 && middle.is_finite()) {
            return Err(BrushError::NoTriangles);
        }
        let size = ((high - low) / cell).ceil().as_uvec3() + 1 + 2 * MARGIN;
        let size = size.clamp(UVec3::splat(SIDES.0), UVec3::splat(samples));
        let corner = middle.as_dvec3() - (size.as_dvec3() - 1.0) / 2.0 * f64::from(cell);
        let fine = |at: Vec3| ((at.as_dvec3() - corner) / f64::from(cell) * FINE as f64).round().as_i64vec3();
        let (numbers, triangles): (Vec<u32>, Vec<[I64Vec3; 3]>) = (0..)
            .zip(triangles)
            .map(|(number, corners)| (number, corners.map(|corner| fine(positions[corner as usize]))))
            .filter(|(_, [a, b, c])| a != b && b != c && c != a)
            .unzip();
        if triangles.is_empty() {
            return Err(BrushError::NoTriangles);
        }
        check_closed(&triangles)?;
        let winding = winding_numbers(size, &triangles);
        let distances = distances(size, &triangles);
        let is_inside = |index: usize| winding.get(index).is_some_and(|own| *own != 0);
        let [row, layer] = [size.x as usize, (size.x * size.y) as usize];
        let signed: Vec<i32> = distances
            .iter()
            .enumerate()
            .map(|(index, (distance, _))| {
                let distance = (distance * f32::from(ONE as i16)).round_ties_even() as i32;
                // Where parts overlap, a face of the one may lie inside the other.
                let is_within = [1, row, layer]
                    .iter()
                    .all(|step| is_inside(index + step) && index >= *step && is_inside(index - step));
                match (is_inside(index), is_within) {
                    (false, _) => distance.max(1),
                    (true, false) => -distance.max(1),
                    (true, true) => -distance.max(ONE / 2),
                }
            })
            .collect();
        let nearest = distances
            .iter()
            .map(|(_, triangle)| numbers.get(*triangle as usize).copied().unwrap_or(u32::MAX))
            .collect();
        Ok((MeshGrid { grid: Self::of(size, &signed)?, middle, cell }, nearest))
    }
}

#[cfg(feature = "plugin")]
impl ShapeGrid {
    /// The grid of a closed [`Mesh`](bevy::mesh::Mesh), of a scene of glTF for example: see
    /// [`from_mesh`](Self::from_mesh).
    ///
    /// # Errors
    /// Those of `from_mesh`.
    pub fn from_bevy_mesh(mesh: &bevy::mesh::Mesh, samples: u32) -> Result<MeshGrid, BrushError> {
        let triangles = mesh.triangles().map_err(|_| BrushError::NoTriangles)?;
        let positions: Vec<Vec3> = triangles.flat_map(|triangle| triangle.vertices).collect();
        let corners = (0..positions.len() as u32 / 3).map(|first| [0, 1, 2].map(|corner| 3 * first + corner));
        Self::from_mesh(&positions, &corners.collect::<Vec<_>>(), samples)
    }

    /// The grid of the meshes of a scene, each at its place and of its material: see
    /// [`from_painted_mesh`](Self::from_painted_mesh). Together they have to be closed.
    ///
    /// # Errors
    /// Those of `from_painted_mesh`.
    pub fn from_bevy_meshes<'a>(
        meshes: impl IntoIterator<Item = (&'a bevy::mesh::Mesh, glam::Affine3A, MaterialId)>,
        samples: u32,
    ) -> Result<MeshGrid, BrushError> {
        let (mut positions, mut corners, mut materials) = (Vec::new(), Vec::new(), Vec::new());
        for (mesh, place, material) in meshes {
            // A mirrored mesh would face inwards.
            let order = if place.matrix3.determinant() < 0.0 { [0, 2, 1] } else { [0, 1, 2] };
            for triangle in mesh.triangles().map_err(|_| BrushError::NoTriangles)? {
                let first = positions.len() as u32;
                positions.extend(triangle.vertices.map(|vertex| place.transform_point3(vertex)));
                corners.push(order.map(|corner| first + corner));
                materials.push(material);
            }
        }
        Self::from_painted_mesh(&positions, &corners, &materials, samples)
    }
}

/// Checks that every edge has as many triangles on the one side as on the other.
fn check_closed(triangles: &[[I64Vec3; 3]]) -> Result<(), BrushError> {
    let mut sides: FxHashMap<(I64Vec3, I64Vec3), i32> = FxHashMap::default();
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let is_forward = from.to_array() < to.to_array();
            let edge = if is_forward { (from, to) } else { (to, from) };
            *sides.entry(edge).or_default() += if is_forward { 1 } else { -1 };
        }
    }
    match sides.values().filter(|&&sides| sides != 0).count() {
        0 => Ok(()),
        edges => Err(BrushError::OpenMesh { edges }),
    }
}

/// Twice the area of a triangle as seen along x, positive if its corners turn left; exact.
fn turn(a: I64Vec3, b: I64Vec3, c: [i64; 2]) -> i64 {
    (b.y - a.y) * (c[1] - a.z) - (b.z - a.z) * (c[0] - a.y)
}

/// The winding number of each sample: by rays along x, from the far left to the sample.
fn winding_numbers(size: UVec3, triangles: &[[I64Vec3; 3]]) -> Vec<i32> {
    let size = size.as_i64vec3();
    let mut steps = vec![0; size.element_product() as usize];
    for &[a, b, c] in triangles {
        let area = turn(a, b, [c.y, c.z]);
        // As seen from the left; edge-on triangles are never crossed.
        let (sign, [a, b, c]) = match area.signum() {
            0 => continue,
            1 => (1, [a, b, c]),
            _ => (-1, [a, c, b]),
        };
        let area = area.abs();
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let rows = |low: i64, high: i64, side: i64| {
            (low.div_euclid(FINE).max(0))..=(high.div_euclid(FINE)).min(side - 1)
        };
        for z in rows(low.z, high.z, size.z) {
            for y in rows(low.y, high.y, size.y) {
                let p = [y * FINE, z * FINE];
                // A point on an edge belongs to the triangle on one side of the edge only.
                let inside = |from: I64Vec3, to: I64Vec3| {
                    let side = turn(from, to, p);
                    let owns = to.z > from.z || to.z == from.z && to.y < from.y;
                    (side > 0 || side == 0 && owns).then_some(side)
                };
                let (Some(c_part), Some(a_part), Some(b_part)) = (inside(a, b), inside(b, c), inside(c, a))
                else {
                    continue;
                };
                let sum = |part: i64, x: i64| part as f64 * x as f64;
                let x = (sum(a_part, a.x) + sum(b_part, b.x) + sum(c_part, c.x)) / area as f64;
                let first = (x / FINE as f64).ceil().max(0.0) as i64;
                if first < size.x {
                    steps[((z * size.y + y) * size.x + first) as usize] += sign;
                }
            }
        }
    }
    for row in steps.chunks_mut(size.x as usize) {
        let mut sum = 0;
        row.iter_mut().for_each(|number| {
            sum += *number;
            *number = sum;
        });
    }
    steps
}

/// Distance from a point to a triangle.
fn to_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let normal = ab.cross(ac);
    let to_segment = |from: DVec3, to: DVec3| {
        let way = to - from;
        let t = ((p - from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
        p.distance(from + way * t)
    };
    let is_left = |from: DVec3, to: DVec3| normal.dot((to - from).cross(p - from)) >= 0.0;
    if normal.length_squared() > 0.0 && is_left(a, b) && is_left(b, c) && is_left(c, a) {
        return ap.dot(normal).abs() / normal.length();
    }
    to_segment(a, b).min(to_segment(b, c)).min(to_segment(c, a))
}

/// Distance from each sample to the nearest triangle, in cells, and the number of that triangle.
fn distances(size: UVec3, triangles: &[[I64Vec3; 3]]) -> Vec<(f32, u32)> {
    let side = size.as_ivec3();
    let index = |at: IVec3| ((at.z * side.y + at.y) * side.x + at.x) as usize;
    let mut all = vec![(f32::MAX, u32::MAX); size.element_product() as usize];
    for (number, triangle) in (0..).zip(triangles) {
        let corners = triangle.map(|corner| corner.as_dvec3() / FINE as f64);
        let [a, b, c] = corners;
        let low = (a.min(b).min(c) - NEAR).ceil().as_ivec3().max(IVec3::ZERO);
        let high = (a.max(b).max(c) + NEAR).floor().as_ivec3().min(side - 1);
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let at = IVec3::new(x, y, z);
                    let own = &mut all[index(at)];
                    let distance = to_triangle(at.as_dvec3(), corners) as f32;
                    if distance < own.0 {
                        *own = (distance, number);
                    }
                }
            }
        }
    }
    // Farther ones by steps from neighbour to neighbour: once up, and once down.
    let steps: Vec<(IVec3, f32)> = (-1..=1)
        .flat_map(|z| (-1..=1).flat_map(move |y| (-1..=1).map(move |x| IVec3::new(x, y, z))))
        .filter(|step| (step.z, step.y, step.x) < (0, 0, 0))
        .map(|step| (step, step.as_vec3().length()))
        .collect();
    let mut pass = |at: IVec3, way: i32| {
        let own = all[index(at)];
        let near = steps.iter().filter_map(|&(step, length)| {
            let other = at + step * way;
            let is_there = other.cmpge(IVec3::ZERO).all() && other.cmplt(side).all();
            is_there.then(|| (all[index(other)].0 + length, all[index(other)].1))
        });
        all[index(at)] = near.fold(own, |least, other| if other.0 < least.0 { other } else { least });
    };
    points(size).for_each(|at| pass(at, 1));
    points(size).for_each(|at| pass(side - 1 - at, -1));
    all
}

#[cfg(all(test, feature = "plugin"))]
mod tests {
    use bevy::math::primitives::{Cuboid, Sphere};
    use bevy::mesh::{Mesh, Meshable};

    use super::*;

    #[test]
    fn meshes_of_bevy_become_grids() {
        // Both have their seams' vertices twice.
        for (mesh, radius) in
            [(Sphere::new(3.0).mesh().uv(24, 16), 3.0), (Mesh::from(Cuboid::from_length(6.0)), 3.0)]
        {
            let MeshGrid { grid, middle, cell } = ShapeGrid::from_bevy_mesh(&mesh, 40).expect("closed");
            assert!(middle.length() < 1e-3);
            let center = (grid.size().as_ivec3() - 1) / 2;
            let right = (radius / cell) as i32;
            assert!(grid.distance(center + IVec3::X * (right - 1)) < 0);
            assert!(grid.distance(center + IVec3::X * (right + 2)) > 0);
        }
        let lines =
            Mesh::new(bevy::mesh::PrimitiveTopology::LineList, bevy::asset::RenderAssetUsages::default());
        assert_eq!(ShapeGrid::from_bevy_mesh(&lines, 40).map(|_| ()), Err(BrushError::NoTriangles));
    }
}
