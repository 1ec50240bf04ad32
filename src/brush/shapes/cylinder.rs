//! The cylinder with flat ends.

use std::f64::consts::PI;

use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::{Axis, Distance, larger, length, smaller};
use super::{Convert, Extent, Kind, Numbers, Outline, Shape, ShapeGeometry, Units, Voxels};
use crate::brush::BrushError;
use crate::brush::quantize::{check_point, disc, measure, sum};

/// A cylinder with flat ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Cylinder<N: Numbers = Voxels> {
    /// Centre of one end.
    pub base: N::Vector,
    /// From there to the centre of the other end.
    pub axis: N::Vector,
    /// The cylinder's radius.
    pub radius: N::Length,
}

impl Shape {
    /// A cylinder from the disc around `base` to the disc around `base + axis`.
    pub const fn cylinder(base: Vec3, axis: Vec3, radius: f32) -> Self {
        Self::Cylinder(Cylinder { base, axis, radius })
    }
}

convert!(Cylinder { base: point, axis: arrow, radius: length });

impl Cylinder {
    pub(super) fn extent(&self) -> Extent {
        Extent { ends: [self.base, self.base + self.axis], around: Vec3::splat(self.radius) }
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        outline.tube([(self.base, self.radius), (self.base + self.axis, self.radius)]);
    }
}

impl ShapeGeometry for Cylinder<Units> {
    type Distance = CylinderDistance;

    fn origin(&self) -> [i32; 3] {
        self.base
    }

    fn check(&self) -> Result<(), BrushError> {
        check_point("end", sum(self.base, self.axis))
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let (base, disc) = (IVec3::from_array(self.base), disc(self.axis, self.radius));
        let end = base + IVec3::from_array(self.axis);
        (base.min(end) - disc, base.max(end) + disc)
    }

    fn deepest(&self) -> i32 {
        self.radius.min((measure(self.axis) / 2.0) as i32)
    }

    fn volume(&self) -> f64 {
        PI * f64::from(self.radius).powi(2) * measure(self.axis)
    }

    fn distance(&self) -> CylinderDistance {
        CylinderDistance { axis: Axis::of(self.axis), radius: self.radius as f32 }
    }
}

#[derive(Clone, Debug)]
pub struct CylinderDistance {
    axis: Axis,
    radius: f32,
}

impl Distance for CylinderDistance {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let along = self.axis.along(x, y, z);
        let side = self.axis.off(x, y, z, along) - self.radius;
        let half = self.axis.length * 0.5;
        let end = (along - half).abs() - half;
        let outside = length(larger(side, 0.0), larger(end, 0.0), 0.0);
        outside + smaller(larger(side, end), 0.0)
    }

    fn constants(&self) -> Vec<f32> {
        self.axis.constants(&[self.radius])
    }
}
