//! Meshing on the device: one launch for all blocks.

use glam::IVec3;

use super::device::{Device, Fault, Kernel};
use super::layout::{self, ColumnJob, MOST_JOBS, MeshJob, MeshParams, MeshResult, NONE};
use super::mail::{Outbox, Plan, fill, map};
use super::session::{Session, Uploads};
use super::windows::Windows;
use crate::lattice::SNAP;
use crate::surface::block::{Block, Part, Parts};
use crate::surface::vertex::WorldView;
use crate::surface::{MaterialMix, Vertex};

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

    /// How many vertices and indices the kernel wanted to write for so many blocks.
    fn totals(&self, blocks: usize) -> (usize, usize) {
        self.results.entries::<MeshResult>(blocks).iter().fold((0, 0), |(vertices, indices), result| {
            (vertices + result.vertices as usize, indices + result.indices as usize)
        })
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

/// What a launch wrote.
struct Meshed {
    /// Vertices and indices.
    totals: (usize, usize),
    /// What all vertices are made of, if it is the same everywhere; their mixes are not written then.
    plain: Option<MaterialMix>,
}

/// From how many things on they are dealt with side by side.
const LONG: usize = 256;

/// From how many blocks on their surfaces are copied, instead of written to the host's memory by the kernel.
const COPIED: usize = 512;

/// Blocks whose parts are put together by one thread.
const GROUP: usize = 64;

impl Session {
    /// Meshes blocks: their parts in order, in one list or several.
    pub fn mesh(&mut self, view: &WorldView, blocks: &[Block]) -> Result<Vec<Parts>, Fault> {
        self.begin();
        let mut uploads = Uploads::new(view.samples.ground());
        let parts = self.run_mesh(view, blocks, &mut uploads, blocks.len() >= COPIED).and_then(|meshed| {
            self.meshes.fetch(&mut *self.device, meshed.totals, meshed.plain.is_none())?;
            Ok(self.meshes.parts(view, blocks, meshed.totals, meshed.plain))
        });
        if parts.is_err() {
            self.give_up(&uploads);
        }
        parts
    }

    /// Meshes blocks and leaves their surfaces on the device, however few they are: how many vertices and indices there
    /// are, in [`MeshOutput::there`].
    #[cfg(all(feature = "interop", target_os = "linux"))]
    pub fn mesh_there(&mut self, view: &WorldView, blocks: &[Block]) -> Result<(usize, usize), Fault> {
        self.begin();
        let mut uploads = Uploads::new(view.samples.ground());
        let meshed = self.run_mesh(view, blocks, &mut uploads, true);
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
    ) -> Result<Meshed, Fault> {
        if blocks.len() > MOST_JOBS {
            return Err(Fault::TooLarge(blocks.len()));
        }
        let ground = view.samples.ground();
        let places = columns(blocks);
        let slots = places.iter().map(|&place| self.need_stack(uploads, place));
        let columns: Vec<_> =
            places.iter().copied().zip(slots.collect::<Result<Vec<u32>, Fault>>()?).collect();
        let windows = Windows::around(view.samples, blocks.iter().map(|block| block.brick), 1);
        let refs = self.refs(&windows, uploads)?;
        let single = ground.single_material().map(MaterialMix::pure);
        let plain = single.filter(|_| refs.iter().all(|&at| at == NONE || at & 1 == 0));

        let mut plan = Plan::default();
        uploads.plan(&mut plan);
        let window_list = plan.section::<u32>(refs.len());
        let column_list = plan.section::<ColumnJob>(columns.len());
        let job_list = plan.section::<MeshJob>(blocks.len());
        let counters = plan.section::<u32>(4);
        self.inbox.open(&mut *self.device, &plan)?;
        self.inbox.put(window_list, &refs);
        let column = |_, &(place, slot): &((i32, i32), u32)| layout::column_job(view, place, slot);
        fill(&columns, self.inbox.entries(column_list), LONG, column);
        let numbers = column_numbers(blocks);
        let job = |number: usize, block: &Block| mesh_job(view, &windows, number, block, numbers[number]);
        fill(blocks, self.inbox.entries(job_list), LONG, job);
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
            self.device.wait()?;
            self.times = self.device.times();
            let totals = self.meshes.totals(blocks.len());
            if !self.meshes.reserve(&mut *self.device, totals, is_long)? {
                return Ok(Meshed { totals, plain });
            }
            // A second pass, with room for all.
        }
        Err(Fault::Failed("results changed from one pass to the next".into()))
    }
}

