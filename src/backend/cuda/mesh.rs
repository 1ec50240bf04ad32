//! Meshing on the device: one launch for all blocks.

use std::ops::Range;

use super::device::{Device, Fault, Kernel, Mark};
use super::layout::{self, ColumnJob, MOST_JOBS, MeshJob, MeshParams, MeshResult};
use super::lists::{cut, fill, hand_out, map};
use super::mail::{Outbox, Plan};
use super::session::{Session, Stacks, Uploads, windows};
use super::surfaces::{Arrival, Surfaces};
use super::windows::Windows;
use crate::ground::Ground;
use crate::lattice::{pieces, side_by_side};
use crate::surface::MaterialMix;
use crate::surface::block::Block;
use crate::surface::vertex::WorldView;

/// What the mesh kernel writes.
pub(super) struct MeshOutput {
    results: Outbox,
    lists: MeshLists,
}

/// Surfaces of all blocks.
pub(super) struct MeshLists {
    pub positions: Outbox,
    pub normals: Outbox,
    pub mixes: Outbox,
    pub indices: Outbox,
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
            lists: MeshLists {
                positions: Outbox::new(device, size_of::<[u16; 4]>(), FIRST_VERTICES)?,
                normals: Outbox::new(device, size_of::<[f32; 3]>(), FIRST_VERTICES)?,
                mixes: Outbox::new(device, size_of::<[u8; 8]>(), FIRST_VERTICES)?,
                indices: Outbox::new(device, size_of::<u16>(), FIRST_VERTICES * INDICES)?,
            },
        })
    }

    /// What the kernel wanted to write for the blocks of each piece and all before it.
    fn extents(&self, blocks: usize) -> Vec<Extent> {
        let of = |results: &&[MeshResult]| results.iter().fold(Extent::default(), Extent::with);
        let pieces: Vec<&[MeshResult]> = self.results.entries::<MeshResult>(blocks).chunks(PIECE).collect();
        let mut extents = map(&pieces, 2, of);
        let mut all = Extent::default();
        extents.iter_mut().for_each(|own| {
            all = all.join(*own);
            *own = all;
        });
        extents
    }

    /// What was written for blocks, on its way to the host where it is not there.
    pub fn surfaces<'a>(&'a self, view: &WorldView, blocks: &'a [Block], meshed: Meshed) -> Surfaces<'a> {
        Surfaces {
            grid: view.grid,
            blocks,
            results: self.results.entries(blocks.len()),
            lists: &self.lists,
            plain: meshed.plain,
            arrival: Arrival::new(meshed.marks),
        }
    }

    /// Where positions, normals and indices are on the device.
    #[cfg(all(feature = "interop", target_os = "linux"))]
    pub fn there(&self) -> [u64; 3] {
        [&self.lists.positions, &self.lists.normals, &self.lists.indices].map(Outbox::address)
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
        let lists = &mut self.lists;
        lists.fetch(device, 0..vertices, 0..indices, false)?;
        device.wait()?;
        Ok((
            lists.positions.entries(vertices),
            lists.normals.entries(vertices),
            lists.indices.entries(indices),
        ))
    }
}

impl MeshLists {
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

    /// Begins to copy some vertices and indices, where they are not written straight to the host's memory.
    fn fetch(
        &mut self,
        device: &mut dyn Device,
        vertices: Range<usize>,
        indices: Range<usize>,
        with_mixes: bool,
    ) -> Result<(), Fault> {
        self.positions.fetch_part(device, vertices.clone())?;
        self.normals.fetch_part(device, vertices.clone())?;
        self.indices.fetch_part(device, indices)?;
        if with_mixes {
            self.mixes.fetch_part(device, vertices)?;
        }
        Ok(())
    }

