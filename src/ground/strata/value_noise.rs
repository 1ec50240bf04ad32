//! Value noise in integers: random numbers at the points of a coarse lattice, blended smoothly between them.
//!
//! All arithmetic is on 32-bit integers, so that `kernels/strata.cuh` computes the same bits. Cells of the lattice are a
//! power of two of voxels wide, 8 at least, so a brick lies in one cell of every noise: whoever asks for many places of
//! a brick hashes the cell's corners once.

use std::sync::OnceLock;

use glam::{IVec2, IVec3};

/// Bits of the place within a cell.
const PART_BITS: u32 = 10;

/// One noise: its seed, and the width of its cells in voxels as a power of two.
#[derive(Clone, Copy, Debug)]
pub(super) struct ValueNoise {
    pub seed: u32,
    pub scale: u32,
}

/// The noise at the corners of a cell in space: x fastest, then z, then y.
pub(super) type Corners = [i32; 8];

/// The noise at the corners of a cell in the plane: x fastest, then z.
pub(super) type FlatCorners = [i32; 4];

impl ValueNoise {
    /// Noise at a point in space, -32768 to 32767.
    pub fn at(self, point: IVec3) -> i32 {
        self.within(&self.corners(point), point)
    }

    /// The corners of the cell around a point.
    pub fn corners(self, point: IVec3) -> Corners {
        let IVec3 { x, y, z } = point >> self.scale;
        std::array::from_fn(|i| {
            let [dx, dz, dy] = [0, 1, 2].map(|bit| i as i32 >> bit & 1);
            corner(self.seed, x.wrapping_add(dx), y.wrapping_add(dy), z.wrapping_add(dz))
        })
    }

    /// Noise at a point of the cell that has these corners. Never beyond the least and the greatest of them.
    pub fn within(self, corners: &Corners, point: IVec3) -> i32 {
        let [x, y, z] = point.to_array().map(|at| self.blend(at));
        let [a, b, c, d, e, f, g, h] = *corners;
        let low = lerp(lerp(a, b, x), lerp(c, d, x), z);
        let high = lerp(lerp(e, f, x), lerp(g, h, x), z);
        lerp(low, high, y)
    }

    /// Least and greatest noise at the points from `low` to `high`, which lie in the cell that has these corners; or a
    /// little beyond.
    pub fn bounds_within(self, corners: &Corners, low: IVec3, high: IVec3) -> [i32; 2] {
        // Along each axis noise is linear in the blend, so both are at corners of the box, but for rounding.
        const ROUNDING: i32 = 4;
        let [x, y, z] = [0, 1, 2].map(|axis| [low[axis], high[axis]].map(|at| self.blend(at)));
        let [a, b, c, d, e, f, g, h] = *corners;
        let mut bounds = [i32::MAX, i32::MIN];
        for x in x {
            let lines = [lerp(a, b, x), lerp(c, d, x), lerp(e, f, x), lerp(g, h, x)];
            for z in z {
                let [under, over] = [lerp(lines[0], lines[1], z), lerp(lines[2], lines[3], z)];
                for noise in y.map(|y| lerp(under, over, y)) {
                    bounds = [bounds[0].min(noise), bounds[1].max(noise)];
                }
            }
        }
        [bounds[0] - ROUNDING, bounds[1] + ROUNDING]
    }

    /// The corners of the cell around a place in the plane (x, z).
    pub fn flat_corners(self, place: IVec2) -> FlatCorners {
        let IVec2 { x, y: z } = place >> self.scale;
        [(0, 0), (1, 0), (0, 1), (1, 1)]
            .map(|(dx, dz)| corner(self.seed, x.wrapping_add(dx), 0, z.wrapping_add(dz)))
    }

    /// Noise at a place of the cell in the plane that has these corners.
    pub fn flat_within(self, corners: &FlatCorners, place: IVec2) -> i32 {
        let [x, z] = place.to_array().map(|at| self.blend(at));
        let [a, b, c, d] = *corners;
        lerp(lerp(a, b, x), lerp(c, d, x), z)
    }

    /// How far a coordinate has come from one corner to the next, smoothed: 0 to 1024.
    fn blend(self, at: i32) -> i32 {
        let part = ((at & ((1 << self.scale) - 1)) << PART_BITS >> self.scale).cast_unsigned();
        ((part * part * ((3 << PART_BITS) - 2 * part)) >> (2 * PART_BITS)).cast_signed()
    }
}

fn lerp(from: i32, to: i32, part: i32) -> i32 {
    from + (((to - from) * part) >> PART_BITS)
}

/// A random number for a corner, -32768 to 32767: a sum of products, then the finaliser of MurmurHash3.
fn corner(seed: u32, x: i32, y: i32, z: i32) -> i32 {
    let product = |at: i32, factor: u32| at.cast_unsigned().wrapping_mul(factor);
    let sum =
        product(x, 0x8DA6_B343).wrapping_add(product(y, 0xD816_3841)).wrapping_add(product(z, 0xCB1A_B31F));
    let word = sum ^ seed;
    let word = (word ^ (word >> 16)).wrapping_mul(0x85EB_CA6B);
    let word = (word ^ (word >> 13)).wrapping_mul(0xC2B2_AE35);
    ((word ^ (word >> 16)) >> 16).cast_signed() - 32_768
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
    [1, 2].map(|seed| ValueNoise { seed, scale: 5 }.at(point))
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
            let corners = noise.corners(point);
            let (least, greatest) = (*corners.iter().min().unwrap(), *corners.iter().max().unwrap());
            prop_assert!((least..=greatest).contains(&noise.at(point)));
            prop_assert!((-32_768..=32_767).contains(&least) && greatest <= 32_767);
            let flat = noise.flat_within(&noise.flat_corners(point.truncate()), point.truncate());
            prop_assert!((-32_768..=32_767).contains(&flat));
        }

        #[test]
        fn bounds_hold_all_noise_of_a_brick(seed: u32, x in -99i32..99, y in -99i32..99, z in -99i32..99, scale in 3u32..=10) {
            let (noise, low) = (ValueNoise { seed, scale }, IVec3::new(x, y, z) * 8);
            let [least, greatest] = noise.bounds_within(&noise.corners(low), low, low + 7);
            for index in 0..512 {
                let own = noise.at(low + IVec3::new(index & 7, index >> 6, index >> 3 & 7));
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
