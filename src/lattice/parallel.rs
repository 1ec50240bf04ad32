//! Work that threads share where there is enough of it.

use rayon::prelude::*;

/// The cost of one item of a list. It decides how long the list must be before threads share it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ItemCost {
    /// Copying it: nanoseconds.
    Copy,
    /// Looking it up, or deriving a few numbers: tens of nanoseconds.
    Lookup,
    /// Editing or meshing a brick: about a microsecond.
    Brick,
    /// Building the surface of a tile or chunk: tens of microseconds.
    Surface,
    /// Building a surface and what depends on it, such as a collider: a tenth of a millisecond or more.
    #[cfg_attr(not(feature = "plugin"), expect(dead_code))]
    Collider,
}

impl ItemCost {
    /// The shortest list that threads share.
    pub const fn shared_from(self) -> usize {
        match self {
            Self::Copy => 1 << 13,
            Self::Lookup => 1 << 9,
            Self::Brick => 48,
            Self::Surface => 8,
            Self::Collider => 2,
        }
    }

    /// The most items that a thread takes at once. Surfaces differ in cost, so they are taken one at a time.
    const fn max_at_once(self) -> usize {
        match self {
            Self::Surface | Self::Collider => 1,
            _ => usize::MAX,
        }
    }

    /// Whether threads share a list of this length.
    pub const fn is_shared(self, count: usize) -> bool {
        count >= self.shared_from()
    }
}

/// Maps a list in order, in parallel if it is long enough.
pub(crate) fn parallel_map<'a, T: Sync, R: Send>(
    list: &'a [T],
    cost: ItemCost,
    work: impl Fn(&'a T) -> R + Send + Sync,
) -> Vec<R> {
    if cost.is_shared(list.len()) {
        list.par_iter().with_max_len(cost.max_at_once()).map(work).collect()
    } else {
        list.iter().map(work).collect()
    }
}

/// Like [`parallel_map`], for a list that is consumed. The result's capacity is its length.
pub(crate) fn parallel_map_into<T: Send, R: Send>(
    list: Vec<T>,
    cost: ItemCost,
    work: impl Fn(T) -> R + Send + Sync,
) -> Vec<R> {
    if cost.is_shared(list.len()) {
        list.into_par_iter().with_max_len(cost.max_at_once()).map(work).collect()
    } else {
        // Not `collect`, which may reuse the larger allocation of the list.
        let mut mapped = Vec::with_capacity(list.len());
        mapped.extend(list.into_iter().map(work));
        mapped
    }
}

/// Runs both tasks, in parallel if `is_shared`.
pub(crate) fn side_by_side<A: Send, B: Send>(
    is_shared: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if is_shared { rayon::join(a, b) } else { (a(), b()) }
}

/// Cuts a list into pieces of at least this length, never between neighbours that belong together.
pub(crate) fn pieces<T>(
    mut list: &[T],
    length: usize,
    belong_together: impl Fn(&T, &T) -> bool,
) -> Vec<&[T]> {
    let length = length.max(1);
    let mut pieces = Vec::with_capacity(list.len() / length + 1);
    while list.len() > length {
        let pairs = list[length - 1..].windows(2);
        let more = pairs.take_while(|pair| belong_together(&pair[0], &pair[1])).count();
        let (piece, others) = list.split_at(length + more);
        pieces.push(piece);
        list = others;
    }
    if !list.is_empty() {
        pieces.push(list);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_belongs_together_is_in_one_piece() {
        let list = [1, 1, 2, 2, 2, 2, 2, 3, 4, 5, 6, 6];
        let all = |length| pieces(&list, length, |a, b| a == b);
        assert_eq!(all(3), [&list[..7], &list[7..10], &list[10..]]);
        assert_eq!(all(2), [&list[..2], &list[2..7], &list[7..9], &list[9..12]]);
        assert_eq!(all(12), [&list[..]]);
        assert_eq!([all(1).concat(), all(0).concat()], [list; 2]);
        assert!(pieces(&[0; 0], 5, |a, b| a == b).is_empty());
    }
}
