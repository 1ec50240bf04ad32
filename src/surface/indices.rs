//! Index buffers: 16 bits an index where they are enough, else 32.

use std::ops::Range;

/// The indices of a triangle mesh, three for each triangle.
///
/// They have 16 bits in a mesh of up to [`Indices::MOST_SHORT`] vertices, 32 in a larger one: half the memory to keep, to
/// copy at each edit and to send to a graphics card. The same mesh always has the same ones.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Indices {
    /// Of a mesh of up to [`Indices::MOST_SHORT`] vertices.
    U16(Vec<u16>),
    /// Of a larger one.
    U32(Vec<u32>),
}

impl Default for Indices {
    fn default() -> Self {
        Self::U16(Vec::new())
    }
}

impl Indices {
    /// Vertices of a mesh that has indices of 16 bits at most. One index is left free: in strips it would mean a new start.
    pub const MOST_SHORT: usize = u16::MAX as usize;

    /// These indices, for a mesh of so many vertices.
    pub fn new(vertices: usize, list: Vec<u32>) -> Self {
        if vertices <= Self::MOST_SHORT {
            Self::U16(list.into_iter().map(|index| index as u16).collect())
        } else {
            Self::U32(list)
        }
    }

    /// None yet, but room for so many, for a mesh of so many vertices.
    pub(crate) fn with_capacity(vertices: usize, indices: usize) -> Self {
        if vertices <= Self::MOST_SHORT {
            Self::U16(Vec::with_capacity(indices))
        } else {
            Self::U32(Vec::with_capacity(indices))
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::U16(list) => list.len(),
            Self::U32(list) => list.len(),
        }
    }

    /// Are there none?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Each of them.
    pub fn iter(&self) -> impl Iterator<Item = u32> {
        let (short, long) = self.lists();
        short.iter().map(|&index| u32::from(index)).chain(long.iter().copied())
    }

    /// Three at a time.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        let (short, long) = self.lists();
        let short = short.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(u32::from));
        short.chain(long.chunks_exact(3).map(|t| [t[0], t[1], t[2]]))
    }

    /// Bytes of the buffer, room that is not used included.
    pub fn bytes(&self) -> usize {
        match self {
            Self::U16(list) => list.capacity() * size_of::<u16>(),
            Self::U32(list) => list.capacity() * size_of::<u32>(),
        }
    }

    /// Both kinds, one of them empty.
    fn lists(&self) -> (&[u16], &[u32]) {
        match self {
            Self::U16(list) => (list, &[]),
            Self::U32(list) => (&[], list),
        }
    }

    /// Appends indices as they are.
    pub(crate) fn extend(&mut self, other: &[u32]) {
        match self {
            Self::U16(list) => list.extend(other.iter().map(|&index| index as u16)),
            Self::U32(list) => list.extend_from_slice(other),
        }
    }

    /// Appends a part whose indices count from vertex `base`.
    pub(crate) fn extend_from_part(&mut self, part: &[u16], base: usize) {
        match self {
            Self::U16(list) => list.extend(part.iter().map(|index| index.wrapping_add(base as u16))),
            Self::U32(list) => list.extend(part.iter().map(|&index| u32::from(index) + base as u32)),
        }
    }

    /// Appends some of another list, whose vertices were after `from` others, and are after `to` others here.
    pub(crate) fn extend_moved(&mut self, other: &Self, range: Range<usize>, from: usize, to: usize) {
        let by = to.wrapping_sub(from) as u32;
        match (self, other) {
            (Self::U16(list), Self::U16(other)) => {
                list.extend(other[range].iter().map(|index| index.wrapping_add(by as u16)));
            }
            (Self::U32(list), Self::U32(other)) => {
                list.extend(other[range].iter().map(|index| index.wrapping_add(by)));
            }
            (Self::U16(list), Self::U32(other)) => {
                list.extend(other[range].iter().map(|index| index.wrapping_add(by) as u16));
            }
            (Self::U32(list), Self::U16(other)) => {
                list.extend(other[range].iter().map(|&index| u32::from(index).wrapping_add(by)));
            }
        }
    }

    /// Are some of them those of a part whose indices count from vertex `base`?
    pub(crate) fn is_part(&self, range: Range<usize>, part: &[u16], base: usize) -> bool {
        match self {
            Self::U16(list) => {
                list[range].iter().copied().eq(part.iter().map(|index| index.wrapping_add(base as u16)))
            }
            Self::U32(list) => {
                list[range].iter().copied().eq(part.iter().map(|&index| u32::from(index) + base as u32))
            }
        }
    }
}
