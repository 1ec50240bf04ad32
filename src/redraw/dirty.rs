//! The cells and blocks where changed samples show: the cells that join the mask, and the blocks that have to be drawn
//! again.
//!
//! Bricks are in order of their stacks throughout, so each step works stack by stack and threads share the stacks.

use glam::IVec3;

use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, Column, LatticeBox};
use crate::surface::block::Block;
use crate::surface::brick_window::{self, Window};
use crate::surface::pristine::{self, PristineStack};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, mask};

use rustc_hash::FxHashSet;

use super::by_brick::{BrickCells, ByBrick, Reached, is_same_stack};
use crate::volume::layers::FIRST_X;
use crate::world::{World, blocks_of};

/// The cells that changed samples show in. `changed` gives the brick of each change, the box around its samples, and
/// whether one of them is edited for the first time: only then may cells join the mask.
pub(crate) fn dirty_cells<T: Sync>(
    grid: ChunkGrid,
    changes: &[T],
    changed: impl Fn(&T) -> (BrickPos, LatticeBox, bool) + Sync,
) -> ByBrick {
    // A sample is a corner of the cells one below it; gradients look one sample further on both sides.
    ByBrick::new(changes, |change| {
        let (brick, changed, is_extended) = changed(change);
        let cells = in_world(grid, changed.min - 2, changed.max + 1);
        let joining = LatticeBox { min: changed.min - 1, max: changed.max };
        Reached { home_x: brick.0.x, cells, joining: is_extended.then_some(joining) }
    })
}

/// Rule 2 for the sheet over some cells: the words of the mask that change. Edited samples stay edited, so cells only
/// ever join it.
pub(crate) fn joined_mask(world: &World, view: &WorldView, dirty: &ByBrick) -> Mask {
    let words = dirty.collect(|stacks, found| {
        let mut bricks = Vec::with_capacity(stacks.len());
        let at_sheet =
            stacks.chunk_by(is_same_stack).filter_map(|stack| at_sheet(world, view, stack, &mut bricks));
        let sheets: Vec<PristineStack> = at_sheet.collect();
        let (mut rest, mut sheets) = (&bricks[..], &sheets[..]);
        while let Some((count, places)) = brick_window::shared(rest.iter().copied()) {
            let (near, others) = rest.split_at(count);
            let window = Window::new(&view.samples, places);
            for stack in near.chunk_by(|a, b| a.stack() == b.stack()) {
                let word = stack[0].stack();
                while let [first, others @ ..] = sheets
                    && first.stack != word
                {
                    sheets = others;
                }
                let Some(sheet) = sheets.first() else { continue };
                let before = view.mask.word(word);
                let cells = mask::joined_cells(view.grid, &window, sheet, stack, before);
                if cells != before {
                    found.push((word, cells));
                }
            }
            rest = others;
        }
    });
    let mut mask = Mask::with_room(words.len());
    words.into_iter().for_each(|(word, cells)| mask.insert_word(word, cells));
    mask
}

/// Adds to `bricks` those of a stack that the pristine surface crosses and that may have cells that join the mask.
/// Returns that surface, or `None` where there are no such bricks.
fn at_sheet(
    world: &World,
    view: &WorldView,
    stack: &[BrickCells],
    bricks: &mut Vec<BrickPos>,
) -> Option<PristineStack> {
    let word = stack[0].brick.stack();
    if !stack.iter().any(|own| own.may_join) || view.mask.word(word) == u64::MAX {
        return None;
    }
    let (sheet, before) = (PristineStack::new(&world.ground, word), bricks.len());
    let rows = sheet.rows();
    let is_there = |brick: &BrickPos| brick.origin().y < rows.end && rows.start < brick.origin().y + 8;
    bricks.extend(stack.iter().filter(|own| own.may_join).map(|own| own.brick).filter(is_there));
    (bricks.len() > before).then_some(sheet)
}

