//! The blend of a sculpting brush towards the rim of its shape.

use serde::{Deserialize, Serialize};

use super::BrushError;
use super::quantize::{in_range, voxels};
use crate::ground::MaterialId;
use crate::lattice::ONE;

/// How an operation that sculpts blends in. Dig, add, paint, reset and paste ignore it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blend {
    /// Share of the change that is applied, from 0 (none) to 1 (all).
    pub strength: f32,
    /// Width in voxels, from the shape's surface inwards, over which the change fades in: 0 to 64. A falloff wider than
    /// the shape's depth ends in its middle. With 0 the change ends in a step at the shape's surface.
    /// For fills and carves it is the radius by which their edge with the ground is rounded, at most 16.
    pub falloff: f32,
    /// The material of new ground. With `None`, a fill uses the materials of its grid, if that has any. Otherwise new
    /// ground has the material of the first ground straight below it within 64 voxels, or else straight above within
    /// 64, or else next to it.
    pub material: Option<MaterialId>,
}

impl Default for Blend {
    fn default() -> Self {
        Self { strength: 1.0, falloff: 4.0, material: None }
    }
}

/// The maximum falloff, in voxels.
const MAX: i32 = 64;

/// A quantised [`Blend`]: strength in 1/256, falloff in 1/256 voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct QuantizedBlend {
    pub strength: i32,
    pub falloff: i32,
    pub material: Option<MaterialId>,
}

impl QuantizedBlend {
    pub fn quantize(blend: &Blend) -> Result<Self, BrushError> {
        let strength = in_range("strength", blend.strength, 0.0, 1.0)?;
        let falloff = in_range("falloff", blend.falloff, 0.0, MAX as f32)?;
        Ok(Self { strength, falloff, material: blend.material })
    }

    pub fn check(self) -> Result<(), BrushError> {
        in_range("strength", voxels(self.strength), 0.0, 1.0)?;
        in_range("falloff", voxels(self.falloff), 0.0, MAX as f32)?;
        Ok(())
    }

    pub fn blend(self) -> Blend {
        Blend { strength: voxels(self.strength), falloff: voxels(self.falloff), material: self.material }
    }

    /// Share of the change at a distance from the shape, in 1/256; the falloff is at most `deep` wide.
    pub fn weight(self, outside: i32, deep: i32) -> i32 {
        let inside = -outside;
        let falloff = self.falloff.min(deep);
        if inside < 0 || inside == 0 && falloff > 0 {
            return 0;
        }
        if inside >= falloff {
            return self.strength;
        }
        // 3 t^2 - 2 t^3: no kink at either end.
        let t = inside * ONE / falloff;
        let faded = (t * t * (3 * ONE - 2 * t)) >> 16;
        (faded * self.strength + ONE / 2) >> 8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_rise_from_nothing_at_the_rim_to_the_strength() {
        for (strength, falloff) in [(256, 1024), (256, 0), (77, 300), (256, 1)] {
            let blend = QuantizedBlend { strength, falloff, material: None };
            let weights: Vec<i32> = (-20_000..600).rev().map(|outside| blend.weight(outside, 9000)).collect();
            assert!(weights.is_sorted());
            assert_eq!((weights[0], weights.last()), (0, Some(&strength)));
            assert_eq!(blend.weight(1, 9000), 0);
            assert_eq!(blend.weight(0, 9000), if falloff == 0 { strength } else { 0 });
        }
        // As wide as the shape is deep: all of it in the middle, and no sudden step on the way.
        let soft = QuantizedBlend { strength: 256, falloff: 64 * ONE, material: None };
        assert_eq!((soft.weight(-5 * ONE, 5 * ONE), soft.weight(-5 * ONE / 2, 5 * ONE)), (256, 128));
        let all: Vec<i32> = (0..5 * ONE).map(|inside| soft.weight(-inside, 5 * ONE)).collect();
        assert!(all.windows(2).all(|pair| (0..=2).contains(&(pair[1] - pair[0]))));
    }
}
