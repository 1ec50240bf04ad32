//! What noise ground is made of.

use bytemuck::{Pod, Zeroable};

use super::{Address, THREADS};
use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::ground::NoiseNumbers;

/// Columns of a block of `heights`.
pub(crate) const COLUMNS: usize = 8 * THREADS as usize;

/// The parameter of `heights`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct HeightsParams {
    /// For each octave 256 `u8`.
    pub tables: Address,
    /// Out: an `i32` for each column, in 1/256 voxel; `i32::MIN` where that is beyond the lattice's limit.
    pub heights: Address,
    pub noise: NoiseNumbers,
    /// Columns of the world, row by row: the first one, and how many.
    pub first: u32,
    pub count: u32,
    /// Columns in a row.
    pub row_len: u32,
    pub octaves: u32,
    /// 1 where it is; 0 otherwise.
    pub is_ridged: u32,
    pub pad: u32,
}

impl KernelParams for HeightsParams {
    const KERNEL: Kernel = Kernel::Heights;
}

// The kernel keeps as many octaves.
const _: () = assert!(crate::ground::MAX_OCTAVES <= 16);
