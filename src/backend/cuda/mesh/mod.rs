//! Meshing on the device: one launch for all blocks. [`output`](self::output) holds the results.

pub(super) mod output;

use super::device::{Fault, Launch};
use super::layout::{self, ColumnJob, MOST_JOBS, MeshJob, MeshParams};
use super::lists::{cut, fill, for_each_parallel, map};
use super::session::{Session, Stacks, Uploads, windows};
use super::staging::{Section, StagingLayout, StrataInput};
use super::windows::Windows;
use crate::ground::Ground;
use crate::lattice::{pieces, side_by_side};
use crate::surface::MaterialMix;
use crate::surface::block::Block;
use crate::surface::vertex::WorldView;
use output::Meshed;

/// Consecutive blocks that one thread processes, all blocks of some stacks.
struct Piece<'b> {
    blocks: &'b [Block],
    /// Number of the first block, and of its stack.
    first: usize,
    column: u32,
}

/// A stack of bricks by position, and its slot.
type Column = ((i32, i32), u32);

/// The input of blocks, and the sections that it was written to.
struct MeshInput<'a> {
    windows: Windows<'a>,
    /// The material mix of all vertices if it is uniform.
    plain: Option<MaterialMix>,
    plan: StagingLayout,
    window_list: Section,
    column_list: Section,
    job_list: Section,
    counters: Section,
    strata: StrataInput,
}

/// From this many blocks or stacks on, they are processed in parallel.
const LONG: usize = 256;

/// Blocks that a thread takes at a time.
const OF_A_THREAD: usize = 256;

/// From this many blocks on, the kernel writes to device memory and surfaces are copied, instead of written to host
/// memory.
const COPIED: usize = 512;

impl Session {
    /// Meshes blocks. Their surfaces are in this session's memory until the next launch; copies may still be in
    /// flight. `overlap` is called while the device works.
    pub fn mesh(
        &mut self,
        view: &WorldView,
        blocks: &[Block],
        overlap: &(dyn Fn() + Sync),
    ) -> Result<Meshed, Fault> {
        self.begin();
        let mut uploads = Uploads::new(view.samples.ground());
        let meshed = self.run_mesh(view, blocks, &mut uploads, overlap);
        if meshed.is_err() {
            self.give_up(&uploads);
        }
        meshed
    }

