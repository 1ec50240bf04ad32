//! A sample and its neighbours, as operations that sculpt read them.
//!
//! Stored densities are known to a depth: a dig and an add cut distances off at [`DEPTH`], and what is stored
//! ends at [`FARTHEST`], so exactly these numbers say "at least as far". Operations that move a surface have
//! to know how far away it is, or the whole middle of a cave would turn solid at once. So a sample that was
//! *cut off* at `DEPTH` counts as one voxel farther than its nearest face neighbour, and is left alone while
//! all of those were cut off too. One that was cut off at `FARTHEST` is left alone unless it lies next to the
//! surface; it then counts as one voxel from the surface. Beyond the world's rim everything continues as at
//! the rim.

use glam::IVec3;

use super::DEPTH;
use crate::lattice::ONE;

/// Greatest stored density, in 1/256 voxel.
pub(crate) const FARTHEST: i32 = i16::MAX as i32;

/// The bound on differences between neighbours, in 1/256 voxel. Densities beyond a cliff are not known better.
const CONTRAST: i32 = 2 * ONE;

/// The opposite neighbours of a sample, their weight in a binomial average (1 2 1 along each axis), and what the way to
/// them measures in 1/256 voxel.
const PAIRS: [([i32; 3], i32, i32); 13] = [
    ([1, 0, 0], 4, 256),
    ([0, 1, 0], 4, 256),
    ([0, 0, 1], 4, 256),
    ([1, 1, 0], 2, 362),
    ([1, -1, 0], 2, 362),
    ([1, 0, 1], 2, 362),
    ([1, 0, -1], 2, 362),
    ([0, 1, 1], 2, 362),
    ([0, 1, -1], 2, 362),
    ([1, 1, 1], 1, 443),
    ([1, 1, -1], 1, 443),
    ([1, -1, 1], 1, 443),
    ([1, -1, -1], 1, 443),
];

/// A sample with the 26 around it, as they were before the operation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stencil {
    /// Densities in 1/256 voxel: x fastest, then z, then y.
    pub densities: [i32; 27],
    /// A bit for each that was cut off, at [`DEPTH`] or [`FARTHEST`].
    pub cut: u32,
    /// A bit for each that [`is_moved`].
    pub moved: u32,
}

/// Returns `true` if a sample is farther from the surface, by a voxel or more, than its pristine state. It is then
/// solid ground that was built or raised, or air that was dug or lowered.
pub(crate) fn is_moved(density: i32, pristine: i32) -> bool {
    let by = density - pristine;
    if density < 0 { by <= -ONE } else { by >= ONE }
}

impl Stencil {
    pub(super) const MIDDLE: usize = 13;

    fn index([x, y, z]: [i32; 3]) -> usize {
        ((y + 1) * 9 + (z + 1) * 3 + x + 1) as usize
    }

    fn is_cut(&self, index: usize) -> bool {
        self.cut >> index & 1 == 1
    }

    /// The density in the middle.
    pub fn own(&self) -> i32 {
        self.densities[Self::MIDDLE]
    }

    /// The density one step away.
    pub fn density(&self, way: IVec3) -> i32 {
        self.densities[Self::index(way.to_array())]
    }

