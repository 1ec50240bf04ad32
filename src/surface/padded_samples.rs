//! The samples around a brick, copied out of its bricks into one array.

use std::ops::RangeInclusive;

use wide::{i16x8, i32x8};

use super::layer_bits::SIDE;
use super::neighbours::Neighbours;
use super::pristine::Heights;
use crate::lattice::ONE;
use crate::volume::{self, Brick, PRISTINE, Sample};

/// Samples in one layer.
pub(super) const AREA: usize = SIDE * SIDE;

/// A sample and whether it is edited, in one number: twice the density in 1/256 voxel, plus one if it is edited.
pub(super) type Marked = i32;

/// Samples from one before the brick's first to two after its last, x fastest, then z, then y. An unused
/// layer follows, so that the samples near an edge can be read as one slice.
pub(super) struct PaddedSamples(Box<[Marked; AREA * (SIDE + 1)]>);

impl Default for PaddedSamples {
    fn default() -> Self {
        Self(Box::new([0; AREA * (SIDE + 1)]))
    }
}

impl PaddedSamples {
    /// All samples; layers that were not filled hold older samples.
    pub fn all(&self) -> &[Marked] {
        &*self.0
    }

    /// Copies some rows of some layers, both counted from the one before the brick's first.
    pub fn fill(
        &mut self,
        neighbours: &Neighbours,
        heights: &Heights,
        layers: RangeInclusive<usize>,
        rows: RangeInclusive<usize>,
    ) {
        let low = neighbours.at.origin().y - 1;
        for layer in layers {
            let height = (low + layer as i32) * ONE;
            // Layer 0 is the last one of the brick below; with rows it is the same.
            let (level, y) = (layer.div_ceil(8), (layer + 7) % 8);
            for (z, bricks) in neighbours.bricks[level].as_chunks::<3>().0.iter().enumerate() {
                let stored = bricks.map(|brick| brick.map_or(&PRISTINE, Brick::samples));
                let (first, last) = ((z * 8).saturating_sub(7).max(*rows.start()), (z * 8).min(*rows.end()));
                for (row, heights) in (first..=last).zip(heights.iter().skip(first)) {
                    let at = y * 64 + (row + 7) % 8 * 8;
                    fill_row(&mut self.0[layer * AREA + row * SIDE..], stored, heights, height, at);
                }
            }
        }
    }

    /// Extrapolates densities by one sample beyond the world's rim, which is as far as gradients look. The rows and
    /// layers are those that were filled, `columns` those of the world, along x and z.
    pub fn extrapolate_beyond(
        &mut self,
        [xs, zs]: &[RangeInclusive<usize>; 2],
        layers: RangeInclusive<usize>,
        rows: RangeInclusive<usize>,
    ) {
        for layer in self.0.chunks_exact_mut(AREA).take(layers.end() + 1).skip(*layers.start()) {
            for (to, rim, inner) in beyond(zs).filter(|(to, ..)| rows.contains(to)) {
                for x in 0..SIDE {
                    layer[to * SIDE + x] = extrapolated(layer[rim * SIDE + x], layer[inner * SIDE + x]);
                }
            }
            for (to, rim, inner) in beyond(xs) {
                for row in layer.chunks_exact_mut(SIDE).take(rows.end() + 1).skip(*rows.start()) {
                    row[to] = extrapolated(row[rim], row[inner]);
                }
            }
        }
    }
}

/// The indices one beyond the world's, each with the two before it.
fn beyond(world: &RangeInclusive<usize>) -> impl Iterator<Item = (usize, usize, usize)> {
    let (first, last) = (*world.start(), *world.end());
    let before = (first > 0).then(|| (first - 1, first, first + 1));
    before.into_iter().chain((last + 1 < SIDE).then(|| (last + 1, last, last - 1)))
}

/// The sample beyond `rim` on the straight line through `inner` and `rim`.
fn extrapolated(rim: Marked, inner: Marked) -> Marked {
    ((rim >> 1) * 2 - (inner >> 1)) << 1
}

/// One row: a sample of the brick before, eight of the middle one, two of the one after. `at` is where the row begins
/// in the bricks.
#[inline(always)]
fn fill_row(
    row: &mut [Marked],
    [before, own, after]: [&[Sample; 512]; 3],
    heights: &[i32; SIDE],
    height: i32,
    at: usize,
) {
    let (Some(row), Some(inner)) = (row.first_chunk_mut::<SIDE>(), heights[1..].first_chunk::<8>()) else {
        return;
    };
    let samples = i32x8::from_i16x8(i16x8::new(volume::row(own, at)));
    let is_pristine = samples.simd_eq(i32x8::splat(i16::MIN.into()));
    let pristine = i32x8::splat(height) - i32x8::new(*inner);
    let marked = is_pristine.select(pristine + pristine, samples + samples + i32x8::splat(1));
    row[1..9].copy_from_slice(&marked.to_array());
    let beside = |stored: Sample, surface: i32| match stored {
        Sample::PRISTINE => (height - surface) * 2,
        stored => i32::from(stored.bits()) * 2 + 1,
    };
    row[0] = beside(before[at + 7], heights[0]);
    row[9] = beside(after[at], heights[9]);
    row[10] = beside(after[at + 1], heights[10]);
}
