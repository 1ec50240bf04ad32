//! Where changed samples show: the cells that join the mask, and the blocks that may draw something else than before.
//!
//! Bricks come in order of their stacks all along, so every step goes stack by stack and needs no other, and threads share
//! them.

use glam::IVec3;

use crate::lattice::{BrickPos, ChunkGrid, Column, LatticeBox};
use crate::surface::Mask;
use crate::surface::block::{self, Block};
use crate::surface::vertex::WorldView;
use crate::surface::window::{self, Window};
use crate::volume::DraftedBrick;

use super::by_brick::{ByBrick, OfBrick, Reached, is_same_stack, place};
use super::world::World;

/// The cells that changed samples show in: `changed` tells the brick of each change, and the box around its samples.
pub(super) fn dirty_cells<T: Sync>(
    grid: ChunkGrid,
    changes: &[T],
    changed: impl Fn(&T) -> OfBrick + Sync,
) -> ByBrick {
    // A sample is a corner of the cells one below it; gradients look one sample further on both sides.
    ByBrick::new(changes, |change| {
        let (brick, changed) = changed(change);
        Reached { home_x: brick.0.x, cells: in_world(grid, changed.min - 2, changed.max + 1) }
    })
}

/// The cells that may join the mask: those that a sample edited for the first time is a corner of.
pub(super) fn cells_in_reach(changed: &[DraftedBrick]) -> ByBrick {
    // A sample is a corner of the cells one below it.
    ByBrick::new(changed, |drafted| {
        let cells = LatticeBox { min: drafted.changed.min - 1, max: drafted.changed.max };
        Reached { home_x: drafted.pos.0.x, cells: drafted.is_extended.then_some(cells) }
    })
}

/// Rule 2 for the sheet over some cells: the words of the mask that change. Edited samples stay edited, so cells only ever
/// join it.
pub(super) fn joined_mask(world: &World, view: &WorldView, near: &ByBrick) -> Mask {
    let words = near.collect(|stacks, found| {
        let at_sheet = stacks.chunk_by(is_same_stack).flat_map(|stack| at_sheet(world, stack));
        let bricks: Vec<BrickPos> = at_sheet.collect();
        let mut rest = &bricks[..];
        while let Some((count, places)) = window::shared(rest.iter().copied()) {
            let (near, others) = rest.split_at(count);
            let window = Window::new(&view.samples, places);
            for stack in near.chunk_by(|a, b| (a.0.x, a.0.z) == (b.0.x, b.0.z)) {
                let word = (stack[0].0.x, stack[0].0.z);
                let before = view.mask.word(word);
                let cells = block::disturbed(view, &window, stack, before);
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

/// Those bricks of a stack that the pristine surface passes through; none where all of its cells are in the mask.
fn at_sheet(world: &World, stack: &[OfBrick]) -> impl Iterator<Item = BrickPos> {
    let is_open = world.mask.word(place(&stack[0])) != u64::MAX;
    let rows = if is_open { block::stack_sheet(&world.ground, place(&stack[0])) } else { 0..0 };
    let bricks = stack.iter().map(|&(brick, _)| brick);
    bricks.filter(move |brick| is_open && brick.origin().y < rows.end && rows.start < brick.origin().y + 8)
}

/// Every block that may draw something else than before, by stacks of bricks, each from below. A word of the mask turns
/// only where samples change, so its cells lie in stacks that have `dirty` cells.
pub(super) fn dirty_blocks(world: &World, view: &WorldView, newer: &Mask, dirty: &ByBrick) -> Vec<Block> {
    let blocks_of =
        |&(brick, cells): &OfBrick| view.grid.chunks_of(cells).map(move |chunk| Block { brick, chunk });
    dirty.collect(|stacks, found| {
        for stack in stacks.chunk_by(is_same_stack) {
            match sheet_near(world, view, newer, place(&stack[0])) {
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

/// A cell that joins the mask draws its sheet, and one that leaves it draws it no longer; beside it, vertices leave the
/// mask's border or come to it. The box around all of these in a stack of bricks.
fn sheet_near(world: &World, view: &WorldView, newer: &Mask, stack: (i32, i32)) -> Option<LatticeBox> {
    let mut cells = 0;
    for (dx, dz) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dz| (dx, dz))) {
        let word = (stack.0 - dx, stack.1 - dz);
        if let Some(own) = newer.get_word(word) {
            cells |= grown_into(own ^ world.mask.word(word), dx, dz);
        }
    }
    if cells == 0 {
        return None;
    }
    let drawn = cells & (view.mask.word(stack) | world.mask.word(stack));
    let low = Column::new(stack.0 * 8, stack.1 * 8);
    let rows = (drawn != 0).then(|| block::sheet_rows(view.samples.ground(), low, drawn))?;
    in_world(view.grid, low.at(rows.start), low.offset(7, 7).at(rows.end - 1))
}

/// The cells of a stack, and those of a box in it.
fn with_sheet(stack: &[OfBrick], sheet: LatticeBox) -> Vec<OfBrick> {
    let mut all = stack.to_vec();
    for brick in BrickPos::covering(sheet) {
        let Some(cells) = brick.samples().intersection(sheet) else { continue };
        match all.binary_search_by_key(&brick.0.y, |(own, _)| own.0.y) {
            Ok(at) => all[at].1 = all[at].1.union(cells),
            Err(at) => all.insert(at, (brick, cells)),
        }
    }
    all
}

/// 8x8 cells and the cells beside and diagonally beside them, as far as they lie in the word (dx, dz) further.
pub(super) fn grown_into(cells: u64, dx: i32, dz: i32) -> u64 {
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