    /// Meshes blocks. On return, the [`MeshResult`](layout::MeshResult)s have arrived; the surfaces may still be in
    /// flight.
    fn run_mesh<'a>(
        &mut self,
        view: &WorldView<'a>,
        blocks: &[Block],
        uploads: &mut Uploads<'a>,
        overlap: &(dyn Fn() + Sync),
    ) -> Result<Meshed, Fault> {
        let is_long = blocks.len() >= COPIED;
        if blocks.len() > MOST_JOBS {
            return Err(Fault::TooLarge(blocks.len()));
        }
        let input = self.stage_mesh(view, blocks, uploads)?;
        self.meshes.results.reserve(&mut *self.device, blocks.len(), is_long)?;
        self.meshes.lists.reserve(&mut *self.device, (0, 0), is_long)?;

        for _ in 0..2 {
            self.send(&input.plan, uploads)?;
            let params = self.mesh_params(view, &input);
            // SAFETY: the parameters are sections of the input, which `stage_mesh` wrote for these blocks, and lists of
            // the session with their capacities. None of them is accessed before the wait below.
            unsafe { self.device.launch(Launch::new(blocks.len() as u32, &params)) }?;
            self.meshes.results.fetch(&mut *self.device, blocks.len())?;
            overlap();
            self.device.wait()?;
            self.times = self.device.times();
            let extents = self.meshes.extents(blocks.len());
            let all = extents.last().copied().unwrap_or_default();
            let lists = &mut self.meshes.lists;
            if !lists.reserve(&mut *self.device, all.totals(), is_long)? {
                // Results locate the surfaces, so check them before use.
                if !all.is_in_lists() {
                    return Err(Fault::Failed("surfaces beyond the ends of their lists".into()));
                }
                let marks = lists.begin_fetch(&mut *self.device, &extents, input.plain.is_none())?;
                self.kept.put(input.windows);
                return Ok(Meshed { plain: input.plain, marks });
            }
            // A second pass, with enough room.
        }
        Err(Fault::Failed("results changed from one pass to the next".into()))
    }

    /// Looks up the bricks and stacks of blocks, and writes the input.
    fn stage_mesh<'a>(
        &mut self,
        view: &WorldView<'a>,
        blocks: &[Block],
        uploads: &mut Uploads<'a>,
    ) -> Result<MeshInput<'a>, Fault> {
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

        let mut plan = StagingLayout::default();
        uploads.plan(&mut plan);
        let window_list = plan.section::<u32>(windows.len());
        let column_list = plan.section::<ColumnJob>(columns.len());
        let job_list = plan.section::<MeshJob>(blocks.len());
        let counters = plan.section::<u32>(4);
        let strata = StrataInput::plan(ground, &mut plan);
        self.input.open(&mut *self.device, &plan)?;
        let (refs, column_jobs, jobs) = self.input.entries_of(window_list, column_list, job_list);
        let column = |_, &(place, slot): &Column| layout::column_job(view, place, slot);
        let write_columns = || fill(&columns, column_jobs, LONG, column);
        let write_jobs = || write_jobs(view, &windows, &pieces, jobs);
        side_by_side(pieces.len() > 1, write_columns, || {
            side_by_side(pieces.len() > 1, write_jobs, || windows.write(refs))
        });
        self.input.entries::<u32>(counters).fill(0);
        strata.put(&mut self.input);
        Ok(MeshInput { windows, plain, plan, window_list, column_list, job_list, counters, strata })
    }

    /// The kernel's parameters, for the present lists of the session.
    fn mesh_params(&self, view: &WorldView, of: &MeshInput) -> MeshParams {
        let lists = &self.meshes.lists;
        MeshParams {
            bricks: self.bricks.base(),
            stacks: self.stacks.base(),
            windows: self.input.address(of.window_list),
            columns: self.input.address(of.column_list),
            jobs: self.input.address(of.job_list),
            table: self.table,
            results: self.meshes.results.address(),
            positions: lists.positions.address(),
            normals: lists.normals.address(),
            mixes: if of.plain.is_some() { 0 } else { lists.mixes.address() },
            indices: lists.indices.address(),
            counters: self.input.address(of.counters),
            vertex_capacity: lists.vertex_capacity(),
            index_capacity: lists.indices.capacity(),
            width: view.grid.width(),
            depth: view.grid.depth(),
            single: layout::single_mix(view.samples.ground()),
            pad: 0,
            strata: of.strata.address(&self.input),
        }
    }
}

/// Writes the jobs of blocks.
fn write_jobs(view: &WorldView, windows: &Windows, pieces: &[Piece], out: &mut [MeshJob]) {
    let places = cut(out, pieces.iter().map(|piece| piece.blocks.len()));
    for_each_parallel(pieces.iter().zip(places).collect(), |(piece, places)| {
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

/// A packed box without cells.
const NO_CELLS: u32 = 7;

/// The stack of bricks that a block belongs to.
fn place(block: &Block) -> (i32, i32) {
    (block.brick.0.x, block.brick.0.z)
}

/// Whether both blocks belong to the same stack.
fn is_same_stack(a: &Block, b: &Block) -> bool {
    place(a) == place(b)
}

impl Session {
    /// Numbers the stacks of these blocks. Missing stacks are queued for upload.
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

/// The blocks of some stacks, and for each stack its slot, if it is cached.
type FoundStacks<'b> = (&'b [Block], Vec<((i32, i32), Option<u32>)>);

/// Looks up the stacks of blocks, in pieces.
fn stacks_of<'b>(stacks: &Stacks, ground: &Ground, blocks: &'b [Block]) -> Vec<FoundStacks<'b>> {
    let find = |stack: &[Block]| (place(&stack[0]), stacks.find(ground, place(&stack[0])));
    let lists = pieces(blocks, OF_A_THREAD, is_same_stack);
    map(&lists, 2, |&blocks| (blocks, blocks.chunk_by(is_same_stack).map(&find).collect()))
}
