//! The interface of the compared meshers, and the class that describes their meshes.

use serde::Serialize;

use crate::fields::Grid;

/// Normals in a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shading {
    /// Unit normals.
    Unit,
    /// Gradients that a shader has to normalise.
    Gradients,
    /// None.
    None,
}

/// Whether triangles share vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Sharing {
    /// One vertex per place.
    Shared,
    /// Some places have several vertices.
    Partly,
    /// Three vertices per triangle.
    TriangleSoup,
}

/// The contents of a contender's meshes. Only contenders of the same class are compared.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Class {
    /// Normals of the meshes.
    pub shading: Shading,
    /// Whether triangles share vertices.
    pub sharing: Sharing,
    /// One vertex per cell and quads between them (dual), instead of one vertex per crossed edge.
    pub dual: bool,
}

/// A mesh in lattice coordinates, for the checks; triangles are counter-clockwise seen from the air.
pub struct Mesh {
    /// A position per vertex.
    pub positions: Vec<[f32; 3]>,
    /// A normal per vertex, or empty.
    pub normals: Vec<[f32; 3]>,
    /// Three indices per triangle.
    pub indices: Vec<u32>,
}

/// The part of a grid that is meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Every cell.
    Whole,
    /// The cells of a chunk: the outermost samples are only used for gradients.
    WithinApron,
}

/// A mesher with its reusable buffers.
pub trait Contender {
    /// Name and version.
    fn name(&self) -> &'static str;
    /// The content of its meshes.
    fn class(&self) -> Class;
    /// Copies the grid if the mesher needs its own copy. Not timed.
    fn load(&mut self, _grid: &Grid) {}
    /// Meshes a grid; this is timed.
    fn mesh(&mut self, grid: &Grid, part: Part);
    /// The number of triangles of the last mesh.
    fn triangles(&self) -> usize;
    /// The last mesh.
    fn result(&self) -> Mesh;
}
