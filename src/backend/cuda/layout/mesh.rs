//! What blocks are to be meshed, and where their surfaces are.

use bytemuck::{Pod, Zeroable};

use super::Address;
use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::ground::Ground;
use crate::surface::vertex::WorldView;
use crate::surface::{MaterialMix, block};

/// What blocks of one stack of bricks share.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ColumnJob {
    /// Its slot.
    pub stack: u32,
    /// Which stack of bricks.
    pub x: i32,
    pub z: i32,
    pub pad: u32,
    /// Cells of the mask, bit `z * 8 + x`.
    pub mask: u64,
    pub pad2: u64,
    /// Lattice edges on the mask's border, as [`border_edges`](crate::surface::MaskView::border_edges) has them: for each axis 128 bits.
    pub borders: [[u32; 4]; 3],
}

/// A block to be meshed.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MeshJob {
    /// Entry of its brick in `windows`.
    pub window: u32,
    /// From there to the next brick along x, and `<< 16` along z; along y it is 1. All 27 around must be there.
    pub strides: u32,
    /// Number of its [`ColumnJob`].
    pub column: u32,
    /// The brick's height.
    pub y: i32,
    /// The cells to draw.
    pub cells: u32,
    pub pad: u32,
}

/// Where the surface of a block is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MeshResult {
    /// First vertex, and how many. The first is [`NONE`] where there was no room and nothing was written.
    pub vertex: u32,
    pub vertices: u32,
    /// First index, and how many.
    pub index: u32,
    pub indices: u32,
}

/// The parameter of `mesh`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MeshParams {
    /// Caches of bricks, of stacks.
    pub bricks: Address,
    pub stacks: Address,
    /// References of bricks.
    pub windows: Address,
    /// [`ColumnJob`]s.
    pub columns: Address,
    /// [`MeshJob`]s, one for each block.
    pub jobs: Address,
    /// What [`table`] gives.
    pub table: Address,
    /// Out: a [`MeshResult`] for each job.
    pub results: Address,
    /// Out: four `u16` each: x, y, z in 1/4096 voxel from the brick's lowest sample, 0.
    pub positions: Address,
    /// Out: three `f32` each.
    pub normals: Address,
    /// Out: eight `u8` each, ids and weights of a [`MaterialMix`]. 0: none are wanted.
    pub mixes: Address,
    /// Out: `u16` each, counted within the block.
    pub indices: Address,
    /// Vertices, indices: two `u32`, zero at the start, which go on past the capacities.
    pub counters: Address,
    pub vertex_capacity: u32,
    pub index_capacity: u32,
    /// Cells of the world.
    pub width: i32,
    pub depth: i32,
    /// See [`single_mix`].
    pub single: SingleMix,
    pub pad: u32,
}

/// The mix of all ground, where it is the same everywhere.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SingleMix {
    /// 1 where it is; 0 otherwise.
    pub is_single: u32,
    /// Four `u8` each.
    pub ids: u32,
    pub weights: u32,
}

impl KernelParams for MeshParams {
    const KERNEL: Kernel = Kernel::Mesh;
}

/// The stack of bricks (x, z) as blocks see it, whose record is in slot `stack`.
pub(crate) fn column_job(view: &WorldView, (x, z): (i32, i32), stack: u32) -> ColumnJob {
    let mask = view.mask.word((x, z));
    let borders = view.mask.border_edges(view.grid, (x, z));
    let borders = borders.map(|bits| [0, 32, 64, 96].map(|shift| (bits >> shift) as u32));
    ColumnJob { stack, x, z, pad: 0, mask, pad2: 0, borders }
}

/// The mix of all ground, where it is the same everywhere.
pub(crate) fn single_mix(ground: &Ground) -> SingleMix {
    ground.single_material().map(MaterialMix::pure).map_or(SingleMix::default(), |mix| SingleMix {
        is_single: 1,
        ids: u32::from_le_bytes(mix.ids),
        weights: u32::from_le_bytes(mix.weights),
    })
}

/// The triangles of all cases: for each up to 15 places of edges, counted from the cube's lowest corner, as
/// `729 axis + 81 y + 9 z + x`; the last number is how many there are.
pub(crate) fn table() -> [[u16; 16]; 256] {
    *block::SLOTS
}
