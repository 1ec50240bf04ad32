//! Chunks whose surface is not kept: it is made on demand, for example when a player comes near.
//!
//! A terrain that is [restored](crate::terrain::Terrain::restore) from a save has meshed nothing, and one that [never
//! meshes](Meshing::Never) keeps no surface. Everything else about them is the same.

use std::sync::{Arc, OnceLock};

use glam::IVec3;

use super::state::World;
use crate::backend::{Compute, Cpu};
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, Column};
use crate::surface::block::Block;
use crate::surface::pristine::sheet_rows;
use crate::surface::vertex::WorldView;
use crate::surface::{ChunkSurface, FreshPart, Mask, MaskView};
use crate::volume::{Bricks, SampleView};

/// Selects the surfaces that a terrain's transactions make.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Meshing {
    /// All changed meshes, ready to be shown.
    #[default]
    All,
    /// None: for servers and tools that show nothing. Meshes are made when they are requested.
    Never,
}

/// The complete input for the surface of a chunk.
pub(crate) struct UnmeshedChunk {
    ground: Arc<Ground>,
    grid: ChunkGrid,
    /// The bricks that its cells read.
    bricks: Bricks,
    mask: Mask,
    blocks: Vec<Block>,
    surface: OnceLock<Arc<ChunkSurface>>,
}

impl UnmeshedChunk {
    fn new(world: &World, chunk: ChunkPos) -> Self {
        let (mut bricks, mut mask) = (Bricks::default(), Mask::default());
        // Gradients and corners of its cells read two samples further.
        let near = BrickPos::range(world.grid.chunk_cells(chunk).grown(3));
        for (x, z) in columns(near.min, near.max) {
            let cells = world.mask.word((x, z));
            if cells != 0 {
                mask.lay_word((x, z), cells);
            }
            let stack = world.stacks.get(&(x, z)).map(Vec::as_slice).unwrap_or_default();
            let from = stack.partition_point(|&y| y < near.min.y);
            for &y in stack.iter().skip(from).take_while(|&&y| y <= near.max.y) {
                let pos = BrickPos(IVec3::new(x, y, z));
                bricks.extend(world.bricks.get(&pos).map(|brick| (pos, Arc::clone(brick))));
            }
        }
        let blocks = blocks_of(world, MaskView::new(&world.mask), chunk);
        let (ground, grid) = (Arc::clone(&world.ground), world.grid);
        Self { ground, grid, bricks, mask, blocks, surface: OnceLock::new() }
    }

    /// The surface, made at the first call.
    pub fn surface(&self) -> &Arc<ChunkSurface> {
        self.surface.get_or_init(|| {
            let samples = SampleView::new(&self.ground, &self.bricks);
            let view = WorldView { samples, mask: MaskView::new(&self.mask), grid: self.grid };
            let mut surface = ChunkSurface::default();
            Cpu.mesh(&view, &self.blocks, &|| {}, &mut |parts| {
                let mut fresh: Vec<FreshPart> = (0..)
                    .zip(&self.blocks)
                    .filter_map(|(number, block)| {
                        Some(FreshPart { key: block.brick.layer_order(), part: parts.part(number)? })
                    })
                    .collect();
                fresh.sort_by_key(|fresh| fresh.key);
                surface = ChunkSurface::default().updated(fresh.into_iter()).unwrap_or_default();
            });
            Arc::new(surface)
        })
    }
}

/// The columns from one position of bricks to another.
fn columns(low: IVec3, high: IVec3) -> impl Iterator<Item = (i32, i32)> {
    (low.x..=high.x).flat_map(move |x| (low.z..=high.z).map(move |z| (x, z)))
}

/// The blocks of a chunk that may draw something of a world with this mask, by stacks, each from below: those of stored
/// bricks and next to them, and those of the mask's sheet.
pub(crate) fn blocks_of(world: &World, mask: MaskView, chunk: ChunkPos) -> Vec<Block> {
    let own = BrickPos::range(world.grid.chunk_cells(chunk));
    let mut blocks = Vec::new();
    for (x, z) in columns(own.min, own.max) {
        let beside = columns(IVec3::new(x - 1, 0, z - 1), IVec3::new(x + 1, 0, z + 1));
        let stored = beside.filter_map(|stack| world.stacks.get(&stack)).flatten();
        let mut rows: Vec<i32> = stored.flat_map(|&y| [y - 1, y, y + 1]).collect();
        let cells = mask.word((x, z));
        if cells != 0 {
            let sheet = sheet_rows(&world.ground, Column::new(x * 8, z * 8), cells);
            rows.extend(sheet.start >> 3..=(sheet.end - 1) >> 3);
        }
        rows.retain(|y| (own.min.y..=own.max.y).contains(y));
        rows.sort_unstable();
        rows.dedup();
        blocks.extend(rows.into_iter().map(|y| Block { brick: BrickPos(IVec3::new(x, y, z)), chunk }));
    }
    blocks
}

impl World {
    /// The complete input for the surface of a chunk; `None` unless it is one whose surface is not kept.
    pub(crate) fn unmeshed(&self, chunk: ChunkPos) -> Option<UnmeshedChunk> {
        self.meshes.unmeshed.contains_key(&chunk).then(|| UnmeshedChunk::new(self, chunk))
    }
}
