//! The meshes that a transaction rebuilds: chunks with dirty blocks, touched tiles.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use rayon::prelude::*;

use super::by_brick::{ByBrick, is_same_stack};
use super::cut::{DrawnCut, NodeUpdate};
use super::dirty::{complete, dirty_blocks};
use super::nodes::redraw_changed;
use super::source::TileUpdate;
use super::stages::Stages;
use super::tiles::TileWork;
use crate::backend::Compute;
use crate::lattice::{
    BrickPos, ChunkPos, Column, ItemCost, LatticeBox, TilePos, side_by_side, sort_permutation,
};
use crate::surface::block::Block;
use crate::surface::meshed_blocks::MeshedBlocks;
use crate::surface::vertex::WorldView;
use crate::surface::{ChunkSurface, FreshPart, Mask, PartKey};
use crate::world::{Meshing, NewSurfaces, World};

/// New meshes of a commit, which replace old ones. An empty one means that nothing is drawn there any more.
#[derive(Clone, Debug, Default)]
pub struct MeshUpdates {
    /// Tiles whose index lists changed.
    pub tiles: Vec<(TilePos, TileUpdate)>,
    /// Chunks whose surface changed.
    pub chunks: Vec<(ChunkPos, Arc<ChunkSurface>)>,
    /// Nodes that are drawn differently, if a [cut](crate::terrain::DrawnCut) is drawn. Tiles and chunks that
    /// change are listed above, whether they are drawn or not.
    pub nodes: Vec<NodeUpdate>,
    /// The cut that is drawn afterwards, if it changes.
    pub(crate) drawn_cut: Option<Arc<DrawnCut>>,
    /// Chunks that change without being meshed.
    pub(crate) outdated: Vec<ChunkPos>,
}

impl MeshUpdates {
    /// What the world keeps of it.
    pub(crate) fn kept(&self) -> NewSurfaces {
        NewSurfaces {
            chunks: self.chunks.clone(),
            rings: self.tiles.iter().map(|(tile, update)| (*tile, update.kept_rings())).collect(),
            outdated: self.outdated.clone(),
        }
    }
}

/// A world as it is drawn, and what draws it.
#[derive(Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub world: &'a World,
    pub meshing: Meshing,
    /// The cut that is drawn; `None` if all of the world is drawn in full detail.
    pub cut: Option<&'a Arc<DrawnCut>>,
    pub backend: &'a dyn Compute,
}

/// Every mesh that these cells and `newer` words of the mask change; `bricks` are the changed bricks.
pub(crate) fn updates(
    scene: Scene,
    view: &WorldView,
    dirty: &ByBrick,
    newer: &Mask,
    bricks: impl Fn() -> Vec<BrickPos>,
    stages: &mut Stages,
) -> MeshUpdates {
    let Scene { world, backend, .. } = scene;
    let Stages { meshing, assembly, ring, .. } = stages;
    if scene.meshing == Meshing::Never {
        let blocks = Stages::time(meshing, || dirty_blocks(world, view, newer, dirty));
        let mut outdated: Vec<ChunkPos> = blocks.iter().map(|block| block.chunk).collect();
        outdated.sort_unstable();
        outdated.dedup();
        return MeshUpdates { outdated, ..MeshUpdates::default() };
    }
    let tiles = TileWork::new(world, view, newer);
    let mut chunks = |overlap: &(dyn Fn() + Sync)| {
        let blocks = Stages::time(meshing, || {
            let mut blocks = dirty_blocks(world, view, newer, dirty);
            complete(world, view, &mut blocks);
            blocks
        });
        mesh_blocks(world, view, backend, &blocks, overlap, meshing, assembly)
    };
    // Tiles and chunks do not depend on each other: each is made while the other leaves threads idle.
    let chunks = if !ItemCost::Brick.is_shared(dirty.len()) {
        chunks(&|| {})
    } else {
        rayon::scope(|scope| {
            tiles.begin(scope);
            let chunks = chunks(&|| tiles.allow(scope));
            tiles.allow(scope);
            chunks
        })
    };
    let (tiles, took) = tiles.finish();
    *ring += took;
    let mut meshes = MeshUpdates { tiles, chunks, ..MeshUpdates::default() };
    if let Some(drawn) = scene.cut {
        let (after, nodes) = Stages::time(meshing, || {
            redraw_changed(world, view, drawn, (&meshes.tiles, &meshes.chunks), &bricks(), &areas(dirty))
        });
        (meshes.drawn_cut, meshes.nodes) = (Some(after), nodes);
    }
    meshes
}

/// The columns of dirty cells: the lowest and the highest of each stack of bricks.
fn areas(dirty: &ByBrick) -> Vec<(Column, Column)> {
    dirty.collect(|stacks, found| {
        for stack in stacks.chunk_by(is_same_stack) {
            let cells = stack.iter().map(|own| own.cells).reduce(LatticeBox::union);
            found.extend(cells.map(|cells| (Column::of(cells.min), Column::of(cells.max))));
        }
    })
}

