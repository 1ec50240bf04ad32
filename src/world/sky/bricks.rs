//! The bricks near a rectangle of columns, found by position without a hash map.

use super::SkyView;
use crate::lattice::BrickPos;
use crate::volume::Brick;

/// In stacks that reach over more bricks, bricks are looked up in the world.
const MAX_HEIGHT: u32 = 64;

/// The bricks in the stacks over a rectangle of columns.
pub(super) struct NearBricks<'a> {
    view: SkyView<'a>,
    /// The lowest stack, and how many there are along x and along z.
    low: (i32, i32),
    size: (usize, usize),
    /// For each stack, x fastest.
    stacks: Vec<Stack>,
    /// Looked up when they are first asked for.
    bricks: Vec<Option<Option<&'a Brick>>>,
}

/// A stack of bricks.
#[derive(Clone, Copy)]
struct Stack {
    /// The height of its lowest brick, and how far above it the last one ends.
    lowest: i32,
    height: u32,
    /// Where its bricks begin in the list of all.
    start: usize,
}

impl<'a> NearBricks<'a> {
    /// The bricks in the stacks from `low` to `high`, both included.
    pub fn new(view: SkyView<'a>, low: (i32, i32), high: (i32, i32)) -> Self {
        let side = |low: i32, high: i32| usize::try_from(high - low + 1).unwrap_or(0);
        let size = (side(low.0, high.0), side(low.1, high.1));
        let mut start = 0;
        let places = (low.1..=high.1).flat_map(|z| (low.0..=high.0).map(move |x| (x, z)));
        let stacks = places.map(|place| {
            let rows = view.rows(place);
            let (lowest, highest) = (rows.first().copied().unwrap_or(0), rows.last().copied().unwrap_or(-1));
            let stack = Stack { lowest, height: (highest - lowest + 1) as u32, start };
            start += if stack.height <= MAX_HEIGHT { stack.height as usize } else { 0 };
            stack
        });
        let stacks = stacks.collect();
        Self { view, low, size, stacks, bricks: vec![None; start] }
    }

    /// The brick at a position, if there is one.
    #[inline(always)]
    pub fn get(&mut self, pos: BrickPos) -> Option<&'a Brick> {
        let (x, z) = ((pos.0.x - self.low.0) as usize, (pos.0.z - self.low.1) as usize);
        let known = self.stacks.get(z.wrapping_mul(self.size.0).wrapping_add(x)).filter(|_| x < self.size.0);
        let Some(stack) = known else { return self.view.brick(pos) };
        let above = pos.0.y.wrapping_sub(stack.lowest) as u32;
        if above >= stack.height {
            return None;
        }
        match self.bricks.get_mut(stack.start + above as usize) {
            Some(known) if stack.height <= MAX_HEIGHT => match *known {
                Some(brick) => brick,
                None => *known.insert(self.view.brick(pos)),
            },
            _ => self.view.brick(pos),
        }
    }
}
