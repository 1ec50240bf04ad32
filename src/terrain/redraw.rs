//! What a transaction draws anew: cells that join the mask, dirty blocks, touched tiles.

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;

use glam::IVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::commit::Stages;
use super::surface::{ChunkSurface, Fresh, key};
use super::world::World;
use crate::backend::{Compute, PARALLEL_BLOCKS};
use crate::ground::Ground;
use crate::lattice::{
    BrickPos, ChunkGrid, ChunkPos, Column, LatticeBox, TilePos, order_of_places, sort_by_place,
};
use crate::surface::block::{self, Block, Parts};
use crate::surface::tile::{self, Rings};
use crate::surface::vertex::WorldView;
use crate::surface::window::{self, Window};
use crate::surface::{Mask, SurfaceMesh};
use crate::volume::DraftedBrick;

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
    pub indices: Vec<u32>,
    /// The rings; their vertices follow after those of the columns.
    pub rings: Arc<Rings>,
    tile: TilePos,
    ground: Arc<Ground>,
    grid: ChunkGrid,
}

impl TileUpdate {
    /// The tile's whole mesh, its columns included.
    pub fn mesh(&self) -> SurfaceMesh {
        let mut vertices = tile::columns(&self.ground, self.grid, self.tile);
        vertices.extend_from_slice(self.rings.vertices());
        SurfaceMesh { vertices, indices: self.indices.clone() }
    }
}

/// Rule 2 for the cells around changed samples. Edited samples stay edited, so cells only ever join the mask.
fn added_cells(view: &WorldView, changed: &[DraftedBrick]) -> Mask {
    // A sample is a corner of the cells one below it.
    let around = |drafted: &DraftedBrick| {
        (drafted.pos.0.x, LatticeBox { min: drafted.changed.min - 1, max: drafted.changed.max })
    };
    let boxes: Vec<_> = changed.iter().filter(|drafted| drafted.is_extended).map(around).collect();
    let near: Vec<BrickPos> = by_brick(&boxes).into_iter().map(|(brick, _)| brick).collect();
    let mut windows = Vec::new();
    let mut rest = &near[..];
    while let Some((count, places)) = window::shared(rest.iter().copied()) {
        let (bricks, others) = rest.split_at(count);
        windows.push((bricks, places));
        rest = others;
    }
    let disturbed = |&(bricks, places): &(&[BrickPos], LatticeBox)| {
        let window = Window::new(&view.samples, places);
        let mut found = Vec::new();
        for stack in bricks.chunk_by(|a, b| (a.0.x, a.0.z) == (b.0.x, b.0.z)) {
            let word = (stack[0].0.x, stack[0].0.z);
            found.push((word, block::disturbed(view, &window, stack) & !view.mask.word(word)));
        }
        found
    };
    let cells: Vec<_> = if near.len() < PARALLEL_BLOCKS {
        windows.iter().flat_map(disturbed).collect()
    } else {
        windows.par_iter().flat_map_iter(disturbed).collect()
    };
    let mut added = Mask::default();
    for (word, cells) in cells {
        added.insert_word(word, cells);
    }
    added
}

/// Cells by the bricks that hold them: by stacks of bricks, each from below.
pub(super) type ByBrick = Vec<(BrickPos, LatticeBox)>;

/// The cells that the changed samples show in.
pub(super) fn dirty_cells(view: &WorldView, changed: &[DraftedBrick]) -> ByBrick {
    // A sample is a corner of the cells one below it; gradients look one sample further on both sides.
    let around = |drafted: &DraftedBrick| {
        let (x, changed) = (drafted.pos.0.x, drafted.changed);
        in_world(view, changed.min - 2, changed.max + 1).map(|cells| (x, cells))
    };
    by_brick(&changed.iter().filter_map(around).collect::<Vec<_>>())
}

/// The cells that join the mask, and those that the changed samples show in, whether they join or not.
pub(super) fn disturb(view: &WorldView, changed: &[DraftedBrick], stages: &mut Stages) -> (Mask, ByBrick) {
    let added = || timed(|| added_cells(view, changed));
    let dirty = || timed(|| dirty_cells(view, changed));
    let ((added, ring), (dirty, meshing)) = side_by_side(changed, added, dirty);
    stages.ring += ring;
    stages.meshing += meshing;
    (added, dirty)
}

/// Every mesh that these cells change, and those of the mask that join it or leave it.
pub(super) fn updates(
    world: &World,
    view: &WorldView,
    backend: &dyn Compute,
    changed: &[DraftedBrick],
    dirty: ByBrick,
    turned: &Mask,
    stages: &mut Stages,
) -> MeshUpdates {
    let chunks = || {
        let mut stages = Stages::default();
        let blocks = Stages::time(&mut stages.meshing, || dirty_blocks(world, view, dirty, turned));
        (mesh_blocks(world, view, backend, &blocks, &mut stages), stages)
    };
    let tiles = || timed(|| touched_tiles(world, view, turned));
    // Tiles and chunks do not depend on each other. What either does alone is time for the other.
    let ((chunks, own), (tiles, ring)) = side_by_side(changed, chunks, tiles);
    stages.meshing += own.meshing;
    stages.assembly += own.assembly;
    stages.ring += ring;
    MeshUpdates { tiles, chunks }
}

