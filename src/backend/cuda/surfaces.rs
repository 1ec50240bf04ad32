//! Surfaces of blocks as the mesh kernel wrote them, read in place without another copy. They arrive in the order
//! of their blocks, so the first ones can be processed while later ones are in flight.

use std::ops::Range;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use web_time::Instant;

use super::device::{Fault, Mark};
use super::guarded;
use super::layout::MeshResult;
use super::mesh::output::{MeshLists, MeshOutput, Meshed, PIECE};
use crate::lattice::{ChunkGrid, SNAP};
use crate::surface::MaterialMix;
use crate::surface::block::Block;
use crate::surface::meshed_blocks::{BlockVertices, MeshedBlock, MeshedBlocks, PackedMixes, PackedVertices};
use crate::surface::vertex::WorldView;

/// The surfaces of some blocks.
pub(super) struct Surfaces<'a> {
    pub grid: ChunkGrid,
    pub blocks: &'a [Block],
    /// The location of each block's surface.
    pub results: &'a [MeshResult],
    /// Vertices and indices of all blocks. Positions are relative to the minimum corner of a block's brick.
    pub lists: &'a MeshLists,
    /// The material mix of all vertices, if it is uniform; otherwise each vertex has its own.
    pub plain: Option<MaterialMix>,
    pub arrival: Arrival,
}

impl<'a> Surfaces<'a> {
    pub fn new(output: &'a MeshOutput, view: &WorldView, blocks: &'a [Block], meshed: Meshed) -> Self {
        Self {
            grid: view.grid,
            blocks,
            results: output.results.entries(blocks.len()),
            lists: &output.lists,
            plain: meshed.plain,
            arrival: Arrival::new(meshed.marks),
        }
    }
}

/// Copies in flight, each with the surfaces of [`PIECE`] more blocks.
pub(super) struct Arrival {
    /// One mark per copy; empty if nothing had to be copied.
    marks: Vec<Box<dyn Mark>>,
    /// Number of copies that have arrived.
    here: AtomicUsize,
    fault: OnceLock<Fault>,
    /// Nanoseconds spent waiting.
    waited: AtomicU64,
}

impl Arrival {
    pub fn new(marks: Vec<Box<dyn Mark>>) -> Self {
        Self { marks, here: AtomicUsize::new(0), fault: OnceLock::new(), waited: AtomicU64::new(0) }
    }

    /// Waits for the surfaces of the first blocks; returns for how many blocks they have arrived.
    fn wait_for(&self, blocks: usize) -> usize {
        let wanted = blocks.div_ceil(PIECE).min(self.marks.len());
        let here = self.here.load(Ordering::Acquire);
        if here < wanted {
            let start = Instant::now();
            self.pass(here, wanted);
            self.waited.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        }
        match self.here.load(Ordering::Acquire) {
            all if all == self.marks.len() => usize::MAX,
            some => some * PIECE,
        }
    }

    /// Waits for a range of copies. Stops at the first one that fails.
    fn pass(&self, here: usize, wanted: usize) {
        for (number, mark) in (here..).zip(&self.marks[here..wanted]) {
            if let Err(fault) = guarded(|| mark.wait()) {
                self.fault.get_or_init(|| fault);
                return;
            }
            self.here.fetch_max(number + 1, Ordering::AcqRel);
        }
    }

    /// Whether all copies have arrived.
    pub fn is_over(&self) -> bool {
        self.here.load(Ordering::Acquire) == self.marks.len()
    }

    /// How long was waited, or the fault if some copies failed.
    pub fn end(self) -> Result<Duration, Fault> {
        match self.fault.into_inner() {
            Some(fault) => Err(fault),
            None => Ok(Duration::from_nanos(self.waited.into_inner())),
        }
    }
}

fn range(first: u32, count: u32) -> Range<usize> {
    first as usize..(first as usize).saturating_add(count as usize)
}

impl MeshedBlocks for Surfaces<'_> {
    fn wait_for(&self, blocks: usize) -> usize {
        self.arrival.wait_for(blocks)
    }

    fn part(&self, number: usize) -> Option<MeshedBlock<'_>> {
        let (block, result) = (self.blocks.get(number)?, self.results.get(number)?);
        // Wait until the surface has arrived.
        (number < self.wait_for(number + 1)).then_some(())?;
        let own = range(result.vertex, result.vertices);
        let vertices = PackedVertices {
            origin: (block.brick.origin() - self.grid.origin(block.chunk)) * SNAP,
            positions: self.lists.positions.part(own.clone())?,
            normals: self.lists.normals.part(own.clone())?,
            mixes: match self.plain {
                Some(mix) => PackedMixes::One(mix),
                None => PackedMixes::Each(self.lists.mixes.part(own)?),
            },
        };
        let indices = self.lists.indices.part(range(result.index, result.indices))?;
        Some(MeshedBlock { vertices: BlockVertices::Packed(vertices), indices })
    }
}
