//! Surfaces of blocks that were meshed just now, wherever they are: in [`Parts`], or packed as a card writes them. Whoever
//! puts them into a chunk's mesh makes vertices of them on the way.

use super::block::Parts;
use super::mesh::Vertex;
#[cfg(feature = "cuda")]
pub(crate) use super::packed::{PackedMixes, PackedVertices};

/// The surfaces of blocks, by the blocks' numbers.
pub(crate) trait FreshParts: Sync {
    /// The surface of a block; `None` where there is no such block.
    fn part(&self, number: usize) -> Option<FreshPart<'_>>;
}

/// The surface of one block. It may be empty.
#[derive(Clone, Copy)]
pub(crate) struct FreshPart<'a> {
    pub vertices: FreshVertices<'a>,
    /// Three for each triangle, counted within the part.
    pub indices: &'a [u16],
}

/// Vertices, local to a chunk.
#[derive(Clone, Copy)]
pub(crate) enum FreshVertices<'a> {
    Made(&'a [Vertex]),
    #[cfg(feature = "cuda")]
    Packed(PackedVertices<'a>),
}

impl FreshVertices<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Made(vertices) => vertices.len(),
            #[cfg(feature = "cuda")]
            Self::Packed(packed) => packed.len(),
        }
    }

    /// Are they these, bit by bit?
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

/// Lists of parts, one after the other.
pub(crate) struct PartLists<'a> {
    lists: &'a [Parts],
    /// Of each, the number of the block that it begins with.
    firsts: Vec<usize>,
}

impl<'a> PartLists<'a> {
    pub fn new(lists: &'a [Parts]) -> Self {
        let count = |end: &mut usize, parts: &Parts| {
            let first = *end;
            *end += parts.list.len();
            Some(first)
        };
        Self { lists, firsts: lists.iter().scan(0, count).collect() }
    }
}

impl FreshParts for PartLists<'_> {
    fn part(&self, number: usize) -> Option<FreshPart<'_>> {
        let list = self.firsts.partition_point(|&first| first <= number).checked_sub(1)?;
        let (vertices, indices) = self.lists.get(list)?.get(number - self.firsts[list])?;
        Some(FreshPart { vertices: FreshVertices::Made(vertices), indices })
    }
}
