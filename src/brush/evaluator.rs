//! Evaluates an edit's signed distance at points of the lattice.

use std::ops::Range;

use glam::{I64Vec3, IVec3};
use wide::{i16x8, i32x8};

use super::roughness::QuantizedRoughness;
#[cfg(feature = "cuda")]
use super::shapes::GridParams;
use super::shapes::{QuantizedShape, ShapeSdf, larger, smaller};
use crate::lattice::{LatticeBox, ONE};

/// Samples evaluated together.
const RUN: usize = 32;

/// Distances are clamped here: 16384 voxels.
const MAX_DISTANCE: f32 = (1 << 22) as f32;

/// Coordinates are clamped here, in voxels from the shape. It is far beyond [`MAX_DISTANCE`], so no distance depends on
/// it, and a run farther still fits into 2^24 of 1/256 voxel, which `f32` holds exactly.
const FARTHEST: i64 = 65_000;

/// An edit's signed distance function, its constants derived once.
///
/// Equal edits give equal distances, bit for bit, on every machine.
#[derive(Clone, Debug)]
pub struct Evaluator {
    /// The shape's origin is at `origin_voxel` voxels and `origin_fraction` (0..256) of 1/256 voxel.
    origin_voxel: IVec3,
    origin_fraction: IVec3,
    form: ShapeSdf,
    roughness: Option<QuantizedRoughness>,
    /// Distance outside within which the edit changes samples.
    band: i32,
}

impl Evaluator {
    /// The evaluator of a checked edit that changes samples within `band` outside its rough shape.
    pub(super) fn new(shape: &QuantizedShape, roughness: Option<QuantizedRoughness>, band: i32) -> Self {
        let origin = shape.origin();
        let (origin_voxel, origin_fraction) = (origin >> 8, origin & 0xff);
        Self { origin_voxel, origin_fraction, form: shape.form(), roughness, band }
    }

    /// Signed distance from a lattice point to the edit's shape in 1/256 voxel: negative inside, roughness included,
    /// rounded to the nearest integer and halves to even.
    ///
    /// Any point may be asked about; distances stop at 16384 voxels.
    pub fn distance(&self, point: IVec3) -> i32 {
        let mut distance = [0];
        self.row(point, &mut distance);
        distance[0]
    }

    /// Like [`distance`](Self::distance), bit for bit, for the samples `start`, `start + (1, 0, 0)` and so
    /// on.
    pub fn row(&self, start: IVec3, out: &mut [i32]) {
        let mut x = i64::from(start.x);
        for run in out.chunks_mut(RUN) {
            let mut buffer = [0.0; RUN];
            let distances = &mut buffer[..run.len()];
            self.smooth(x, start, distances);
            if let Some(roughness) = &self.roughness {
                roughness.add(x, start, distances);
            }
            for (out, &distance) in run.iter_mut().zip(&*distances) {
                *out = round(distance);
            }
            x = x.saturating_add(run.len() as i64);
        }
    }

    /// Distances of rows of 8 samples along x from `origin` on, clamped to 16 bits, far beyond the distances that edits
    /// distinguish. Rows with `y` and `z` in these ranges, counted from `origin`, go to `out[y * 8 + z]`; other rows
    /// stay as they are.
    pub(crate) fn rows(&self, origin: IVec3, y: Range<i32>, z: Range<i32>, out: &mut [i16x8; 64]) {
        let along = |start: i32, origin_voxel: i32, origin_fraction: i32| -> [f32; 8] {
            std::array::from_fn(|i| units(i64::from(start) + i as i64, origin_voxel, origin_fraction))
        };
        // Clamped coordinates still increase within a run, as in longer runs.
        let first = voxels(origin.x.into(), self.origin_voxel.x);
        let xs = std::array::from_fn(|i| ((first + i as i32) * ONE - self.origin_fraction.x) as f32);
        let ys = along(origin.y, self.origin_voxel.y, self.origin_fraction.y);
        let zs = along(origin.z, self.origin_voxel.z, self.origin_fraction.z);
        let range = |range: Range<i32>| range.start as usize..range.end as usize;
        self.form.rows(&[xs, ys, zs], range(y), range(z), |y, z, mut distances| {
            if let Some(roughness) = &self.roughness {
                let start = origin + IVec3::new(0, y as i32, z as i32);
                roughness.add(i64::from(origin.x), start, &mut distances);
            }
            out[y * 8 + z] = i16x8::from_i32x8_saturate(i32x8::new(distances.map(round)));
        });
    }

