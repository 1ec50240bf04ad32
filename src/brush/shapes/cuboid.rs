//! The box, turned any way.

use glam::{IVec3, Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::{Distance, dot, larger, length, smaller};
use super::{Convert, Extent, Kind, Numbers, Outline, Shape, ShapeGeometry, Units, Voxels};
use crate::brush::BrushError;
use crate::brush::quantize::matrix;

/// A box, turned any way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Cuboid<N: Numbers = Voxels> {
    /// The cuboid's middle.
    pub center: N::Vector,
    /// Half its sides, along its own axes.
    pub half: N::Vector,
    /// From its own axes to the terrain's; of length 1. It may be left out in a line of JSON.
    #[serde(default = "N::unturned", skip_serializing_if = "N::may_leave_out")]
    pub rotation: N::Turn,
}

impl Shape {
    /// A box along the terrain's axes; `half` its sides.
    pub const fn cuboid(center: Vec3, half: Vec3) -> Self {
        Self::turned_cuboid(center, half, Quat::IDENTITY)
    }

    /// A box turned by `rotation`.
    pub const fn turned_cuboid(center: Vec3, half: Vec3, rotation: Quat) -> Self {
        Self::Cuboid(Cuboid { center, half, rotation })
    }
}

convert!(Cuboid { center: point, half: sides, rotation: turn });

impl Cuboid {
    pub(super) fn extent(&self) -> Extent {
        let Self { center, half, rotation } = *self;
        let around = if half.is_finite() && rotation.is_normalized() {
            let turn = Mat3::from_quat(rotation);
            turn.x_axis.abs() * half.x + turn.y_axis.abs() * half.y + turn.z_axis.abs() * half.z
        } else {
            Vec3::splat(half.length())
        };
        Extent { ends: [center; 2], around }
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        let corner = |signs: [f32; 3]| self.center + self.rotation * (self.half * Vec3::from_array(signs));
        for (a, b) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            outline.line(corner([-1.0, a, b]), corner([1.0, a, b]));
            outline.line(corner([a, -1.0, b]), corner([a, 1.0, b]));
            outline.line(corner([a, b, -1.0]), corner([a, b, 1.0]));
        }
    }
}

impl ShapeGeometry for Cuboid<Units> {
    type Distance = CuboidDistance;

    fn origin(&self) -> [i32; 3] {
        self.center
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let (rows, squared) = matrix(self.rotation);
        let reach = IVec3::from_array(rows.map(|row| {
            let reach: i64 = (0..3).map(|i| row[i].abs() * i64::from(self.half[i])).sum();
            ((reach + squared - 1) / squared) as i32
        }));
        let center = IVec3::from_array(self.center);
        (center - reach, center + reach)
    }

    fn deepest(&self) -> i32 {
        self.half.into_iter().fold(i32::MAX, i32::min)
    }

    fn volume(&self) -> f64 {
        8.0 * self.half.map(f64::from).iter().product::<f64>()
    }

    fn distance(&self) -> CuboidDistance {
        let (rows, squared) = matrix(self.rotation);
        let columns = std::array::from_fn(|i| rows.map(|row| row[i] as f32 / squared as f32));
        CuboidDistance { columns, half: self.half.map(|v| v as f32) }
    }
}

#[derive(Clone, Debug)]
pub struct CuboidDistance {
    /// The box's own axes in terrain space.
    columns: [[f32; 3]; 3],
    half: [f32; 3],
}

impl Distance for CuboidDistance {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let [a, b, c] = &self.columns;
        let qx = dot(x, y, z, a).abs() - self.half[0];
        let qy = dot(x, y, z, b).abs() - self.half[1];
        let qz = dot(x, y, z, c).abs() - self.half[2];
        let outside = length(larger(qx, 0.0), larger(qy, 0.0), larger(qz, 0.0));
        outside + smaller(larger(larger(qx, qy), qz), 0.0)
    }

    fn constants(&self) -> Vec<f32> {
        [self.columns.as_flattened(), &self.half].concat()
    }
}
