//! The dense mesher of bevy_burrow.

use bevy_burrow::dense::{DenseGrid, DenseMesh, DenseMesher, Density, Normals};

use crate::contender::{Class, Contender, Mesh, Part, Shading, Sharing};
use crate::fields::Grid;

/// The contender with which all others are compared.
pub const REFERENCE: &str = "burrow dense f32";
/// The reference without normals.
pub const REFERENCE_BARE: &str = "burrow dense f32, bare";

/// Ours with unit normals.
pub fn with_normals() -> Vec<Box<dyn Contender>> {
    vec![
        Box::new(Dense::<f32>::new(REFERENCE, Normals::Gradient)),
        Box::new(Dense::<i16>::new("burrow dense i16", Normals::Gradient)),
    ]
}

/// Ours without normals.
pub fn without_normals() -> Vec<Box<dyn Contender>> {
    vec![
        Box::new(Dense::<f32>::new(REFERENCE_BARE, Normals::None)),
        Box::new(Dense::<i16>::new("burrow dense i16, bare", Normals::None)),
    ]
}

/// The dense mesher for one sample type.
struct Dense<S> {
    name: &'static str,
    normals: Normals,
    mesher: DenseMesher,
    mesh: DenseMesh,
    samples: fn(&Grid) -> &[S],
}

impl Dense<f32> {
    fn new(name: &'static str, normals: Normals) -> Self {
        Self {
            name,
            normals,
            mesher: DenseMesher::new(),
            mesh: DenseMesh::default(),
            samples: |grid| &grid.samples,
        }
    }
}

impl Dense<i16> {
    fn new(name: &'static str, normals: Normals) -> Self {
        Self {
            name,
            normals,
            mesher: DenseMesher::new(),
            mesh: DenseMesh::default(),
            samples: |grid| &grid.fixed,
        }
    }
}

impl<S: Density> Contender for Dense<S> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn class(&self) -> Class {
        let shading = match self.normals {
            Normals::None => Shading::None,
            Normals::Gradient => Shading::Unit,
        };
        Class { shading, sharing: Sharing::Shared, dual: false }
    }

    fn mesh(&mut self, grid: &Grid, part: Part) {
        let samples = (self.samples)(grid);
        let dense = match part {
            Part::Whole => DenseGrid::new(samples, grid.sides()),
            Part::WithinApron => DenseGrid::with_apron(samples, grid.sides()),
        };
        self.mesher.mesh(dense.expect("the sides match the number of samples"), self.normals, &mut self.mesh);
    }

    fn triangles(&self) -> usize {
        self.mesh.indices.len() / 3
    }

    fn result(&self) -> Mesh {
        let DenseMesh { positions, normals, indices } = &self.mesh;
        Mesh { positions: positions.clone(), normals: normals.clone(), indices: indices.clone() }
    }
}
