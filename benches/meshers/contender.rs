//! What is compared: anything that meshes a grid, and the class that says what its meshes hold.

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

/// Do triangles share vertices?
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Sharing {
    /// One vertex per place.
    Shared,
    /// Some places have several.
    Partly,
    /// Three vertices per triangle.
    TriangleSoup,
}

/// What a contender's meshes hold. Only what holds the same is compared.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Class {
    /// Its normals.
    pub shading: Shading,
    /// Its vertices.
    pub sharing: Sharing,
    /// One vertex per cell, and quads between them, instead of one per crossed edge.
    pub dual: bool,
}

/// A mesh in the form that the checks read, in lattice coordinates, counter-clockwise seen from the air.
pub struct Mesh {
    /// A position per vertex.
    pub positions: Vec<[f32; 3]>,
    /// A normal per vertex, or nothing.
    pub normals: Vec<[f32; 3]>,
    /// Three per triangle.
    pub indices: Vec<u32>,
}

/// Part of a grid that is meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Every cell.
    Whole,
    /// The cells of a chunk: the outermost samples are there for gradients alone.
    WithinApron,
}

/// A mesher with its buffers, which it uses again and again.
pub trait Contender {
    /// Name and version.
    fn name(&self) -> &'static str;
    /// What its meshes hold.
    fn class(&self) -> Class;
    /// Takes a copy of the grid, where it works on nothing else. Not timed.
    fn load(&mut self, _grid: &Grid) {}
    /// Meshes a grid; this is timed.
    fn mesh(&mut self, grid: &Grid, part: Part);
    /// Triangles of the last mesh.
    fn triangles(&self) -> usize;
    /// The last mesh.
    fn result(&self) -> Mesh;
}
