//! The cone with its base disc.

use std::f64::consts::PI;

use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::{Axis, Distance, larger, length, smaller};
use super::{Convert, Extent, Kind, Numbers, Outline, Shape, ShapeGeometry, Units, Voxels};
use crate::brush::BrushError;
use crate::brush::quantize::{check_point, disc, measure, sum};

/// A cone with its base disc.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Cone<N: Numbers = Voxels> {
    /// Centre of the base disc.
    pub base: N::Vector,
    /// From there to the apex.
    pub axis: N::Vector,
    /// Radius of the base disc.
    pub radius: N::Length,
}

impl Shape {
    /// A cone from the disc around `base` to the apex `base + axis`.
    pub const fn cone(base: Vec3, axis: Vec3, radius: f32) -> Self {
        Self::Cone(Cone { base, axis, radius })
    }
}

convert!(Cone { base: point, axis: arrow, radius: length });

impl Cone {
    pub(super) fn extent(&self) -> Extent {
        Extent { ends: [self.base, self.base + self.axis], around: Vec3::splat(self.radius) }
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        outline.tube([(self.base, self.radius), (self.base + self.axis, 0.0)]);
    }
}

impl ShapeGeometry for Cone<Units> {
    type Distance = ConeDistance;

    fn origin(&self) -> [i32; 3] {
        self.base
    }

    fn check(&self) -> Result<(), BrushError> {
        check_point("end", sum(self.base, self.axis))
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let (base, disc) = (IVec3::from_array(self.base), disc(self.axis, self.radius));
        let apex = base + IVec3::from_array(self.axis);
        ((base - disc).min(apex), (base + disc).max(apex))
    }

    fn deepest(&self) -> i32 {
        let (height, radius) = (measure(self.axis), f64::from(self.radius));
        let slant = (height * height + radius * radius).sqrt();
        (radius * height / (radius + slant)) as i32
    }

    fn volume(&self) -> f64 {
        PI / 3.0 * f64::from(self.radius).powi(2) * measure(self.axis)
    }

    fn distance(&self) -> ConeDistance {
        let (axis, radius) = (Axis::of(self.axis), self.radius as f32);
        let slant = length(axis.length, radius, 0.0);
        let (rise, run) = (axis.length / slant, radius / slant);
        ConeDistance { axis, radius, slant, rise, run }
    }
}

/// ```text
///   along
///     ^ apex
///     |\            slant: length of the side
///     | \  rise = length / slant, run = radius / slant:
///     |  \          (rise, run) is the side's outward normal
///     o---+-> off
///       radius
/// ```
#[derive(Clone, Debug)]
pub struct ConeDistance {
    axis: Axis,
    radius: f32,
    slant: f32,
    rise: f32,
    run: f32,
}

impl Distance for ConeDistance {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let along = self.axis.along(x, y, z);
        let beyond = self.axis.off(x, y, z, along) - self.radius;
        // Over the side's line, and how far that point is past either end of the side.
        let over = beyond * self.rise + along * self.run;
        let up = along * self.rise - beyond * self.run;
        let past = up - smaller(larger(up, 0.0), self.slant);
        let to_side = over * over + past * past;
        let rim = larger(beyond, 0.0);
        let to_base = rim * rim + along * along;
        let outside = smaller(to_side, to_base).sqrt();
        let inside = larger(over, -along);
        if inside < 0.0 { inside } else { outside }
    }

    fn constants(&self) -> Vec<f32> {
        self.axis.constants(&[self.radius, self.slant, self.rise, self.run])
    }
}
