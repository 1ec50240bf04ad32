//! The new density of a sample where a shape is united with the ground, or taken out of it, with a rounded edge.
//!
//! Where the ground's surface and the shape's surface meet, a ball of the radius rolls along both: what it can't reach
//! is filled in a union, and taken away where a shape is dug out. In a cut across the edge that is an arc, which
//! touches the one surface at the radius from the other one:
//!
//! ```text
//! ground's distance d, shape's distance b, radius r:  r - sqrt((r - d)^2 + (r - b)^2)  where both are below r
//! ```
//!
//! Digging is the same with ground and air exchanged.

use super::{BAND, DEPTH};

/// The maximum radius, in voxels.
pub(super) const MAX: i32 = 16;

/// A union or a subtraction with a rounded edge. Lengths are in 1/256 voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rounding {
    pub radius: i32,
    /// Whether the shape is dug out.
    pub is_dig: bool,
}

impl Rounding {
    /// The distance from the ground's surface up to which it has to be known.
    pub fn horizon(self) -> i32 {
        self.radius.max(DEPTH)
    }

    /// The density of a sample afterwards, from its density `before`, its signed distance to the shape, `outside`, and
    /// its distance to the surface of the ground: at most the [horizon](Self::horizon), where it is that or more.
    ///
    /// With a radius of 0 it is that of a plain dig or add.
    pub fn density(self, before: i32, outside: i32, surface: i32) -> i32 {
        let is_solid = before < 0;
        if self.is_dig {
            -self.united(-before, !is_solid, outside, surface)
        } else {
            self.united(before, is_solid, outside, surface)
        }
    }

    /// The density of a union; `is_inside` says whether the sample was inside already, where `before` is not positive.
    fn united(self, before: i32, is_inside: bool, outside: i32, surface: i32) -> i32 {
        let shape = outside.max(-DEPTH);
        let plain = if outside <= BAND { before.min(shape) } else { before };
        let radius = self.radius;
        if shape >= radius || !is_inside && surface >= radius || is_inside && before <= -DEPTH {
            return plain;
        }
        let own = if is_inside { -surface } else { surface };
        // Within both, only the distance to the surface counts, or the middle would get deeper without a radius too.
        let beside = if is_inside { shape.max(0) } else { shape };
        let arc = radius - hypotenuse(radius - own, radius - beside);
        let rounded = if is_inside {
            // As much deeper as the arc is below the surface.
            before.min(shape) - (own - arc)
        } else if arc > 0 && own < shape {
            // The density of ground that is steep changes faster than distances do: the surface moves by the share.
            (i64::from(before) * i64::from(arc) / i64::from(own)) as i32
        } else {
            arc
        };
        plain.min(rounded.max(-DEPTH))
    }
}

/// The length of the longest side of a right triangle, rounded down.
fn hypotenuse(a: i32, b: i32) -> i32 {
    (i64::from(a) * i64::from(a) + i64::from(b) * i64::from(b)).isqrt() as i32
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::brush::Kind;
    use crate::ground::MaterialId;
    use crate::lattice::ONE;

    #[test]
    fn a_corner_of_two_planes_becomes_an_arc() {
        // Ground below y = 0, a wall beyond x = 0, and a radius of 8 voxels.
        let (radius, mut filled) = (8 * ONE, 0);
        let rounding = Rounding { radius, is_dig: false };
        for (x, y) in (0..10 * ONE).step_by(37).flat_map(|x| (0..10 * ONE).step_by(41).map(move |y| (x, y))) {
            let is_solid = rounding.density(y, x, y.min(rounding.horizon())) < 0;
            let (across, up) = (f64::from(radius - x).max(0.0), f64::from(radius - y).max(0.0));
            let beyond = across.hypot(up) - f64::from(radius);
            assert!(beyond.abs() < 2.0 || is_solid == (beyond > 0.0 && x < radius && y < radius), "{x} {y}");
            filled += usize::from(is_solid);
        }
        assert!(filled > 500);
    }

    proptest! {
        #[test]
        fn without_a_radius_it_is_plain(before in -9000..9000i32, outside in -9000..9000i32, surface in 0..=DEPTH) {
            for (is_dig, kind) in [(true, Kind::Dig), (false, Kind::Add { material: MaterialId(1) })] {
                let expected = if outside <= BAND { kind.apply(before, outside) } else { before };
                prop_assert_eq!(Rounding { radius: 0, is_dig }.density(before, outside, surface), expected);
            }
        }

        #[test]
        fn a_union_never_takes_away_and_a_dig_never_adds_nor_do_they_reach_beyond_the_radius(
            before in -9000..9000i32, outside in -9000..9000i32, radius in 0..=MAX * ONE, surface in 0..=MAX * ONE,
        ) {
            for is_dig in [true, false] {
                let rounding = Rounding { radius, is_dig };
                let after = rounding.density(before, outside, surface.min(rounding.horizon()));
                let plain = Rounding { radius: 0, is_dig }.density(before, outside, surface);
                let is_between =
                    if is_dig { after >= plain && plain >= before } else { after <= plain && plain <= before };
                prop_assert!(is_between);
                prop_assert!(after == before || outside <= radius.max(BAND));
                prop_assert!(after.abs() <= before.abs().max(DEPTH + outside.abs()));
            }
        }

        #[test]
        fn nothing_jumps_where_the_rounding_begins(near in 0..MAX * ONE, radius in ONE..=MAX * ONE) {
            let rounding = Rounding { radius, is_dig: false };
            let near = near.min(radius);
            // At the radius from one of both, it is as without.
            let density = |own: i32, outside: i32| rounding.density(own, outside, own.min(rounding.horizon()));
            prop_assert!((density(near, radius - 1) - near).abs() <= 2);
            if near <= BAND {
                prop_assert!((density(radius - 1, near) - near).abs() <= 2);
            }
        }
    }
}
