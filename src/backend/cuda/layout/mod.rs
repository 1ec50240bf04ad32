//! Data structures that the host and the kernels exchange, the counterpart of `kernels/layout.cuh`.
//!
//! All numbers are little-endian. Kernels identify a brick by a *reference*, `slot << 1 | has_materials`, or
//! [`NONE`]. Sample (x, y, z) of a brick has index `x + 8 z + 64 y`. A box within a brick is packed into one word,
//! see [`pack_box`].

#[cfg(test)]
mod agreement;
mod edit;
mod heights;
mod mesh;
mod stencil_edit;
mod strata;
mod surface;

use bytemuck::{Pod, Zeroable};
use glam::IVec3;

use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{Column, LatticeBox};
use crate::volume::{Brick, Sample};

pub(crate) use edit::*;
pub(crate) use heights::*;
pub(crate) use mesh::*;
pub(crate) use stencil_edit::*;
pub(crate) use strata::*;
pub(crate) use surface::*;

/// A device address.
pub(crate) type Address = u64;

/// No brick, or no entry.
pub(crate) const NONE: u32 = u32::MAX;

/// Threads per block, for all kernels.
pub(crate) const THREADS: u32 = 128;

/// Maximum number of jobs per launch. Each block may request 7680 indices, and counters have 32 bits.
pub(crate) const MOST_JOBS: usize = 1 << 19;

/// Bytes of a brick's slot: a record, then materials.
pub(crate) const BRICK_BYTES: usize = RECORD_BYTES + MATERIAL_BYTES;

/// Bytes of a brick's samples and bits.
pub(crate) const RECORD_BYTES: usize = size_of::<BrickRecord>();

/// Bytes of a brick's materials.
pub(crate) const MATERIAL_BYTES: usize = 512;

/// A brick without materials.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BrickRecord {
    /// Densities in 1/256 voxel, `i16::MIN` for pristine samples.
    pub samples: [i16; 512],
    /// One word per layer y, with bit `z * 8 + x`.
    pub solid: [u64; 8],
    pub edited: [u64; 8],
}

/// The 11 x 11 columns around a stack of bricks, starting one before its first; x varies fastest.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct StackRecord {
    /// In units of 1/256 voxel.
    pub heights: [i32; 121],
    /// See `strata::column_word`.
    pub columns: [u32; 121],
    pub pad: [u32; 2],
}

/// A copy. Addresses and size are multiples of 16.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ScatterJob {
    pub to: Address,
    pub from: Address,
    pub bytes: u32,
    pub pad: u32,
}

/// Parameters of `scatter`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ScatterParams {
    /// [`ScatterJob`]s, one per block.
    pub jobs: Address,
}

impl KernelParams for ScatterParams {
    const KERNEL: Kernel = Kernel::Scatter;
}

/// Writes a brick in the format of a slot: [`BRICK_BYTES`], or [`RECORD_BYTES`] if `out` has no room for materials.
pub(crate) fn brick_record(brick: &Brick, out: &mut [u8]) {
    let record = BrickRecord {
        samples: brick.samples().map(Sample::bits),
        solid: *brick.solid(),
        edited: *brick.edited(),
    };
    if let Some((place, rest)) = out.split_first_chunk_mut::<RECORD_BYTES>() {
        *place = bytemuck::cast(record);
        if let Some(place) = rest.first_chunk_mut::<MATERIAL_BYTES>() {
            *place =
                brick.materials().map_or([MaterialId::GROUND.0; 512], |all| all.map(|material| material.0));
        }
    }
}

/// Builds a brick from its record, and its materials if it has any.
pub(crate) fn brick_of(record: &BrickRecord, materials: Option<&[u8; MATERIAL_BYTES]>) -> Brick {
    Brick::of_parts(&record.samples, record.solid, record.edited, materials)
}

/// The record for the stack of bricks at (x, z).
pub(crate) fn stack_record(ground: &Ground, (x, z): (i32, i32)) -> StackRecord {
    let low = Column::new(x * 8 - 1, z * 8 - 1);
    let heights = ground.heights::<11>(low);
    let mut record = StackRecord { heights: [0; 121], columns: [0; 121], pad: [0; 2] };
    record.heights.copy_from_slice(heights.as_flattened());
    match ground.single_material() {
        Some(_) => record.columns.fill(column_word(ground, low)),
        None => {
            let columns = (0..11).flat_map(|z| (0..11).map(move |x| low.offset(x, z)));
            let words = columns.map(|column| column_word(ground, column));
            record.columns.iter_mut().zip(words).for_each(|(place, word)| *place = word);
        }
    }
    record
}

/// Packs a box within a brick, with inclusive ends, into one word: the minimum `x | y << 3 | z << 6`, and the
/// maximum likewise `<< 9`. `from` is the brick's minimum corner.
pub(crate) fn pack_box(cells: LatticeBox, from: IVec3) -> u32 {
    let pack = |at: IVec3| {
        let IVec3 { x, y, z } = (at - from) & 7;
        (x | y << 3 | z << 6) as u32
    };
    pack(cells.min) | pack(cells.max) << 9
}

/// The inverse of [`pack_box`].
pub(crate) fn unpack_box(word: u32, from: IVec3) -> LatticeBox {
    let unpack = |word: u32| from + IVec3::new(word as i32 & 7, word as i32 >> 3 & 7, word as i32 >> 6 & 7);
    LatticeBox { min: unpack(word), max: unpack(word >> 9) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    #[test]
    fn boxes_go_through_a_word() {
        let from = IVec3::new(-8, 16, -24);
        let whole = LatticeBox { min: from, max: from + 7 };
        for min in whole.points() {
            let cells = LatticeBox { min, max: min.max(from + IVec3::new(7, 3, 5)) };
            assert_eq!(unpack_box(pack_box(cells, from), from), cells);
        }
    }

    #[test]
    fn bricks_go_through_a_record() {
        let mut rng = Rng::with_seed(3);
        let mut brick = Brick::of_edited(&std::array::from_fn(|_| rng.i16(..)));
        let mut bytes = [7; BRICK_BYTES];
        for _ in 0..2 {
            brick_record(&brick, &mut bytes);
            let record: BrickRecord = bytemuck::pod_read_unaligned(&bytes[..RECORD_BYTES]);
            let materials = brick.materials().and_then(|_| bytes[RECORD_BYTES..].first_chunk());
            let found = brick_of(&record, materials);
            assert_eq!(found.samples(), brick.samples());
            assert_eq!((found.solid(), found.edited()), (brick.solid(), brick.edited()));
            assert_eq!(found.materials(), brick.materials());
            brick.set_material(300, MaterialId(9));
        }
        assert_eq!(bytes[RECORD_BYTES + 299..][..3], [255, 9, 255]);
    }
}