    /// Returns `true` if every sample of the box lies farther outside than the edit changes samples, so that it changes
    /// none of them (rule 6).
    ///
    /// Cheap and conservative: `false` may also mean "not sure". It takes one distance, at the middle of the box, of
    /// which no corner can be nearer by more than half the diagonal.
    pub fn is_out_of_reach(&self, samples: LatticeBox) -> bool {
        let (min, max) = (samples.min.as_i64vec3(), samples.max.as_i64vec3());
        let middle: I64Vec3 = (min + max) >> 1;
        let corner = (max - middle).as_dvec3() * f64::from(ONE);
        let diagonal = (corner.x * corner.x + corner.y * corner.y + corner.z * corner.z).sqrt();

        let [x, y, z] = std::array::from_fn(|axis| {
            units(middle[axis], self.origin_voxel[axis], self.origin_fraction[axis])
        });
        let distance = round(self.form.least(x, y, z));
        // A generous bound on the rounding to f32 at this distance.
        let rounding = 16 + (distance >> 14);
        let amplitude = self.roughness.map_or(0, |roughness| roughness.amplitude);
        f64::from(distance - rounding) > f64::from(self.band + amplitude) + diagonal
    }

    /// Distances without roughness, not rounded, for a run of at most [`RUN`] from (`x`, `start.y`, `start.z`) along
    /// +x.
    fn smooth(&self, x: i64, start: IVec3, out: &mut [f32]) {
        let first = voxels(x, self.origin_voxel.x);
        let xs: [f32; RUN] =
            std::array::from_fn(|i| ((first + i as i32) * ONE - self.origin_fraction.x) as f32);
        let y = units(start.y.into(), self.origin_voxel.y, self.origin_fraction.y);
        let z = units(start.z.into(), self.origin_voxel.z, self.origin_fraction.z);
        self.form.run(&xs[..out.len().min(RUN)], y, z, out);
    }
}

/// From a shape's origin to a coordinate, in voxels.
#[inline(always)]
fn voxels(at: i64, origin_voxel: i32) -> i32 {
    (at - i64::from(origin_voxel)).clamp(-FARTHEST, FARTHEST) as i32
}

/// From a shape's origin to a coordinate, in 1/256 voxel.
#[inline(always)]
fn units(at: i64, origin_voxel: i32, origin_fraction: i32) -> f32 {
    (voxels(at, origin_voxel) * ONE - origin_fraction) as f32
}

/// An evaluator as plain numbers, for the GPU.
#[cfg(feature = "cuda")]
pub(crate) struct Constants {
    /// The shape's origin in voxels, and 1/256 voxel from there.
    pub origin_voxel: IVec3,
    pub origin_fraction: IVec3,
    /// The kind of shape.
    pub kind: u32,
    /// The result of [`ShapeSdf::constants`].
    pub shape: [f32; 12],
    /// Amplitude, scale, seed and origin of roughness.
    pub roughness: Option<(i32, i32, u32, [i32; 3])>,
    /// Distance outside the rough shape within which the edit changes samples.
    pub band: i32,
}

#[cfg(feature = "cuda")]
impl Evaluator {
    /// Returns `true` if the shape is rough.
    pub(crate) fn is_rough(&self) -> bool {
        self.roughness.is_some()
    }

    /// Whether only the CPU computes these distances.
    pub(crate) fn is_for_cpu(&self) -> bool {
        self.form.is_for_cpu()
    }

    /// The parameters of the grid, if the shape is one.
    pub(crate) fn grid(&self) -> Option<GridParams<'_>> {
        self.form.grid()
    }

    /// All parameters of distances.
    pub(crate) fn constants(&self) -> Constants {
        let (kind, shape) = self.form.constants();
        let roughness = self.roughness.as_ref().map(QuantizedRoughness::constants);
        Constants {
            origin_voxel: self.origin_voxel,
            origin_fraction: self.origin_fraction,
            kind,
            shape,
            roughness,
            band: self.band,
        }
    }
}

