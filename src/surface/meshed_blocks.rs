//! The surfaces of the blocks that a transaction has meshed: in [`Parts`], or packed as a GPU writes them. They are
//! unpacked when they are copied into a chunk's mesh.

use super::block::Parts;
use super::mesh::Vertex;
#[cfg(feature = "cuda")]
pub(crate) use super::packed::{PackedMixes, PackedVertices};

/// The surfaces of blocks, by the blocks' numbers.
pub(crate) trait MeshedBlocks: Sync {
    /// Waits until the surfaces of the first `blocks` blocks are ready; returns how many of them are. If these are
    /// fewer, the others will never be ready, and what was made of any surface must be dropped.
    fn wait_for(&self, _blocks: usize) -> usize {
        usize::MAX
    }

    /// Waits for the surface of a block; `None` if there is no such block, or its surface will never be ready.
    fn part(&self, number: usize) -> Option<MeshedBlock<'_>>;
}

/// The surface of one block. It may be empty.
#[derive(Clone, Copy)]
pub(crate) struct MeshedBlock<'a> {
    pub vertices: BlockVertices<'a>,
    /// Three for each triangle, counted within the part.
    pub indices: &'a [u16],
}

/// Vertices, local to a chunk.
#[derive(Clone, Copy)]
pub(crate) enum BlockVertices<'a> {
    Made(&'a [Vertex]),
    #[cfg(feature = "cuda")]
    Packed(PackedVertices<'a>),
}

impl BlockVertices<'_> {
    /// The number of vertices.
    pub fn len(&self) -> usize {
        match self {
            Self::Made(vertices) => vertices.len(),
            #[cfg(feature = "cuda")]
            Self::Packed(packed) => packed.len(),
        }
    }

    /// Returns `true` if they equal these, bit by bit.
    pub fn are_same(&self, others: &[Vertex]) -> bool {
        self.len() == others.len()
            && match self {
                Self::Made(vertices) => vertices.iter().zip(others).all(|(own, other)| own.is_same(other)),
                #[cfg(feature = "cuda")]
                Self::Packed(packed) => packed.iter().zip(others).all(|(own, other)| own.is_same(other)),
            }
    }

    /// Appends them to others.
    pub fn append_to(&self, list: &mut Vec<Vertex>) {
        match self {
            Self::Made(vertices) => list.extend_from_slice(vertices),
            #[cfg(feature = "cuda")]
            Self::Packed(packed) => list.extend(packed.iter()),
        }
    }
}

impl MeshedBlocks for Parts {
    fn part(&self, number: usize) -> Option<MeshedBlock<'_>> {
        let (vertices, indices) = self.get(number)?;
        Some(MeshedBlock { vertices: BlockVertices::Made(vertices), indices })
    }
}

/// Consecutive blocks whose parts are consecutive in one list.
#[derive(Clone, Copy)]
pub(crate) struct Group {
    /// How many.
    pub count: usize,
    /// The number of the list.
    pub list: usize,
    /// Where the parts begin in the list.
    pub first: usize,
}

/// Parts in several lists, group by group.
pub(crate) struct PartLists<'a> {
    lists: &'a [Parts],
    groups: &'a [Group],
    /// The number of the first block of each group.
    firsts: Vec<usize>,
}

impl<'a> PartLists<'a> {
    pub fn new(lists: &'a [Parts], groups: &'a [Group]) -> Self {
        let first = |end: &mut usize, group: &Group| {
            let first = *end;
            *end += group.count;
            Some(first)
        };
        Self { lists, groups, firsts: groups.iter().scan(0, first).collect() }
    }
}

impl MeshedBlocks for PartLists<'_> {
    fn part(&self, number: usize) -> Option<MeshedBlock<'_>> {
        let at = self.firsts.partition_point(|&first| first <= number).checked_sub(1)?;
        let Group { count, list, first } = self.groups[at];
        let number = number - self.firsts[at];
        if number >= count {
            return None;
        }
        self.lists.get(list)?.part(first + number)
    }
}
