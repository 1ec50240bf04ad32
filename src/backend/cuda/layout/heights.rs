//! Input and output of the heights kernel.

use bytemuck::{Pod, Zeroable};

use super::{Address, THREADS};
use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::ground::NoiseFactors;

/// Columns per block of `heights`.
pub(crate) const COLUMNS: usize = 8 * THREADS as usize;

/// Parameters of `heights`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct HeightsParams {
    /// 256 `u8` per octave.
    pub tables: Address,
    /// Output: an `i32` per column in 1/256 voxel; `i32::MIN` if it exceeds the lattice's limit.
    pub heights: Address,
    pub noise: NoiseFactors,
    /// Columns of the world, row by row: the first one, and their number.
    pub first: u32,
    pub count: u32,
    /// Columns in a row.
    pub row_len: u32,
    pub octaves: u32,
    /// 1 if the noise is ridged, else 0.
    pub is_ridged: u32,
    pub pad: u32,
}

impl KernelParams for HeightsParams {
    const KERNEL: Kernel = Kernel::Heights;
}

// The kernel has shared memory for this many octaves.
const _: () = assert!(crate::ground::MAX_OCTAVES <= 16);
