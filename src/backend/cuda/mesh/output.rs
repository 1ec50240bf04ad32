//! The output of the mesh kernel, and its transfer to the host.

use std::ops::Range;

use super::super::device::{Device, Fault, Mark};
use super::super::layout::MeshResult;
use super::super::lists::map;
use super::super::staging::OutputList;
use crate::surface::MaterialMix;

/// The output lists of the mesh kernel.
pub(in super::super) struct MeshOutput {
    pub(in super::super) results: OutputList,
    pub(in super::super) lists: MeshLists,
}

/// The surfaces of all blocks.
pub(in super::super) struct MeshLists {
    pub positions: OutputList,
    pub normals: OutputList,
    pub mixes: OutputList,
    pub indices: OutputList,
}

/// Initial capacity in vertices.
const FIRST_VERTICES: usize = 1 << 14;

/// Indices per vertex: a typical surface has two triangles per vertex.
const INDICES: usize = 6;

/// Blocks whose surfaces are copied at a time; few in tests, so that there are several pieces.
pub(in super::super) const PIECE: usize = if cfg!(test) { 150 } else { 1 << 12 };

impl MeshOutput {
    pub fn new(device: &mut dyn Device) -> Result<Self, Fault> {
        Ok(Self {
            results: OutputList::new(device, size_of::<MeshResult>(), 1 << 10)?,
            lists: MeshLists {
                positions: OutputList::new(device, size_of::<[u16; 4]>(), FIRST_VERTICES)?,
                normals: OutputList::new(device, size_of::<[f32; 3]>(), FIRST_VERTICES)?,
                mixes: OutputList::new(device, size_of::<[u8; 8]>(), FIRST_VERTICES)?,
                indices: OutputList::new(device, size_of::<u16>(), FIRST_VERTICES * INDICES)?,
            },
        })
    }

    /// All lists.
    pub fn lists_mut(&mut self) -> [&mut OutputList; 5] {
        let Self { results, lists: MeshLists { positions, normals, mixes, indices } } = self;
        [results, positions, normals, mixes, indices]
    }

    /// For each piece of blocks, the extent of its output and that of all pieces before.
    pub(super) fn extents(&self, blocks: usize) -> Vec<Extent> {
        let of = |results: &&[MeshResult]| results.iter().fold(Extent::default(), Extent::with);
        let pieces: Vec<&[MeshResult]> = self.results.entries::<MeshResult>(blocks).chunks(PIECE).collect();
        let mut extents = map(&pieces, 2, of);
        let mut all = Extent::default();
        extents.iter_mut().for_each(|own| {
            all = all.join(*own);
            *own = all;
        });
        extents
    }
}

impl MeshLists {
    /// Makes room for these numbers of vertices and indices, and returns whether there was too little.
    pub(super) fn reserve(
        &mut self,
        device: &mut dyn Device,
        (vertices, indices): (usize, usize),
        is_long: bool,
    ) -> Result<bool, Fault> {
        let mut grown = false;
        for list in [&mut self.positions, &mut self.normals, &mut self.mixes] {
            grown |= list.reserve(device, vertices, is_long)?;
        }
        grown |= self.indices.reserve(device, indices, is_long)?;
        Ok(grown)
    }

    /// Starts to copy ranges of vertices and indices, unless they were written to host memory.
    fn fetch(
        &mut self,
        device: &mut dyn Device,
        vertices: Range<usize>,
        indices: Range<usize>,
        with_mixes: bool,
    ) -> Result<(), Fault> {
        self.positions.fetch_part(device, vertices.clone())?;
        self.normals.fetch_part(device, vertices.clone())?;
        self.indices.fetch_part(device, indices)?;
        if with_mixes {
            self.mixes.fetch_part(device, vertices)?;
        }
        Ok(())
    }

    /// Starts to copy all surfaces piece by piece, and places a mark after each. Returns no marks if nothing has to
    /// be copied.
    pub(super) fn begin_fetch(
        &mut self,
        device: &mut dyn Device,
        extents: &[Extent],
        with_mixes: bool,
    ) -> Result<Vec<Box<dyn Mark>>, Fault> {
        if self.positions.is_mapped() {
            return Ok(Vec::new());
        }
        let (mut marks, mut before) = (Vec::with_capacity(extents.len()), Extent::default());
        for &own in extents {
            let (vertices, indices) = (before.vertex_end..own.vertex_end, before.index_end..own.index_end);
            self.fetch(device, vertices, indices, with_mixes)?;
            marks.push(device.mark()?);
            before = own;
        }
        Ok(marks)
    }

    pub(super) fn vertex_capacity(&self) -> u32 {
        self.positions.capacity().min(self.normals.capacity()).min(self.mixes.capacity())
    }
}

/// Total size of some blocks' output, and where it ends in the lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Extent {
    vertices: usize,
    indices: usize,
    vertex_end: usize,
    index_end: usize,
}

impl Extent {
    /// Adds one block.
    fn with(self, result: &MeshResult) -> Self {
        let end = |first: u32, count: u32| (first as usize).saturating_add(count as usize);
        self.join(Self {
            vertices: result.vertices as usize,
            indices: result.indices as usize,
            vertex_end: end(result.vertex, result.vertices),
            index_end: end(result.index, result.indices),
        })
    }

    /// The union of both.
    fn join(self, other: Self) -> Self {
        Self {
            vertices: self.vertices + other.vertices,
            indices: self.indices + other.indices,
            vertex_end: self.vertex_end.max(other.vertex_end),
            index_end: self.index_end.max(other.index_end),
        }
    }

    /// Numbers of vertices and indices.
    pub(super) fn totals(self) -> (usize, usize) {
        (self.vertices, self.indices)
    }

    /// Whether everything lies within lists of the total length.
    pub(super) fn is_in_lists(self) -> bool {
        self.vertex_end <= self.vertices && self.index_end <= self.indices
    }
}

/// The outcome of a launch.
pub(in super::super) struct Meshed {
    /// The material mix of all vertices if it is uniform; then no mixes are written.
    pub(in super::super) plain: Option<MaterialMix>,
    /// Marks of the copies in flight, one for each [`PIECE`] of blocks.
    pub(in super::super) marks: Vec<Box<dyn Mark>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_beyond_the_ends_of_lists_are_noticed() {
        let result = |vertex, vertices, index, indices| MeshResult { vertex, vertices, index, indices };
        let extent = |results: &[MeshResult]| results.iter().fold(Extent::default(), Extent::with);
        let whole = [result(5, 4, 0, 6), MeshResult::default(), result(0, 5, 6, 9)];
        assert_eq!(extent(&whole).totals(), (9, 15));
        assert!(extent(&whole).is_in_lists());
        assert!(extent(&[]).is_in_lists());
        for broken in [result(6, 4, 0, 6), result(5, 4, 10, 6), result(u32::MAX, 4, 0, 6)] {
            assert!(!extent(&[broken, whole[2]]).is_in_lists(), "{broken:?}");
        }
    }
}
