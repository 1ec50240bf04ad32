//! Input and output of the edit kernels.

use bytemuck::{Pod, Zeroable};
use glam::IVec3;

use super::Address;
use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::brush::shapes::GridParams;
use crate::brush::{Evaluator, Kind};
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, LatticeBox};

/// Maximum length of `list` in one `edit` launch. Each entry may write 256 counts and 8 parts.
pub(crate) const MOST_LIST: usize = 1 << 23;

/// A brick to edit.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditJob {
    /// The brick's [`BrickPos`].
    pub brick: [i32; 3],
    /// Reference of the current brick.
    pub base: u32,
    /// Slot for the edited brick; may be the one of `base`.
    pub target: u32,
    /// Slot of its ground stack.
    pub stack: u32,
    /// The brick's edits in order, a range of `list`.
    pub first: u32,
    pub count: u32,
    /// See [`cuts`].
    pub cuts: u32,
    /// `stencil_edit` only: its entry in the windows, and the strides along x and along z `<< 16`; along y it is 1.
    pub window: u32,
    pub strides: u32,
    /// Fills and carves only: the number of its [`SurfaceJob`](super::SurfaceJob), or [`NONE`].
    pub surface: u32,
}

impl EditJob {
    /// The brick's position.
    pub fn pos(&self) -> BrickPos {
        BrickPos(IVec3::from_array(self.brick))
    }

    /// The position of the brick's stack.
    pub fn place(&self) -> (i32, i32) {
        let [x, _, z] = self.brick;
        (x, z)
    }
}

/// A quantised edit with its derived constants.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditRecord {
    /// Index of the shape, in the order of `brush/shapes/mod.rs`.
    pub kind: u32,
    /// 0 dig, 1 add, 2 paint.
    pub operation: u32,
    pub material: u32,
    pub is_rough: u32,
    /// The shape's origin: whole voxels, and the remainder in 1/256 voxel.
    pub origin_voxel: [i32; 3],
    pub origin_fraction: [i32; 3],
    /// Inclusive bounds of the lattice points of the world within its reach.
    pub min: [i32; 3],
    pub max: [i32; 3],
    pub constants: [f32; 12],
    pub amplitude: i32,
    pub scale: i32,
    pub seed: u32,
    /// The point that noise is tied to, in 1/256 voxel.
    pub noise_origin: [i32; 3],
    /// Distance outside the rough shape up to which samples may change.
    pub band: i32,
    /// Index of its [`GridRecord`], or [`NONE`].
    pub grid: u32,
}

/// A shape that is given by distances on a grid.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct GridRecord {
    /// Rows of the rotation's matrix, and their divisor.
    pub rows: [[i64; 3]; 3],
    pub squared: i64,
    /// Spacing of the samples in 1/256 voxel.
    pub scale: i64,
    /// Number of samples along each side.
    pub size: [u32; 3],
    /// Index of the first sample of its image.
    pub image: u32,
    pub has_materials: u32,
    pub pad: u32,
}

impl GridRecord {
    /// The record of a grid, whose image begins at an index.
    pub fn new(of: &GridParams, image: u32) -> Self {
        let &GridParams { rows, squared, scale, size, has_materials, .. } = of;
        Self { rows, squared, scale, size, image, has_materials: has_materials.into(), pad: 0 }
    }
}

/// The result for a brick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditResult {
    /// Change of the hash of the world's samples.
    pub hash: u64,
    /// A combination of the constants below.
    pub flags: u32,
    /// Entries of `records` and `materials`; [`NONE`] if nothing was written, possibly for lack of room.
    pub record: u32,
    pub material: u32,
    /// Packed bounds of the changed samples.
    pub bounds: u32,
    /// `sample | material << 16` of a uniform brick.
    pub uniform: u32,
    pub pad: u32,
}

impl EditResult {
    /// Some sample changed, and the brick is in its target slot. Without this flag, all other values are
    /// meaningless, apart from `TOO_FAR`.
    pub const CHANGED: u32 = 1;
    /// Some pristine sample became edited.
    pub const EXTENDED: u32 = 2;
    /// All samples are edited and equal; no record was written.
    pub const UNIFORM: u32 = 4;
    /// The brick has materials.
    pub const HAS_MATERIALS: u32 = 8;
    /// New ground had to search beyond the windows for its material, so the result may be wrong.
    pub const TOO_FAR: u32 = 16;
}

/// What an edit changed in the part of a brick that belongs to one chunk.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditPart {
    /// Number of the job.
    pub job: u32,
    /// Number of the edit record.
    pub edit: u32,
    /// See [`part_chunk`].
    pub part: u32,
    /// Packed bounds of the changed samples.
    pub bounds: u32,
}