/// Two things, at once where much has changed.
fn side_by_side<A: Send, B: Send>(
    changed: &[DraftedBrick],
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if changed.len() < PARALLEL_BLOCKS { (a(), b()) } else { rayon::join(a, b) }
}

/// What `work` gives, and how long it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let mut time = Duration::ZERO;
    (Stages::time(&mut time, work), time)
}

/// The box from `low` to `high` as far as it lies in the world.
fn in_world(view: &WorldView, low: IVec3, high: IVec3) -> Option<LatticeBox> {
    let last = IVec3::new(view.grid.width() - 1, i32::MAX, view.grid.depth() - 1);
    LatticeBox::new(low.max(IVec3::new(0, i32::MIN, 0)), high.min(last))
}

/// Every block that may draw something else than before, by stacks of bricks, each from below.
fn dirty_blocks(world: &World, view: &WorldView, mut dirty: ByBrick, turned: &Mask) -> Vec<Block> {
    let is_large = dirty.len() >= PARALLEL_BLOCKS;
    let sheets = sheets_near(world, view, turned);
    if !sheets.is_empty() {
        dirty.extend(by_brick(&sheets));
        // Two sorted lists, which this merges.
        dirty.sort_by_key(|(brick, _)| stack_order(brick));
    }
    let blocks = |same: &[(BrickPos, LatticeBox)]| {
        let brick = same[0].0;
        let cells = same.iter().fold(same[0].1, |all, (_, cells)| all.union(*cells));
        view.grid.chunks_of(cells).map(move |chunk| Block { brick, chunk })
    };
    if is_large {
        dirty.par_chunk_by(|a, b| a.0 == b.0).flat_map_iter(blocks).collect()
    } else {
        let mut found = Vec::with_capacity(dirty.len());
        dirty.chunk_by(|a, b| a.0 == b.0).for_each(|same| found.extend(blocks(same)));
        found
    }
}

/// A cell that joins the mask draws its sheet, and one that leaves it draws it no longer; beside it, vertices leave the
/// mask's border or come to it. The boxes around all of these, one for each stack of bricks and with its x, by which they
/// are sorted.
fn sheets_near(world: &World, view: &WorldView, turned: &Mask) -> Vec<(i32, LatticeBox)> {
    let mut near = Vec::new();
    for ((x, z), cells) in turned.words() {
        for (dx, dz) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dz| (dx, dz))) {
            let cells = grown_into(cells, dx, dz);
            near.extend((cells != 0).then_some(((x + dx, z + dz), cells)));
        }
    }
    sort_by_place(&mut near, |&((x, z), _)| [x, z, 0]);
    let sheet = |same: &[((i32, i32), u64)]| {
        let stack = same[0].0;
        let drawn = view.mask.word(stack) | world.mask.word(stack);
        let cells = same.iter().fold(0, |all, (_, cells)| all | cells) & drawn;
        let low = Column::new(stack.0 * 8, stack.1 * 8);
        let rows = (cells != 0).then(|| block::sheet_rows(view.samples.ground(), low, cells))?;
        Some((stack.0, in_world(view, low.at(rows.start), low.offset(7, 7).at(rows.end - 1))?))
    };
    let stacks = |a: &((i32, i32), u64), b: &((i32, i32), u64)| a.0 == b.0;
    if near.len() < PARALLEL_BLOCKS {
        near.chunk_by(stacks).filter_map(sheet).collect()
    } else {
        near.par_chunk_by(stacks).filter_map(sheet).collect()
    }
}

/// Stacks of bricks one after the other, each from below.
fn stack_order(brick: &BrickPos) -> (i32, i32, i32) {
    (brick.0.x, brick.0.z, brick.0.y)
}

/// How many places for bricks a table may have for each box.
const PLACES: u64 = 64;

/// The bricks that hold cells of these boxes, each with the box around its own of them. Every box belongs to something
/// whose x, in bricks, stands beside it, at most one brick away; by that number they are sorted.
fn by_brick(boxes: &[(i32, LatticeBox)]) -> ByBrick {
    let (Some(first), Some(last)) = (boxes.first(), boxes.last()) else { return ByBrick::new() };
    if boxes.len() < PARALLEL_BLOCKS {
        return those_within(first.0 - 1..=last.0 + 1, boxes);
    }
    let slab = |x: i32| {
        let from = boxes.partition_point(|(home, _)| *home < x - 1);
        let near = boxes[from..].partition_point(|(home, _)| *home <= x + 1);
        those_within(x..=x, &boxes[from..from + near])
    };
    (first.0 - 1..last.0 + 2).into_par_iter().map(slab).collect::<Vec<_>>().concat()
}

