//! Marching cubes over a plain dense grid: shared vertices, and unit normals if they are wanted.
//!
//! For fields that are stored as one array: imported volumes, simulations, chunks of a game that keeps its own samples.
//! The terrain's own blocks are meshed by `surface::block`, which follows edits, materials and seams.
//!
//! Samples below zero are solid. Triangles are counter-clockwise seen from the air, and the case table is the one in
//! `surface::cases`: a surface that stays away from the grid's border is closed.
//!
//! ```
//! use bevy_burrow::dense::{DenseGrid, DenseMesh, DenseMesher, Normals};
//!
//! let size = [16; 3];
//! let mut samples = Vec::new();
//! for z in 0..16 {
//!     for y in 0..16 {
//!         for x in 0..16 {
//!             let [x, y, z] = [x, y, z].map(|step| step as f32 - 7.5);
//!             samples.push((x * x + y * y + z * z).sqrt() - 5.0);
//!         }
//!     }
//! }
//! let mut mesher = DenseMesher::new();
//! let mut mesh = DenseMesh::default();
//! mesher.mesh(DenseGrid::new(&samples, size)?, Normals::Gradient, &mut mesh);
//! // A sphere: vertices - edges + faces = 2, and each triangle has three halves of edges.
//! let triangles = mesh.indices.len() / 3;
//! assert_eq!(mesh.positions.len() + triangles - triangles * 3 / 2, 2);
//! # Ok::<(), bevy_burrow::dense::DenseGridError>(())
//! ```
//!
//! # How it works
//!
//! Four passes, each over flat arrays, so that none of them waits for the others' branches:
//!
//! 1. `signs`: each layer of samples becomes bits.
//! 2. `cells`: bits of four rows become a stream of crossed cells, and three lists of the edges that they start.
//! 3. `vertices`: each list becomes vertices, four at a time.
//! 4. `triangles`: the stream becomes indices; vertices are found by counting.
//!
//! It follows *Flying Edges: A High-Performance Scalable Isocontouring Algorithm* (Schroeder, Maynard, Geveci 2015) in
//! that each edge is interpolated once, in row order, and that vertices are numbered by counting along rows.

mod cells;
mod density;
mod grid;
mod signs;
#[cfg(test)]
mod simple;
mod stream;
#[cfg(test)]
mod tests;
mod triangles;
mod vertices;

use cells::{Cells, Point};
pub use density::Density;
pub use grid::{DenseGrid, DenseGridError};
use signs::Signs;
use stream::Stream;

/// A triangle mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DenseMesh {
    /// Vertices, in voxels from sample (0, 0, 0), the apron included. One for each lattice edge that the surface
    /// crosses, in its middle where the difference between its two samples is not finite.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals towards the air, one for each vertex; empty with [`Normals::None`].
    pub normals: Vec<[f32; 3]>,
    /// Three for each triangle, counter-clockwise seen from the air.
    pub indices: Vec<u32>,
}

/// Kind of normals of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normals {
    /// None.
    None,
    /// The gradient of the densities, by central differences, linear between the two samples of an edge, of length 1.
    /// It points up where the densities have no finite gradient.
    #[default]
    Gradient,
}

/// Meshes dense grids, and keeps its memory from one to the next.
///
/// The first grids make it allocate. Nothing is allocated for a grid with no longer sides, no more crossed cells and no
/// more vertices and triangles than one before, if the mesh is reused as well. It takes some 34 bytes for each cell of
/// a layer in z, crossed or not: of a flat grid, a long side should lie along z.
#[derive(Debug, Default)]
pub struct DenseMesher {
    low: Signs,
    high: Signs,
    cells: Cells,
}

impl DenseMesher {
    /// A mesher without any memory yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Meshes a grid. What `out` held is replaced, its memory is used again.
    ///
    /// Equal samples give equal bits on every machine.
    pub fn mesh<S: Density>(&mut self, grid: DenseGrid<S>, normals: Normals, out: &mut DenseMesh) {
        let depth = grid.meshed()[2];
        self.cells.start(&grid);
        let mut vertices = 0;
        let mut numbered_layers = 0;
        self.low.read(&grid, 0);
        for z in 0..depth {
            let is_last = z + 1 == depth;
            if is_last {
                self.cells.add_layer(&grid, z, &self.low, &self.low);
            } else {
                self.high.read(&grid, z + 1);
                self.cells.add_layer(&grid, z, &self.low, &self.high);
                std::mem::swap(&mut self.low, &mut self.high);
            }
            if is_last || self.cells.is_full() {
                match normals {
                    Normals::None => {
                        self.add_vertices::<S, false>(&grid, numbered_layers, &mut vertices, out)
                    }
                    Normals::Gradient => {
                        self.add_vertices::<S, true>(&grid, numbered_layers, &mut vertices, out)
                    }
                }
                numbered_layers = z + 1;
            }
        }
        out.positions.truncate(vertices);
        out.normals.truncate(if normals == Normals::None { 0 } else { vertices });
        triangles::mesh(&self.cells, &mut out.indices);
    }

    /// Appends the vertex of every listed edge to the `vertices` that exist, and stores in the layers from
    /// `first_layer` on where their vertices begin.
    fn add_vertices<S: Density, const NORMALS: bool>(
        &mut self,
        grid: &DenseGrid<S>,
        first_layer: usize,
        vertices: &mut usize,
        out: &mut DenseMesh,
    ) {
        let room = *vertices + self.cells.pending() + vertices::SLACK;
        if out.positions.len() < room {
            out.positions.resize(room, [0.0; 3]);
        }
        if NORMALS && out.normals.len() < room {
            out.normals.resize(room, [0.0; 3]);
        }
        let [x, y, z] = &mut self.cells.edges;
        let mut add = |edges: &mut Stream<Point>, mesh: MeshEdges<S>| {
            let first = *vertices;
            let normals = if NORMALS { &mut out.normals[first..] } else { &mut [] };
            mesh(grid, edges.in_groups_of(vertices::LANES), &mut out.positions[first..], normals);
            *vertices += edges.len();
            edges.clear();
            first as u32
        };
        let bases = [
            add(x, vertices::mesh::<S, 0, NORMALS>),
            add(y, vertices::mesh::<S, 1, NORMALS>),
            add(z, vertices::mesh::<S, 2, NORMALS>),
        ];
        for layer in &mut self.cells.layers[first_layer..] {
            layer.shift(bases);
        }
    }
}

/// One of the three instances of [`vertices::mesh`].
type MeshEdges<S> = fn(&DenseGrid<S>, &[Point], &mut [[f32; 3]], &mut [[f32; 3]]);
