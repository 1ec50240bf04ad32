//! mcubes: marching cubes with unit normals and three new vertices per triangle, in newly allocated vectors.
//!
//! The crate walks z innermost over samples whose x varies fastest. Triangles of what it calls the inside of a mesh are
//! counter-clockwise seen from the air.

use mcubes::{MarchingCubes as Peer, Mesh as PeerMesh, MeshSide};

use crate::contender::{Class, Contender, Mesh, Part, Shading, Sharing};
use crate::fields::Grid;

/// The mesher with its samples, once loaded, and its last mesh.
#[derive(Default)]
pub struct MarchingCubes {
    loaded: Option<Peer>,
    mesh: Option<PeerMesh>,
}

impl Contender for MarchingCubes {
    fn name(&self) -> &'static str {
        "mcubes 0.1.7"
    }

    fn class(&self) -> Class {
        Class { shading: Shading::Unit, sharing: Sharing::TriangleSoup, dual: false }
    }

    fn load(&mut self, grid: &Grid) {
        // The crate's normals point from large values to small ones, so solid samples have to be large.
        let samples = grid.samples.iter().map(|sample| -sample).collect();
        let side = grid.size as f32;
        let peer = Peer::new(
            (grid.size, grid.size, grid.size),
            (side, side, side),
            (side, side, side),
            [0.0; 3].into(),
            samples,
            0.0,
        );
        self.loaded = Some(peer.expect("the sides match the number of samples"));
    }

    fn mesh(&mut self, _grid: &Grid, part: Part) {
        assert_eq!(part, Part::Whole, "mcubes only meshes whole grids");
        self.mesh = self.loaded.as_ref().map(|peer| peer.generate(MeshSide::InsideOnly));
    }

    fn triangles(&self) -> usize {
        self.mesh.as_ref().map_or(0, |mesh| mesh.indices.len() / 3)
    }

    fn result(&self) -> Mesh {
        let vertices = self.mesh.as_ref().map_or(&[][..], |mesh| &mesh.vertices);
        let indices = self.mesh.as_ref().map_or(&[][..], |mesh| &mesh.indices);
        Mesh {
            positions: vertices.iter().map(|v| [v.posit.x, v.posit.y, v.posit.z]).collect(),
            normals: vertices.iter().map(|v| [v.normal.x, v.normal.y, v.normal.z]).collect(),
            indices: indices.iter().map(|&index| index as u32).collect(),
        }
    }
}
