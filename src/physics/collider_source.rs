//! The component that says where ground has colliders.

use bevy::prelude::*;

/// Ground has colliders in all columns of chunks within the radius of a source, and nowhere else.
///
/// Put it on players and on everything else that needs ground. With a radius of `f32::INFINITY` all ground has
/// colliders.
///
/// A source that enters another voxel costs main-thread time for each column of chunks within its radius and on its way
/// ahead; one that reaches the whole terrain does so only when it enters another column. Each collider costs time in a
/// task, and memory: some 190 MB for a square of 1000 x 1000 voxels. A warning is logged once for a source that needs
/// more than 256 MB.
///
/// With a `LinearVelocity`, ground where the source will be in a second has colliders too, up to 64 chunks ahead.
/// Bodies need not be sources: those too far from any are [held](super::HeldByGround).
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default)]
#[require(Transform)]
pub struct ColliderSource {
    /// Metres, along x and z.
    pub radius: f32,
}

impl Default for ColliderSource {
    fn default() -> Self {
        Self { radius: 48.0 }
    }
}
