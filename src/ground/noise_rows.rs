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

/// Dot product of one of four diagonal gradients with the offset from its corner.
fn gradient_dot(hash: u8, x: f64, z: f64) -> f64 {
    let flip_sign = |at: f64, bit: u32| f64::from_bits(at.to_bits() ^ u64::from(hash >> bit & 1) << 63);
    flip_sign(x, 0) + flip_sign(z, 1)
}

/// The floor of a number, and its fraction.
fn floor_fract(at: f64) -> (i64, f64) {
    let whole = at as i64;
    let whole = whole - i64::from(at < whole as f64);
    (whole, at - whole as f64)
}

/// Gradient noise at points of a row.
fn perlin(table: &[u8; 256], xs: &Lanes, z: f64) -> Lanes {
    let (row, v) = floor_fract(z);
    let (north, south, bend) = (row as u8, (row + 1) as u8, fade(v));
    let hash = |own: u8| table[usize::from(own)];
    from_fn(|lane| {
        let (column, u) = floor_fract(xs[lane]);
        let (west, east) = (hash(column as u8), hash((column + 1) as u8));
        let side = |own: u8, u: f64| {
            lerp(gradient_dot(hash(own ^ north), u, v), gradient_dot(hash(own ^ south), u, v - 1.0), bend)
        };
        (lerp(side(west, u), side(east, u - 1.0), fade(u)) * (2.0 / SQRT_2)).clamp(-1.0, 1.0)
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