/// Voxels affected by an edit. Several entries may have the same edit, outcome and material.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditCount {
    /// Number of the edit record.
    pub edit: u32,
    /// 0 removed, 1 added, 2 painted, 3 protected, 4 unbreakable, 5 too hard, 6 slowed; plus `material << 8`.
    pub outcome: u32,
    pub voxels: u32,
    pub pad: u32,
}

/// Parameters of `edit`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditParams {
    /// First slots of the caches of bricks and stacks.
    pub bricks: Address,
    pub stacks: Address,
    /// [`EditJob`]s, one per block.
    pub jobs: Address,
    /// Numbers of edit records.
    pub list: Address,
    pub edit_records: Address,
    /// Output: an [`EditResult`] per job.
    pub results: Address,
    /// Output: [`RECORD_BYTES`] each.
    pub records: Address,
    /// Output: [`MATERIAL_BYTES`] each.
    pub materials: Address,
    /// Output: [`EditPart`]s and [`EditCount`]s, in any order.
    pub parts: Address,
    pub counts: Address,
    /// Numbers of records, materials, parts and counts: four `u32`, initially zero. They keep counting past the
    /// capacities.
    pub counters: Address,
    pub record_capacity: u32,
    pub material_capacity: u32,
    pub part_capacity: u32,
    pub count_capacity: u32,
    /// A [`StrataTable`](super::StrataTable), or 0.
    pub strata: Address,
    /// [`GridRecord`]s.
    pub grids: Address,
    /// Samples of the images of stamps and grids, `u16` each.
    pub images: Address,
}

impl KernelParams for EditParams {
    const KERNEL: Kernel = Kernel::Edit;
}

/// The record of an edit with this reach in the world; `None` if it reaches no sample. `grid` is the index of its grid,
/// or [`NONE`].
pub(crate) fn record(
    reach: Option<LatticeBox>,
    operation: Kind,
    evaluator: &Evaluator,
    grid: u32,
) -> EditRecord {
    let of = evaluator.constants();
    let nothing = LatticeBox { min: IVec3::MAX, max: IVec3::MIN };
    let LatticeBox { min, max } = reach.unwrap_or(nothing);
    let (amplitude, scale, seed, noise_origin) = of.roughness.unwrap_or((0, 1, 0, [0; 3]));
    EditRecord {
        kind: of.kind,
        operation: match operation {
            Kind::Dig => 0,
            Kind::Add { .. } => 1,
            // Resets and pastes never come here: see `edits::reset` and `edits::paste`.
            Kind::Paint { .. } | Kind::Sculpt | Kind::Reset | Kind::Paste => 2,
        },
        material: operation.material().map_or(0, |material| material.0.into()),
        is_rough: of.roughness.is_some().into(),
        origin_voxel: of.origin_voxel.to_array(),
        origin_fraction: of.origin_fraction.to_array(),
        min: min.to_array(),
        max: max.to_array(),
        constants: of.shape,
        amplitude,
        scale,
        seed,
        noise_origin,
        band: of.band,
        grid,
    }
}

/// How many of a brick's samples along x belong to the chunk of its minimum corner, and likewise along y `<< 4` and
/// z `<< 8`. Any others belong to the next chunk.
pub(crate) fn cuts(grid: ChunkGrid, brick: BrickPos) -> u32 {
    let low = brick.origin();
    let own = grid.chunk_samples(grid.chunk_of(low)).max.saturating_sub(low).saturating_add(IVec3::ONE);
    let IVec3 { x, y, z } = own.clamp(IVec3::ZERO, IVec3::splat(8));
    (x | y << 4 | z << 8) as u32
}

/// The chunk of one part of a brick. Bits 0, 1, 2 of `part` are set beyond the cut along x, y, z.
pub(crate) fn part_chunk(grid: ChunkGrid, brick: BrickPos, part: u32) -> ChunkPos {
    let beyond = [0, 1, 2].map(|axis| (part >> axis & 1) as i32);
    ChunkPos::from_ivec3(grid.chunk_of(brick.origin()).as_ivec3() + IVec3::from_array(beyond))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_is_in_the_part_of_its_chunk() {
        for (size, width, depth) in [(8, 24, 20), (25, 64, 75), (9, 8, 10), (100, 104, 116)] {
            let grid = ChunkGrid::new(size, width, depth);
            let world = LatticeBox { min: IVec3::new(0, -30, 0), max: IVec3::new(width, 30, depth) };
            for point in world.points() {
                let brick = BrickPos::of(point);
                let (inside, cuts) = ((point & 7).to_array(), cuts(grid, brick));
                let is_beyond = |axis: usize| inside[axis] >= (cuts >> (axis * 4) & 15) as i32;
                let part = (0..3).fold(0, |part, axis| part | u32::from(is_beyond(axis)) << axis);
                assert_eq!(part_chunk(grid, brick, part), grid.chunk_of(point), "{point}");
            }
        }
    }
}
