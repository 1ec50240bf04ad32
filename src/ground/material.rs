//! Materials of the ground.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::error::GroundError;
use crate::lattice::ONE;

/// Depth of the overlay below the surface: 1.5 voxels, in 1/256 voxel.
pub const OVERLAY_DEPTH: i32 = ONE + ONE / 2;

/// Identifies a material; the renderer decides what it looks like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct MaterialId(pub u8);

impl MaterialId {
    /// The ground's own material at that place, computed and never stored: that of samples that were never built or
    /// painted. Painting with it restores the ground's own look. No ground can be made of it.
    pub const GROUND: Self = Self(u8::MAX);

    /// Checks a parameter of this name: ground cannot be made of [`Self::GROUND`].
    pub(super) fn check(self, name: impl Into<Cow<'static, str>>) -> Result<(), GroundError> {
        if self != Self::GROUND {
            return Ok(());
        }
        let allowed = "0 to 254, as 255 means whatever the ground has";
        Err(GroundError::Parameter { name: name.into(), value: self.0.into(), allowed })
    }
}

/// The materials of one column: a base all the way down and an overlay as its skin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ColumnMaterial {
    /// The material below the overlay, and on the surface where the overlay does not cover it.
    pub base: MaterialId,
    /// The skin, [`OVERLAY_DEPTH`] thick.
    pub overlay: MaterialId,
    /// Share of the surface that the overlay covers: 0 shows the base only, 255 the overlay only.
    pub blend: u8,
}

impl ColumnMaterial {
    /// One material from the surface down.
    pub const fn solid(material: MaterialId) -> Self {
        Self { base: material, overlay: material, blend: 0 }
    }

    /// The skin's material: the overlay where it covers at least half (`blend >= 128`), else the base.
    pub const fn skin(self) -> MaterialId {
        if self.blend >= 128 { self.overlay } else { self.base }
    }

    /// The material at a signed distance from the surface in 1/256 voxel, negative below it. Above the surface it is
    /// the skin's.
    pub const fn at_distance(self, distance: i32) -> MaterialId {
        if distance >= -OVERLAY_DEPTH { self.skin() } else { self.base }
    }

    /// The materials as one word, for hashing.
    pub(super) fn word(self) -> u64 {
        u64::from(self.base.0) | u64::from(self.overlay.0) << 8 | u64::from(self.blend) << 16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_overlay_is_a_skin() {
        let grass_on_rock = ColumnMaterial { base: MaterialId(1), overlay: MaterialId(2), blend: 128 };
        for (distance, material) in
            [(i32::MIN, 1), (-385, 1), (-384, 2), (-1, 2), (0, 2), (900, 2), (i32::MAX, 2)]
        {
            assert_eq!(grass_on_rock.at_distance(distance), MaterialId(material), "at {distance}");
        }
        assert_eq!(ColumnMaterial { blend: 127, ..grass_on_rock }.at_distance(0), MaterialId(1));
    }

    #[test]
    fn an_id_is_stored_as_a_number() {
        assert_eq!(serde_json::to_string(&MaterialId(7)).unwrap(), "7");
        assert_eq!(serde_json::from_str::<MaterialId>("7").unwrap(), MaterialId(7));
        assert!(serde_json::from_str::<MaterialId>("256").is_err());
    }
}
