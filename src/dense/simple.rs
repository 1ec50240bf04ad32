//! The same mesh, cell by cell, as plainly as it can be said: what the fast mesher is tested against.

use std::collections::HashMap;

use super::{DenseGrid, DenseMesh, Density, Normals};
use crate::surface::cases;

/// Meshes a grid. Vertices are in another order than the fast mesher's.
pub(super) fn mesh<S: Density>(grid: DenseGrid<S>, normals: Normals) -> DenseMesh {
    let mut mesh = DenseMesh::default();
    let mut numbers = HashMap::new();
    let [width, height, depth] = grid.meshed().map(|samples| grid.first()..grid.first() + samples - 1);
    for z in depth {
        for y in height.clone() {
            for x in width.clone() {
                let corner = |index| {
                    let [i, j, k] = cases::corner(index).map(|step| step as usize);
                    [x + i, y + j, z + k]
                };
                let case: usize = (0..8).map(|i| usize::from(sample(grid, corner(i)) < 0.0) << i).sum();
                for edge in cases::table()[case].triangles().flatten() {
                    let (low, axis) = cases::edge_corners(edge);
                    let number = *numbers.entry((corner(low), axis)).or_insert_with(|| {
                        add_vertex(grid, corner(low), axis, normals, &mut mesh);
                        mesh.positions.len() as u32 - 1
                    });
                    mesh.indices.push(number);
                }
            }
        }
    }
    mesh
}

fn sample<S: Density>(grid: DenseGrid<S>, [x, y, z]: [usize; 3]) -> f32 {
    let [width, height, _] = grid.size();
    grid.samples()[x + width * (y + height * z)].number()
}

fn add_vertex<S: Density>(
    grid: DenseGrid<S>,
    start: [usize; 3],
    axis: usize,
    normals: Normals,
    mesh: &mut DenseMesh,
) {
    let mut end = start;
    end[axis] += 1;
    let (low, high) = (sample(grid, start), sample(grid, end));
    let difference = low - high;
    let crossing = if difference.is_finite() { low / difference } else { 0.5 };
    let mut position = start.map(|coordinate| coordinate as f32);
    position[axis] += crossing;
    mesh.positions.push(position);
    if normals == Normals::Gradient {
        let (low, high) = (gradient(grid, start), gradient(grid, end));
        mesh.normals.push(unit([0, 1, 2].map(|i| low[i] + (high[i] - low[i]) * crossing)));
    }
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
