//! The hills that the server runs on without a heightmap. Shared by examples, which include this file by path.

use bevy_burrow::ground::{Ground, GroundError, NoiseHeights};

/// Hills of `side` cells along each side.
pub fn noise_ground(side: u32) -> Result<Ground, GroundError> {
    let noise =
        NoiseHeights { seed: 4, amplitude: 40.0, scale: 180.0, octaves: 5, ..NoiseHeights::default() };
    Ground::from_noise(side, side, &noise)
}