    /// Where there is a solid neighbour across a face.
    pub fn solid_faces(&self) -> impl Iterator<Item = IVec3> {
        let ways = [IVec3::X, IVec3::Y, IVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
        ways.filter(|way| self.density(*way) < 0)
    }

    /// The six neighbours across faces: densities, and where those are.
    fn faces(&self) -> impl Iterator<Item = (i32, usize)> {
        [4, 10, 12, 14, 16, 22].map(|index| (self.densities[index], index)).into_iter()
    }

    /// Returns `true` if any of the neighbours selected by `which` lies on the other side of the surface.
    fn is_beside(&self, which: impl Fn(usize) -> bool) -> bool {
        self.faces().any(|(other, index)| (other < 0) != (self.own() < 0) && which(index))
    }

    /// How near the surface the known ones of the neighbours across faces lie, on the side of the middle.
    fn nearest(&self) -> Option<i32> {
        let known = self.faces().filter(|&(_, index)| !self.is_cut(index));
        // Towards the surface, distances along the own sign get smaller.
        known.map(|(other, _)| other * self.own().signum()).min()
    }

    /// The density in the middle; `None` if it is unknown.
    pub(super) fn middle(&self) -> Option<i32> {
        let own = self.own();
        if !self.is_cut(Self::MIDDLE) {
            return Some(own);
        }
        if own.abs() == FARTHEST {
            return self.is_beside(|_| true).then_some(own.signum() * ONE);
        }
        let nearest = self.nearest()?;
        let are_all_known = self.faces().all(|(_, index)| !self.is_cut(index));
        let nearest = if are_all_known { nearest } else { nearest.min(DEPTH) };
        Some(own.signum() * (nearest.max(0) + ONE))
    }

    /// The density in the middle with a part of `by` added, which an opposite shift takes away again: to the bit, or to
    /// 1/256 voxel where one of both would end at exactly [`DEPTH`].
    pub(super) fn shifted(&self, by: i32, weight: i32) -> Option<i32> {
        let by = by.signum() * ((by.abs() * weight + ONE / 2) >> 8);
        if by == 0 {
            return None;
        }
        let own = self.own();
        // Pristine densities continue beyond, but their shift could not be stored.
        let middle = if own.abs() >= FARTHEST {
            let is_moved = |index| self.moved >> index & 1 == 1 && !self.is_cut(index);
            let is_reached = by.signum() != own.signum() && self.is_beside(is_moved);
            is_reached.then_some(own.signum() * ONE)?
        } else if self.is_cut(Self::MIDDLE) {
            let nearest = self.nearest().filter(|&nearest| nearest <= DEPTH)?;
            own.signum() * (nearest + ONE).max(DEPTH)
        } else {
            own
        };
        let after = middle + by;
        // The result must not look like a cut-off sample, or the opposite shift would not recognise it.
        Some(if after.abs() == DEPTH { after + by.signum() } else { after })
    }

    /// 64 times the way from the middle, which is `own`, to the average of all.
    pub(super) fn way_to_average(&self, own: i32) -> i32 {
        let pair = |&(way, weight, length): &([i32; 3], i32, i32)| {
            let one = |way: [i32; 3]| {
                let index = Self::index(way);
                if self.is_cut(index) && own.abs() + length > self.densities[index].abs() {
                    return None;
                }
                Some((self.densities[index] - own).clamp(-CONTRAST, CONTRAST))
            };
            // Where one side is not known, the other one has nothing to be compared with.
            Some(weight * (one(way)? + one(way.map(|step| -step))?))
        };
        PAIRS.iter().filter_map(pair).sum()
    }

    /// The density after a change that may make the sample solid only next to a solid one, and air only next
    /// to air, so that no crumb appears in isolation.
    pub(super) fn attached(&self, after: i32) -> i32 {
        let was_solid = self.densities[Self::MIDDLE] < 0;
        if (after < 0) == was_solid || self.faces().any(|(other, _)| (other < 0) == (after < 0)) {
            return after;
        }
        if was_solid { -1 } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn around(density: impl Fn(i32, i32, i32) -> i32) -> Stencil {
        let mut all = Stencil { densities: [0; 27], cut: 0, moved: 0 };
        for way in (0..27).map(|i| [i % 3 - 1, i / 9 - 1, i / 3 % 3 - 1]) {
            all.densities[Stencil::index(way)] = density(way[0], way[1], way[2]);
        }
        all
    }

    #[test]
    fn pairs_and_the_middle_are_the_binomial_average() {
        assert_eq!(PAIRS.iter().map(|(_, weight, _)| 2 * weight).sum::<i32>() + 8, 64);
        for (way, weight, length) in PAIRS {
            let along = |step: i32| if step == 0 { 2 } else { 1 };
            assert_eq!(weight, way.map(along).iter().product::<i32>());
            let squared: i32 = way.iter().map(|step| step * step).sum();
            assert_eq!(length, (f64::from(squared).sqrt() * 256.0).round() as i32);
        }
    }

    proptest! {
        #[test]
        fn slopes_of_any_steepness_are_smooth_already(
            slope in prop::array::uniform3(-3000..3000i32), middle in -900..900i32,
        ) {
            let slope = around(|x, y, z| middle + slope[0] * x + slope[1] * y + slope[2] * z);
            prop_assert_eq!(slope.way_to_average(middle), 0);
        }
    }

    #[test]
    fn what_was_cut_off_is_one_voxel_farther_than_what_is_known() {
        let mut cave = around(|_, _, _| DEPTH);
        cave.cut = (1 << 27) - 1;
        assert_eq!(cave.middle(), None);
        let below = Stencil::index([0, -1, 0]);
        (cave.densities[below], cave.cut) = (500, cave.cut & !(1 << below));
        assert_eq!(cave.middle(), Some(756));
        cave.densities[below] = 1000;
        assert_eq!(cave.middle(), Some(1000 + ONE));
        cave.densities[below] = -300;
        assert_eq!(cave.middle(), Some(ONE));
        // A wall that is cut off on its far side stays where it is.
        let mut wall = around(|x, _, _| (x * 256 + 900).min(DEPTH));
        wall.cut = (0..27).filter(|i| i % 3 == 2).fold(0, |cut, i| cut | 1 << i);
        assert_eq!(wall.way_to_average(900), 0);
    }

    #[test]
    fn shifts_leave_alone_what_was_cut_off_unless_neighbours_tell_how_far_it_is() {
        let below = Stencil::index([0, -1, 0]);
        // Of a cave's air, with a neighbour that is known.
        let cave = |below_is: i32| {
            let mut cave = around(|_, _, _| DEPTH);
            (cave.densities[below], cave.cut) = (below_is, ((1 << 27) - 1) & !(1 << below));
            cave
        };
        assert_eq!(cave(900).shifted(-ONE, 256), Some(900));
        assert_eq!(
            cave(100).shifted(-ONE, 256),
            Some(DEPTH - ONE),
            "it is no nearer than where it was cut off"
        );
        assert_eq!(cave(900).shifted(-3, 128), Some(900 + ONE - 2));
        assert_eq!(cave(DEPTH + 1).shifted(-ONE, 256), None, "that one was moved");
        assert_eq!(around(|_, y, _| DEPTH - 1 + y * ONE).shifted(1, 256), Some(DEPTH + 1));
        assert_eq!(around(|_, y, _| DEPTH + 1 + y * ONE).shifted(-1, 256), Some(DEPTH - 1));
        for side in [1, -1] {
            let far = |end: i32, other: i32, moved: u32| {
                let mut far = around(|_, _, _| side * end);
                far.densities[below] = side * other;
                (far.cut, far.moved) =
                    (if end == FARTHEST { !(1 << below) & ((1 << 27) - 1) } else { 0 }, moved);
                far
            };
            let (away, nearer) = (side * 700, -side * 700);
            for end in [FARTHEST, FARTHEST + 5000] {
                let is_moved = 1 << below;
                assert_eq!(far(end, FARTHEST - 9, is_moved).shifted(nearer, 256), None, "as far as it says");
                assert_eq!(far(end, -40, 0).shifted(nearer, 256), None, "next to natural ground");
                assert_eq!(far(end, -40, is_moved).shifted(away, 256), None, "farther is as far");
                assert_eq!(far(end, -40, is_moved).shifted(nearer, 256), Some(side * ONE + nearer));
            }
            assert_eq!(far(FARTHEST, -40, 0).middle(), Some(side * ONE));
            assert_eq!(far(FARTHEST, 40, 0).middle(), None);
            assert_eq!(far(FARTHEST + 5000, 40, 0).middle(), Some(side * (FARTHEST + 5000)));
        }
    }

    #[test]
    fn crumbs_do_not_come_from_nowhere() {
        let air = around(|_, _, _| 20);
        assert_eq!((air.attached(-9), air.attached(5)), (0, 5));
        let ground = around(|_, y, _| y * 256 + 20);
        assert_eq!(ground.attached(-9), -9);
        let solid = around(|_, _, _| -20);
        assert_eq!((solid.attached(9), solid.attached(-5)), (-1, -5));
    }
}
