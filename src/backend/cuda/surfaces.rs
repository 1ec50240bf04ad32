//! Surfaces of blocks as the mesh kernel wrote them: whoever draws them takes them from there, with no copy in between.

use std::ops::Range;

use super::layout::MeshResult;
use crate::lattice::{ChunkGrid, SNAP};
use crate::surface::block::Block;
use crate::surface::fresh::{FreshPart, FreshParts, FreshVertices, PackedMixes, PackedVertices};

/// What a launch wrote for some blocks. All lists are those of all blocks together.
pub(super) struct Surfaces<'a> {
    pub grid: ChunkGrid,
    pub blocks: &'a [Block],
    /// Where the surface of each block is.
    pub results: &'a [MeshResult],
    /// From the lowest sample of a block's brick.
    pub positions: &'a [[u16; 4]],
    pub normals: &'a [[f32; 3]],
    pub mixes: PackedMixes<'a>,
    pub indices: &'a [u16],
}

fn range(first: u32, count: u32) -> Range<usize> {
    first as usize..(first as usize).saturating_add(count as usize)
}

impl FreshParts for Surfaces<'_> {
    fn part(&self, number: usize) -> Option<FreshPart<'_>> {
        let (block, result) = (self.blocks.get(number)?, self.results.get(number)?);
        let own = range(result.vertex, result.vertices);
        let vertices = PackedVertices {
            origin: (block.brick.origin() - self.grid.origin(block.chunk)) * SNAP,
            positions: self.positions.get(own.clone())?,
            normals: self.normals.get(own.clone())?,
            mixes: match self.mixes {
                PackedMixes::One(mix) => PackedMixes::One(mix),
                PackedMixes::Each(mixes) => PackedMixes::Each(mixes.get(own)?),
            },
        };
        let indices = self.indices.get(range(result.index, result.indices))?;
        Some(FreshPart { vertices: FreshVertices::Packed(vertices), indices })
    }
}
