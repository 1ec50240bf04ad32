//! The bricks around a brick, found once.

use super::brick_window::Window;
use super::layer_bits::{self, LayerBits};
use crate::lattice::BrickPos;
use crate::volume::Brick;

/// The bricks around a brick and itself: `[y][z * 3 + x]`, each from one before to one after.
pub(super) struct Neighbours<'a> {
    pub bricks: [[Option<&'a Brick>; 9]; 3],
    pub at: BrickPos,
}

impl<'a> Neighbours<'a> {
    /// Finds the bricks that hold corners of a brick's cells.
    #[inline]
    pub fn corners_of(window: &Window<'a>, at: BrickPos) -> Self {
        let mut own = Self { bricks: [[None; 9]; 3], at };
        let [x, y, z] = window.steps();
        let place = window.place(at);
        for dy in 0..2 {
            for (i, step) in CORNER_STACKS.into_iter().zip([0, x, z, x + z]) {
                own.bricks[dy + 1][i] = window.at(place + dy * y + step);
            }
        }
        own
    }

    /// Finds the remaining bricks.
    #[inline]
    pub fn complete(&mut self, window: &Window<'a>) {
        let [x, y, z] = window.steps();
        let first = window.place(self.at) - x - y - z;
        for (dy, level) in self.bricks.iter_mut().enumerate() {
            for (i, brick) in level.iter_mut().enumerate() {
                *brick = window.at(first + dy * y + i / 3 * z + i % 3 * x);
            }
        }
    }

    /// The bricks that hold corners of the cells of the brick itself.
    #[inline]
    pub fn near(&self) -> CornerBricks<'a> {
        CornerBricks([1, 2].map(|level| CORNER_STACKS.map(|i| self.bricks[level][i])))
    }
}

/// Which of nine stacks hold corners of the middle one's cells: itself, beyond x, beyond z, beyond both.
const CORNER_STACKS: [usize; 4] = [4, 5, 7, 8];

/// The bricks that hold corners of a brick's cells, at its own height and at the next: the own one, those beyond x,
/// beyond z and beyond both.
pub(super) struct CornerBricks<'a>(pub [[Option<&'a Brick>; 4]; 2]);

impl CornerBricks<'_> {
    /// Returns `true` if all corners are solid, or all air. `pristine` is the side that all corners without a brick are
    /// on, if they are on one.
    pub fn is_one_side(&self, pristine: Option<bool>) -> bool {
        let mut sides = self.0.iter().flatten().map(|brick| match brick {
            None => pristine,
            Some(brick) => match (brick.solid(), brick.solid().iter().all(|&layer| layer == u64::MAX)) {
                (_, true) => Some(true),
                (solid, _) => solid.iter().all(|&layer| layer == 0).then_some(false),
            },
        });
        sides.next().flatten().is_some_and(|first| sides.all(|side| side == Some(first)))
    }

    /// Solid corners, layer by layer; `pristine` gives those of bricks that are not stored.
    pub fn solid(&self, pristine: impl Fn() -> [LayerBits; 9]) -> [LayerBits; 9] {
        let mut layers = std::array::from_fn(|y| {
            layer_bits::join(self.0[y / 8].map(|brick| brick.map_or(0, |brick| brick.solid()[y % 8])))
        });
        let missing = self
            .0
            .map(|bricks| layer_bits::join(bricks.map(|brick| if brick.is_none() { u64::MAX } else { 0 })));
        if missing != [0; 2] {
            let pristine = pristine();
            for (y, layer) in layers.iter_mut().enumerate() {
                *layer |= pristine[y] & missing[y / 8];
            }
        }
        layers
    }

    /// Edited corners of one layer.
    pub fn edited(&self, y: usize) -> LayerBits {
        layer_bits::join(self.0[y / 8].map(|brick| brick.map_or(0, |brick| brick.edited()[y % 8])))
    }
}
