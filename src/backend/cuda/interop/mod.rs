//! **Experimental.** Surfaces that CUDA writes where Vulkan draws them, with no way through the host.
//!
//! Linux, one NVIDIA card that both know, and wgpu on Vulkan. Whatever is here may change or go with any version.
//!
//! ```text
//! mesh kernel -> lists on the card --copy on the card--> SharedBuffer --drawn as it is, or copied once more
//!                      \--without: download, write_buffer--> any wgpu::Buffer
//! ```
//!
//! ```no_run
//! use bevy_burrow::backend::interop::{InteropError, SharedCard};
//! use bevy_burrow::surface::block::Block;
//! use bevy_burrow::terrain::World;
//!
//! # fn draw(_: &wgpu::Buffer) {}
//! fn surfaces(
//!     device: &wgpu::Device,
//!     queue: &wgpu::Queue,
//!     world: &World,
//!     blocks: &[Block],
//!     target: &wgpu::Buffer,
//! ) -> Result<(), InteropError> {
//!     let mut card = SharedCard::open(device, queue)?;
//!     let mut shared = card.share(64 << 20)?;
//!     let mut surfaces = card.mesh(&world.view(), blocks)?;
//!     let layout = surfaces.write(&mut shared)?;
//!     shared.copy_to(0..layout.bytes(), target, 0);
//!     Ok(())
//! }
//! ```
//!
//! # Why this is sound
//!
//! - **The same card.** Vulkan's `deviceUUID` and CUDA's are compared before anything is shared.
//! - **Who owns what.** Vulkan allocates the memory and exports a file descriptor, which owns a reference to it. CUDA
//!   takes the descriptor over where the import succeeds; where it fails, it is closed. The `VkBuffer` and its
//!   `VkDeviceMemory` belong to the `wgpu::Buffer`, and wgpu destroys them once no submission uses them. The card's memory
//!   goes with the last of these references, so the order in which they go does not matter, and a device that is lost, or
//!   destroyed, on one side leaves no dangling address on the other.
//! - **Who writes when.** [`Surfaces::write`] gives the buffer from the queue to CUDA and back, as Vulkan asks for: a
//!   release barrier to `VK_QUEUE_FAMILY_EXTERNAL`, a wait until the queue has done it and so all before it, the copy on a
//!   CUDA stream, a wait for that, and an acquire barrier. Waits are the host's: wgpu 29 lets others add semaphores that a
//!   queue signals, and none that it waits for.
//! - **Who else may use it.** [`SharedBuffer::copy_to`] is safe: the buffer does not leave its owner, and writing takes
//!   that `&mut`. To draw from it without that copy takes [`SharedBuffer::buffer`], which is `unsafe`: a `wgpu::Buffer` can
//!   be cloned and submitted from any thread, and nothing but the caller's word keeps that apart from the next write.
//!
//! # With Bevy's own meshes
//!
//! A [`SharedCard`] opens on Bevy 0.19's device just as well: `RenderDevice::wgpu_device` and `RenderQueue` are of the same
//! wgpu, and its Vulkan devices can export memory as they are. What can't be done is to let Bevy's meshes draw out of such
//! a buffer. All of them live in slabs of `MeshAllocator`, whose buffers its `SlabAllocator` makes itself, with
//! `RenderDevice::create_buffer`, replaces when they grow, and fills from nothing but the host's bytes of a `Mesh`; there is
//! no way to hand it a buffer. The way that is left, [`SharedBuffer::copy_to`] into the slab that
//! `MeshAllocator::mesh_vertex_slice` names, in a system after `allocate_and_free_meshes`, is sound and not worth it:
//!
//! - The place has to be allocated first, and is so only for a `Mesh` with that many vertices and indices on the host, as
//!   `RenderMesh::prepare_asset` counts them there and `copy_element_data` uploads them: the upload to be saved is made,
//!   with bytes that nobody wants. Bounds for culling come from those as well.
//! - A mesh there is one interleaved array for each chunk; lists as above, with 16-bit positions for each block, would have
//!   to be put together on the card by another kernel.
//! - The world keeps its chunks' surfaces on the host, as parts that did not change are copied from there, and so do
//!   colliders and seam checks. Downloads would stay.
//!
//! A `RenderCommand` of one's own in place of `DrawMesh` may bind a [`SharedBuffer::buffer`]; it takes that function's
//! promise, and all of the mesh pipeline's passes (prepass, shadows, indirect draws) find their vertices by
//! `MeshAllocator` alone.
//!
//! # What is shared
//!
//! Materials are left out; positions, normals and indices are what the mesh kernel writes for every transaction.
#![allow(unsafe_code)]