    /// Begins to copy all, piece by piece: each goes as far as its extent, and has a mark. None where nothing is to be copied.
    fn begin_fetch(
        &mut self,
        device: &mut dyn Device,
        extents: &[Extent],
        with_mixes: bool,
    ) -> Result<Vec<Box<dyn Mark>>, Fault> {
        if self.positions.is_mapped() {
            return Ok(Vec::new());
        }
        let (mut marks, mut before) = (Vec::with_capacity(extents.len()), Extent::default());
        for &own in extents {
            let (vertices, indices) = (before.vertex_end..own.vertex_end, before.index_end..own.index_end);
            self.fetch(device, vertices, indices, with_mixes)?;
            marks.push(device.mark()?);
            before = own;
        }
        Ok(marks)
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
pub(super) struct Meshed {
    /// Vertices and indices.
    #[cfg(all(feature = "interop", target_os = "linux"))]
    totals: (usize, usize),
    /// What all vertices are made of, if it is the same everywhere; their mixes are not written then.
    plain: Option<MaterialMix>,
    /// Copies to the host that are under way, one for each [`PIECE`] of blocks.
    marks: Vec<Box<dyn Mark>>,
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

/// From how many stacks or blocks on they are dealt with side by side.
const LONG: usize = 256;

/// How many blocks a thread deals with at a time.
const OF_A_THREAD: usize = 256;

/// How many blocks' surfaces are copied at a time; few in tests, so that there are several such pieces.
pub(super) const PIECE: usize = if cfg!(test) { 150 } else { 1 << 12 };

/// From how many blocks on their surfaces are copied, instead of written to the host's memory by the kernel.
const COPIED: usize = 512;

/// Where surfaces are wanted.
#[derive(Clone, Copy)]
struct Wanted {
    /// Are they written on the device, to be copied, instead of straight to the host's memory?
    is_long: bool,
    /// Are they wanted on the host?
    on_host: bool,
}

impl Session {
    /// Meshes blocks. Their [`surfaces`](MeshOutput::surfaces) are in this session's memory until the next launch, or on their
    /// way there. `meanwhile` is called when the device is at work.
    pub fn mesh(
        &mut self,
        view: &WorldView,
        blocks: &[Block],
        meanwhile: &(dyn Fn() + Sync),
    ) -> Result<Meshed, Fault> {
        self.begin();
        let mut uploads = Uploads::new(view.samples.ground());
        let wanted = Wanted { is_long: blocks.len() >= COPIED, on_host: true };
        let meshed = self.run_mesh(view, blocks, &mut uploads, wanted, meanwhile);
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
        let wanted = Wanted { is_long: true, on_host: false };
        let meshed = self.run_mesh(view, blocks, &mut uploads, wanted, &|| {});
        if meshed.is_err() {
            self.give_up(&uploads);
        }
        meshed.map(|meshed| meshed.totals)
    }

    /// Has blocks meshed; their [`MeshResult`]s are here then, and surfaces not yet.
    fn run_mesh<'a>(
        &mut self,
        view: &WorldView<'a>,
        blocks: &[Block],
        uploads: &mut Uploads<'a>,
        wanted: Wanted,
        meanwhile: &(dyn Fn() + Sync),
    ) -> Result<Meshed, Fault> {
        let is_long = wanted.is_long;
        if blocks.len() > MOST_JOBS {
            return Err(Fault::TooLarge(blocks.len()));
        }
        let ground = view.samples.ground();
        let (found, mut windows) = side_by_side(
            blocks.len() >= LONG,
            || stacks_of(&self.stacks, ground, blocks),
            || windows(&self.bricks, view.samples, blocks, |block| block.brick, 1, &mut self.kept),
        );
        let (pieces, columns) = self.columns(found, uploads)?;
        self.complete(uploads, &mut windows)?;
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
        self.meshes.lists.reserve(&mut *self.device, (0, 0), is_long)?;

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
                positions: self.meshes.lists.positions.address(),
                normals: self.meshes.lists.normals.address(),
                mixes: if plain.is_some() { 0 } else { self.meshes.lists.mixes.address() },
                indices: self.meshes.lists.indices.address(),
                counters: self.inbox.address(counters),
                vertex_capacity: self.meshes.lists.vertex_capacity(),
                index_capacity: self.meshes.lists.indices.capacity(),
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
            let extents = self.meshes.extents(blocks.len());
            let all = extents.last().copied().unwrap_or_default();
            let lists = &mut self.meshes.lists;
            if !lists.reserve(&mut *self.device, all.totals(), is_long)? {
                // Whoever draws surfaces takes them from where results say they are.
                if !all.is_in_lists() {
                    return Err(Fault::Failed("surfaces beyond the ends of their lists".into()));
                }
                let extents = if wanted.on_host { &extents[..] } else { &[] };
                let marks = lists.begin_fetch(&mut *self.device, extents, plain.is_none())?;
                self.kept.put(windows);
                return Ok(Meshed {
                    #[cfg(all(feature = "interop", target_os = "linux"))]
                    totals: all.totals(),
                    plain,
                    marks,
                });
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
    /// These blocks in pieces, and their stacks, which are uploaded where they have to be.
    fn columns<'b>(
        &mut self,
        found: Vec<FoundStacks<'b>>,
        uploads: &mut Uploads,
    ) -> Result<(Vec<Piece<'b>>, Vec<Column>), Fault> {
        let (mut pieces, mut first) = (Vec::with_capacity(found.len()), 0);
        let mut columns = Vec::with_capacity(found.iter().map(|(_, stacks)| stacks.len()).sum());
        for (blocks, stacks) in found {
            pieces.push(Piece { blocks, first, column: columns.len() as u32 });
            first += blocks.len();
            for (place, slot) in stacks {
                let slot = slot.map_or_else(|| self.need_stack(uploads, place), Ok)?;
                columns.push((place, slot));
            }
        }
        Ok((pieces, columns))
    }
}

/// Blocks of some stacks, and for each of these the slot that it has, if any.
type FoundStacks<'b> = (&'b [Block], Vec<((i32, i32), Option<u32>)>);

/// The stacks of blocks, in pieces.
fn stacks_of<'b>(stacks: &Stacks, ground: &Ground, blocks: &'b [Block]) -> Vec<FoundStacks<'b>> {
    let find = |stack: &[Block]| (place(&stack[0]), stacks.find(ground, place(&stack[0])));
    let lists = pieces(blocks, OF_A_THREAD, is_same_stack);
    map(&lists, 2, |&blocks| (blocks, blocks.chunk_by(is_same_stack).map(&find).collect()))
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
