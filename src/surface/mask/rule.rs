//! Rule 2: a cell belongs to the mask when a corner of its sheet is edited. The sheet is the stack of cubes that the
//! pristine surface crosses over the cell.

use crate::lattice::{BrickPos, ChunkGrid, Column};
use crate::surface::brick_window::Window;
use crate::surface::layer_bits::{self, CELLS, LayerBits};
use crate::surface::neighbours::Neighbours;
use crate::surface::pristine::PristineStack;

/// The cells of a stack of bricks that belong to the mask by rule 2: those `before`, and those over which a corner of a
/// cube of the sheet is edited. Only these bricks, and those that hold corners of their cells, are looked at. Cells are
/// given as bits `z * 8 + x`; the window must reach one brick further than the bricks.
pub(crate) fn joined_cells(
    grid: ChunkGrid,
    window: &Window,
    surface: &PristineStack,
    bricks: &[BrickPos],
    before: u64,
) -> u64 {
    let mut cells = layer_bits::spread(before);
    for &brick in bricks {
        let low = brick.origin().y;
        if surface.side(low).is_some() {
            continue;
        }
        let near = Neighbours::corners_of(window, brick).near();
        let pristine = surface.solid(low);
        // No other layer holds a cube of the sheet.
        for y in surface.crossed(low) {
            let sheet = layer_bits::mixed(pristine[y], pristine[y + 1]);
            if sheet & !cells != 0 {
                cells |= sheet & layer_bits::any(near.edited(y) | near.edited(y + 1));
            }
        }
    }
    let cells = cells & world_cells(grid, surface.stack);
    (0..8).fold(0, |word, z| word | ((cells >> (z * 9)) as u64 & 0xff) << (z * 8))
}

/// The world's cells among those of a stack.
fn world_cells(grid: ChunkGrid, (x, z): (i32, i32)) -> LayerBits {
    let last = Column::new((grid.width() - 1 - x * 8).min(7), (grid.depth() - 1 - z * 8).min(7));
    let first = Column::new((-x * 8).max(0), (-z * 8).max(0));
    if last.x < first.x || last.z < first.z { 0 } else { layer_bits::rectangle(first, last) & CELLS }
}
