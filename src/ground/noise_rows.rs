//! Octaves of Perlin noise over rows of columns, equal bit by bit to those of the crate `noise`: the same operations in
//! the same order, as in `kernels/heights.cuh`, but for several columns at a time, and with values that a row shares
//! computed only once. Tests compare it with the crate, and the GPU kernel with it.

use std::array::from_fn;
use std::f64::consts::SQRT_2;

use super::noise_heights::NoiseKind;
use super::noise_params::NoiseParams;

/// Columns at a time.
const LANES: usize = 8;

/// One number for each of some columns.
type Lanes = [f64; LANES];

/// Quintic fade curve: first and second derivatives are zero at both ends.
fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    b * t + a * (1.0 - t)
}

/// Added to a number of less than 2^51, it leaves the nearest integer in the lowest bits of the sum. Conversions to
/// integers would do one number at a time.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// The floor of a number, as bits of which the lowest eight are those of the integer, and its fraction.
fn floor_fract(at: f64) -> (u64, f64) {
    let shifted = at + ROUND;
    let nearest = shifted - ROUND;
    let above = if nearest > at { 1.0 } else { 0.0 };
    ((shifted - above).to_bits(), at - (nearest - above))
}

/// Dot products of diagonal gradients, one of four by the lowest bits of a hash, with the offsets from their corners.
fn gradient_dots(hashes: &[u64; LANES], xs: &Lanes, z: f64) -> Lanes {
    let flip_sign = |at: f64, sign: u64| f64::from_bits(at.to_bits() ^ sign << 63);
    from_fn(|lane| flip_sign(xs[lane], hashes[lane]) + flip_sign(z, hashes[lane] >> 1))
}

/// Gradient noise at points of a row. All loops but the one that looks up hashes work on several columns at once.
fn perlin(table: &[u8; 256], xs: &Lanes, z: f64) -> Lanes {
    let (row, v) = floor_fract(z);
    let (north, south, bend) = (row as u8, (row as u8).wrapping_add(1), fade(v));
    let (mut columns, mut us) = ([0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        (columns[lane], us[lane]) = floor_fract(xs[lane]);
    }
    let hash = |own: u8| table[usize::from(own)];
    let mut corners = [[0; LANES]; 4];
    for lane in 0..LANES {
        let column = columns[lane] as u8;
        let (west, east) = (hash(column), hash(column.wrapping_add(1)));
        let own = [west ^ north, west ^ south, east ^ north, east ^ south].map(hash);
        corners.iter_mut().zip(own).for_each(|(corner, hash)| corner[lane] = u64::from(hash));
    }
    let easts = us.map(|u| u - 1.0);
    let dots = |corner: usize| {
        let xs = if corner < 2 { &us } else { &easts };
        gradient_dots(&corners[corner], xs, [v, v - 1.0][corner & 1])
    };
    let [north_west, south_west, north_east, south_east] = [dots(0), dots(1), dots(2), dots(3)];
    from_fn(|lane| {
        let west = lerp(north_west[lane], south_west[lane], bend);
        let east = lerp(north_east[lane], south_east[lane], bend);
        (lerp(west, east, fade(us[lane])) * (2.0 / SQRT_2)).clamp(-1.0, 1.0)
    })
}

impl NoiseParams {
    /// Heights in voxels of a row of columns, the first at `x` and each `stride` farther along x; not rounded.
    pub fn row(&self, x: i32, z: i32, stride: i32, heights: &mut [f64]) {
        let numbers = &self.numbers;
        let place = |at: f64, axis: usize| (at / numbers.scale + numbers.origin[axis]) * numbers.frequency;
        for (part, heights) in heights.chunks_mut(LANES).enumerate() {
            let first = f64::from(x) + f64::from(stride) * (part * LANES) as f64;
            let xs: Lanes = from_fn(|lane| place(first + f64::from(stride) * lane as f64, 0));
            let noise = match self.kind {
                NoiseKind::Fractal => self.fractal(xs, place(z.into(), 1)),
                NoiseKind::Ridged => self.ridged(xs, place(z.into(), 1)),
            };
            for (height, noise) in heights.iter_mut().zip(noise) {
                *height = numbers.base + numbers.amplitude * noise;
            }
        }
    }

    /// The amplitude decreases from octave to octave.
    fn fractal(&self, mut xs: Lanes, mut z: f64) -> Lanes {
        let numbers = &self.numbers;
        let (mut sum, mut strength) = ([0.0; LANES], numbers.persistence);
        for table in &self.tables {
            let octave = perlin(table, &xs, z);
            sum = from_fn(|lane| sum[lane] + octave[lane] * strength);
            strength *= numbers.persistence;
            xs = xs.map(|x| x * numbers.lacunarity);
            z *= numbers.lacunarity;
        }
        sum.map(|sum| sum * numbers.factor)
    }

    /// Ridges where an octave is 0. Each octave is weighted by the previous one.
    fn ridged(&self, mut xs: Lanes, mut z: f64) -> Lanes {
        let numbers = &self.numbers;
        let (mut sum, mut strength, mut weight) = ([0.0; LANES], 1.0, [1.0; LANES]);
        for table in &self.tables {
            let octave = perlin(table, &xs, z);
            let ridge: Lanes = from_fn(|lane| {
                let ridge = 1.0 - octave[lane].abs();
                ridge * ridge * weight[lane]
            });
            weight = ridge.map(|ridge| (ridge * numbers.weighting).clamp(0.0, 1.0));
            sum = from_fn(|lane| sum[lane] + ridge[lane] * strength);
            strength *= numbers.persistence;
            xs = xs.map(|x| x * numbers.lacunarity);
            z *= numbers.lacunarity;
        }
        sum.map(|sum| (sum * numbers.factor - 1.0 + 1.0) / numbers.peak * 2.0 - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{MAX_OCTAVES, MAX_SCALE, NoiseHeights};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_are_the_noise_of_the_crate(
            seed: u32, ridged: bool, octaves in 1..=MAX_OCTAVES, scale in prop_oneof![1.0..300.0, 1.0..MAX_SCALE],
            amplitude in -99.0..99.0, x in -9000..270_000i32, z in -9000..270_000i32, stride in 1..1025i32, count in 0..20usize,
        ) {
            let kind = if ridged { NoiseKind::Ridged } else { NoiseKind::Fractal };
            let heights = NoiseHeights { seed, kind, octaves, scale, amplitude, base: 3.0 };
            let noise = heights.generator().unwrap();
            let mut row = vec![0.0; count];
            heights.params(1, 1).unwrap().row(x, z, stride, &mut row);
            for (at, own) in (0..).zip(row) {
                let expected = 3.0 + amplitude * noise(x + at * stride, z);
                prop_assert_eq!(own.to_bits(), expected.to_bits(), "column {} of the row", at);
            }
        }
    }
}