/// Those of the bricks whose x lies in a range.
fn those_within(xs: RangeInclusive<i32>, boxes: &[(i32, LatticeBox)]) -> ByBrick {
    let within = |cells: &LatticeBox| {
        let (min, max): (IVec3, IVec3) = (cells.min >> 3, cells.max >> 3);
        LatticeBox::new(min.with_x(min.x.max(*xs.start())), max.with_x(max.x.min(*xs.end())))
    };
    let bricks = || boxes.iter().filter_map(|(_, cells)| Some((within(cells)?, cells)));
    let Some(all) = bricks().map(|(bricks, _)| bricks).reduce(LatticeBox::union) else {
        return ByBrick::new();
    };
    // Where bricks lie close together, a table of all of them finds them at once; else they are looked up by position.
    let size = all.size();
    let is_dense = all.volume() <= PLACES * boxes.len() as u64;
    let mut table = if is_dense { vec![0u32; all.volume() as usize] } else { Vec::new() };
    let mut index: FxHashMap<BrickPos, u32> = FxHashMap::default();
    let mut found = ByBrick::with_capacity(boxes.len() * 4);
    for (bricks, cells) in bricks() {
        for brick in bricks.points().map(BrickPos) {
            let Some(cells) = brick.samples().intersection(*cells) else { continue };
            let number = if is_dense {
                let at = brick.0 - all.min;
                &mut table[((at.x * size.z + at.z) * size.y + at.y) as usize]
            } else {
                index.entry(brick).or_default()
            };
            if *number == 0 {
                found.push((brick, cells));
                *number = found.len() as u32;
            } else {
                let own = &mut found[*number as usize - 1].1;
                *own = own.union(cells);
            }
        }
    }
    if is_dense {
        return table
            .iter()
            .filter(|&&number| number != 0)
            .map(|&number| found[number as usize - 1])
            .collect();
    }
    found.sort_unstable_by_key(|(brick, _)| stack_order(brick));
    found
}

/// 8x8 cells and the cells beside and diagonally beside them, as far as they lie in the word (dx, dz) further.
fn grown_into(cells: u64, dx: i32, dz: i32) -> u64 {
    const FIRST: u64 = 0x0101_0101_0101_0101;
    let along = match dx {
        -1 => (cells & FIRST) << 7,
        0 => cells | (cells & !(FIRST << 7)) << 1 | (cells & !FIRST) >> 1,
        _ => (cells & FIRST << 7) >> 7,
    };
    match dz {
        -1 => along << 56,
        0 => along | along << 8 | along >> 8,
        _ => along >> 56,
    }
}

/// Has blocks meshed and puts their parts among those of their chunks that stay; leaves out chunks where nothing changed.
fn mesh_blocks(
    world: &World,
    view: &WorldView,
    backend: &dyn Compute,
    blocks: &[Block],
    stages: &mut Stages,
) -> Vec<(ChunkPos, Arc<ChunkSurface>)> {
    let (mut chunks, mut assembly) = (Vec::new(), Duration::ZERO);
    let (_, all) = timed(|| {
        backend.mesh(view, blocks, &mut |parts| {
            chunks = Stages::time(&mut assembly, || assemble(world, parts));
        });
    });
    stages.meshing += all - assembly;
    stages.assembly += assembly;
    chunks
}

/// The surfaces of chunks with these parts in place of old ones.
fn assemble(world: &World, parts: &[Parts]) -> Vec<(ChunkPos, Arc<ChunkSurface>)> {
    let fresh = |(block, vertices, indices): (Block, _, _)| {
        (block.chunk, Fresh { key: key(block.brick), vertices, indices })
    };
    let all: Vec<(ChunkPos, Fresh)> = parts.iter().flat_map(|parts| parts.iter().map(fresh)).collect();
    let mut order = order_of_places(&all, |(chunk, _)| chunk.as_ivec3().to_array());
    let is_large = all.len() >= PARALLEL_BLOCKS;
    let part = |number: u32| &all[number as usize];
    let mut chunks: Vec<&mut [u32]> = order.chunk_by_mut(|&a, &b| part(a).0 == part(b).0).collect();
    let update = |numbers: &mut &mut [u32]| {
        numbers.sort_unstable_by_key(|&number| part(number).1.key);
        let chunk = part(numbers[0]).0;
        let nothing = ChunkSurface::default();
        let old = world.surfaces.get(&chunk).map_or(&nothing, Arc::as_ref);
        Some((chunk, Arc::new(old.updated(numbers.iter().map(|&number| part(number).1))?)))
    };
    if is_large {
        chunks.par_iter_mut().filter_map(update).collect()
    } else {
        chunks.iter_mut().filter_map(update).collect()
    }
}

/// Tiles that lose a cell to the mask or get one back, or border on one that does, in order.
fn touched_tiles(world: &World, view: &WorldView, turned: &Mask) -> Vec<(TilePos, TileUpdate)> {
    let mut touched = Vec::new();
    for ((x, z), cells) in turned.words() {
        for (dx, dz) in [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)] {
            let patch = (x + dx, z + dz);
            let near = grown_into(cells, dx, dz);
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
