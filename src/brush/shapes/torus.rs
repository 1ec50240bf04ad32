//! The torus: a ring with a round section.

use std::f64::consts::PI;

use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::{Axis, Distance, length};
use super::{Convert, Extent, Kind, Numbers, Outline, Shape, ShapeGeometry, Units, Voxels};
use crate::brush::BrushError;
use crate::brush::quantize::{disc, voxels};

/// A ring: all that is nearer to a circle than the radius of the tube.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Torus<N: Numbers = Voxels> {
    /// The torus's middle.
    pub center: N::Vector,
    /// The axis through its hole; only its direction matters.
    pub axis: N::Direction,
    /// Radius of the circle.
    pub radius: N::Length,
    /// Radius of the tube around the circle, at most that of the circle.
    pub tube: N::Length,
}

impl Shape {
    /// A ring around `center`, its hole along `axis`, from a circle of `radius` and the radius of its `tube`.
    pub const fn torus(center: Vec3, axis: Vec3, radius: f32, tube: f32) -> Self {
        Self::Torus(Torus { center, axis, radius, tube })
    }
}

convert!(Torus { center: point, axis: direction, radius: length, tube: length });

impl Torus {
    pub(super) fn extent(&self) -> Extent {
        Extent { ends: [self.center; 2], around: Vec3::splat(self.radius + self.tube) }
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        let axis = self.axis.try_normalize().unwrap_or(Vec3::Y);
        for side in [-1.0, 1.0] {
            outline.circle(self.center, axis, self.radius + side * self.tube);
            outline.circle(self.center + axis * side * self.tube, axis, self.radius);
        }
        let (right, up) = axis.any_orthonormal_pair();
        for way in [right, up, -right, -up] {
            outline.circle(self.center + way * self.radius, way.cross(axis), self.tube);
        }
    }
}

impl ShapeGeometry for Torus<Units> {
    type Distance = TorusDistance;

    fn origin(&self) -> [i32; 3] {
        self.center
    }

    fn check(&self) -> Result<(), BrushError> {
        if self.tube > self.radius {
            return Err(BrushError::TooLarge {
                what: "tube",
                value: voxels(self.tube),
                most: voxels(self.radius),
            });
        }
        Ok(())
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let center = IVec3::from_array(self.center);
        let reach = disc(self.axis.map(i32::from), self.radius) + self.tube;
        (center - reach, center + reach)
    }

    fn deepest(&self) -> i32 {
        self.tube
    }

    fn volume(&self) -> f64 {
        2.0 * PI * PI * f64::from(self.radius) * f64::from(self.tube).powi(2)
    }

    fn distance(&self) -> TorusDistance {
        let axis = Axis::of(self.axis.map(i32::from));
        TorusDistance { axis, radius: self.radius as f32, tube: self.tube as f32 }
    }
}

#[derive(Clone, Debug)]
pub struct TorusDistance {
    axis: Axis,
    radius: f32,
    tube: f32,
}

impl Distance for TorusDistance {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let along = self.axis.along(x, y, z);
        let beyond = self.axis.off(x, y, z, along) - self.radius;
        length(beyond, along, 0.0) - self.tube
    }

    fn constants(&self) -> Vec<f32> {
        self.axis.constants(&[self.radius, self.tube])
    }
}
