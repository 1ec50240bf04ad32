//! Meshing on the device: one launch for all blocks.

use super::device::{Device, Fault, Kernel};
use super::layout::{self, ColumnJob, MOST_JOBS, MeshJob, MeshParams, MeshResult};
use super::lists::{cut, fill, hand_out, map};
use super::mail::{Outbox, Plan};
use super::session::{Session, Uploads};
use super::surfaces::Surfaces;
use super::windows::Windows;
use crate::lattice::{pieces, side_by_side};
use crate::surface::MaterialMix;
use crate::surface::block::Block;
use crate::surface::fresh::PackedMixes;
use crate::surface::vertex::WorldView;

/// What the mesh kernel writes.
pub(super) struct MeshOutput {
    results: Outbox,
    positions: Outbox,
    normals: Outbox,
    mixes: Outbox,
    indices: Outbox,
}

/// Positions, normals and indices.
#[cfg(all(feature = "interop", target_os = "linux"))]
pub(super) type Lists<'a> = (&'a [[u16; 4]], &'a [[f32; 3]], &'a [u16]);

/// Vertices that there is room for at the start; indices are six times as many.
const FIRST_VERTICES: usize = 1 << 14;

/// Indices for each vertex: two triangles, as surfaces have.
const INDICES: usize = 6;

impl MeshOutput {
    pub fn new(device: &mut dyn Device) -> Result<Self, Fault> {
        Ok(Self {
            results: Outbox::new(device, size_of::<MeshResult>(), 1 << 10)?,
            positions: Outbox::new(device, size_of::<[u16; 4]>(), FIRST_VERTICES)?,
            normals: Outbox::new(device, size_of::<[f32; 3]>(), FIRST_VERTICES)?,
            mixes: Outbox::new(device, size_of::<[u8; 8]>(), FIRST_VERTICES)?,
            indices: Outbox::new(device, size_of::<u16>(), FIRST_VERTICES * INDICES)?,
        })
    }

    /// Room for so many vertices and indices; says whether there was too little.
    fn reserve(
        &mut self,
        device: &mut dyn Device,
        (vertices, indices): (usize, usize),
        is_long: bool,
    ) -> Result<bool, Fault> {
        let mut grown = false;
        for list in [&mut self.positions, &mut self.normals, &mut self.mixes] {
            grown |= list.reserve(device, vertices, is_long)?;
        }
        grown |= self.indices.reserve(device, indices, is_long)?;
        Ok(grown)
    }

    /// What the kernel wanted to write for so many blocks.
    fn extent(&self, blocks: usize) -> Extent {
        let all = self.results.entries::<MeshResult>(blocks);
        let of = |results: &[MeshResult]| results.iter().fold(Extent::default(), Extent::with);
        if all.len() < MANY_RESULTS {
            return of(all);
        }
        let pieces: Vec<&[MeshResult]> = all.chunks(MANY_RESULTS / 4).collect();
        map(&pieces, 2, |results| of(results)).into_iter().fold(Extent::default(), Extent::join)
    }

    /// What was written and copied for blocks.
    pub fn surfaces<'a>(&'a self, view: &WorldView, blocks: &'a [Block], meshed: Meshed) -> Surfaces<'a> {
        let (vertices, indices) = meshed.totals;
        Surfaces {
            grid: view.grid,
            blocks,
            results: self.results.entries(blocks.len()),
            positions: self.positions.entries(vertices),
            normals: self.normals.entries(vertices),
            mixes: match meshed.plain {
                Some(mix) => PackedMixes::One(mix),
                None => PackedMixes::Each(self.mixes.entries(vertices)),
            },
            indices: self.indices.entries(indices),
        }
    }

    /// Copies what is not here yet.
    fn fetch(
        &mut self,
        device: &mut dyn Device,
        (vertices, indices): (usize, usize),
        with_mixes: bool,
    ) -> Result<(), Fault> {
        let mut is_copied = self.positions.fetch(device, vertices)?;
        is_copied |= self.normals.fetch(device, vertices)?;
        is_copied |= self.indices.fetch(device, indices)?;
        is_copied |= with_mixes && self.mixes.fetch(device, vertices)?;
        if is_copied { device.wait() } else { Ok(()) }
    }

