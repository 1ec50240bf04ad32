//! What a brush does to the samples it reaches.

use serde::{Deserialize, Serialize};

use super::DEPTH;
use crate::ground::MaterialId;

/// What happens inside the shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Operation {
    /// Takes ground away.
    Dig,
    /// Fills with ground of one material.
    Add {
        /// The material of the new ground.
        material: MaterialId,
    },
    /// Changes the material of ground that is there, and no density. [`MaterialId::GROUND`] gives ground its own look
    /// back; ground that has it is handed over to marching cubes all the same, without a difference to be seen.
    ///
    /// It stores the density of what it paints: exactly within 127 voxels of the surface. On taller cliffs, between
    /// neighbouring columns, painting may move the surface by less than a voxel.
    Paint {
        /// The new material.
        material: MaterialId,
    },
}

impl Operation {
    /// The density of a sample after the operation, from its density `before` and its signed distance to the shape,
    /// `outside`. All in 1/256 voxel, negative is solid, and inside for the distance.
    ///
    /// A shape counts as [`DEPTH`] deep at most: beyond, no surface shows the difference, and the middle of a large
    /// cave or hill is all one number. Applying an operation twice is the same as once, and neither a dig ever adds
    /// ground nor an add removes it.
    #[inline]
    pub fn apply(self, before: i32, outside: i32) -> i32 {
        let outside = outside.max(-DEPTH);
        match self {
            Self::Dig => before.max(-outside),
            Self::Add { .. } => before.min(outside),
            Self::Paint { .. } => before,
        }
    }

    /// The material that the operation brings along; none for a dig.
    pub fn material(self) -> Option<MaterialId> {
        match self {
            Self::Dig => None,
            Self::Add { material } | Self::Paint { material } => Some(material),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dig_takes_away_add_fills_paint_leaves() {
        let (add, paint) =
            (Operation::Add { material: MaterialId(3) }, Operation::Paint { material: MaterialId(3) });
        // (before, outside, dig, add)
        for (before, outside, dug, added) in [
            (-300, -100, 100, -300), // solid, inside
            (-300, 100, -100, -300), // solid, outside but near
            (-50, 100, -50, -50),    // already nearer the surface than the shape is
            (300, -100, 300, -100),  // air, inside
            (300, 100, 300, 100),    // air, near
            (0, i32::MIN, DEPTH, -DEPTH),
            (2 * DEPTH, -3 * DEPTH, 2 * DEPTH, -DEPTH), // deep inside: less than what was there
        ] {
            assert_eq!(Operation::Dig.apply(before, outside), dug);
            assert_eq!(add.apply(before, outside), added);
            assert_eq!(paint.apply(before, outside), before);
            for operation in [Operation::Dig, add, paint] {
                let once = operation.apply(before, outside);
                assert_eq!(operation.apply(once, outside), once);
            }
        }
    }
}
