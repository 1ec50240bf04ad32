//! Value noise in integers: random numbers at the points of a coarse lattice, blended smoothly between them.
//!
//! All arithmetic is on 32-bit integers, so that `kernels/strata.cuh` computes the same bits. Cells of the
//! lattice are a power of two of voxels wide, 8 at least, so a brick lies in one cell of every noise: the
//! cell's corners are hashed once for many places of a brick.
//!
//! From one corner to the next, noise is `from + (to - from) * part / 1024`, rounded down. That is
//! `(from * (1024 - part) + to * part) / 1024`, rounded down, a sum of two products of 16 bits: several of them are one
//! instruction on all processors.

use std::sync::OnceLock;

use glam::{IVec2, IVec3};
use wide::{i16x8, i32x4, i32x8};

/// Bits of the place within a cell.
const PART_BITS: u32 = 10;

/// One noise: its seed, and the width of its cells in voxels as a power of two, 3 to 10.
#[derive(Clone, Copy, Debug)]
pub(super) struct ValueNoise {
    pub seed: u32,
    pub scale: u32,
}

/// The noise at the corners of a cell: x fastest, then z, then y. In the plane, the last four are 0.
pub(super) type Corners = i16x8;

/// Along each axis noise is linear in the weight, so the least and the greatest of a box are at its corners, but for
/// this much of rounding.
const ROUNDING: i32 = 4;

impl ValueNoise {
    /// Noise at a point in space, -32768 to 32767.
    pub fn at(self, point: IVec3) -> i32 {
        self.within(self.corners(point), point)
    }

    /// The corners of the cell around a point.
    pub fn corners(self, point: IVec3) -> Corners {
        let IVec3 { x, y, z } = point >> self.scale;
        Corners::new(std::array::from_fn(|i| {
            let [dx, dz, dy] = [0, 1, 2].map(|bit| i as i32 >> bit & 1);
            corner(self.seed, x.wrapping_add(dx), y.wrapping_add(dy), z.wrapping_add(dz))
        }))
    }

    /// Noise at a point of the cell that has these corners. Never beyond the least and the greatest of them.
    #[inline]
    pub fn within(self, corners: Corners, point: IVec3) -> i32 {
        let [x, y, z] = point.to_array().map(|at| self.weights(at));
        let lines = blend(corners, x);
        let planes = blend(packed([lines; 2]), z);
        blend(packed([planes; 2]), y).to_array()[0]
    }

    /// Least and greatest noise at the points from `low` to `high`, which lie in the cell that has these corners; or a
    /// little beyond.
    pub fn bounds_within(self, corners: Corners, low: IVec3, high: IVec3) -> [i32; 2] {
        let [x, y, z] = [0, 1, 2].map(|axis| [low[axis], high[axis]].map(|at| self.weights(at)));
        let lines = packed(x.map(|x| blend(corners, x)));
        let planes = packed(z.map(|z| blend(lines, z)));
        let [under, over] = y.map(|y| blend(planes, y));
        let (least, greatest) = (under.min(over).to_array(), under.max(over).to_array());
        let least = least.into_iter().fold(i32::MAX, i32::min);
        [least - ROUNDING, greatest.into_iter().fold(i32::MIN, i32::max) + ROUNDING]
    }

    /// The corners of the cell around a place in the plane (x, z).
    pub fn flat_corners(self, place: IVec2) -> Corners {
        let IVec2 { x, y: z } = place >> self.scale;
        let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)]
            .map(|(dx, dz)| corner(self.seed, x.wrapping_add(dx), 0, z.wrapping_add(dz)));
        Corners::new([a, b, c, d, 0, 0, 0, 0])
    }

    /// Noise at a place of the cell in the plane that has these corners.
    #[inline]
    pub fn flat_within(self, corners: Corners, place: IVec2) -> i32 {
        let [x, z] = place.to_array().map(|at| self.weights(at));
        let lines = blend(corners, x);
        blend(packed([lines; 2]), z).to_array()[0]
    }

    /// Least and greatest noise at the places from `low` to `high`, which lie in the cell that has these corners; or a
    /// little beyond.
    pub fn flat_bounds_within(self, corners: Corners, low: IVec2, high: IVec2) -> [i32; 2] {
        let ends = [low, IVec2::new(high.x, low.y), IVec2::new(low.x, high.y), high];
        let noise = ends.map(|place| self.flat_within(corners, place));
        let (least, greatest) = (noise.into_iter().min(), noise.into_iter().max());
        [least.unwrap_or_default() - ROUNDING, greatest.unwrap_or_default() + ROUNDING]
    }

    /// How much the corners before and after a coordinate weigh, four times over.
    #[inline]
    fn weights(self, at: i32) -> i16x8 {
        let width = 1 << self.scale;
        let place = (width | at & (width - 1)) as usize;
        bytemuck::cast(i32x4::splat(WEIGHTS[place % WEIGHTS.len()]))
    }
}