fn mesh_job(view: &WorldView, windows: &Windows, number: usize, block: &Block, column: u32) -> MeshJob {
    let entry = windows.entry(number, block.brick);
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

impl MeshOutput {
    /// What came back, as parts. `mix` is what all vertices are made of, if it is the same everywhere.
    fn parts(
        &self,
        view: &WorldView,
        blocks: &[Block],
        (vertices, indices): (usize, usize),
        mix: Option<MaterialMix>,
    ) -> Vec<Parts> {
        let results = self.results.entries::<MeshResult>(blocks.len());
        let positions = self.positions.entries::<[u16; 4]>(vertices);
        let normals = self.normals.entries::<[f32; 3]>(vertices);
        let mixes = if mix.is_some() { &[] } else { self.mixes.entries::<[u8; 8]>(vertices) };
        let all = self.indices.entries::<u16>(indices);
        let range = |first: u32, count: u32| first as usize..(first + count) as usize;
        let put = |group: &(&[Block], &[MeshResult])| {
            let mut parts = Parts::default();
            let sum = |of: fn(&MeshResult) -> u32| group.1.iter().map(|result| of(result) as usize).sum();
            parts.list.reserve_exact(group.0.len());
            parts.vertices.reserve_exact(sum(|result| result.vertices));
            parts.indices.reserve_exact(sum(|result| result.indices));
            for (&block, result) in group.0.iter().zip(group.1) {
                let base = (block.brick.origin() - view.grid.origin(block.chunk)) * SNAP;
                let own = range(result.vertex, result.vertices);
                let near = positions[own.clone()].iter().zip(&normals[own.clone()]);
                let vertex = |(&[x, y, z, _], &normal): (&[u16; 4], &[f32; 3])| Vertex {
                    position: base + IVec3::new(x.into(), y.into(), z.into()),
                    normal: normal.into(),
                    materials: mix.unwrap_or_default(),
                };
                let first = parts.vertices.len();
                parts.vertices.extend(near.map(vertex));
                if mix.is_none() {
                    for (vertex, mix) in parts.vertices[first..].iter_mut().zip(&mixes[own]) {
                        let (ids, weights) = mix.split_at(4);
                        vertex.materials.ids.copy_from_slice(ids);
                        vertex.materials.weights.copy_from_slice(weights);
                    }
                }
                parts.indices.extend_from_slice(&all[range(result.index, result.indices)]);
                parts.list.push(Part { block, vertices: parts.vertices.len(), indices: parts.indices.len() });
            }
            parts
        };
        let groups: Vec<_> = blocks.chunks(GROUP).zip(results.chunks(GROUP)).collect();
        map(&groups, 2, put)
    }
}

/// The stack of bricks that a block belongs to.
fn place(block: &Block) -> (i32, i32) {
    (block.brick.0.x, block.brick.0.z)
}

/// The stacks of blocks, in order.
fn columns(blocks: &[Block]) -> Vec<(i32, i32)> {
    blocks.chunk_by(|a, b| place(a) == place(b)).map(|same| place(&same[0])).collect()
}

/// The number of each block's stack among these.
fn column_numbers(blocks: &[Block]) -> Vec<u32> {
    let groups = blocks.chunk_by(|a, b| place(a) == place(b));
    (0..).zip(groups).flat_map(|(number, same)| same.iter().map(move |_| number)).collect()
}
