//! Marching cubes by the book, cell by cell: what the mesher is checked against.

use std::collections::HashMap;

use super::vertices::unit;
use super::{DenseGrid, DenseMesh, Density};
use crate::surface::cases;

/// The triangles of a grid, cell by cell: position and normal of each corner. And how many vertices there are.
pub fn triangles<S: Density>(grid: &DenseGrid<S>) -> (Vec<[([f32; 3], [f32; 3]); 3]>, usize) {
    let [nx, ny, nz] = grid.corners();
    let (mut triangles, mut vertices) = (Vec::new(), HashMap::new());
    for z in 0..nz - 1 {
        for y in 0..ny - 1 {
            for x in 0..nx - 1 {
                let at = |corner: usize| {
                    let [dx, dy, dz] = cases::corner(corner).map(|step| step as usize);
                    [x + dx, y + dy, z + dz]
                };
                let is_solid = |corner: usize| value(grid, at(corner)) < 0.0;
                let case = (0..8).fold(0, |case, corner| case | usize::from(is_solid(corner)) << corner);
                for triangle in cases::table()[case].triangles() {
                    triangles.push(triangle.map(|edge| {
                        let (corner, axis) = cases::edge_corners(edge);
                        *vertices.entry((at(corner), axis)).or_insert_with(|| vertex(grid, at(corner), axis))
                    }));
                }
            }
        }
    }
    (triangles, vertices.len())
}

/// The corners of a mesh's triangles.
pub fn corners(mesh: &DenseMesh) -> Vec<[([f32; 3], [f32; 3]); 3]> {
    let vertex = |&i: &u32| (mesh.positions[i as usize], mesh.normals[i as usize]);
    mesh.indices.chunks_exact(3).map(|t| [vertex(&t[0]), vertex(&t[1]), vertex(&t[2])]).collect()
}

fn value<S: Density>(grid: &DenseGrid<S>, corner: [usize; 3]) -> f32 {
    grid.samples()[grid.index(corner)].value()
}

fn vertex<S: Density>(grid: &DenseGrid<S>, p: [usize; 3], axis: usize) -> ([f32; 3], [f32; 3]) {
    let mut q = p;
    q[axis] += 1;
    let (a, b) = (value(grid, p), value(grid, q));
    let mut t = a / (a - b);
    if !(0.0..=1.0).contains(&t) {
        t = 0.5;
    }
    let mut position = p.map(|v| v as f32 + grid.apron() as f32);
    position[axis] += t;
    let (a, b) = (gradient(grid, p), gradient(grid, q));
    (position, unit([0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * t)))
}

/// Central differences over two voxels; without an apron, at the rim twice the one-sided ones.
fn gradient<S: Density>(grid: &DenseGrid<S>, corner: [usize; 3]) -> [f32; 3] {
    let strides = grid.strides();
    let at = grid.index(corner);
    let sample = |index: usize| grid.samples()[index].value();
    [0, 1, 2].map(|axis| {
        let (is_first, is_last) = (corner[axis] == 0, corner[axis] + 1 == grid.corners()[axis]);
        match (grid.apron(), is_first, is_last) {
            (0, true, _) => (sample(at + strides[axis]) - sample(at)) * 2.0,
            (0, _, true) => (sample(at) - sample(at - strides[axis])) * 2.0,
            _ => sample(at + strides[axis]) - sample(at - strides[axis]),
        }
    })
}
