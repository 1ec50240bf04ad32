//! Nodes of level 0: the tile and the chunks below it, mostly unchanged.
//!
//! Next to coarser nodes the mask differs from the world's: their cells are not in it, and cells that are
//! promoted because of them are. Where that shows in a node, its tile and its blocks are made from scratch
//! with that *drawn mask*.

use glam::IVec3;
use rustc_hash::FxHashSet;

use super::near_bricks::NearBricks;
use super::sides::Cell;
use super::view::LodView;
use super::volumetric::Volumetric;
use crate::lattice::{BrickPos, ChunkPos, Column, LatticeBox, SNAP, TilePos};
use crate::lod::Node;
use crate::surface::block::{Block, Mesher, Parts};
use crate::surface::mask::cell_sheet;
use crate::surface::vertex::WorldView;
use crate::surface::{Indices, Mask, MaskView, SurfaceMesh, Vertex, tile};

/// The mask by which a node of level 0 is drawn, right for its cells and those around them; `None` if it is the
/// world's.
pub(super) fn drawn_mask(view: &LodView, node: Node) -> Option<Mask> {
    if view.cut.touching(node).iter().all(|other| other.level == 0) {
        return None;
    }
    let (low, high) = view.cut.grid().columns(node);
    if !view.stacks.has_any(low.offset(-2, -2), high.offset(2, 2)) {
        return None;
    }
    let mut volumetric = Volumetric::new(view, node);
    let (mut mask, mut is_other) = (Mask::default(), false);
    for z in low.z - 1..=high.z {
        for x in low.x - 1..=high.x {
            let cell = Column::new(x, z);
            let is_inside = (low.x + 1..high.x - 1).contains(&x) && (low.z + 1..high.z - 1).contains(&z);
            let committed = view.world.mask.contains(cell);
            let is_drawn = if is_inside {
                committed
            } else {
                // All others of level 0 may be promoted.
                view.level_at(cell) == Some(0) && volumetric.contains(Cell::new(cell, 1))
            };
            is_other |= is_drawn != committed;
            if is_drawn {
                mask.insert_word((x >> 3, z >> 3), 1 << ((z & 7) << 3 | x & 7));
            }
        }
    }
    is_other.then_some(mask)
}

/// The mesh of a node of level 0, relative to its lowest column at y = 0.
pub(super) fn mesh(view: &LodView, node: Node) -> SurfaceMesh {
    let drawn = drawn_mask(view, node);
    let world = match &drawn {
        Some(mask) => WorldView { mask: MaskView::new(mask), ..view.world },
        None => view.world,
    };
    let tile = node.tile();
    let tile_mesh = tile::mesh(&world, tile);
    let mut blocks = blocks(view, &world, tile);
    if blocks.is_empty() {
        return tile_mesh;
    }
    blocks.sort_unstable_by_key(|block| (block.brick, block.chunk));
    let mut parts = Parts::default();
    Mesher::default().mesh(&world, &blocks, &mut parts);
    // In the order in which chunks hold them.
    let mut drawn: Vec<(Block, &[Vertex], &[u16])> =
        parts.iter().filter(|(_, _, indices)| !indices.is_empty()).collect();
    drawn.sort_unstable_by_key(|(block, ..)| (block.chunk.y, block.brick.layer_order()));
    let mut vertices = tile_mesh.vertices;
    let mut indices: Vec<u32> = tile_mesh.indices.iter().collect();
    for (block, own, numbers) in drawn {
        let first = vertices.len() as u32;
        let up = IVec3::Y * (world.grid.origin(block.chunk).y * SNAP);
        vertices.extend(own.iter().map(|vertex| Vertex { position: vertex.position + up, ..*vertex }));
        indices.extend(numbers.iter().map(|&number| first + u32::from(number)));
    }
    SurfaceMesh { indices: Indices::new(vertices.len(), indices), vertices }
}

/// Every block of a tile that may draw something.
fn blocks(view: &LodView, world: &WorldView, tile: TilePos) -> Vec<Block> {
    let (low, high) = world.grid.tile_cells(tile);
    let mut bricks: FxHashSet<BrickPos> = FxHashSet::default();
    // Edited samples are corners of cells up to one below them.
    let near = NearBricks::new(&view.world.samples, &view.stacks, [low, high], 1, view.last());
    for brick in near.positions() {
        bricks.extend(LatticeBox { min: brick.0 - 1, max: brick.0 }.points().map(BrickPos));
    }
    for (x, z) in
        (low.x >> 3..=(high.x - 1) >> 3).flat_map(|x| (low.z >> 3..=(high.z - 1) >> 3).map(move |z| (x, z)))
    {
        let mut cells = world.mask.word((x, z));
        while cells != 0 {
            let bit = cells.trailing_zeros() as i32;
            cells &= cells - 1;
            let sheet =
                cell_sheet(world.samples.ground(), Column::new(x * 8 + (bit & 7), z * 8 + (bit >> 3)));
            bricks.extend((sheet.start >> 3..=(sheet.end - 1) >> 3).map(|y| BrickPos(IVec3::new(x, y, z))));
        }
    }
    let own = |brick: BrickPos| {
        let LatticeBox { min, max } = brick.samples();
        let (low, high) = (low.at(min.y), high.offset(-1, -1).at(max.y));
        LatticeBox::new(min.max(low), max.min(high))
    };
    let of_tile = |&chunk: &ChunkPos| chunk.tile() == tile;
    bricks
        .into_iter()
        .filter_map(|brick| Some((brick, own(brick)?)))
        .flat_map(|(brick, cells)| world.grid.chunks_of(cells).map(move |chunk| Block { brick, chunk }))
        .filter(|block| of_tile(&block.chunk))
        .collect()
}