mod imported;
mod vulkan;

use std::ops::Range;
use std::sync::Arc;

use cudarc::driver::CudaContext;

use super::device::{Device, Fault};
use super::driver::Card;
use super::self_test;
use super::session::Session;
use crate::backend::CardChoice;
use crate::surface::block::Block;
use crate::surface::vertex::WorldView;
use imported::Imported;
use vulkan::SharedMemory;

/// Why surfaces can't be shared, or can't be shared any longer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InteropError {
    /// The device is of another backend.
    #[error("the wgpu device does not run on Vulkan")]
    NotVulkan,
    /// The device's driver can't share memory with others.
    #[error("Vulkan can't share memory here: {0}")]
    CannotShare(&'static str),
    /// CUDA has no card that is the Vulkan device, or it can't be used.
    #[error("CUDA has nothing to share with Vulkan's device: {0}")]
    NoCard(String),
    /// The buffer would be empty, or larger than the device allows.
    #[error("a shared buffer of {0} bytes is not in 1..={1}")]
    Size(u64, u64),
    /// Surfaces are larger than the buffer.
    #[error("surfaces take {needed} bytes, the shared buffer has {bytes}")]
    TooSmall {
        /// Bytes of the surfaces.
        needed: u64,
        /// Bytes of the buffer.
        bytes: u64,
    },
    /// The buffer was shared with another card.
    #[error("the buffer is shared with another card")]
    OtherCard,
    /// The wgpu device was lost or destroyed, and the buffer with it.
    #[error("the wgpu device is lost")]
    Lost,
    /// A Vulkan call failed.
    #[error("Vulkan failed: {0}")]
    Vulkan(String),
    /// A CUDA call failed.
    #[error("CUDA failed: {0}")]
    Cuda(String),
}

impl From<Fault> for InteropError {
    fn from(fault: Fault) -> Self {
        Self::Cuda(fault.to_string())
    }
}

/// The card of a wgpu device, opened for CUDA as well.
pub struct SharedCard {
    session: Session,
    context: Arc<CudaContext>,
    device: wgpu::Device,
    queue: wgpu::Queue,
}

impl SharedCard {
    /// Opens the card that a wgpu device runs on, and compares it with the processor.
    ///
    /// # Errors
    /// Where the device is not Vulkan's, can't share memory, or CUDA does not have the same card.
    pub fn open(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, InteropError> {
        let uuid = vulkan::uuid(device)?;
        let no_card = |fault: Fault| InteropError::NoCard(fault.to_string());
        let mut card = Card::open(&CardChoice::Uuid(uuid), None).map_err(no_card)?;
        let context = card.context();
        let budget = (card.free_memory() / 4).min(1 << 30);
        let mut session = Session::new(Box::new(card), budget)?;
        self_test::run(&mut session, self_test::FULL).map_err(no_card)?;
        Ok(Self { session, context, device: device.clone(), queue: queue.clone() })
    }

    /// Who the card is.
    pub fn name(&self) -> String {
        self.session.name()
    }

    /// Allocates a buffer that both see, all zero: a vertex and an index buffer, to be copied from and not to be mapped.
    ///
    /// # Errors
    /// Where there is no memory left, or the driver refuses.
    pub fn share(&self, bytes: u64) -> Result<SharedBuffer, InteropError> {
        let most = self.device.limits().max_buffer_size;
        if bytes == 0 || bytes > most {
            return Err(InteropError::Size(bytes, most));
        }
        let bytes = bytes.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT);
        let memory = SharedMemory::new(&self.device, bytes)?;
        let imported = Imported::new(&self.context, memory.descriptor()?, memory.allocated(), bytes)?;
        imported.clear()?;
        let mut shared =
            SharedBuffer { imported, memory: memory.into_buffer(&self.device, &self.queue, bytes)? };
        shared.memory.acquire()?;
        Ok(shared)
    }

    /// Meshes blocks on the card and leaves their surfaces there. Blocks of one stack of bricks should follow each other,
    /// from below.
    ///
    /// # Errors
    /// Where the card fails, or has not enough memory for so much.
    pub fn mesh(&mut self, view: &WorldView, blocks: &[Block]) -> Result<Surfaces<'_>, InteropError> {
        let (vertices, indices) = self.session.mesh_there(view, blocks)?;
        Ok(Surfaces { card: self, blocks: blocks.len(), vertices, indices })
    }
}

/// Surfaces on a card, until the next ones are made there.
pub struct Surfaces<'a> {
    card: &'a mut SharedCard,
    blocks: usize,
    vertices: usize,
    indices: usize,
}