    /// Where positions, normals and indices are on the device.
    #[cfg(all(feature = "interop", target_os = "linux"))]
    pub fn there(&self) -> [u64; 3] {
        [&self.positions, &self.normals, &self.indices].map(Outbox::address)
    }

    /// Where the surfaces of so many blocks are in these lists.
    #[cfg(all(feature = "interop", target_os = "linux"))]
    pub fn results(&self, blocks: usize) -> &[MeshResult] {
        self.results.entries(blocks)
    }

    /// Copies positions, normals and indices to the host.
    #[cfg(all(feature = "interop", target_os = "linux"))]
    pub fn download(
        &mut self,
        device: &mut dyn Device,
        (vertices, indices): (usize, usize),
    ) -> Result<Lists<'_>, Fault> {
        self.fetch(device, (vertices, indices), false)?;
        Ok((self.positions.entries(vertices), self.normals.entries(vertices), self.indices.entries(indices)))
    }

    fn vertex_capacity(&self) -> u32 {
        self.positions.capacity().min(self.normals.capacity()).min(self.mixes.capacity())
    }
}

/// How much blocks have together, and where the last of it ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Extent {
    vertices: usize,
    indices: usize,
    vertex_end: usize,
    index_end: usize,
}

impl Extent {
    /// With one block more.
    fn with(self, result: &MeshResult) -> Self {
        let end = |first: u32, count: u32| (first as usize).saturating_add(count as usize);
        self.join(Self {
            vertices: result.vertices as usize,
            indices: result.indices as usize,
            vertex_end: end(result.vertex, result.vertices),
            index_end: end(result.index, result.indices),
        })
    }

    /// Of both.
    fn join(self, other: Self) -> Self {
        Self {
            vertices: self.vertices + other.vertices,
            indices: self.indices + other.indices,
            vertex_end: self.vertex_end.max(other.vertex_end),
            index_end: self.index_end.max(other.index_end),
        }
    }

    /// Vertices and indices.
    fn totals(self) -> (usize, usize) {
        (self.vertices, self.indices)
    }

    /// Does all of it lie in lists that are as long as that?
    fn is_in_lists(self) -> bool {
        self.vertex_end <= self.vertices && self.index_end <= self.indices
    }
}

/// What a launch wrote.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meshed {
    /// Vertices and indices.
    totals: (usize, usize),
    /// What all vertices are made of, if it is the same everywhere; their mixes are not written then.
    plain: Option<MaterialMix>,
}

/// Blocks of some stacks that one thread deals with.
struct Piece<'b> {
    blocks: &'b [Block],
    /// The numbers of the first block, and of its stack.
    first: usize,
    column: u32,
}

/// A stack of blocks, with its slot.
type Column = ((i32, i32), u32);

/// From how many stacks on they are dealt with side by side.
const LONG: usize = 256;

/// How many blocks a thread deals with at a time.
const PIECE: usize = 256;

/// From how many blocks on what the kernel says of them is added up side by side.
const MANY_RESULTS: usize = 1 << 13;

/// From how many blocks on their surfaces are copied, instead of written to the host's memory by the kernel.
const COPIED: usize = 512;

impl Session {
    /// Meshes blocks. Their [`surfaces`](MeshOutput::surfaces) are in this session's memory until the next launch.
    /// `meanwhile` is called when the device is at work.
    pub fn mesh(
        &mut self,
        view: &WorldView,
        blocks: &[Block],
        meanwhile: &(dyn Fn() + Sync),
    ) -> Result<Meshed, Fault> {
        self.begin();
        let mut uploads = Uploads::new(view.samples.ground());
        let is_long = blocks.len() >= COPIED;
        let meshed = self.run_mesh(view, blocks, &mut uploads, is_long, meanwhile).and_then(|meshed| {
            self.meshes.fetch(&mut *self.device, meshed.totals, meshed.plain.is_none())?;
            Ok(meshed)
        });
        if meshed.is_err() {
            self.give_up(&uploads);
        }
        meshed
    }

