//! The sphere.

use std::f64::consts::PI;

use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::{Distance, length};
use super::{Convert, Extent, Kind, Numbers, Outline, Shape, ShapeGeometry, Units, Voxels};
use crate::brush::BrushError;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Sphere<N: Numbers = Voxels> {
    /// The sphere's middle.
    pub center: N::Vector,
    /// The sphere's radius.
    pub radius: N::Length,
}

impl Shape {
    /// A ball.
    pub const fn sphere(center: Vec3, radius: f32) -> Self {
        Self::Sphere(Sphere { center, radius })
    }
}

convert!(Sphere { center: point, radius: length });

impl Sphere {
    pub(super) fn extent(&self) -> Extent {
        Extent { ends: [self.center; 2], around: Vec3::splat(self.radius) }
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        outline.ball(self.center, self.radius);
    }
}

impl ShapeGeometry for Sphere<Units> {
    type Distance = SphereDistance;

    fn origin(&self) -> [i32; 3] {
        self.center
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let center = IVec3::from_array(self.center);
        (center - self.radius, center + self.radius)
    }

    fn deepest(&self) -> i32 {
        self.radius
    }

    fn volume(&self) -> f64 {
        ball(self.radius)
    }

    fn distance(&self) -> SphereDistance {
        SphereDistance { radius: self.radius as f32 }
    }
}

/// Volume of a ball.
pub(super) fn ball(radius: i32) -> f64 {
    PI * 4.0 / 3.0 * f64::from(radius).powi(2) * f64::from(radius)
}

#[derive(Clone, Debug)]
pub struct SphereDistance {
    radius: f32,
}

impl Distance for SphereDistance {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        length(x, y, z) - self.radius
    }

    fn constants(&self) -> Vec<f32> {
        vec![self.radius]
    }
}