/// Where the surface of a block is in the lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockRange {
    /// First vertex.
    pub vertex: u32,
    /// Vertices.
    pub vertices: u32,
    /// First index. Indices count from the first vertex.
    pub index: u32,
    /// Indices.
    pub indices: u32,
}

/// Surfaces in the host's memory.
#[derive(Clone, Copy, Debug)]
pub struct HostSurfaces<'a> {
    /// x, y, z in 1/4096 voxel from the lowest sample of the block's brick, and 0.
    pub positions: &'a [[u16; 4]],
    /// Unit vectors.
    pub normals: &'a [[f32; 3]],
    /// Three for each triangle, counted within the block.
    pub indices: &'a [u16],
}

impl Surfaces<'_> {
    /// Where these surfaces stand in a buffer that holds nothing else.
    pub fn layout(&self) -> SurfaceLayout {
        SurfaceLayout::new(self.vertices as u64, self.indices as u64)
    }

    /// Where each block's surface is in the lists, in the order in which blocks were given.
    pub fn ranges(&self) -> impl ExactSizeIterator<Item = BlockRange> {
        self.card.session.meshes.results(self.blocks).iter().map(|result| BlockRange {
            vertex: result.vertex,
            vertices: result.vertices,
            index: result.index,
            indices: result.indices,
        })
    }

    /// Copies them to the host: the way without a shared buffer.
    ///
    /// # Errors
    /// Where the card fails.
    pub fn download(&mut self) -> Result<HostSurfaces<'_>, InteropError> {
        let Session { meshes, device, .. } = &mut self.card.session;
        let (positions, normals, indices) = meshes.download(&mut **device, (self.vertices, self.indices))?;
        Ok(HostSurfaces { positions, normals, indices })
    }

    /// Copies them on the card into a shared buffer, from its start on. Waits for everything that was submitted to the
    /// queue before, and until the copy is done; whatever is submitted afterwards sees it.
    ///
    /// # Errors
    /// Where the buffer is too small or another card's; where a side fails, and what the buffer holds is unknown then.
    pub fn write(&mut self, shared: &mut SharedBuffer) -> Result<SurfaceLayout, InteropError> {
        let layout = self.layout();
        if !shared.imported.is_of(&self.card.context) {
            return Err(InteropError::OtherCard);
        }
        if layout.bytes() > shared.bytes() {
            return Err(InteropError::TooSmall { needed: layout.bytes(), bytes: shared.bytes() });
        }
        shared.memory.release()?;
        let Session { meshes, device, .. } = &mut self.card.session;
        let ranges = [&layout.positions, &layout.normals, &layout.indices];
        let copy = |(from, range): (u64, &Range<u64>)| {
            let bytes = range.end - range.start;
            if bytes == 0 {
                return Ok(());
            }
            device.copy(from, shared.imported.address() + range.start, bytes as usize)
        };
        let copied = meshes.there().into_iter().zip(ranges).try_for_each(copy);
        // Also what was begun before a fault is waited for.
        let copied = copied.and(device.wait());
        // The queue owns the buffer between writes, whatever became of them.
        shared.memory.acquire()?;
        copied?;
        Ok(layout)
    }
}

/// Where lists stand in a buffer, in bytes: one after the other, each at a multiple of 16.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SurfaceLayout {
    /// Four `u16` each, see [`HostSurfaces::positions`].
    pub positions: Range<u64>,
    /// Three `f32` each.
    pub normals: Range<u64>,
    /// A `u16` each.
    pub indices: Range<u64>,
}

impl SurfaceLayout {
    /// That of so many vertices and indices.
    pub fn new(vertices: u64, indices: u64) -> Self {
        let after = |end: u64, bytes: u64| {
            let start = end.next_multiple_of(16);
            start..start + bytes
        };
        let positions = after(0, vertices * size_of::<[u16; 4]>() as u64);
        let normals = after(positions.end, vertices * size_of::<[f32; 3]>() as u64);
        let indices = after(normals.end, indices * size_of::<u16>() as u64);
        Self { positions, normals, indices }
    }

    /// How large the buffer has to be; a multiple of 4, as copies are.
    pub fn bytes(&self) -> u64 {
        self.indices.end.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT)
    }
}

/// Memory of a card that CUDA writes and Vulkan reads.
pub struct SharedBuffer {
    // CUDA lets go of it first, though it need not.
    imported: Imported,
    memory: vulkan::SharedBuffer,
}

impl SharedBuffer {
    /// How large it is.
    pub fn bytes(&self) -> u64 {
        self.memory.buffer().size()
    }

