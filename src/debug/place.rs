//! Where views draw.

use bevy::prelude::*;

/// What a view draws around.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// In voxels of the terrain.
    pub focus: Vec3,
    /// How far most views reach, in voxels.
    pub radius: f32,
    /// How far normals, wires and walkable ground reach, in voxels.
    pub near: f32,
    /// The agent of the view `walkable`, in voxels.
    #[cfg(feature = "navigation")]
    pub agent: crate::navigation::WalkSettings,
}
