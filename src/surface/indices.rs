//! Index buffers: 16 bits an index where they are enough, else 32.

use std::ops::Range;

/// The indices of a triangle mesh, three for each triangle.
///
/// They have 16 bits in a mesh of up to [`Indices::MAX_SHORT`] vertices, 32 in a larger one: half the memory to keep,
/// to copy at each edit and to upload to a GPU. Equal meshes have equal indices.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Indices {
    /// 16 bits each, for up to [`Indices::MAX_SHORT`] vertices.
    U16(Vec<u16>),
    /// 32 bits each, for larger meshes.
    U32(Vec<u32>),
}

impl Default for Indices {
    fn default() -> Self {
        Self::U16(Vec::new())
    }
}

impl Indices {
    /// Vertices of a mesh that has indices of 16 bits at most. The largest index is left free, as it restarts triangle
    /// strips.
    pub const MAX_SHORT: usize = u16::MAX as usize;

    /// These indices, for a mesh of `vertices` vertices. Indices that do not fit 16 bits are kept in 32, even if they
    /// are invalid.
    pub fn new(vertices: usize, list: Vec<u32>) -> Self {
        let short = || list.iter().map(|&index| u16::try_from(index).ok()).collect();
        match (vertices <= Self::MAX_SHORT).then(short).flatten() {
            Some(short) => Self::U16(short),
            None => Self::U32(list),
        }
    }

    /// An empty buffer with room for `indices` indices, for a mesh of `vertices` vertices.
    pub(crate) fn with_capacity(vertices: usize, indices: usize) -> Self {
        if vertices <= Self::MAX_SHORT {
            Self::U16(Vec::with_capacity(indices))
        } else {
            Self::U32(Vec::with_capacity(indices))
        }
    }

    /// The number of indices.
    pub fn len(&self) -> usize {
        match self {
            Self::U16(list) => list.len(),
            Self::U32(list) => list.len(),
        }
    }

    /// Returns `true` if there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Each index.
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

    /// Bytes of the buffer, its spare capacity included.
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

    /// Appends a range of another list whose vertices began at `from` there, and begin at `to` here.
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

    /// Returns `true` if this range equals a part whose indices count from vertex `base`.
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The most vertices that 16-bit indices allow, or one more.
    fn vertices(is_long: bool) -> usize {
        Indices::MAX_SHORT + usize::from(is_long)
    }

    proptest! {
        #[test]
        fn both_kinds_hold_the_same(list in prop::collection::vec(0u32..1 << 16, 0..40), is_long: bool) {
            let indices = Indices::new(vertices(is_long), list.clone());
            prop_assert_eq!(matches!(indices, Indices::U32(_)), is_long);
            prop_assert_eq!(indices.iter().collect::<Vec<_>>(), list.clone());
            prop_assert_eq!((indices.len(), indices.is_empty()), (list.len(), list.is_empty()));
            let triangles: Vec<[u32; 3]> = list.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
            prop_assert_eq!(indices.triangles().collect::<Vec<_>>(), triangles);
        }

        #[test]
        fn parts_are_copied_from_either_kind_to_either(
            part in prop::collection::vec(0u16..500, 1..40),
            from in 0usize..60_000,
            to in 0usize..60_000,
            was_long: bool,
            is_long: bool,
        ) {
            let mut old = Indices::with_capacity(vertices(was_long), 0);
            old.extend(&[7, 8, 9]);
            old.extend_from_part(&part, from);
            let range = 3..3 + part.len();
            prop_assert!(old.is_part(range.clone(), &part, from));
            prop_assert!(!old.is_part(range.clone(), &part, from + 1));
            let mut new = Indices::with_capacity(vertices(is_long), 0);
            new.extend_moved(&old, range, from, to);
            let expected: Vec<u32> = part.iter().map(|&index| u32::from(index) + to as u32).collect();
            prop_assert_eq!(new, Indices::new(vertices(is_long), expected));
        }
    }
}
