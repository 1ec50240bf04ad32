//! Input and output of the kernels that compute distances to the surface of the ground.

use bytemuck::{Pod, Zeroable};
use glam::IVec3;

use super::Address;
use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::lattice::BrickPos;

/// Bytes of the distances of one brick: 512 of `i16`.
pub(crate) const DISTANCE_BYTES: usize = 1024;

/// A brick whose samples' distances to the surface are computed.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SurfaceJob {
    /// The brick's [`BrickPos`].
    pub brick: [i32; 3],
    /// As in [`EditJob`](super::EditJob).
    pub stack: u32,
    pub window: u32,
    pub strides: u32,
    /// The numbers of the jobs of the 27 bricks around, x fastest, then z, then y; [`NONE`](super::NONE) where there is
    /// none.
    pub around: [u32; 27],
    pub pad: u32,
}

impl SurfaceJob {
    /// The brick's position.
    pub fn pos(&self) -> BrickPos {
        BrickPos(IVec3::from_array(self.brick))
    }
}

/// Parameters of `surface_start`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SurfaceStartParams {
    /// First slots of the caches of bricks and stacks.
    pub bricks: Address,
    pub stacks: Address,
    /// References of bricks. For each job they include all 27 bricks around.
    pub windows: Address,
    /// [`SurfaceJob`]s, one per block.
    pub jobs: Address,
    /// Output: [`DISTANCE_BYTES`] per job. Distances are in 1/256 voxel, those of solid samples inverted bit by bit.
    pub distances: Address,
    /// The greatest distance.
    pub horizon: i32,
    /// The last columns of the world along x and z.
    pub last: [i32; 2],
    pub pad: u32,
}

impl KernelParams for SurfaceStartParams {
    const KERNEL: Kernel = Kernel::SurfaceStart;
}

/// Parameters of `surface_spread`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SurfaceSpreadParams {
    /// [`SurfaceJob`]s, one per block.
    pub jobs: Address,
    /// Distances before and after the step, as in [`SurfaceStartParams`]. They must not overlap.
    pub from: Address,
    pub to: Address,
}

impl KernelParams for SurfaceSpreadParams {
    const KERNEL: Kernel = Kernel::SurfaceSpread;
}
