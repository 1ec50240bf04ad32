//! Marching cubes over a plain dense grid, for whoever has one: shared vertices, unit normals if wanted.
//!
//! ```
//! use bevy_burrow::surface::dense::{DenseGrid, DenseMesh, DenseMesher, Normals};
//!
//! // A ball of radius 3 in the middle of 10x10x10 samples: negative is solid.
//! let samples: Vec<f32> = (0..1000)
//!     .map(|i| {
//!         let [x, y, z] = [i % 10, i / 10 % 10, i / 100].map(|v| v as f32 - 4.5);
//!         (x * x + y * y + z * z).sqrt() - 3.0
//!     })
//!     .collect();
//! let grid = DenseGrid::new(&samples, [10, 10, 10])?;
//!
//! let (mut mesher, mut mesh) = (DenseMesher::new(), DenseMesh::default());
//! mesher.mesh(grid, Normals::Gradient, &mut mesh);
//! assert_eq!(mesh.positions.len() + mesh.indices.len() / 3, 2 + mesh.indices.len() / 2); // closed: V + F = 2 + E
//! # Ok::<(), bevy_burrow::surface::dense::DenseGridError>(())
//! ```
//!
//! # How it works
//!
//! The grid is taken slice by slice along z, and only what a slice and the next need is kept:
//!
//! 1. [`signs`]: the sign of every sample, 64 of a row in one word.
//! 2. [`edges`]: words that differ tell the lattice edges that are crossed. They are listed by axis, in row order.
//! 3. [`vertices`]: the lists become vertices, eight at a time.
//! 4. [`triangles`]: lists are in row order, so the numbers of a cube's vertices are running counts, which go on by what
//!    each cube's case says; no vertex is ever looked up.

mod edges;
mod grid;
#[cfg(test)]
mod plain;
mod signs;
#[cfg(test)]
mod tests;
mod triangles;
mod vertices;

pub use grid::{DenseGrid, DenseGridError, Density};

use edges::Edges;
use signs::Signs;
use triangles::Room;

/// An indexed triangle mesh; triangles are counter-clockwise seen from the air.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DenseMesh {
    /// One for each lattice edge that the surface crosses, in voxels from sample (0, 0, 0).
    pub positions: Vec<[f32; 3]>,
    /// Unit normals towards the air, one for each position; empty if not wanted.
    pub normals: Vec<[f32; 3]>,
    /// Three for each triangle.
    pub indices: Vec<u32>,
}

/// Are normals wanted?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normals {
    /// Positions only.
    None,
    /// From central differences of the samples, linear along the crossed edge. At the rim of a grid without an apron the
    /// differences are one-sided.
    Gradient,
}

/// Meshes dense grids; keeps its working memory from one call to the next.
#[derive(Debug, Default)]
pub struct DenseMesher {
    signs: Signs,
    edges: Edges,
    room: Room,
}

impl DenseMesher {
    /// A mesher without memory; the first call gets what it needs.
    pub fn new() -> Self {
        Self::default()
    }

    /// Meshes a grid by marching cubes, in place of what `out` held. A second call on a grid that is no larger and no
    /// richer takes no memory.
    ///
    /// Samples below 0 are solid, all others air; NaN is air, and so is -0. Whatever the samples are, positions lie in the
    /// grid and normals have length 1.
    pub fn mesh<S: Density>(&mut self, grid: DenseGrid<S>, normals: Normals, out: &mut DenseMesh) {
        self.signs.begin(&grid);
        self.edges.begin(&grid);
        out.positions.clear();
        out.normals.clear();
        out.indices.clear();
        let last = grid.corners()[2] - 1;
        self.signs.read(&grid, 0);
        for z in 0..=last {
            if z < last {
                self.signs.read(&grid, z + 1);
            }
            self.edges.list(&self.signs, z, z == last, out.positions.len());
            vertices::make(&grid, z, &self.edges, normals, out);
            if z > 0 {
                triangles::make(&self.signs, &self.edges, z - 1, &mut self.room, &mut out.indices);
            }
        }
    }
}
