//! The steep cells of a ground, a bit each.

/// The steep cells of a ground, one bit each.
///
/// A cell is steep if two lattice levels or more separate the ends of one of its sides or of its diagonal, and not all
/// voxels along these lines, its columns' tops included, are of the same material. A cell with more than
/// [`MAX_FACE_LEVELS`](super::steep::MAX_FACE_LEVELS) on such a line is not: it shows its corners' materials, as a
/// ground without strata does.
#[derive(Clone, PartialEq)]
pub(crate) struct SteepCells {
    /// Words along x.
    pub(super) across: usize,
    /// Row-major words of 8x8 cells: bit `z * 8 + x`, as in the mask.
    pub(super) words: Vec<u64>,
}

impl SteepCells {
    /// The steep ones of the 8x8 cells from (8 x, 8 z) on; there are none beyond the rim.
    pub fn word(&self, (x, z): (i32, i32)) -> u64 {
        let inside = |at: i32| usize::try_from(at).ok();
        let place = inside(x).filter(|&x| x < self.across).zip(inside(z));
        place.and_then(|(x, z)| self.words.get(z * self.across + x)).copied().unwrap_or_default()
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(self.words.as_slice())
    }
}
