//! The highest ground in the columns of a stack of bricks.

use super::SkyView;
use crate::lattice::{BrickPos, Column, ONE, ceil};
use crate::volume::{Brick, layers};
use glam::IVec3;

/// The tops of the 8x8 columns of a stack, x fastest, in 1/256 voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StackTops {
    pub tops: [i32; 64],
    /// A bit for each column whose top is not the ground's own height.
    pub changed: u64,
}

/// Computes the tops of a stack; `None` where it holds no bricks.
pub(crate) fn stack_tops(view: SkyView, stack: (i32, i32)) -> Option<StackTops> {
    let rows = view.rows(stack);
    let lowest = *rows.first()?;
    let low = Column::new(stack.0 * 8, stack.1 * 8);
    let heights = view.ground().heights::<8>(low);
    let heights = heights.as_flattened();
    let highest = heights.iter().fold(i32::MIN, |highest, &height| highest.max(height));
    // Where no edited sample is the highest solid one or lies above it, the top is the ground's own height.
    let mut found = StackTops { tops: [0; 64], changed: 0 };
    found.tops.copy_from_slice(heights);
    // Columns whose topmost solid sample is not found yet.
    let mut left = u64::MAX;
    let mut above: Option<(i32, &Brick)> = None;
    let mut set = |bit: usize, y: i32, own: Option<i32>, upper: Option<i32>| {
        let height = heights[bit];
        if own.is_some() || upper.is_some() {
            let own = own.unwrap_or(y * ONE - height).abs();
            let upper = upper.unwrap_or((y + 1) * ONE - height).abs();
            found.tops[bit] =
                y * ONE + (i64::from(ONE) * i64::from(own) / i64::from((own + upper).max(1))) as i32;
            found.changed |= u64::from(found.tops[bit] != height) << bit;
        }
    };
    let sample =
        |brick: &Brick, layer: i32, bit: usize| brick.samples()[layer as usize * 64 + bit].distance();
    // The topmost solid sample of a pristine stretch that ends below `end`, and begins at `start`.
    let pristine = |bit: usize, start: i32, end: i32| {
        let y = (ceil(heights[bit]) - 1).min(end - 1);
        (y >= start).then_some(y)
    };
    for &row in rows.iter().rev() {
        let Some(brick) = view.brick(BrickPos(IVec3::new(stack.0, row, stack.1))) else { continue };
        let bottom = row * 8;
        let next = above.map(|(row, _)| row * 8);
        if next != Some(bottom + 8) && highest > (bottom + 8) * ONE {
            for bit in layers::ones(left) {
                if let Some(y) = pristine(bit, bottom + 8, next.unwrap_or(i32::MAX)) {
                    let upper = above.filter(|(row, _)| row * 8 == y + 1);
                    set(bit, y, None, upper.and_then(|(_, brick)| sample(brick, 0, bit)));
                    left &= !(1 << bit);
                }
            }
        }
        let next = above.filter(|(above, _)| *above == row + 1).map(|(_, brick)| brick);
        let mut edited_above = next.map_or(0, |brick| brick.edited()[0]);
        for layer in (0..8).rev() {
            let solid = left & brick.solid()[layer as usize];
            let edited = brick.edited()[layer as usize];
            for bit in layers::ones(solid & (edited | edited_above)) {
                let upper = match layer {
                    7 => next.and_then(|brick| sample(brick, 0, bit)),
                    _ => sample(brick, layer + 1, bit),
                };
                set(bit, bottom + layer, sample(brick, layer, bit), upper);
            }
            left &= !solid;
            edited_above = edited;
        }
        if left == 0 {
            return Some(found);
        }
        above = Some((row, brick));
    }
    for bit in layers::ones(left) {
        // The deep is solid.
        let y = pristine(bit, i32::MIN, lowest * 8).unwrap_or(lowest * 8 - 1);
        let upper = above.filter(|_| y + 1 == lowest * 8);
        set(bit, y, None, upper.and_then(|(_, brick)| sample(brick, 0, bit)));
    }
    Some(found)
}
