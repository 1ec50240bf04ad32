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
pub(super) struct Neighbours<'a> {
    bricks: [[Option<&'a Brick>; 9]; 3],
    at: BrickPos,
}

impl<'a> Neighbours<'a> {
    /// Looks up the bricks that hold corners of a brick's cells.
    pub fn corners_of(view: &SampleView<'a>, at: BrickPos) -> Self {
        let mut own = Self { bricks: [[None; 9]; 3], at };
        for dy in 1..3 {
            for i in CORNER_STACKS {
                own.bricks[dy][i] = view.brick(own.pos(dy, i));
            }
        }
        own
    }

    /// Looks up the others as well.
    pub fn complete(&mut self, view: &SampleView<'a>) {
        for (dy, i) in (0..3).flat_map(|dy| (0..9).map(move |i| (dy, i))) {
            if dy == 0 || !CORNER_STACKS.contains(&i) {
                self.bricks[dy][i] = view.brick(self.pos(dy, i));
            }
        }
    }

    fn pos(&self, dy: usize, i: usize) -> BrickPos {
        BrickPos(self.at.0 + IVec3::new((i % 3) as i32, dy as i32, (i / 3) as i32) - 1)
    }

    /// The bricks that hold corners of the own brick's cells at its own height (`up` = 0) or at the next (1): the own
    /// one, those beyond x, beyond z and beyond both.
    #[inline]
    pub fn corners(&self, up: usize) -> [Option<&'a Brick>; 4] {
        CORNER_STACKS.map(|i| self.bricks[up + 1][i])
    }
}

/// Of nine stacks, those that hold corners of the middle one's cells: itself, beyond x, beyond z, beyond both.
const CORNER_STACKS: [usize; 4] = [4, 5, 7, 8];

/// Samples from one before the brick's first to two after its last, x fastest, then z, then y. A layer of no meaning
/// follows, so that what is near an edge can be read as one piece.
pub(super) struct Apron(Box<[Marked; AREA * (SIDE + 1)]>);

impl Default for Apron {
    fn default() -> Self {
        Self(Box::new([0; AREA * (SIDE + 1)]))
    }
}

impl Apron {
    /// All samples; those of layers that were not filled are old ones.
    pub fn samples(&self) -> &[Marked] {
        &*self.0
    }

    /// Copies the layers `first..=last`, counted from the one before the brick's first.
    pub fn fill(&mut self, neighbours: &Neighbours, heights: &Heights, first: usize, last: usize) {
        let low = neighbours.at.origin().y - 1;
        for layer in first..=last {
            let height = (low + layer as i32) * ONE;
            // Layer 0 is the last one of the brick below.
            let (level, y) = (layer.div_ceil(8), (layer + 7) % 8);
            let rows = self.0[layer * AREA..].chunks_exact_mut(SIDE);
            for ((z, row), heights) in (7..).zip(rows).zip(heights) {
                let bricks = &neighbours.bricks[level][z / 8 * 3..][..3];
                fill_row(row, bricks, heights, height, y * 64 + z % 8 * 8);
            }
        }
    }
}

/// One row: a sample of the brick before, eight of the middle one, two of the one after. `at` is where the row begins in
/// the bricks.
#[inline(always)]
fn fill_row(row: &mut [Marked], bricks: &[Option<&Brick>], heights: &[i32; SIDE], height: i32, at: usize) {
    let (Some(row), Some(inner)) = (row.first_chunk_mut::<SIDE>(), heights[1..].first_chunk::<8>()) else {
        return;
    };
    let pristine = i32x8::splat(height) - i32x8::new(*inner);
    let mut marked = pristine + pristine;
    if let Some(brick) = bricks[1] {
        let samples = i32x8::from_i16x8(i16x8::new(brick.row(at)));
        let is_pristine = samples.simd_eq(i32x8::splat(i16::MIN.into()));
        marked = is_pristine.select(marked, samples + samples + i32x8::splat(1));
    }
    row[1..9].copy_from_slice(&marked.to_array());
    let beside = |brick: Option<&Brick>, x: usize, pristine: i32| {
        let stored = brick.map_or(Sample::PRISTINE, |brick| brick.samples()[at + x]);
        stored.distance().map_or((height - pristine) * 2, |distance| distance * 2 + 1)
    };
    row[0] = beside(bricks[0], 7, heights[0]);
    row[9] = beside(bricks[2], 0, heights[9]);
    row[10] = beside(bricks[2], 1, heights[10]);
}