/// Rounds to the nearest integer, halves to even, with an addition: next to 1.5 * 2^23, floats are the integers.
#[inline(always)]
fn round(distance: f32) -> i32 {
    const SHIFT: f32 = 12_582_912.0;
    let near = smaller(larger(distance, -MAX_DISTANCE), MAX_DISTANCE);
    (near + SHIFT).to_bits() as i32 - SHIFT.to_bits() as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::shapes::{Cone, Cuboid, Sphere};
    use crate::brush::{BAND, Roughness};

    fn sphere(center: [i32; 3], radius: i32) -> QuantizedShape {
        QuantizedShape::Sphere(Sphere { center, radius })
    }

    fn cone(base: [i32; 3], axis: [i32; 3], radius: i32) -> QuantizedShape {
        QuantizedShape::Cone(Cone { base, axis, radius })
    }

    #[test]
    fn rounding_is_to_nearest_and_halves_to_even() {
        for (distance, rounded) in [
            (0.0, 0),
            (-0.0, 0),
            (0.5, 0),
            (1.5, 2),
            (2.5, 2),
            (-0.5, 0),
            (-1.5, -2),
            (-2.500_001, -3),
            (1e30, 1 << 22),
            (-1e30, -(1 << 22)),
            (4_194_303.5, 1 << 22),
            (-4_194_302.5, -4_194_302),
        ] {
            assert_eq!(round(distance), rounded, "{distance}");
        }
    }

    #[test]
    fn rows_of_a_brick_are_rows() {
        for (seed, shape) in [
            (None, sphere([900, 300, 700], 600)),
            (Some(3), cone([1 << 10, 9, -7], [-99, 5_000, 999], 900)),
            (
                Some(9),
                QuantizedShape::Cuboid(Cuboid {
                    center: [0, 0, 0],
                    half: [900, 80, 700],
                    rotation: [3, 5, 7, 90],
                }),
            ),
        ] {
            let roughness =
                seed.map(|seed| QuantizedRoughness::quantize(&Roughness::new(1.5, 3.0, seed)).unwrap());
            let evaluator = Evaluator::new(&shape, roughness, BAND);
            for origin in [IVec3::new(-3, -4, 0), IVec3::new(8, 0, -8), IVec3::new(1 << 14, 0, 0)] {
                let mut rows = [i16x8::splat(i16::MIN); 64];
                evaluator.rows(origin, 1..7, 2..8, &mut rows);
                for (i, row) in (0..).zip(rows) {
                    let (y, z) = (i / 8, i % 8);
                    let mut expected = [i32::from(i16::MIN); 8];
                    if (1..7).contains(&y) && (2..8).contains(&z) {
                        evaluator.row(origin + IVec3::new(0, y, z), &mut expected);
                    }
                    let expected =
                        expected.map(|distance| distance.clamp(i16::MIN.into(), i16::MAX.into()) as i16);
                    assert_eq!(row.to_array(), expected, "{shape:?} at {origin}, row {y} {z}");
                }
            }
        }
    }

    #[test]
    fn beyond_the_horizon_all_distances_are_one() {
        for shape in [sphere([-5, 300, 7], 600), cone([1 << 23, 9, -7], [-99, 55_000, 999], 9_000)] {
            let evaluator = Evaluator::new(&shape, None, BAND);
            let far = FARTHEST as i32;
            for x in [far - 40, far, -far - 40, -2 * far, i32::MIN, i32::MAX - 80] {
                for start in [IVec3::new(x, 3, 0), IVec3::new(x, i32::MAX, i32::MIN)] {
                    let mut row = [0; 80];
                    evaluator.row(start, &mut row);
                    assert_eq!(row, [MAX_DISTANCE as i32; 80], "{start}");
                }
            }
        }
    }

    #[test]
    fn up_to_the_horizon_distances_are_exact() {
        let evaluator = Evaluator::new(&sphere([0; 3], 256), None, BAND);
        let mut row = [0; 33_000];
        evaluator.row(IVec3::new(-16_500, 0, 0), &mut row);
        for (x, distance) in (-16_500i32..).zip(row) {
            assert_eq!(distance, ((x.abs() - 1) * ONE).min(MAX_DISTANCE as i32));
        }
    }
}