/// For each width of cells, from there on, and each place within: the weights of the corners before and after it, 1024
/// together. 16 bits each, the first one low.
static WEIGHTS: [i32; 2048] = {
    let (mut all, mut width) = ([0; 2048], 1);
    while width <= 1024 {
        let mut at = 0;
        while at < width {
            // How far the place is from one corner to the next, smoothed.
            let part = (at << PART_BITS) / width;
            let after = (part * part * ((3 << PART_BITS) - 2 * part)) >> (2 * PART_BITS);
            all[width + at] = (after << 16 | ((1 << PART_BITS) - after)) as i32;
            at += 1;
        }
        width *= 2;
    }
    all
};

/// Noise between the numbers of each pair.
#[inline]
fn blend(pairs: i16x8, weights: i16x8) -> i32x4 {
    pairs.dot(weights) >> PART_BITS
}

/// Numbers of 16 bits, one after the other.
#[inline]
fn packed(halves: [i32x4; 2]) -> i16x8 {
    i16x8::from_i32x8_saturate(bytemuck::cast::<_, i32x8>(halves))
}

/// A random number for a corner, -32768 to 32767: a sum of products, then the finaliser of MurmurHash3.
fn corner(seed: u32, x: i32, y: i32, z: i32) -> i16 {
    let product = |at: i32, factor: u32| at.cast_unsigned().wrapping_mul(factor);
    let sum =
        product(x, 0x8DA6_B343).wrapping_add(product(y, 0xD816_3841)).wrapping_add(product(z, 0xCB1A_B31F));
    let word = sum ^ seed;
    let word = (word ^ (word >> 16)).wrapping_mul(0x85EB_CA6B);
    let word = (word ^ (word >> 13)).wrapping_mul(0xC2B2_AE35);
    (((word ^ (word >> 16)) >> 16) as u16 ^ 0x8000).cast_signed()
}

/// The number that this share of all places, 0 to 1, exceeds.
pub(super) fn exceeded_by(share: f64) -> i32 {
    static SORTED: OnceLock<Vec<i32>> = OnceLock::new();
    quantile(SORTED.get_or_init(|| sorted(|place| samples(place)[0])), 1.0 - share)
}

/// How far from 0 two noises are at most in this share of all places, 0 to 1.
pub(super) fn both_within(share: f64) -> i32 {
    static SORTED: OnceLock<Vec<i32>> = OnceLock::new();
    let farther = |place| {
        let [a, b] = samples(place);
        a.abs().max(b.abs())
    };
    quantile(SORTED.get_or_init(|| sorted(farther)), share)
}

/// Two noises at one of many places.
fn samples(place: i32) -> [i32; 2] {
    // Steps of odd lengths, so that places lie all over their cells.
    let point = IVec3::new(place.wrapping_mul(29), place.wrapping_mul(137) >> 3, place.wrapping_mul(61) >> 6);
    [1, 2].map(|seed| ValueNoise { seed, scale: 5 }).map(|noise| noise.within(noise.corners(point), point))
}

fn sorted(value: impl Fn(i32) -> i32) -> Vec<i32> {
    let mut values: Vec<i32> = (0..1 << 16).map(value).collect();
    values.sort_unstable();
    values
}

