//! The cylinder with round ends.

use std::f64::consts::PI;

use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::{Axis, Distance, larger, smaller};
use super::sphere::ball;
use super::{Convert, Extent, Kind, Numbers, Outline, Shape, ShapeGeometry, Units, Voxels};
use crate::brush::BrushError;
use crate::brush::quantize::{difference, measure};

/// All points nearer to a line segment than the radius; a ball if the ends coincide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Capsule<N: Numbers = Voxels> {
    /// One end of the segment.
    pub from: N::Vector,
    /// The other end.
    pub to: N::Vector,
    /// The capsule's radius.
    pub radius: N::Length,
}

impl Shape {
    /// A capsule around the segment between two points.
    pub const fn capsule(from: Vec3, to: Vec3, radius: f32) -> Self {
        Self::Capsule(Capsule { from, to, radius })
    }
}

convert!(Capsule { from: point, to: point, radius: length });

impl Capsule {
    pub(super) fn extent(&self) -> Extent {
        Extent { ends: [self.from, self.to], around: Vec3::splat(self.radius) }
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        let ends = [self.from, self.to].map(|end| (end, self.radius));
        ends.iter().for_each(|&(end, radius)| outline.ball(end, radius));
        outline.tube(ends);
    }
}

impl ShapeGeometry for Capsule<Units> {
    type Distance = CapsuleDistance;

    fn origin(&self) -> [i32; 3] {
        self.from
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let [from, to] = [self.from, self.to].map(IVec3::from_array);
        (from.min(to) - self.radius, from.max(to) + self.radius)
    }

    fn deepest(&self) -> i32 {
        self.radius
    }

    fn volume(&self) -> f64 {
        PI * f64::from(self.radius).powi(2) * measure(difference(self.to, self.from)) + ball(self.radius)
    }

    fn distance(&self) -> CapsuleDistance {
        CapsuleDistance { axis: Axis::of(difference(self.to, self.from)), radius: self.radius as f32 }
    }
}

#[derive(Clone, Debug)]
pub struct CapsuleDistance {
    axis: Axis,
    radius: f32,
}

impl Distance for CapsuleDistance {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let along = smaller(larger(self.axis.along(x, y, z), 0.0), self.axis.length);
        self.axis.off(x, y, z, along) - self.radius
    }

    fn constants(&self) -> Vec<f32> {
        self.axis.constants(&[self.radius])
    }
}
