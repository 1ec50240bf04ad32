//! Signed Euclidean distances in `f32`, in one written order of exactly rounded operations.
//!
//! Every function takes a point relative to the shape's origin, in 1/256 voxel, and gives the distance in 1/256 voxel,
//! negative inside. All are exact distances to the shape's surface up to rounding, so none changes faster than the
//! point moves. Sums are written `x + (y + z)`, so that along a row of samples the bracket is computed once.

use super::quantized_shape::{QuantizedShape, difference, matrix};

/// A shape's constants.
#[derive(Clone, Debug)]
pub(super) enum Form {
    Sphere(Sphere),
    Cuboid(Cuboid),
    Cylinder(Cylinder),
    Capsule(Capsule),
    Cone(Cone),
}

/// Signed distance to one shape.
pub(super) trait Distance {
    /// Distance of the point (x, y, z).
    fn at(&self, x: f32, y: f32, z: f32) -> f32;
}

impl Form {
    /// The constants of a checked shape.
    pub(super) fn of(solid: &QuantizedShape) -> Self {
        match *solid {
            QuantizedShape::Sphere { radius, .. } => Self::Sphere(Sphere { radius: radius as f32 }),
            QuantizedShape::Cuboid { half, rotation, .. } => {
                let (rows, squared) = matrix(rotation);
                let columns = std::array::from_fn(|i| rows.map(|row| row[i] as f32 / squared as f32));
                Self::Cuboid(Cuboid { columns, half: half.map(|v| v as f32) })
            }
            QuantizedShape::Cylinder { axis, radius, .. } => {
                Self::Cylinder(Cylinder { axis: Axis::of(axis), radius: radius as f32 })
            }
            QuantizedShape::Capsule { from, to, radius } => {
                Self::Capsule(Capsule { axis: Axis::of(difference(to, from)), radius: radius as f32 })
            }
            QuantizedShape::Cone { axis, radius, .. } => {
                let (axis, radius) = (Axis::of(axis), radius as f32);
                let slant = length(axis.length, radius, 0.0);
                let (rise, run) = (axis.length / slant, radius / slant);
                Self::Cone(Cone { axis, radius, slant, rise, run })
            }
        }
    }
}

#[cfg(feature = "cuda")]
impl Form {
    /// Which shape it is, in the order of the variants, and its constants in the order of their fields.
    pub(super) fn constants(&self) -> (u32, [f32; 12]) {
        let mut all = [0.0; 12];
        let mut put = |at: usize, values: &[f32]| {
            all[at..].iter_mut().zip(values).for_each(|(place, value)| *place = *value);
        };
        let kind = match self {
            Self::Sphere(Sphere { radius }) => {
                put(0, &[*radius]);
                0
            }
            Self::Cuboid(Cuboid { columns, half }) => {
                put(0, columns.as_flattened());
                put(9, half);
                1
            }
            Self::Cylinder(Cylinder { axis, radius }) => {
                put(0, &axis.unit);
                put(3, &[axis.length, *radius]);
                2
            }
            Self::Capsule(Capsule { axis, radius }) => {
                put(0, &axis.unit);
                put(3, &[axis.length, *radius]);
                3
            }
            Self::Cone(Cone { axis, radius, slant, rise, run }) => {
                put(0, &axis.unit);
                put(3, &[axis.length, *radius, *slant, *rise, *run]);
                4
            }
        };
        (kind, all)
    }
}

/// A ball around the origin.
#[derive(Clone, Debug)]
pub(super) struct Sphere {
    radius: f32,
}

impl Distance for Sphere {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        length(x, y, z) - self.radius
    }
}

/// A turned box around the origin.
#[derive(Clone, Debug)]
pub(super) struct Cuboid {
    /// The box's own axes in terrain space.
    columns: [[f32; 3]; 3],
    half: [f32; 3],
}

impl Distance for Cuboid {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let [a, b, c] = &self.columns;
        let qx = dot(x, y, z, a).abs() - self.half[0];
        let qy = dot(x, y, z, b).abs() - self.half[1];
        let qz = dot(x, y, z, c).abs() - self.half[2];
        let outside = length(larger(qx, 0.0), larger(qy, 0.0), larger(qz, 0.0));
        outside + smaller(larger(larger(qx, qy), qz), 0.0)
    }
}

/// A cylinder from the origin along its axis.
#[derive(Clone, Debug)]
pub(super) struct Cylinder {
    axis: Axis,
    radius: f32,
}

impl Distance for Cylinder {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let along = self.axis.along(x, y, z);
        let side = self.axis.off(x, y, z, along) - self.radius;
        let half = self.axis.length * 0.5;
        let end = (along - half).abs() - half;
        let outside = length(larger(side, 0.0), larger(end, 0.0), 0.0);
        outside + smaller(larger(side, end), 0.0)
    }
}

/// A capsule from the origin along its axis, which may be zero.
#[derive(Clone, Debug)]
pub(super) struct Capsule {
    axis: Axis,
    radius: f32,
}

impl Distance for Capsule {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let along = smaller(larger(self.axis.along(x, y, z), 0.0), self.axis.length);
        self.axis.off(x, y, z, along) - self.radius
    }
}

/// A cone with the centre of its base in the origin.
///
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
pub(super) struct Cone {
    axis: Axis,
    radius: f32,
    slant: f32,
    rise: f32,
    run: f32,
}

impl Distance for Cone {
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
}

/// A line segment from the origin.
#[derive(Clone, Debug)]
struct Axis {
    /// Direction, of length 1; zero for a segment of length 0.
    unit: [f32; 3],
    length: f32,
}

impl Axis {
    fn of(axis: [i32; 3]) -> Self {
        let squared: i64 = axis.iter().map(|&v| i64::from(v) * i64::from(v)).sum();
        let length = (squared as f32).sqrt();
        Self { unit: axis.map(|v| if squared == 0 { 0.0 } else { v as f32 / length }), length }
    }

    /// Where on the axis the point's foot is.
    #[inline(always)]
    fn along(&self, x: f32, y: f32, z: f32) -> f32 {
        dot(x, y, z, &self.unit)
    }

    /// Distance from the point to the place `along` the axis. The difference of vectors is formed before squaring: a
    /// difference of squares would lose half the digits close to the axis.
    #[inline(always)]
    fn off(&self, x: f32, y: f32, z: f32, along: f32) -> f32 {
        let [ux, uy, uz] = self.unit;
        length(x - along * ux, y - along * uy, z - along * uz)
    }
}

#[inline(always)]
fn length(x: f32, y: f32, z: f32) -> f32 {
    (x * x + (y * y + z * z)).sqrt()
}

#[inline(always)]
fn dot(x: f32, y: f32, z: f32, v: &[f32; 3]) -> f32 {
    x * v[0] + (y * v[1] + z * v[2])
}

/// The larger number, written as the one machine instruction that it is.
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller number.
#[inline(always)]
pub(super) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
