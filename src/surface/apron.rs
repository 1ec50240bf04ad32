//! The samples around a brick, copied out of its bricks into one array.

use glam::IVec3;
use wide::{i16x8, i32x8};

use super::corners::Heights;
use crate::lattice::{BrickPos, ONE};
use crate::volume::{Brick, Sample, SampleView};

/// Samples along one side: 9 corners, one more before and after for gradients.
pub(super) const SIDE: usize = 11;
/// Samples in one layer.
pub(super) const AREA: usize = SIDE * SIDE;

/// A sample with its editedness in one number: twice the density in 1/256 voxel, and one more if it is edited.
pub(super) type Marked = i32;

/// The bricks around a brick and itself: `[y][z * 3 + x]`, each from one before to one after.
#[derive(Clone, Copy)]
pub(super) struct Neighbours<'a> {
    bricks: [[Option<&'a Brick>; 9]; 3],
    at: BrickPos,
}

impl<'a> Neighbours<'a> {
    /// Looks around a brick.
    pub fn new(view: &SampleView<'a>, at: BrickPos) -> Self {
        Self { bricks: [-1, 0, 1].map(|dy| level(view, at, dy)), at }
    }

    /// Looks around another brick; one step up, most is known already.
    pub fn go(&mut self, view: &SampleView<'a>, to: BrickPos) {
        if to.0 == self.at.0 + IVec3::Y {
            self.bricks = [self.bricks[1], self.bricks[2], level(view, to, 1)];
            self.at = to;
        } else {
            *self = Self::new(view, to);
        }
    }

    /// The bricks that hold corners of the own brick's cells at its own height (`up` = 0) or at the next (1): the own
    /// one, those beyond x, beyond z and beyond both.
    #[inline]
    pub fn corners(&self, up: usize) -> [Option<&'a Brick>; 4] {
        [4, 5, 7, 8].map(|at| self.bricks[up + 1][at])
    }
}

fn level<'a>(view: &SampleView<'a>, at: BrickPos, dy: i32) -> [Option<&'a Brick>; 9] {
    std::array::from_fn(|i| {
        let (dx, dz) = (i as i32 % 3 - 1, i as i32 / 3 - 1);
        view.brick(BrickPos(at.0 + IVec3::new(dx, dy, dz)))
    })
}

/// Samples from one before the brick's first to two after its last, x fastest, then z, then y.
pub(super) struct Apron(Box<[Marked; AREA * SIDE]>);

impl Default for Apron {
    fn default() -> Self {
        Self(Box::new([0; AREA * SIDE]))
    }
}

impl Apron {
    /// Place of a corner of the brick's cells.
    #[inline]
    pub fn place(y: usize, corner: usize) -> usize {
        (y + 1) * AREA + (corner / 9 + 1) * SIDE + corner % 9 + 1
    }

    /// All samples; those of layers that were not filled are old ones.
    pub fn samples(&self) -> &[Marked; AREA * SIDE] {
        &self.0
    }

    /// Copies the layers `first..=last`, counted from the one before the brick's first.
    pub fn fill(&mut self, neighbours: &Neighbours, heights: &Heights, first: usize, last: usize) {
        let low = neighbours.at.origin().y - 1;
        for layer in first..=last {
            let height = (low + layer as i32) * ONE;
            let (level, y) = ((layer + 7) / 8, (layer + 7) % 8);
            for z in 0..SIDE {
                let stack = (z + 7) / 8 * 3;
                let bricks = &neighbours.bricks[level][stack..stack + 3];
                let at = layer * AREA + z * SIDE;
                fill_row(&mut self.0[at..at + SIDE], bricks, &heights[z], height, y, (z + 7) % 8);
            }
        }
    }
}

/// One row: a sample of the brick before, eight of the middle one, two of the one after.
#[inline]
fn fill_row(
    row: &mut [Marked],
    bricks: &[Option<&Brick>],
    heights: &[i32; SIDE],
    height: i32,
    y: usize,
    z: usize,
) {
    for (marked, pristine) in row.iter_mut().zip(heights) {
        *marked = (height - pristine) * 2;
    }
    if let Some(brick) = bricks[1]
        && let Some(row) = row[1..].first_chunk_mut::<8>()
    {
        let samples = i32x8::from_i16x8(i16x8::new(brick.row(y, z)));
        let is_pristine = samples.simd_eq(i32x8::splat(i16::MIN.into()));
        let edited = samples + samples + i32x8::splat(1);
        *row = is_pristine.select(i32x8::new(*row), edited).to_array();
    }
    let mut put = |at: usize, brick: Option<&Brick>, x: usize| {
        if let Some(brick) = brick
            && let sample = brick.samples()[y * 64 + z * 8 + x]
            && sample != Sample::PRISTINE
        {
            row[at] = sample.or(0) * 2 + 1;
        }
    };
    put(0, bricks[0], 7);
    put(9, bricks[2], 0);
    put(10, bricks[2], 1);
}
