//! What host and kernels hand each other: the other half of `kernels.cu`.
//!
//! All numbers are little-endian. Bricks on the device are called by a *reference*, `slot << 1 | has_materials`, or
//! [`NONE`]. Samples of a brick are numbered `x + 8 z + 64 y`. Boxes inside a brick are one word, see [`pack_box`].

use bytemuck::{Pod, Zeroable};
use glam::IVec3;

use crate::brush::{Evaluator, Kind};
use crate::ground::{ColumnMaterial, Ground, MaterialId};
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, Column, LatticeBox};
use crate::surface::vertex::WorldView;
use crate::surface::{MaterialMix, block, borders};
use crate::volume::{Brick, Sample};

/// An address on the device.
pub(crate) type Address = u64;

/// No brick; no entry.
pub(crate) const NONE: u32 = u32::MAX;

/// Threads of a block, whichever the kernel.
pub(crate) const THREADS: u32 = 128;

/// Most jobs of one launch. Each block may ask for 7680 indices, and counters have 32 bits.
pub(crate) const MOST_JOBS: usize = 1 << 19;

/// Most numbers in the `list` of one `edit` launch. Each may enter 256 counts and 8 parts.
pub(crate) const MOST_LIST: usize = 1 << 23;

/// Bytes of a brick's slot: a record, then materials.
pub(crate) const BRICK_BYTES: usize = RECORD_BYTES + MATERIAL_BYTES;
/// Bytes of a brick's samples and bits.
pub(crate) const RECORD_BYTES: usize = size_of::<BrickRecord>();
/// Bytes of a brick's materials.
pub(crate) const MATERIAL_BYTES: usize = 512;

/// A brick without its materials.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BrickRecord {
    /// Densities in 1/256 voxel, `i16::MIN` for pristine samples.
    pub samples: [i16; 512],
    /// A word for each y, bit `z * 8 + x`.
    pub solid: [u64; 8],
    pub edited: [u64; 8],
}

/// The columns around a stack of bricks, from one before its first on, 11 x 11 of them, x fastest.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct StackRecord {
    /// In 1/256 voxel.
    pub heights: [i32; 121],
    /// `base | overlay << 8 | blend << 16`.
    pub columns: [u32; 121],
    pub pad: [u32; 2],
}

/// Bytes to be copied; addresses and size are multiples of 16.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ScatterJob {
    pub to: Address,
    pub from: Address,
    pub bytes: u32,
    pub pad: u32,
}

/// The parameter of `scatter`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ScatterParams {
    /// [`ScatterJob`]s, one for each block.
    pub jobs: Address,
}

/// A brick to be edited.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditJob {
    /// Its [`BrickPos`].
    pub brick: [i32; 3],
    /// Reference of what it is now.
    pub base: u32,
    /// Slot for what it becomes; may be the one of `base`.
    pub target: u32,
    /// Slot of its stack.
    pub stack: u32,
    /// Its tools, in order: a range of `list`.
    pub first: u32,
    pub count: u32,
    /// See [`cuts`].
    pub cuts: u32,
    pub pad: [u32; 3],
}

/// An edit, all that is derived from it once included.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Tool {
    /// Sphere, cuboid, cylinder, capsule, cone.
    pub kind: u32,
    /// Dig, add, paint.
    pub operation: u32,
    pub material: u32,
    pub is_rough: u32,
    /// The shape's origin: voxels, and 1/256 voxel from there.
    pub home: [i32; 3],
    pub rest: [i32; 3],
    /// The lattice points that it reaches in the world, both ends included.
    pub min: [i32; 3],
    pub max: [i32; 3],
    pub constants: [f32; 12],
    pub amplitude: i32,
    pub scale: i32,
    pub seed: u32,
    pub pad: u32,
}

/// What became of a brick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditResult {
    /// By how much the hash of the world's samples changes.
    pub hash: u64,
    /// See the constants.
    pub flags: u32,
    /// Entries of `records` and `materials`, [`NONE`] where nothing was written, also for lack of room.
    pub record: u32,
    pub material: u32,
    /// The box around the samples that changed.
    pub bounds: u32,
    /// `sample | material << 16` of a uniform brick.
    pub uniform: u32,
    pub pad: u32,
}

impl EditResult {
    /// Some sample changed; the brick is in its target slot. Without this flag nothing else is said.
    pub const CHANGED: u32 = 1;
    /// Some sample is edited now that had not been.
    pub const EXTENDED: u32 = 2;
    /// All samples are edited and alike; no record was written.
    pub const UNIFORM: u32 = 4;
    /// The brick has materials.
    pub const HAS_MATERIALS: u32 = 8;
}

