//! isosurface: marching cubes without normals; most vertices are shared.
//!
//! It supports normals only if the caller's source computes them at arbitrary points, which samples alone cannot.

use isosurface::marching_cubes::MarchingCubes as Peer;
use isosurface::source::Source;

use crate::contender::{Class, Contender, Mesh, Part, Shading, Sharing};
use crate::fields::Grid;

/// The peer and its buffers.
#[derive(Default)]
pub struct MarchingCubes {
    peer: Option<Peer>,
    vertices: Vec<f32>,
    indices: Vec<u32>,
    size: usize,
}

/// Samples as a function of space: the crate queries lattice points only, but in units of the whole grid.
struct Samples<'a> {
    samples: &'a [f32],
    side: usize,
    cells: f32,
}

impl Source for Samples<'_> {
    fn sample(&self, x: f32, y: f32, z: f32) -> f32 {
        // The crate queries one layer too many at the end of z.
        let [x, y, z] = [x, y, z].map(|at| ((at * self.cells + 0.5) as usize).min(self.side - 1));
        self.samples[(z * self.side + y) * self.side + x]
    }
}

impl Contender for MarchingCubes {
    fn name(&self) -> &'static str {
        "isosurface 0.0.4"
    }

    fn class(&self) -> Class {
        Class { shading: Shading::None, sharing: Sharing::Partly, dual: false }
    }

    fn load(&mut self, grid: &Grid) {
        if self.size != grid.size {
            self.size = grid.size;
            self.peer = Some(Peer::new(grid.size));
        }
    }

    fn mesh(&mut self, grid: &Grid, part: Part) {
        assert_eq!(part, Part::Whole, "isosurface only meshes whole grids");
        self.vertices.clear();
        self.indices.clear();
        let source = Samples { samples: &grid.samples, side: grid.size, cells: (grid.size - 1) as f32 };
        if let Some(peer) = &mut self.peer {
            peer.extract(&source, &mut self.vertices, &mut self.indices);
        }
    }

    fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    fn result(&self) -> Mesh {
        let cells = (self.size - 1) as f32;
        let positions = self.vertices.chunks_exact(3).map(|v| [v[0] * cells, v[1] * cells, v[2] * cells]);
        // The crate's triangles are clockwise.
        let indices = self.indices.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]);
        Mesh { positions: positions.collect(), normals: Vec::new(), indices: indices.collect() }
    }
}