fn quantile(sorted: &[i32], part: f64) -> i32 {
    let at = (part.clamp(0.0, 1.0) * sorted.len() as f64) as usize;
    sorted.get(at.min(sorted.len().saturating_sub(1))).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn noise_stays_between_the_corners_of_its_cell(seed: u32, x: i32, y: i32, z: i32, scale in 3u32..=10) {
            let (noise, point) = (ValueNoise { seed, scale }, IVec3::new(x, y, z));
            let corners = noise.corners(point).to_array();
            let (least, greatest) = (*corners.iter().min().unwrap(), *corners.iter().max().unwrap());
            prop_assert!((i32::from(least)..=i32::from(greatest)).contains(&noise.at(point)));
            let flat = noise.flat_within(noise.flat_corners(point.truncate()), point.truncate());
            prop_assert!((-32_768..=32_767).contains(&flat));
        }

        #[test]
        fn noise_is_blended_along_one_axis_after_the_other(seed: u32, x: i32, y: i32, z: i32, scale in 3u32..=10) {
            let (noise, point) = (ValueNoise { seed, scale }, IVec3::new(x, y, z));
            let lerp = |from: i32, to: i32, at: i32| {
                let part = ((at & ((1 << scale) - 1)) << PART_BITS >> scale).cast_unsigned();
                let part = ((part * part * ((3 << PART_BITS) - 2 * part)) >> (2 * PART_BITS)).cast_signed();
                from + (((to - from) * part) >> PART_BITS)
            };
            let plane = |[a, b, c, d]: [i32; 4]| lerp(lerp(a, b, x), lerp(c, d, x), z);
            let [a, b, c, d, e, f, g, h] = noise.corners(point).to_array().map(i32::from);
            prop_assert_eq!(noise.at(point), lerp(plane([a, b, c, d]), plane([e, f, g, h]), y));
            let place = IVec2::new(x, z);
            let [a, b, c, d, ..] = noise.flat_corners(place).to_array().map(i32::from);
            prop_assert_eq!(noise.flat_within(noise.flat_corners(place), place), plane([a, b, c, d]));
        }

        #[test]
        fn bounds_hold_all_noise_of_a_brick(seed: u32, x in -99i32..99, y in -99i32..99, z in -99i32..99, scale in 3u32..=10) {
            let (noise, low) = (ValueNoise { seed, scale }, IVec3::new(x, y, z) * 8);
            let [least, greatest] = noise.bounds_within(noise.corners(low), low, low + 7);
            for index in 0..512 {
                let own = noise.at(low + IVec3::new(index & 7, index >> 6, index >> 3 & 7));
                prop_assert!((least..=greatest).contains(&own), "{own} is not in {least}..={greatest}");
            }
            let (from, to) = (IVec2::new(low.x, low.z), IVec2::new(low.x, low.z) + 7);
            let corners = noise.flat_corners(from);
            let [least, greatest] = noise.flat_bounds_within(corners, from, to);
            for index in 0..64 {
                let own = noise.flat_within(corners, from + IVec2::new(index & 7, index >> 3));
                prop_assert!((least..=greatest).contains(&own), "{own} is not in {least}..={greatest}");
            }
        }

        #[test]
        fn noise_does_not_jump(seed: u32, x in -9999i32..9999, y in -9999i32..9999, z in -9999i32..9999, scale in 3u32..=10) {
            let noise = ValueNoise { seed, scale };
            // From one corner to the next the blend rises by at most 1.5 / width a voxel.
            let most = 65_536 * 3 / 2 / (1 << scale) + 256;
            let own = noise.at(IVec3::new(x, y, z));
            for step in [IVec3::X, IVec3::Y, IVec3::Z] {
                let next = noise.at(IVec3::new(x, y, z) + step);
                prop_assert!((next - own).abs() <= most, "{own} to {next}");
            }
        }
    }

    #[test]
    fn shares_are_what_they_say() {
        let point = |i: i32| IVec3::new(i % 101 * 7, i / 101 % 97 * 11, i / 9797 * 5);
        for share in [0.01, 0.1, 0.5] {
            let (level, width) = (exceeded_by(share), both_within(share));
            let [mut above, mut near] = [0; 2];
            let all = 97 * 101 * 40;
            for i in 0..all {
                let [a, b] = [77, 78].map(|seed| ValueNoise { seed, scale: 4 }.at(point(i)));
                above += i32::from(a > level);
                near += i32::from(a.abs().max(b.abs()) < width);
            }
            for (what, found) in [("above", above), ("near", near)] {
                let found = f64::from(found) / f64::from(all);
                assert!((found / share - 1.0).abs() < 0.2, "{what}: {found} is not {share}");
            }
        }
    }
}