/// What an edit changed in one chunk's part of a brick.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditPart {
    /// Number of the job.
    pub job: u32,
    /// Number of the tool.
    pub edit: u32,
    /// See [`part_chunk`].
    pub part: u32,
    /// The box around the samples that changed.
    pub bounds: u32,
}

/// Voxels that an edit dealt with. There may be several for one edit, fate and material.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditCount {
    /// Number of the tool.
    pub edit: u32,
    /// Removed (0), added (1) or painted (2), and `material << 8`.
    pub fate: u32,
    pub voxels: u32,
    pub pad: u32,
}

/// The parameter of `edit`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EditParams {
    /// Slots of bricks, of stacks.
    pub bricks: Address,
    pub stacks: Address,
    /// [`EditJob`]s, one for each block.
    pub jobs: Address,
    /// Numbers of tools.
    pub list: Address,
    pub tools: Address,
    /// Out: an [`EditResult`] for each job.
    pub results: Address,
    /// Out: [`RECORD_BYTES`] each.
    pub records: Address,
    /// Out: [`MATERIAL_BYTES`] each.
    pub materials: Address,
    /// Out: [`EditPart`]s, [`EditCount`]s, in any order.
    pub parts: Address,
    pub counts: Address,
    /// Records, materials, parts, counts: four `u32`, zero at the start, which go on past the capacities.
    pub counters: Address,
    pub record_capacity: u32,
    pub material_capacity: u32,
    pub part_capacity: u32,
    pub count_capacity: u32,
}

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
    /// Lattice edges on the mask's border, as [`borders`] has them: for each axis 128 bits.
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
    /// Slots of bricks, of stacks.
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

/// Columns of a block of `heights`.
pub(crate) const COLUMNS: usize = 8 * THREADS as usize;

