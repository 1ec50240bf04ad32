//! What a transaction draws anew: chunks with dirty blocks, touched tiles.

use std::sync::Arc;
use std::time::Duration;

use glam::IVec3;
use rayon::prelude::*;

use super::by_brick::ByBrick;
use super::commit::Stages;
use super::dirty::{dirty_blocks, grown_into};
use super::surface::{ChunkSurface, Fresh, key};
use super::world::World;
use crate::backend::{Compute, PARALLEL_BLOCKS};
use crate::ground::Ground;
use crate::lattice::{ChunkGrid, ChunkPos, Column, LatticeBox, TilePos, order_of_places};
use crate::surface::block::{Block, Parts};
use crate::surface::tile::{self, Rings};
use crate::surface::vertex::WorldView;
use crate::surface::{Indices, Mask, SurfaceMesh};

/// Meshes that a commit puts in place of old ones. An empty one means that nothing is drawn there any more.
#[derive(Clone, Debug, Default)]
pub struct MeshUpdates {
    /// Tiles whose index lists changed.
    pub tiles: Vec<(TilePos, TileUpdate)>,
    /// Chunks whose surface changed.
    pub chunks: Vec<(ChunkPos, Arc<ChunkSurface>)>,
}

/// What changes in a tile's mesh. Its columns stay as they are.
#[derive(Clone, Debug)]
pub struct TileUpdate {
    /// The whole list of indices.
    pub indices: Indices,
    /// The rings; their vertices follow after those of the columns.
    pub rings: Arc<Rings>,
    tile: TilePos,
    ground: Arc<Ground>,
    grid: ChunkGrid,
}

impl TileUpdate {
    /// The tile's whole mesh, its columns included.
    pub fn mesh(&self) -> SurfaceMesh {
        let vertices = tile::vertices(&self.ground, self.grid, self.tile, &self.rings);
        SurfaceMesh { vertices, indices: self.indices.clone() }
    }
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
    let chunks = || {
        let blocks = Stages::time(meshing, || dirty_blocks(world, view, newer, dirty));
        mesh_blocks(world, view, backend, &blocks, meshing, assembly)
    };
    let tiles = || Stages::time(ring, || touched_tiles(world, view, newer));
    // Tiles and chunks do not depend on each other. What either does alone is time for the other.
    let (chunks, tiles) = side_by_side(dirty.len(), chunks, tiles);
    MeshUpdates { tiles, chunks }
}

/// Two things, at once where so many bricks are worth it.
pub(super) fn side_by_side<A: Send, B: Send>(
    bricks: usize,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if bricks < PARALLEL_BLOCKS { (a(), b()) } else { rayon::join(a, b) }
}

/// Has blocks meshed and puts their parts among those of their chunks that stay; leaves out chunks where nothing changed.
fn mesh_blocks(
    world: &World,
    view: &WorldView,
    backend: &dyn Compute,
    blocks: &[Block],
    meshing: &mut Duration,
    assembly: &mut Duration,
) -> Vec<(ChunkPos, Arc<ChunkSurface>)> {
    let (mut chunks, mut own) = (Vec::new(), Duration::ZERO);
    Stages::time(meshing, || {
        backend.mesh(view, blocks, &mut |parts| {
            chunks = Stages::time(&mut own, || assemble(world, blocks, parts));
        });
    });
    // The backend hands parts out in the middle of its own time.
    *meshing = meshing.saturating_sub(own);
    *assembly += own;
    chunks
}

/// The surfaces of chunks with the parts of these blocks in place of old ones.
fn assemble(world: &World, blocks: &[Block], parts: &[Parts]) -> Vec<(ChunkPos, Arc<ChunkSurface>)> {
    // Of each list, the block that its parts begin with.
    let count = |end: &mut usize, parts: &Parts| {
        let first = *end;
        *end += parts.list.len();
        Some(first)
    };
    let firsts: Vec<usize> = parts.iter().scan(0, count).collect();
    let fresh = |&number: &u32| {
        let number = number as usize;
        let list = firsts.partition_point(|&first| first <= number).checked_sub(1)?;
        let (vertices, indices) = parts.get(list)?.get(number - firsts[list])?;
        Some(Fresh { key: key(blocks[number].brick), vertices, indices })
    };
    let chunk = |number: u32| blocks[number as usize].chunk;
    let mut order = order_of_places(blocks, |block| block.chunk.as_ivec3().to_array());
    let mut chunks: Vec<&mut [u32]> = order.chunk_by_mut(|&a, &b| chunk(a) == chunk(b)).collect();
    let update = |numbers: &mut &mut [u32]| {
        numbers.sort_unstable_by_key(|&number| key(blocks[number as usize].brick));
        let chunk = chunk(numbers[0]);
        let nothing = ChunkSurface::default();
        let old = world.surfaces.get(&chunk).map_or(&nothing, Arc::as_ref);
        Some((chunk, Arc::new(old.updated(numbers.iter().filter_map(fresh))?)))
    };
    if blocks.len() >= PARALLEL_PARTS {
        chunks.par_iter_mut().filter_map(update).collect()
    } else {
        chunks.iter_mut().filter_map(update).collect()
    }
}

/// Tiles that lose a cell to the mask or get one back, or border on one that does, in order.
fn touched_tiles(world: &World, view: &WorldView, newer: &Mask) -> Vec<(TilePos, TileUpdate)> {
    let mut touched = Vec::new();
    for ((x, z), cells) in newer.words() {
        let turned = cells ^ world.mask.word((x, z));
        for (dx, dz) in [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)] {
            let patch = (x + dx, z + dz);
            let near = grown_into(turned, dx, dz);
            if near != 0 {
                touched.extend(tiles_of(view.grid, patch).map(|tile| (tile, (patch.1, patch.0))));
            }
        }
    }
    touched.sort_unstable();
    touched.dedup();
    let tiles: Vec<_> = touched.chunk_by(|a, b| a.0 == b.0).collect();
    let update = |touched: &&[(TilePos, (i32, i32))]| {
        let tile = touched[0].0;
        let patches: Vec<(i32, i32)> = touched.iter().map(|&(_, patch)| patch).collect();
        let borders = tile::borders(view, tile);
        let nothing = Rings::default();
        let old = world.rings.get(&tile).map_or(&nothing, Arc::as_ref);
        let rings = Arc::new(old.updated(view, tile, &borders, &patches));
        let indices = tile::indices(view.grid, tile, &borders, &rings);
        (tile, TileUpdate { indices, rings, tile, ground: Arc::clone(&world.ground), grid: view.grid })
    };
    if tiles.len() < 8 { tiles.iter().map(update).collect() } else { tiles.par_iter().map(update).collect() }
}

/// The tiles that draw some of the 8x8 cells of a word.
fn tiles_of(grid: ChunkGrid, (x, z): (i32, i32)) -> impl Iterator<Item = TilePos> {
    let last = |at: i32, cells: i32| (at * 8 + 7).min(cells - 1);
    let cells = LatticeBox::new(
        IVec3::new((x * 8).max(0), 0, (z * 8).max(0)),
        IVec3::new(last(x, grid.width()), 0, last(z, grid.depth())),
    );
    cells.into_iter().flat_map(move |cells| {
        let (low, high) =
            (grid.tile_of_cell(Column::of(cells.min)), grid.tile_of_cell(Column::of(cells.max)));
        (low.z..=high.z).flat_map(move |z| (low.x..=high.x).map(move |x| TilePos { x, z }))
    })
}
