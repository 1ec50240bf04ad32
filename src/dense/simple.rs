//! A simple reference mesher, cell by cell, which the fast mesher is tested against.

use glam::IVec3;

use super::{DenseGrid, DenseMesh, Density, Normals};
use crate::surface::cases;
use crate::surface::plain::CubeMesh;

/// Meshes a grid. Vertices are in another order than the fast mesher's.
pub(super) fn mesh<S: Density>(grid: DenseGrid<S>, normals: Normals) -> DenseMesh {
    let mut mesh = CubeMesh::new();
    let [width, height, depth] = grid.meshed().map(|samples| grid.first()..grid.first() + samples - 1);
    let point = |at: IVec3| at.to_array().map(|coordinate| coordinate as usize);
    for z in depth {
        for y in height.clone() {
            for x in width.clone() {
                let low = IVec3::new(x as i32, y as i32, z as i32);
                let case = cases::case_of(low, |corner| sample(grid, point(corner)) < 0.0);
                mesh.add(low, case, |start, axis| vertex(grid, point(start), axis));
            }
        }
    }
    let (positions, all_normals): (_, Vec<_>) = mesh.vertices.into_iter().unzip();
    let normals = if normals == Normals::None { Vec::new() } else { all_normals };
    DenseMesh { positions, normals, indices: mesh.indices }
}

fn sample<S: Density>(grid: DenseGrid<S>, [x, y, z]: [usize; 3]) -> f32 {
    let [width, height, _] = grid.size();
    grid.samples()[x + width * (y + height * z)].number()
}

/// Position and normal of the vertex on an edge.
fn vertex<S: Density>(grid: DenseGrid<S>, start: [usize; 3], axis: usize) -> ([f32; 3], [f32; 3]) {
    let mut end = start;
    end[axis] += 1;
    let (low, high) = (sample(grid, start), sample(grid, end));
    let difference = low - high;
    let crossing = if difference.is_finite() { low / difference } else { 0.5 };
    let mut position = start.map(|coordinate| coordinate as f32);
    position[axis] += crossing;
    let (low, high) = (gradient(grid, start), gradient(grid, end));
    (position, unit([0, 1, 2].map(|i| low[i] + (high[i] - low[i]) * crossing)))
}

fn gradient<S: Density>(grid: DenseGrid<S>, point: [usize; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| {
        let (mut before, mut behind) = (point, point);
        before[axis] = point[axis].saturating_sub(1);
        behind[axis] = (point[axis] + 1).min(grid.size()[axis] - 1);
        let weight = if behind[axis] - before[axis] == 2 { 1.0 } else { 2.0 };
        (sample(grid, behind) - sample(grid, before)) * weight
    })
}

fn unit(vector: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = vector;
    let squared = x * x + y * y + z * z;
    if (1e-30..=f32::MAX).contains(&squared) {
        let scale = 1.0 / squared.sqrt();
        return [x * scale, y * scale, z * scale];
    }
    let [x, y, z] = vector.map(f64::from);
    let length = (x * x + y * y + z * z).sqrt();
    if length.is_finite() && length > 0.0 {
        [x / length, y / length, z / length].map(|component| component as f32)
    } else {
        [0.0, 1.0, 0.0]
    }
}