/// The parameter of `heights`. See [`NoiseTerms`](crate::ground::NoiseTerms).
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct HeightsParams {
    /// For each octave 256 `u8`.
    pub tables: Address,
    /// Out: an `i32` for each column, in 1/256 voxel; `i32::MIN` where that is beyond the lattice's limit.
    pub heights: Address,
    pub scale: f64,
    pub origin: [f64; 2],
    pub frequency: f64,
    pub lacunarity: f64,
    pub persistence: f64,
    pub weighting: f64,
    pub factor: f64,
    pub peak: f64,
    pub amplitude: f64,
    pub base: f64,
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

// kernels.cu says the same.
const _: () = assert!(size_of::<BrickRecord>() == 1152 && BRICK_BYTES == 1664);
const _: () = assert!(size_of::<StackRecord>() == 976 && size_of::<ScatterJob>() == 24);
const _: () =
    assert!(size_of::<EditJob>() == 48 && size_of::<Tool>() == 128 && size_of::<EditResult>() == 32);
const _: () =
    assert!(size_of::<EditPart>() == 16 && size_of::<EditCount>() == 16 && size_of::<EditParams>() == 104);
const _: () =
    assert!(size_of::<ColumnJob>() == 80 && size_of::<MeshJob>() == 24 && size_of::<MeshResult>() == 16);
const _: () = assert!(size_of::<MeshParams>() == 128 && size_of::<ScatterParams>() == 8);
const _: () = assert!(size_of::<HeightsParams>() == 128 && crate::ground::MAX_OCTAVES <= 16);

/// Writes a brick as it is in a slot: [`BRICK_BYTES`], or [`RECORD_BYTES`] where `out` has no room for materials.
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

/// The brick of a record and its materials, if it has any; `None` where a slice is too short.
pub(crate) fn brick_of(record: &[u8], materials: Option<&[u8]>) -> Option<Brick> {
    let record: BrickRecord = bytemuck::cast(*record.first_chunk::<RECORD_BYTES>()?);
    let materials = match materials {
        Some(materials) => Some(materials.first_chunk::<MATERIAL_BYTES>()?),
        None => None,
    };
    Some(Brick::of_parts(&record.samples, record.solid, record.edited, materials))
}

/// The columns around the stack of bricks (x, z).
pub(crate) fn stack_record(ground: &Ground, (x, z): (i32, i32)) -> StackRecord {
    let low = Column::new(x * 8 - 1, z * 8 - 1);
    let word = |material: ColumnMaterial| {
        u32::from_le_bytes([material.base.0, material.overlay.0, material.blend, 0])
    };
    let heights = ground.heights::<11>(low);
    let mut record = StackRecord { heights: [0; 121], columns: [0; 121], pad: [0; 2] };
    record.heights.copy_from_slice(heights.as_flattened());
    match ground.single_material() {
        Some(material) => record.columns.fill(word(ColumnMaterial::solid(material))),
        None => {
            let columns = (0..11).flat_map(|z| (0..11).map(move |x| low.offset(x, z)));
            let words = columns.map(|column| word(ground.column_material(column)));
            record.columns.iter_mut().zip(words).for_each(|(place, word)| *place = word);
        }
    }
    record
}

/// An edit that reaches these samples of the world; `None`: it reaches none. One that sculpts is no work for a card.
pub(crate) fn tool(reach: Option<LatticeBox>, operation: Kind, evaluator: &Evaluator) -> Tool {
    let of = evaluator.constants();
    let nothing = LatticeBox { min: IVec3::MAX, max: IVec3::MIN };
    let LatticeBox { min, max } = reach.filter(|_| operation != Kind::Sculpt).unwrap_or(nothing);
    let (amplitude, scale, seed) = of.grain.unwrap_or((0, 1, 0));
    Tool {
        kind: of.kind,
        operation: match operation {
            Kind::Dig => 0,
            Kind::Add { .. } => 1,
            Kind::Paint { .. } | Kind::Sculpt => 2,
        },
        material: operation.material().map_or(0, |material| material.0.into()),
        is_rough: of.grain.is_some().into(),
        home: of.home.to_array(),
        rest: of.rest.to_array(),
        min: min.to_array(),
        max: max.to_array(),
        constants: of.shape,
        amplitude,
        scale,
        seed,
        pad: 0,
    }
}

/// How many of a brick's samples along x (`<< 4`: y, `<< 8`: z) belong to the chunk of its lowest one; the rest, if any,
/// belongs to the next.
pub(crate) fn cuts(grid: ChunkGrid, brick: BrickPos) -> u32 {
    let low = brick.origin();
    let own = grid.chunk_samples(grid.chunk_of(low)).max.saturating_sub(low).saturating_add(IVec3::ONE);
    let IVec3 { x, y, z } = own.clamp(IVec3::ZERO, IVec3::splat(8));
    (x | y << 4 | z << 8) as u32
}

/// The chunk that a part of a brick belongs to: bits 0, 1, 2 of the part are set beyond the cut along x, y, z.
pub(crate) fn part_chunk(grid: ChunkGrid, brick: BrickPos, part: u32) -> ChunkPos {
    let beyond = [0, 1, 2].map(|axis| (part >> axis & 1) as i32);
    ChunkPos::from_ivec3(grid.chunk_of(brick.origin()).as_ivec3() + IVec3::from_array(beyond))
}

/// A box inside a brick, both ends included, as one word: lowest `x | y << 3 | z << 6`, and the same of the highest
/// `<< 9`. `from` is the brick's lowest sample.
pub(crate) fn pack_box(cells: LatticeBox, from: IVec3) -> u32 {
    let pack = |at: IVec3| {
        let IVec3 { x, y, z } = (at - from) & 7;
        (x | y << 3 | z << 6) as u32
    };
    pack(cells.min) | pack(cells.max) << 9
}

/// What [`pack_box`] made of it.
pub(crate) fn unpack_box(word: u32, from: IVec3) -> LatticeBox {
    let unpack = |word: u32| from + IVec3::new(word as i32 & 7, word as i32 >> 3 & 7, word as i32 >> 6 & 7);
    LatticeBox { min: unpack(word), max: unpack(word >> 9) }
}

/// The stack of bricks (x, z) as blocks see it, whose record is in slot `stack`.
pub(crate) fn column_job(view: &WorldView, (x, z): (i32, i32), stack: u32) -> ColumnJob {
    let mask = view.mask.word((x, z));
    let borders = borders(view, (x, z), mask).map(|bits| [0, 32, 64, 96].map(|shift| (bits >> shift) as u32));
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
    block::slot_table()
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
            let materials = brick.materials().map(|_| &bytes[RECORD_BYTES..]);
            let found = brick_of(&bytes, materials).expect("all bytes are there");
            assert_eq!(found.samples(), brick.samples());
            assert_eq!((found.solid(), found.edited()), (brick.solid(), brick.edited()));
            assert_eq!(found.materials(), brick.materials());
            brick.set_material(300, MaterialId(9));
        }
        assert_eq!(bytes[RECORD_BYTES + 299..][..3], [255, 9, 255]);
        assert!(brick_of(&bytes[..RECORD_BYTES - 1], None).is_none());
    }

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
