//! The shapes that a brush can have.

use glam::{Quat, Vec3};

/// A solid in voxels of terrain space; in a [`Brush`](super::Brush) that is a message of the plugin's, in units of world
/// space.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Its middle.
        center: Vec3,
        /// Its radius.
        radius: f32,
    },
    /// A box, turned any way.
    Cuboid {
        /// Its middle.
        center: Vec3,
        /// Half its sides, along its own axes.
        half: Vec3,
        /// From its own axes to the terrain's; of length 1.
        rotation: Quat,
    },
    /// A cylinder with flat ends.
    Cylinder {
        /// Centre of one end.
        base: Vec3,
        /// From there to the centre of the other end.
        axis: Vec3,
        /// Its radius.
        radius: f32,
    },
    /// All that is nearer to a line segment than the radius; a ball where the ends coincide.
    Capsule {
        /// One end of the segment.
        from: Vec3,
        /// The other end.
        to: Vec3,
        /// Its radius.
        radius: f32,
    },
    /// A cone with its base disc.
    Cone {
        /// Centre of the base disc.
        base: Vec3,
        /// From there to the apex.
        axis: Vec3,
        /// Radius of the base disc.
        radius: f32,
    },
}

impl Shape {
    /// A ball.
    pub const fn sphere(center: Vec3, radius: f32) -> Self {
        Self::Sphere { center, radius }
    }

    /// A box along the terrain's axes; `half` its sides.
    pub const fn cuboid(center: Vec3, half: Vec3) -> Self {
        Self::Cuboid { center, half, rotation: Quat::IDENTITY }
    }

    /// A box turned by `rotation`.
    pub const fn turned_cuboid(center: Vec3, half: Vec3, rotation: Quat) -> Self {
        Self::Cuboid { center, half, rotation }
    }

    /// A cylinder from the disc around `base` to the disc around `base + axis`.
    pub const fn cylinder(base: Vec3, axis: Vec3, radius: f32) -> Self {
        Self::Cylinder { base, axis, radius }
    }

    /// A capsule around the segment between two points.
    pub const fn capsule(from: Vec3, to: Vec3, radius: f32) -> Self {
        Self::Capsule { from, to, radius }
    }

    /// A cone from the disc around `base` to the apex `base + axis`.
    pub const fn cone(base: Vec3, axis: Vec3, radius: f32) -> Self {
        Self::Cone { base, axis, radius }
    }

    /// The shape after every point p moved to `turn * (p * scale) + shift`.
    pub(super) fn transformed(self, turn: Quat, shift: Vec3, scale: f32) -> Self {
        let arrow = |v: Vec3| turn * (v * scale);
        let point = |p: Vec3| arrow(p) + shift;
        match self {
            Self::Sphere { center, radius } => Self::sphere(point(center), radius * scale),
            Self::Cuboid { center, half, rotation } => {
                Self::turned_cuboid(point(center), half * scale, turn * rotation)
            }
            Self::Cylinder { base, axis, radius } => Self::cylinder(point(base), arrow(axis), radius * scale),
            Self::Capsule { from, to, radius } => Self::capsule(point(from), point(to), radius * scale),
            Self::Cone { base, axis, radius } => Self::cone(point(base), arrow(axis), radius * scale),
        }
    }
}
