//! Boxes of lattice points, both ends included.

use glam::{I64Vec3, IVec3};

/// A non-empty box of lattice points; `min` and `max` belong to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LatticeBox {
    /// Lowest point of the box.
    pub min: IVec3,
    /// Highest point of the box.
    pub max: IVec3,
}

impl LatticeBox {
    /// The box from `min` to `max`, `None` where it would hold no point.
    pub fn new(min: IVec3, max: IVec3) -> Option<Self> {
        min.cmple(max).all().then_some(Self { min, max })
    }

    /// The box of one point.
    pub const fn point(point: IVec3) -> Self {
        Self { min: point, max: point }
    }

    /// Returns `true` if the point is in the box.
    pub fn contains(self, point: IVec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// Returns `true` if all of `other` is in the box.
    pub fn encloses(self, other: Self) -> bool {
        self.contains(other.min) && self.contains(other.max)
    }

    /// The points that both boxes hold.
    pub fn intersection(self, other: Self) -> Option<Self> {
        Self::new(self.min.max(other.min), self.max.min(other.max))
    }

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Grows an optional box to hold `other` as well.
    pub fn include(own: &mut Option<Self>, other: Self) {
        *own = Some(own.map_or(other, |own| own.union(other)));
    }

    /// The box with `by` more points on every side; coordinates saturate.
    pub fn grown(self, by: i32) -> Self {
        let by = IVec3::splat(by);
        Self { min: self.min.saturating_sub(by), max: self.max.saturating_add(by) }
    }

    /// Returns `true` if the boxes share a point, or lie one step apart, so that a lattice cell touches both.
    pub fn meets(self, other: Self) -> bool {
        self.grown(1).intersection(other).is_some()
    }

    /// Points along each axis; [`i32::MAX`] where there are more.
    pub fn size(self) -> IVec3 {
        self.max.saturating_sub(self.min).saturating_add(IVec3::ONE)
    }

    /// Points in the box; [`u64::MAX`] where there are more.
    pub fn volume(self) -> u64 {
        let size = (self.max.as_i64vec3() - self.min.as_i64vec3() + 1).max(I64Vec3::ZERO).as_u64vec3();
        size.x.saturating_mul(size.y).saturating_mul(size.z)
    }

    /// Every point of the box, x fastest, then z, then y; none for an inverted box.
    pub fn points(self) -> impl Iterator<Item = IVec3> {
        let Self { min, max } = self;
        let mut next = Self::new(min, max).map(|own| own.min);
        std::iter::from_fn(move || {
            let point = next?;
            next = if point.x < max.x {
                Some(point.with_x(point.x + 1))
            } else if point.z < max.z {
                Some(IVec3::new(min.x, point.y, point.z + 1))
            } else if point.y < max.y {
                Some(IVec3::new(min.x, point.y + 1, min.z))
            } else {
                None
            };
            Some(point)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_one_step_apart_meet() {
        let a = LatticeBox::new(IVec3::ZERO, IVec3::splat(3)).unwrap();
        let beside = LatticeBox::point(IVec3::new(4, 0, 0));
        let apart = LatticeBox::point(IVec3::new(5, 0, 0));
        assert!(a.meets(beside) && beside.meets(a));
        assert!(!a.meets(apart) && !apart.meets(a));
        assert_eq!(a.intersection(beside), None);
    }

    #[test]
    fn points_are_as_many_as_the_volume() {
        let cube = LatticeBox::new(IVec3::new(-1, 2, 3), IVec3::new(1, 3, 6)).unwrap();
        assert_eq!(cube.points().count() as u64, cube.volume());
        assert!(cube.points().all(|p| cube.contains(p)));
    }

    #[test]
    fn boxes_as_large_as_numbers_go_are_boxes() {
        let (all, middle) = (LatticeBox { min: IVec3::MIN, max: IVec3::MAX }, LatticeBox::point(IVec3::ZERO));
        assert_eq!((all.grown(1), all.volume(), all.size()), (all, u64::MAX, IVec3::MAX));
        assert!(all.meets(middle) && middle.meets(all) && all.encloses(middle));
        let half = LatticeBox { min: IVec3::MIN.with_y(0), ..all };
        assert_eq!(half.grown(i32::MAX).min, IVec3::new(i32::MIN, -i32::MAX, i32::MIN));
        let flat = LatticeBox { min: IVec3::MIN.with_y(3), max: IVec3::new(i32::MAX, 3, i32::MIN) };
        assert_eq!(flat.volume(), 1 << 32);
        // Inverted.
        let nothing = LatticeBox { min: IVec3::MAX, max: IVec3::MIN };
        assert_eq!((nothing.volume(), nothing.points().count()), (0, 0));
        assert_eq!(LatticeBox { min: IVec3::X, max: IVec3::new(0, 3, 3) }.points().count(), 0);
    }
}