    /// Meshes blocks and leaves their surfaces on the device, however few they are: how many vertices and indices there
    /// are, in [`MeshOutput::there`].
    #[cfg(all(feature = "interop", target_os = "linux"))]
    pub fn mesh_there(&mut self, view: &WorldView, blocks: &[Block]) -> Result<(usize, usize), Fault> {
        self.begin();
        let mut uploads = Uploads::new(view.samples.ground());
        let meshed = self.run_mesh(view, blocks, &mut uploads, true, &|| {});
        if meshed.is_err() {
            self.give_up(&uploads);
        }
        meshed.map(|meshed| meshed.totals)
    }

    /// Has blocks meshed; their [`MeshResult`]s are here then, and surfaces not yet. `is_long`: they are written on the
    /// device and to be copied, instead of straight to the host's memory.
    fn run_mesh<'a>(
        &mut self,
        view: &WorldView<'a>,
        blocks: &[Block],
        uploads: &mut Uploads<'a>,
        is_long: bool,
        meanwhile: &(dyn Fn() + Sync),
    ) -> Result<Meshed, Fault> {
        if blocks.len() > MOST_JOBS {
            return Err(Fault::TooLarge(blocks.len()));
        }
        let ground = view.samples.ground();
        let (pieces, columns) = self.columns(view, blocks, uploads)?;
        let windows = self.windows(uploads, view.samples, blocks, |block| block.brick, 1)?;
        let single = ground.single_material().map(MaterialMix::pure);
        let plain = single.filter(|_| !windows.has_materials());

        let mut plan = Plan::default();
        uploads.plan(&mut plan);
        let window_list = plan.section::<u32>(windows.len());
        let column_list = plan.section::<ColumnJob>(columns.len());
        let job_list = plan.section::<MeshJob>(blocks.len());
        let counters = plan.section::<u32>(4);
        self.inbox.open(&mut *self.device, &plan)?;
        let (refs, column_jobs, jobs) = self.inbox.entries_of(window_list, column_list, job_list);
        let column = |_, &(place, slot): &Column| layout::column_job(view, place, slot);
        let write_columns = || fill(&columns, column_jobs, LONG, column);
        let write_jobs = || write_jobs(view, &windows, &pieces, jobs);
        side_by_side(pieces.len() > 1, write_columns, || {
            side_by_side(pieces.len() > 1, write_jobs, || windows.write(refs))
        });
        self.inbox.entries::<u32>(counters).fill(0);
        self.meshes.results.reserve(&mut *self.device, blocks.len(), is_long)?;
        self.meshes.reserve(&mut *self.device, (0, 0), is_long)?;

        for _ in 0..2 {
            self.send(&plan, uploads)?;
            let params = MeshParams {
                bricks: self.bricks.base(),
                stacks: self.stacks.base(),
                windows: self.inbox.address(window_list),
                columns: self.inbox.address(column_list),
                jobs: self.inbox.address(job_list),
                table: self.table,
                results: self.meshes.results.address(),
                positions: self.meshes.positions.address(),
                normals: self.meshes.normals.address(),
                mixes: if plain.is_some() { 0 } else { self.meshes.mixes.address() },
                indices: self.meshes.indices.address(),
                counters: self.inbox.address(counters),
                vertex_capacity: self.meshes.vertex_capacity(),
                index_capacity: self.meshes.indices.capacity(),
                width: view.grid.width(),
                depth: view.grid.depth(),
                single: layout::single_mix(ground),
                pad: 0,
            };
            self.device.launch(Kernel::Mesh, blocks.len() as u32, bytemuck::bytes_of(&params))?;
            self.meshes.results.fetch(&mut *self.device, blocks.len())?;
            meanwhile();
            self.device.wait()?;
            self.times = self.device.times();
            let extent = self.meshes.extent(blocks.len());
            if !self.meshes.reserve(&mut *self.device, extent.totals(), is_long)? {
                // Whoever draws surfaces takes them from where results say they are.
                if !extent.is_in_lists() {
                    return Err(Fault::Failed("surfaces beyond the ends of their lists".into()));
                }
                return Ok(Meshed { totals: extent.totals(), plain });
            }
            // A second pass, with room for all.
        }
        Err(Fault::Failed("results changed from one pass to the next".into()))
    }
}

