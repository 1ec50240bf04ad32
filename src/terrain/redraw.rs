//! What a transaction draws anew: chunks with dirty blocks, touched tiles.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use rayon::prelude::*;

use super::by_brick::ByBrick;
use super::commit::Stages;
use super::dirty::dirty_blocks;
use super::surface::{ChunkSurface, Fresh, key};
use super::tiles::{TileUpdate, TileWork};
use super::world::World;
use crate::backend::{Compute, PARALLEL_BLOCKS};
use crate::lattice::{ChunkPos, TilePos, order_of_places, side_by_side};
use crate::surface::Mask;
use crate::surface::block::Block;
use crate::surface::fresh::FreshParts;
use crate::surface::vertex::WorldView;

/// Meshes that a commit puts in place of old ones. An empty one means that nothing is drawn there any more.
#[derive(Clone, Debug, Default)]
pub struct MeshUpdates {
    /// Tiles whose index lists changed.
    pub tiles: Vec<(TilePos, TileUpdate)>,
    /// Chunks whose surface changed.
    pub chunks: Vec<(ChunkPos, Arc<ChunkSurface>)>,
}

/// From how many parts on chunks are put together side by side.
const PARALLEL_PARTS: usize = 256;

/// Every mesh that these cells change, and `newer` words of the mask.
pub(super) fn updates(
    world: &World,
    view: &WorldView,
    backend: &dyn Compute,
    dirty: &ByBrick,
    newer: &Mask,
    stages: &mut Stages,
) -> MeshUpdates {
    let Stages { meshing, assembly, ring, .. } = stages;
    let tiles = TileWork::new(world, view, newer);
    let mut chunks = |meanwhile: &(dyn Fn() + Sync)| {
        let blocks = Stages::time(meshing, || dirty_blocks(world, view, newer, dirty));
        mesh_blocks(world, view, backend, &blocks, meanwhile, meshing, assembly)
    };
    // Tiles and chunks do not depend on each other. What either leaves threads idle for is time for the other.
    let chunks = if dirty.len() < PARALLEL_BLOCKS {
        chunks(&|| {})
    } else {
        rayon::scope(|scope| {
            tiles.begin(scope);
            let chunks = chunks(&|| tiles.go_on(scope));
            tiles.go_on(scope);
            chunks
        })
    };
    let (tiles, took) = tiles.finish();
    *ring += took;
    MeshUpdates { tiles, chunks }
}

/// Has blocks meshed and puts their parts among those of their chunks that stay; leaves out chunks where nothing changed.
fn mesh_blocks(
    world: &World,
    view: &WorldView,
    backend: &dyn Compute,
    blocks: &[Block],
    meanwhile: &(dyn Fn() + Sync),
    meshing: &mut Duration,
    assembly: &mut Duration,
) -> Vec<(ChunkPos, Arc<ChunkSurface>)> {
    let (mut chunks, mut own) = (Vec::new(), Duration::ZERO);
    // Found while blocks are meshed, unless that is over sooner.
    let order = OnceLock::new();
    let order = || order.get_or_init(|| order_by_chunk(blocks));
    let meshed = || {
        backend.mesh(view, blocks, meanwhile, &mut |parts| {
            chunks = Stages::time(&mut own, || assemble(world, blocks, order(), parts));
        });
    };
    Stages::time(meshing, || {
        side_by_side(blocks.len() >= PARALLEL_BLOCKS, meshed, || {
            order();
        })
    });
    // The backend hands parts out in the middle of its own time.
    *meshing = meshing.saturating_sub(own);
    *assembly += own;
    chunks
}

/// The numbers of blocks, by their chunks, and in each chunk in the order of its parts. No other thread helps: who waits for
/// this must not do so while this one does something else.
fn order_by_chunk(blocks: &[Block]) -> Vec<u32> {
    let of = |number: u32| &blocks[number as usize];
    let mut order = order_of_places(blocks, |block| block.chunk.as_ivec3().to_array());
    let chunks = order.chunk_by_mut(|&a, &b| of(a).chunk == of(b).chunk);
    chunks.for_each(|chunk| chunk.sort_unstable_by_key(|&number| key(of(number).brick)));
    order
}

/// The surfaces of chunks with the parts of these blocks, in order, in place of old ones.
fn assemble(
    world: &World,
    blocks: &[Block],
    order: &[u32],
    parts: &dyn FreshParts,
) -> Vec<(ChunkPos, Arc<ChunkSurface>)> {
    let fresh = |&number: &u32| {
        let number = number as usize;
        Some(Fresh { key: key(blocks[number].brick), part: parts.part(number)? })
    };
    let chunk = |number: u32| blocks[number as usize].chunk;
    let chunks: Vec<&[u32]> = order.chunk_by(|&a, &b| chunk(a) == chunk(b)).collect();
    let update = |numbers: &&[u32]| {
        let chunk = chunk(numbers[0]);
        let nothing = ChunkSurface::default();
        let old = world.surfaces.get(&chunk).map_or(&nothing, Arc::as_ref);
        Some((chunk, Arc::new(old.updated(numbers.iter().filter_map(fresh))?)))
    };
    if blocks.len() >= PARALLEL_PARTS {
        chunks.par_iter().with_max_len(1).filter_map(update).collect()
    } else {
        chunks.iter().filter_map(update).collect()
    }
}
