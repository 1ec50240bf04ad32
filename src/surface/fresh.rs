//! Surfaces of blocks that were meshed just now, wherever they are: in [`Parts`], or packed as a card writes them. Whoever
//! puts them into a chunk's mesh makes vertices of them on the way.

use super::block::Parts;
use super::mesh::Vertex;
#[cfg(feature = "cuda")]
pub(crate) use super::packed::{PackedMixes, PackedVertices};

/// The surfaces of blocks, by the blocks' numbers.
pub(crate) trait FreshParts: Sync {
    /// Waits until the surfaces of the first so many blocks are here, and tells how many of the first ones are. Where that is
    /// less, they will never be, and all that was made of others is to be forgotten.
    fn wait_for(&self, _blocks: usize) -> usize {
        usize::MAX
    }

    /// The surface of a block, which is waited for; `None` where there is no such block, or it will never be here.
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

impl FreshParts for Parts {
    fn part(&self, number: usize) -> Option<FreshPart<'_>> {
        let (vertices, indices) = self.get(number)?;
        Some(FreshPart { vertices: FreshVertices::Made(vertices), indices })
    }
}

/// Blocks that follow each other, and whose parts do in some list.
#[derive(Clone, Copy)]
pub(crate) struct Group {
    /// How many.
    pub count: usize,
    /// The number of the list.
    pub list: usize,
    /// Where they begin in it.
    pub first: usize,
}

/// Parts in several lists, group by group.
pub(crate) struct PartLists<'a> {
    lists: &'a [Parts],
    groups: &'a [Group],
    /// Of each group, the number of the block that it begins with.
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

impl FreshParts for PartLists<'_> {
    fn part(&self, number: usize) -> Option<FreshPart<'_>> {
        let at = self.firsts.partition_point(|&first| first <= number).checked_sub(1)?;
        let Group { count, list, first } = self.groups[at];
        let number = number - self.firsts[at];
        if number >= count {
            return None;
        }
        self.lists.get(list)?.part(first + number)
    }
}