/// Has blocks meshed and puts their parts among those of their chunks that stay; leaves out chunks where nothing
/// changed.
fn mesh_blocks(
    world: &World,
    view: &WorldView,
    backend: &dyn Compute,
    blocks: &[Block],
    overlap: &(dyn Fn() + Sync),
    meshing: &mut Duration,
    assembly: &mut Duration,
) -> Vec<(ChunkPos, Arc<ChunkSurface>)> {
    let (mut chunks, mut own) = (Vec::new(), Duration::ZERO);
    // Found while blocks are meshed, unless that is over sooner.
    let order = OnceLock::new();
    let order = || order.get_or_init(|| ByChunk::new(blocks));
    let meshed = || {
        backend.mesh(view, blocks, overlap, &mut |parts| {
            chunks = Stages::time(&mut own, || assemble(world, blocks, order(), parts));
        });
    };
    Stages::time(meshing, || {
        side_by_side(ItemCost::Brick.is_shared(blocks.len()), meshed, || {
            order();
        })
    });
    // The backend returns parts while it is still running.
    *meshing = meshing.saturating_sub(own);
    *assembly += own;
    chunks
}

/// Blocks by their chunks.
struct ByChunk {
    /// The numbers of blocks, chunk by chunk, and in each chunk in the order of its parts.
    order: Vec<u32>,
    chunks: Vec<OfChunk>,
}

/// Blocks of a chunk.
struct OfChunk {
    chunk: ChunkPos,
    /// The number of blocks.
    count: usize,
    /// One more than the greatest of their numbers.
    end: usize,
}

impl ByChunk {
    /// On one thread: with rayon's help, a thread that waits for this could be given other work first.
    fn new(blocks: &[Block]) -> Self {
        let of = |number: u32| &blocks[number as usize];
        let mut order = sort_permutation(blocks, |block| block.chunk.as_ivec3().to_array());
        let mut keyed = Vec::new();
        let of_chunk = |numbers: &mut [u32]| {
            let end = numbers.iter().max().map_or(0, |&last| last as usize + 1);
            // By the keys of their parts, each of which is looked up once and compared as one number.
            keyed.clear();
            keyed.extend(numbers.iter().map(|&number| as_number(of(number).brick.layer_order(), number)));
            keyed.sort_unstable();
            numbers.iter_mut().zip(&keyed).for_each(|(number, &own)| *number = own as u32);
            OfChunk { chunk: of(numbers[0]).chunk, count: numbers.len(), end }
        };
        let chunks = order.chunk_by_mut(|&a, &b| of(a).chunk == of(b).chunk).map(of_chunk).collect();
        Self { order, chunks }
    }

    /// The chunks, each with the numbers of its blocks.
    fn iter(&self) -> impl Iterator<Item = (&OfChunk, &[u32])> {
        let mut order = &self.order[..];
        self.chunks.iter().map(move |chunk| {
            let (own, others) = order.split_at(chunk.count);
            order = others;
            (chunk, own)
        })
    }
}

/// A part's key and the number of its block, as one number in the same order.
fn as_number(key: PartKey, number: u32) -> u128 {
    let unsigned = key.map(|at| u128::from(at.cast_unsigned() ^ 1 << 31));
    unsigned[0] << 96 | unsigned[1] << 64 | unsigned[2] << 32 | u128::from(number)
}

/// A chunk, and its surface.
type Updated = (ChunkPos, Arc<ChunkSurface>);

/// The surfaces of chunks with the parts of these blocks, in order, in place of old ones. Threads begin with those
/// whose parts are here.
fn assemble(world: &World, blocks: &[Block], by_chunk: &ByChunk, parts: &dyn MeshedBlocks) -> Vec<Updated> {
    let fresh = |&number: &u32| {
        let number = number as usize;
        Some(FreshPart { key: blocks[number].brick.layer_order(), part: parts.part(number)? })
    };
    let update = |chunk: ChunkPos, numbers: &[u32]| {
        let nothing = ChunkSurface::default();
        let old = world.meshes.surfaces.get(chunk).map_or(&nothing, Arc::as_ref);
        // For a chunk without a kept surface, an empty surface counts as a change.
        let empty = || world.meshes.unmeshed.contains_key(&chunk).then(ChunkSurface::default);
        Some((chunk, Arc::new(old.updated(numbers.iter().filter_map(fresh)).or_else(empty)?)))
    };
    if !ItemCost::Lookup.is_shared(blocks.len()) {
        return by_chunk.iter().filter_map(|(own, numbers)| update(own.chunk, numbers)).collect();
    }
    let chunks: Vec<(&OfChunk, &[u32])> = by_chunk.iter().collect();
    let mut updated: Vec<Option<Updated>> = vec![None; chunks.len()];
    let update = &update;
    rayon::scope(|scope| {
        let (mut chunks, mut places) = (&chunks[..], &mut updated[..]);
        while let Some((first, _)) = chunks.first() {
            let here = parts.wait_for(first.end);
            let ((own, others), (own_places, other_places)) =
                match chunks.iter().take_while(|(chunk, _)| chunk.end <= here).count() {
                    // They will never be here.
                    0 => break,
                    count => (chunks.split_at(count), places.split_at_mut(count)),
                };
            (chunks, places) = (others, other_places);
            scope.spawn(move |_| {
                let own = own.par_iter().zip(own_places).with_max_len(1);
                own.for_each(|((chunk, numbers), place)| *place = update(chunk.chunk, numbers));
            });
        }
    });
    updated.into_iter().flatten().collect()
}
