//! Mountains that reach to the horizon, for benches.

use bevy_burrow::ground::{NoiseHeights, NoiseKind};

/// Ridges up to 420 voxels high, some 1,400 voxels apart.
pub fn heights() -> NoiseHeights {
    NoiseHeights { seed: 7, kind: NoiseKind::Ridged, octaves: 7, scale: 1400.0, amplitude: 420.0, base: 0.0 }
}
