//! What sliders of lengths offer: metres, as far as the chosen terrain takes them, whose limits count in voxels.

use std::ops::RangeInclusive;

/// A length of the brush in hand.
///
/// Its slider offers no other values than those in range. One that lies outside, as the game or another terrain left it,
/// stays until somebody drags it.
pub struct Length {
    /// Least and most of what is offered, in metres.
    metres: (f32, f32),
    /// The same in voxels: within what [`brush`](crate::brush) has as limits.
    voxels: (f32, f32),
}

impl Length {
    /// What is offered, in metres, where voxels are so many metres wide.
    pub fn range(&self, voxel: f32) -> RangeInclusive<f32> {
        let least = self.metres.0.max(self.voxels.0 * voxel);
        least..=self.metres.1.min(self.voxels.1 * voxel).max(least)
    }
}

/// Radii, and half the sides of boxes. All of the most together are within the volume that a shape may have.
pub const RADIUS: Length = Length { metres: (0.5, 32.0), voxels: (0.25, 128.0) };
/// Of the tube of a ring.
pub const TUBE: Length = Length { metres: (0.5, 16.0), voxels: (0.25, 64.0) };
/// Of cylinders, capsules and cones.
pub const LENGTH: Length = Length { metres: (1.0, 64.0), voxels: (0.25, 256.0) };
pub const FALLOFF: Length = Length { metres: (0.0, 16.0), voxels: (0.0, 64.0) };
/// How far the surface moves, or how high a stamp is.
pub const AMOUNT: Length = Length { metres: (0.0, 16.0), voxels: (0.0, 64.0) };
pub const STEP: Length = Length { metres: (1.0, 32.0), voxels: (1.0, 256.0) };
pub const BUMP: Length = Length { metres: (0.0, 4.0), voxels: (0.0, 8.0) };
pub const BUMP_WIDTH: Length = Length { metres: (1.0, 32.0), voxels: (1.0, 256.0) };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn something_is_offered_whatever_the_voxels() {
        for voxel in (-3..=3).map(|power| 2f32.powi(power)) {
            for length in [RADIUS, TUBE, LENGTH, FALLOFF, AMOUNT, STEP, BUMP, BUMP_WIDTH] {
                let range = length.range(voxel);
                assert!(range.start() < range.end(), "{range:?} at {voxel}");
                // Sliders show tenths: their ends are none that rounding carries beyond the limits.
                for end in [range.start(), range.end()] {
                    assert_eq!((end * 10.0).round() / 10.0, *end, "{range:?} at {voxel}");
                }
            }
        }
        assert_eq!(RADIUS.range(1.0), 0.5..=32.0);
        assert_eq!((RADIUS.range(8.0), FALLOFF.range(0.125)), (2.0..=32.0, 0.0..=8.0));
    }
}
