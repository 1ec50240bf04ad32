//! Slider ranges for lengths: in metres, within the limits of a brush, which are in voxels.

use std::ops::RangeInclusive;

/// The range of a length. A value outside, which the game or another terrain's range may have set, stays until the
/// slider is dragged.
pub struct Length {
    /// Minimum and maximum in metres.
    metres: (f32, f32),
    /// Minimum and maximum that a [`brush`](crate::brush) allows, in voxels.
    voxels: (f32, f32),
}

impl Length {
    /// The range in metres for this voxel size.
    pub fn range(&self, voxel: f32) -> RangeInclusive<f32> {
        let least = self.metres.0.max(self.voxels.0 * voxel);
        least..=self.metres.1.min(self.voxels.1 * voxel).max(least)
    }
}

/// Radii, and half extents of boxes. Even with all maxima, a shape stays within its maximum volume.
pub const RADIUS: Length = Length { metres: (0.5, 32.0), voxels: (0.25, 128.0) };
/// Radius of a torus's tube.
pub const TUBE: Length = Length { metres: (0.5, 16.0), voxels: (0.25, 64.0) };
/// Length of cylinders, capsules and cones. An axis that is not upright is rounded, and must not become too short for a
/// brush.
pub const LENGTH: Length = Length { metres: (1.0, 64.0), voxels: (0.5, 256.0) };
/// How far a road levels the ground above and below it.
pub const ROAD_HEIGHT: Length = Length { metres: (1.0, 32.0), voxels: (0.25, 64.0) };
/// Radius of a rounded edge.
pub const ROUNDING: Length = Length { metres: (0.0, 8.0), voxels: (0.0, 16.0) };
pub const FALLOFF: Length = Length { metres: (0.0, 16.0), voxels: (0.0, 64.0) };
/// Amount to raise or lower, or height of a stamp.
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
            for length in
                [RADIUS, TUBE, LENGTH, ROAD_HEIGHT, ROUNDING, FALLOFF, AMOUNT, STEP, BUMP, BUMP_WIDTH]
            {
                let range = length.range(voxel);
                assert!(range.start() < range.end(), "{range:?} at {voxel}");
                // Sliders show tenths. Rounding to tenths must not move an end beyond the limits.
                for end in [range.start(), range.end()] {
                    assert_eq!((end * 10.0).round() / 10.0, *end, "{range:?} at {voxel}");
                }
            }
        }
        assert_eq!(RADIUS.range(1.0), 0.5..=32.0);
        assert_eq!((RADIUS.range(8.0), FALLOFF.range(0.125)), (2.0..=32.0, 0.0..=8.0));
    }
}