/// Every block that has to be drawn again, by stacks of bricks, each from below. A word of the mask changes only where
/// samples do, so its cells lie in stacks that have `dirty` cells.
pub(crate) fn dirty_blocks(world: &World, view: &WorldView, newer: &Mask, dirty: &ByBrick) -> Vec<Block> {
    let blocks_of = |&BrickCells { brick, cells, .. }: &BrickCells| {
        view.grid.chunks_of(cells).map(move |chunk| Block { brick, chunk })
    };
    dirty.collect(|stacks, found| {
        for stack in stacks.chunk_by(is_same_stack) {
            match sheet_near(world, view, newer, stack[0].brick.stack()) {
                Some(sheet) => found.extend(with_sheet(stack, sheet).iter().flat_map(blocks_of)),
                None => found.extend(stack.iter().flat_map(blocks_of)),
            }
        }
    })
}

/// The box from `low` to `high` as far as it lies in the world.
fn in_world(grid: ChunkGrid, low: IVec3, high: IVec3) -> Option<LatticeBox> {
    let last = IVec3::new(grid.width() - 1, i32::MAX, grid.depth() - 1);
    LatticeBox::new(low.max(IVec3::new(0, i32::MIN, 0)), high.min(last))
}

/// The box in a stack of bricks around the sheets of cells that join or leave the mask, and of the cells next to them,
/// whose vertices may move onto the mask's border or off it.
fn sheet_near(world: &World, view: &WorldView, newer: &Mask, stack: (i32, i32)) -> Option<LatticeBox> {
    if newer.is_empty() {
        return None;
    }
    let (own, before) = (newer.get_word(stack), world.mask.word(stack));
    let all = own.unwrap_or(before) | before;
    let mut cells = own.map_or(0, |own| grown_into(own ^ before, 0, 0));
    for (dx, dz) in BESIDE {
        // Often all cells are near already.
        if all & !cells == 0 {
            break;
        }
        let word = (stack.0 - dx, stack.1 - dz);
        if let Some(own) = newer.get_word(word) {
            cells |= grown_into(own ^ world.mask.word(word), dx, dz);
        }
    }
    let (drawn, low) = (cells & all, Column::new(stack.0 * 8, stack.1 * 8));
    let rows = (drawn != 0).then(|| pristine::sheet_rows(view.samples.ground(), low, drawn))?;
    in_world(view.grid, low.at(rows.start), low.offset(7, 7).at(rows.end - 1))
}

/// The eight stacks around one.
const BESIDE: [(i32, i32); 8] = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

/// The cells of a stack with those of a box added.
fn with_sheet(stack: &[BrickCells], sheet: LatticeBox) -> Vec<BrickCells> {
    let mut all = stack.to_vec();
    for brick in BrickPos::covering(sheet) {
        let Some(cells) = brick.samples().intersection(sheet) else { continue };
        match all.binary_search_by_key(&brick.0.y, |own| own.brick.0.y) {
            Ok(at) => all[at].cells = all[at].cells.union(cells),
            Err(at) => all.insert(at, BrickCells { brick, cells, may_join: false }),
        }
    }
    all
}

/// 8x8 cells and the eight cells around each, as far as they lie in the word that is (dx, dz) away.
pub(crate) fn grown_into(cells: u64, dx: i32, dz: i32) -> u64 {
    let along = match dx {
        -1 => (cells & FIRST_X) << 7,
        0 => cells | (cells & !(FIRST_X << 7)) << 1 | (cells & !FIRST_X) >> 1,
        _ => (cells & FIRST_X << 7) >> 7,
    };
    match dz {
        -1 => along << 56,
        0 => along | along << 8 | along >> 8,
        _ => along >> 56,
    }
}

/// Adds the other blocks of each touched chunk whose surface is not kept.
pub(crate) fn complete(world: &World, view: &WorldView, blocks: &mut Vec<Block>) {
    if world.meshes.unmeshed.is_empty() {
        return;
    }
    let chunks: FxHashSet<ChunkPos> = blocks
        .iter()
        .map(|block| block.chunk)
        .filter(|chunk| world.meshes.unmeshed.contains_key(chunk))
        .collect();
    blocks.extend(chunks.into_iter().flat_map(|chunk| blocks_of(world, view.mask, chunk)));
    blocks.sort_unstable_by_key(|block| (block.brick, block.chunk));
    blocks.dedup();
}
