//! transvoxel without transition sides: marching cubes with shared vertices and unit normals, which cannot be turned
//! off.
//!
//! The crate walks z innermost, so its axes are swapped here: its z is the grid's x, and both read memory in order.
//! Samples are read through a custom block type and written through a custom mesh builder, as its documentation
//! advises; its built-in ones copy the samples and start with empty vectors.

use transvoxel::prelude::*;
use transvoxel::structs::grid_point::GridPoint;
use transvoxel::structs::vertex_index::VertexIndex;
use transvoxel::structs::voxel_index::VoxelIndex;
use transvoxel::traits::mesh_builder::MeshBuilder;
use transvoxel::traits::voxel_block::VoxelBlock;
use transvoxel::traits::voxel_data::Density;

use crate::contender::{Class, Contender, Mesh, Part, Shading, Sharing};
use crate::fields::Grid;

/// The peer and its buffers.
#[derive(Default)]
pub struct Transvoxel {
    buffers: Buffers,
}

/// The buffers to which it appends vertices and triangles.
#[derive(Default)]
struct Buffers {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    indices: Vec<u32>,
}

impl MeshBuilder<f32, f32> for &mut Buffers {
    fn add_vertex_between(
        &mut self,
        a: GridPoint<f32, f32>,
        b: GridPoint<f32, f32>,
        to_b: f32,
    ) -> VertexIndex {
        let between = |a: f32, b: f32| a + to_b * (b - a);
        let [x, y, z] = [
            between(a.position.x, b.position.x),
            between(a.position.y, b.position.y),
            between(a.position.z, b.position.z),
        ];
        let [nx, ny, nz] = f32::gradients_to_normal(
            between(a.gradient.0, b.gradient.0),
            between(a.gradient.1, b.gradient.1),
            between(a.gradient.2, b.gradient.2),
        );
        self.positions.push([z, y, x]);
        self.normals.push([nz, ny, nx]);
        VertexIndex(self.positions.len() - 1)
    }

    fn add_triangle(&mut self, a: VertexIndex, b: VertexIndex, c: VertexIndex) {
        // Swapping axes mirrors the mesh, so the winding is reversed.
        self.indices.extend([a.0 as u32, c.0 as u32, b.0 as u32]);
    }
}

/// Samples as the crate expects them: positive is solid. Beyond the border the outermost sample is repeated.
struct Samples<'a> {
    block: Block<f32>,
    samples: &'a [f32],
}

impl VoxelBlock<f32, f32> for Samples<'_> {
    fn block(&self) -> &Block<f32> {
        &self.block
    }

    fn get(&self, VoxelIndex { x, y, z }: VoxelIndex) -> f32 {
        let last = self.block.subdivisions as isize;
        let [x, y, z] = [x, y, z].map(|at| at.clamp(0, last) as usize);
        let side = self.block.subdivisions + 1;
        -self.samples[(x * side + y) * side + z]
    }
}

impl Contender for Transvoxel {
    fn name(&self) -> &'static str {
        "transvoxel 2.0.0"
    }

    fn class(&self) -> Class {
        Class { shading: Shading::Unit, sharing: Sharing::Shared, dual: false }
    }

    fn mesh(&mut self, grid: &Grid, part: Part) {
        assert_eq!(part, Part::Whole, "transvoxel only meshes whole grids");
        let cells = grid.size - 1;
        let samples = Samples { block: Block::new([0.0; 3], cells as f32, cells), samples: &grid.samples };
        self.buffers.positions.clear();
        self.buffers.normals.clear();
        self.buffers.indices.clear();
        type View<'a> = BlockStarView<f32, f32, Samples<'a>, Samples<'a>>;
        extract(&View::new_simple(samples), 0.0, &mut self.buffers);
    }

    fn triangles(&self) -> usize {
        self.buffers.indices.len() / 3
    }

    fn result(&self) -> Mesh {
        let Buffers { positions, normals, indices } = &self.buffers;
        Mesh { positions: positions.clone(), normals: normals.clone(), indices: indices.clone() }
    }
}
