//! Input and output of the mesh kernel.

use bytemuck::{Pod, Zeroable};

use super::Address;
use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::ground::Ground;
use crate::surface::vertex::WorldView;
use crate::surface::{MaterialMix, block};

/// Data shared by the blocks of one stack of bricks.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ColumnJob {
    /// Slot of its ground stack.
    pub stack: u32,
    /// Position of the stack of bricks.
    pub x: i32,
    pub z: i32,
    pub pad: u32,
    /// Masked cells, bit `z * 8 + x`.
    pub mask: u64,
    pub pad2: u64,
    /// Lattice edges on the mask's border, 128 bits per axis, as in
    /// [`border_edges`](crate::surface::MaskView::border_edges).
    pub borders: [[u32; 4]; 3],
}

/// A block to mesh.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MeshJob {
    /// The entry of its brick in `windows`.
    pub window: u32,
    /// Strides to the next brick: along x, and along z `<< 16`. Along y it is 1. All 27 bricks around must be in
    /// the window.
    pub strides: u32,
    /// Number of its [`ColumnJob`].
    pub column: u32,
    /// The brick's y coordinate.
    pub y: i32,
    /// Packed box of the cells to draw.
    pub cells: u32,
    pub pad: u32,
}

/// The location of a block's surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MeshResult {
    /// First vertex and number of vertices. The first is [`NONE`] if there was no room, and nothing was written.
    pub vertex: u32,
    pub vertices: u32,
    /// First index and number of indices.
    pub index: u32,
    pub indices: u32,
}

/// Parameters of `mesh`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MeshParams {
    /// First slots of the caches of bricks and stacks.
    pub bricks: Address,
    pub stacks: Address,
    /// References of bricks.
    pub windows: Address,
    /// [`ColumnJob`]s.
    pub columns: Address,
    /// [`MeshJob`]s, one per block.
    pub jobs: Address,
    /// The content of [`table`].
    pub table: Address,
    /// Output: a [`MeshResult`] per job.
    pub results: Address,
    /// Output: four `u16` each: x, y, z in 1/4096 voxel from the brick's minimum corner, and 0.
    pub positions: Address,
    /// Output: three `f32` each.
    pub normals: Address,
    /// Output: eight `u8` each, ids and weights of a [`MaterialMix`]. 0 if mixes are not needed.
    pub mixes: Address,
    /// Output: `u16` each, relative to the block's first vertex.
    pub indices: Address,
    /// Numbers of vertices and indices: two `u32`, initially zero. They keep counting past the capacities.
    pub counters: Address,
    pub vertex_capacity: u32,
    pub index_capacity: u32,
    /// Size of the world in cells.
    pub width: i32,
    pub depth: i32,
    /// See [`single_mix`].
    pub single: SingleMix,
    pub pad: u32,
    /// A [`StrataTable`](super::StrataTable), or 0.
    pub strata: Address,
}

/// The material mix of the ground if it is uniform.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SingleMix {
    /// 1 if it is uniform, else 0.
    pub is_single: u32,
    /// Four `u8` each.
    pub ids: u32,
    pub weights: u32,
}

impl KernelParams for MeshParams {
    const KERNEL: Kernel = Kernel::Mesh;
}

/// The job for the blocks of the stack of bricks at (x, z), whose record is in slot `stack`.
pub(crate) fn column_job(view: &WorldView, (x, z): (i32, i32), stack: u32) -> ColumnJob {
    let mask = view.mask.word((x, z));
    let borders = view.mask.border_edges(view.grid, (x, z));
    let borders = borders.map(|bits| [0, 32, 64, 96].map(|shift| (bits >> shift) as u32));
    ColumnJob { stack, x, z, pad: 0, mask, pad2: 0, borders }
}

/// The material mix of the ground if it is uniform.
pub(crate) fn single_mix(ground: &Ground) -> SingleMix {
    ground.single_material().map(MaterialMix::pure).map_or(SingleMix::default(), |mix| SingleMix {
        is_single: 1,
        ids: u32::from_le_bytes(mix.ids),
        weights: u32::from_le_bytes(mix.weights),
    })
}

/// The triangles of all marching cubes cases: up to 15 edge ids relative to the cube's minimum corner, `729 axis +
/// 81 y + 9 z + x`. The last number is their count.
pub(crate) fn table() -> [[u16; 16]; 256] {
    *block::SLOTS
}