/// Writes the jobs of blocks.
fn write_jobs(view: &WorldView, windows: &Windows, pieces: &[Piece], out: &mut [MeshJob]) {
    let places = cut(out, pieces.iter().map(|piece| piece.blocks.len()));
    hand_out(pieces.iter().zip(places).collect(), |(piece, places)| {
        let stacks = (piece.column..).zip(piece.blocks.chunk_by(is_same_stack));
        let blocks = stacks.flat_map(|(column, stack)| stack.iter().map(move |block| (column, block)));
        for ((number, (column, block)), place) in (piece.first..).zip(blocks).zip(places) {
            *place = mesh_job(view, windows, number, block, column);
        }
    });
}

fn mesh_job(view: &WorldView, windows: &Windows, number: usize, block: &Block, column: u32) -> MeshJob {
    let entry = windows.entry(number);
    let cells = block.brick.samples().intersection(view.grid.chunk_cells(block.chunk));
    MeshJob {
        window: entry.number,
        strides: entry.strides,
        column,
        y: block.brick.0.y,
        cells: cells.map_or(NO_CELLS, |cells| layout::pack_box(cells, block.brick.origin())),
        pad: 0,
    }
}

/// A box of cells that holds none.
const NO_CELLS: u32 = 7;

/// The stack of bricks that a block belongs to.
fn place(block: &Block) -> (i32, i32) {
    (block.brick.0.x, block.brick.0.z)
}

/// Do both blocks belong to the same stack?
fn is_same_stack(a: &Block, b: &Block) -> bool {
    place(a) == place(b)
}

impl Session {
    /// Blocks in pieces, and their stacks, which are uploaded where they have to be.
    fn columns<'b>(
        &mut self,
        view: &WorldView,
        blocks: &'b [Block],
        uploads: &mut Uploads,
    ) -> Result<(Vec<Piece<'b>>, Vec<Column>), Fault> {
        let (stacks, ground) = (&self.stacks, view.samples.ground());
        let find = |stack: &[Block]| (place(&stack[0]), stacks.find(ground, place(&stack[0])));
        let lists = pieces(blocks, PIECE, is_same_stack);
        let found = map(&lists, 2, |blocks| blocks.chunk_by(is_same_stack).map(&find).collect::<Vec<_>>());
        let (mut pieces, mut first) = (Vec::with_capacity(lists.len()), 0);
        let mut columns = Vec::with_capacity(found.iter().map(Vec::len).sum());
        for (blocks, found) in lists.into_iter().zip(found) {
            pieces.push(Piece { blocks, first, column: columns.len() as u32 });
            first += blocks.len();
            for (place, slot) in found {
                let slot = slot.map_or_else(|| self.need_stack(uploads, place), Ok)?;
                columns.push((place, slot));
            }
        }
        Ok((pieces, columns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_beyond_the_ends_of_lists_are_noticed() {
        let result = |vertex, vertices, index, indices| MeshResult { vertex, vertices, index, indices };
        let extent = |results: &[MeshResult]| results.iter().fold(Extent::default(), Extent::with);
        let whole = [result(5, 4, 0, 6), MeshResult::default(), result(0, 5, 6, 9)];
        assert_eq!(extent(&whole).totals(), (9, 15));
        assert!(extent(&whole).is_in_lists());
        assert!(extent(&[]).is_in_lists());
        for broken in [result(6, 4, 0, 6), result(5, 4, 10, 6), result(u32::MAX, 4, 0, 6)] {
            assert!(!extent(&[broken, whole[2]]).is_in_lists(), "{broken:?}");
        }
    }
}