    /// The buffer itself, to be drawn from: [`VERTEX`](wgpu::BufferUsages::VERTEX), [`INDEX`](wgpu::BufferUsages::INDEX)
    /// and [`COPY_SRC`](wgpu::BufferUsages::COPY_SRC).
    ///
    /// # Safety
    /// While [`Surfaces::write`] writes to this, nothing that uses the buffer or a clone of it may be submitted to a
    /// queue. It may not be [destroyed](wgpu::Buffer::destroy) while this lives.
    pub unsafe fn buffer(&self) -> &wgpu::Buffer {
        self.memory.buffer()
    }

    /// Submits a copy of some of its bytes to another buffer, which is to be a
    /// [`COPY_DST`](wgpu::BufferUsages::COPY_DST). Ranges and offsets are multiples of 4; wgpu reports what is not in order.
    pub fn copy_to(&self, bytes: Range<u64>, target: &wgpu::Buffer, offset: u64) {
        self.memory.copy_to(bytes, target, offset);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::tests::device;
    use super::*;
    use crate::lattice::{BrickPos, SNAP};
    use crate::prelude::*;

    #[test]
    fn surfaces_that_stay_on_a_device_are_those_that_come_back() {
        let Some(device) = device() else { return };
        let mut session = Session::new(device, 64 << 20).expect("there is memory");
        let ground = Ground::from_fn(64, 64, |x, z| 12.0 + (f64::from(x) * 0.3).sin() + f64::from(z) * 0.1)
            .expect("finite heights");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        terrain.apply([
            Brush::dig(Shape::sphere(Vec3::new(30.0, 12.0, 33.0), 9.0)),
            Brush::dig(Shape::sphere(Vec3::new(50.0, 4.0, 20.0), 5.0)),
        ]);
        let world = terrain.world();
        let of_chunk = |chunk| {
            let bricks = BrickPos::covering(world.grid().chunk_samples(chunk));
            bricks.map(move |brick| Block { brick, chunk })
        };
        let mut blocks: Vec<Block> = world.drawn_chunks().flat_map(of_chunk).collect();
        blocks.sort_unstable_by_key(|Block { brick, chunk }| (brick.0.x, brick.0.z, brick.0.y, *chunk));
        let view = world.view();
        let meshed = session.mesh(&view, &blocks, &|| {}).expect("the device works");
        let expected = self_test::collected(&blocks, &session.meshes.surfaces(&view, &blocks, meshed));
        assert_eq!(expected.list.len(), blocks.len());
        let totals = session.mesh_there(&world.view(), &blocks).expect("the device works");
        let results = session.meshes.results(blocks.len()).to_vec();
        let Session { meshes, device, .. } = &mut session;
        let lists = meshes.download(&mut **device, totals).expect("the device works");
        let (positions, normals, indices) = lists;
        let (mut vertices, mut drawn) = (0, 0);
        for ((block, all, triangles), result) in expected.iter().zip(&results) {
            let range = |first: u32, count: u32| first as usize..(first + count) as usize;
            let own = range(result.vertex, result.vertices);
            let base = (block.brick.origin() - world.grid().origin(block.chunk)) * SNAP;
            let found = positions[own.clone()].iter().zip(&normals[own]);
            let found: Vec<_> = found.map(|(&[x, y, z, _], &normal)| ([x, y, z], normal)).collect();
            let near = |vertex: &crate::surface::Vertex| {
                ((vertex.position - base).to_array().map(|steps| steps as u16), vertex.normal.to_array())
            };
            assert_eq!(found, all.iter().map(near).collect::<Vec<_>>());
            assert_eq!(&indices[range(result.index, result.indices)], triangles);
            vertices += all.len();
            drawn += triangles.len();
        }
        assert_eq!(totals, (vertices, drawn));
        assert!(drawn > 1000, "{drawn} indices");
    }

    #[test]
    fn lists_do_not_overlap_and_can_be_bound() {
        for (vertices, indices) in [(0, 0), (1, 3), (5, 9), (1000, 6001)] {
            let layout = SurfaceLayout::new(vertices, indices);
            let ranges = [&layout.positions, &layout.normals, &layout.indices];
            assert!(ranges.windows(2).all(|pair| pair[0].end <= pair[1].start));
            assert!(ranges.iter().all(|range| range.start.is_multiple_of(16)));
            assert_eq!(
                ranges.map(|range| range.end - range.start),
                [vertices * 8, vertices * 12, indices * 2]
            );
            assert!(layout.bytes() >= layout.indices.end && layout.bytes().is_multiple_of(4));
        }
    }
}
