//! Periodic noise, for textures without seams.
//!
//! The `noise` crate has periodic noise only by way of four dimensions, at several times the cost. This module uses
//! only `+ - * / sqrt` and integers in a fixed order, so every machine paints the same pictures.

/// A number from a lattice point; the same bits everywhere.
pub(super) fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let mut word = seed.wrapping_mul(0x9e37_79b9) ^ x.cast_unsigned().wrapping_mul(0x85eb_ca6b);
    word = (word ^ (word >> 15)).wrapping_mul(0x2c1b_3c6d) ^ y.cast_unsigned().wrapping_mul(0xc2b2_ae35);
    word = (word ^ (word >> 12)).wrapping_mul(0x297a_2d39) ^ z.cast_unsigned().wrapping_mul(0x27d4_eb2f);
    word = (word ^ (word >> 15)).wrapping_mul(0x85eb_ca6b);
    word ^ (word >> 16)
}

/// A number from 0 to 1.
pub(super) fn chance(x: i32, y: i32, seed: u32) -> f32 {
    (hash(x, y, 0, seed) >> 8) as f32 / (1 << 24) as f32
}

/// 0 below `low`, 1 above `high`, and an S between.
pub(super) fn smooth(low: f32, high: f32, at: f32) -> f32 {
    let t = ((at - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// The largest whole number that is not above; not for numbers beyond those of 32 bits. Where processors have no
/// instruction for it, [`f32::floor`] is a call.
fn floor(at: f32) -> i32 {
    let whole = at as i32;
    whole - i32::from(at < whole as f32)
}

/// Lattice steps modulo the period. Most lie within the first period, so this avoids slow divisions.
fn wrap(at: i32, period: i32) -> i32 {
    if (0..period).contains(&at) { at } else { at.rem_euclid(period) }
}

/// Eight directions, those along the axes as long as the others.
const DIRECTIONS: [[f32; 2]; 8] = [
    [1.0, 1.0],
    [1.0, -1.0],
    [-1.0, 1.0],
    [-1.0, -1.0],
    [1.414, 0.0],
    [-1.414, 0.0],
    [0.0, 1.414],
    [0.0, -1.414],
];

/// Gradient noise, about -1 to 1, that repeats after `period` lattice steps; `u` and `v` go from 0 to 1 over the
/// period.
pub(super) fn gradient(u: f32, v: f32, period: i32, seed: u32) -> f32 {
    let (x, y) = (u * period as f32, v * period as f32);
    let (i, j) = (floor(x), floor(y));
    let (fx, fy) = (x - i as f32, y - j as f32);
    let (columns, rows) =
        ([0, 1].map(|step| wrap(i + step, period)), [0, 1].map(|step| wrap(j + step, period)));
    let corner = |dx: usize, dy: usize| {
        let [across, along] = DIRECTIONS[(hash(columns[dx], rows[dy], 0, seed) & 7) as usize];
        across * (fx - dx as f32) + along * (fy - dy as f32)
    };
    let (sx, sy) = (fade(fx), fade(fy));
    lerp(lerp(corner(0, 0), corner(1, 0), sx), lerp(corner(0, 1), corner(1, 1), sx), sy)
}

/// Octaves of [`gradient`] noise, each twice as fine and half as strong, about -1 to 1.
pub(super) fn octaves(u: f32, v: f32, period: i32, count: u32, seed: u32) -> f32 {
    let (mut sum, mut strength, mut period, mut all) = (0.0, 1.0, period, 0.0);
    for octave in 0..count {
        sum += strength * gradient(u, v, period, seed.wrapping_add(octave * 101));
        all += strength;
        strength *= 0.5;
        period *= 2;
    }
    1.4 * sum / all
}

/// Octaves folded at 0: ridges, 0 in the valleys to 1 on the crests.
pub(super) fn ridges(u: f32, v: f32, period: i32, count: u32, seed: u32) -> f32 {
    let (mut sum, mut strength, mut period, mut all) = (0.0, 1.0, period, 0.0);
    for octave in 0..count {
        sum += strength * (1.0 - gradient(u, v, period, seed.wrapping_add(octave * 131)).abs().min(1.0));
        all += strength;
        strength *= 0.5;
        period *= 2;
    }
    sum / all
}

/// The nearest of points scattered over cells.
pub(super) struct Cell {
    /// Distance to the nearest point, in cells.
    pub nearest: f32,
    /// Distance to the second nearest.
    pub second: f32,
    /// Which point it is: a random number from 0 to 1.
    pub name: f32,
    /// From the point to here, in cells.
    pub offset: [f32; 2],
}

/// Scattered points, one for each of `period` x `period` cells, repeating.
pub(super) fn cells(u: f32, v: f32, period: i32, seed: u32) -> Cell {
    let (x, y) = (u * period as f32, v * period as f32);
    let (i, j) = (floor(x), floor(y));
    let (columns, rows) =
        ([-1, 0, 1].map(|step| wrap(i + step, period)), [-1, 0, 1].map(|step| wrap(j + step, period)));
    let mut cell = Cell { nearest: f32::MAX, second: f32::MAX, name: 0.0, offset: [0.0; 2] };
    for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
        let (cx, cy) = (columns[(dx + 1) as usize], rows[(dy + 1) as usize]);
        let offset = [
            x - (i + dx) as f32 - chance(cx, cy, seed),
            y - (j + dy) as f32 - chance(cx, cy, seed ^ 0x5bd1_e995),
        ];
        let distance = (offset[0] * offset[0] + offset[1] * offset[1]).sqrt();
        if distance < cell.nearest {
            cell.second = cell.nearest;
            cell = Cell { nearest: distance, name: chance(cx, cy, seed ^ 0x0123_4567), offset, ..cell };
        } else {
            cell.second = cell.second.min(distance);
        }
    }
    cell
}

/// Gradient noise in space, about -1 to 1, that repeats after `period` steps along each axis.
pub(super) fn solid(place: [f32; 3], period: i32, seed: u32) -> f32 {
    let cell = place.map(|at| floor(at * period as f32));
    let fraction: [f32; 3] = std::array::from_fn(|axis| place[axis] * period as f32 - cell[axis] as f32);
    let corner = |dx: i32, dy: i32, dz: i32| {
        let at = |axis: usize, step: i32| wrap(cell[axis] + step, period);
        let hash = hash(at(0, dx), at(1, dy), at(2, dz), seed);
        let (x, y, z) = (fraction[0] - dx as f32, fraction[1] - dy as f32, fraction[2] - dz as f32);
        // The twelve edges of a cube.
        let (a, b) = match hash % 12 / 4 {
            0 => (x, y),
            1 => (y, z),
            _ => (z, x),
        };
        (if hash & 64 == 0 { a } else { -a }) + (if hash & 128 == 0 { b } else { -b })
    };
    let [sx, sy, sz] = fraction.map(fade);
    let row = |dy, dz| lerp(corner(0, dy, dz), corner(1, dy, dz), sx);
    lerp(lerp(row(0, 0), row(1, 0), sy), lerp(row(0, 1), row(1, 1), sy), sz)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_repeats_without_a_seam() {
        for i in 0..40 {
            let along = i as f32 / 40.0;
            for seed in 0..3 {
                let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-3, "{a} is not {b}");
                near(octaves(0.0, along, 5, 4, seed), octaves(1.0, along, 5, 4, seed));
                near(octaves(along, 0.0, 5, 4, seed), octaves(along, 1.0, 5, 4, seed));
                near(ridges(0.0, along, 3, 3, seed), ridges(1.0, along, 3, 3, seed));
                near(cells(0.0, along, 7, seed).nearest, cells(1.0, along, 7, seed).nearest);
                near(solid([0.0, along, 0.3], 4, seed), solid([1.0, along, 0.3], 4, seed));
            }
        }
    }

    #[test]
    fn shortcuts_give_what_they_stand_for() {
        for i in -2000..2000 {
            let at = i as f32 * 0.037;
            assert_eq!((floor(at), floor(i as f32)), (at.floor() as i32, i));
            assert_eq!(
                [1, 5, 40].map(|period| wrap(i, period)),
                [1, 5, 40].map(|period| i.rem_euclid(period))
            );
        }
    }

    #[test]
    fn noise_is_the_same_on_every_machine() {
        let all = (0..64).fold(0u32, |all, i| {
            let (u, v) = (i as f32 / 64.0, (i * 7 % 64) as f32 / 64.0);
            let sum = octaves(u, v, 4, 3, 9) + ridges(u, v, 4, 3, 9) + cells(u, v, 4, 9).nearest;
            all.rotate_left(5) ^ sum.to_bits()
        });
        // If this fails, golden pictures differ as well.
        assert_eq!(all, 0x9848_5AA0, "{all:#x}");
    }
}
