//! Why parts of a world or its ground can't be replaced.

use crate::lattice::{BrickPos, ChunkPos};

/// Why parts of a world or its ground can't be replaced; nothing changed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PartsError {
    /// A brick is repeated or out of order.
    #[error("the brick {0:?} is repeated or out of order: sort bricks by position")]
    Unsorted(BrickPos),
    /// A brick, or one of its edited samples, lies outside the world.
    #[error("the brick {0:?} extends beyond the world")]
    OutsideWorld(BrickPos),
    /// A brick has a pristine sample that is solid where this ground is air, or vice versa.
    #[error("the brick {0:?} was made on a different ground")]
    OtherGround(BrickPos),
    /// Fields of a chunk reach out of it, it comes twice, or one of its fields has the name of another.
    #[error("the fields of chunk {0:?} extend beyond it, are repeated, or share a name")]
    Fields(ChunkPos),
    /// A revision or the name of a field is so great that no others could follow.
    #[error("{0} is too large for a revision or the name of a field")]
    Number(u64),
    /// The world would not have the hash that was expected.
    #[error("the world would have the hash {found:#018x}, not {expected:#018x}")]
    Hash {
        /// The hash that it would have.
        found: u64,
        /// The expected hash.
        expected: u64,
    },
    /// The ground has another size, in cells.
    #[error("the new ground has {found:?} cells, but the world has {expected:?}")]
    GroundSize {
        /// Width and depth of the new one.
        found: (i32, i32),
        /// Width and depth of the world's ground.
        expected: (i32, i32),
    },
}

/// Checks that a revision or the name of a field leaves room for those that follow.
pub(super) fn check_number(number: u64) -> Result<u64, PartsError> {
    if number > u64::MAX / 2 { Err(PartsError::Number(number)) } else { Ok(number) }
}
