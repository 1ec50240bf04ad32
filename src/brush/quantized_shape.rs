//! Shapes in integers: quantisation, limits, bounds. All lengths are in 1/256 voxel.

use glam::{IVec3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::{BrushError, Shape};
use crate::lattice::{LIMIT, ONE};

/// Least radius, half side and axis.
const LEAST: i32 = ONE / 4;
/// Longest side of the box around a shape.
const LONGEST: i32 = 1024 * ONE;
/// Most volume of a shape, in cubic voxels.
const VOLUME: f64 = (1 << 25) as f64;
/// What an integer quaternion's components mean 1 by.
const UNIT: f64 = 32767.0;

/// A [`Shape`] in integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum QuantizedShape {
    Sphere { center: [i32; 3], radius: i32 },
    Cuboid { center: [i32; 3], half: [i32; 3], rotation: [i16; 4] },
    Cylinder { base: [i32; 3], axis: [i32; 3], radius: i32 },
    Capsule { from: [i32; 3], to: [i32; 3], radius: i32 },
    Cone { base: [i32; 3], axis: [i32; 3], radius: i32 },
}

impl QuantizedShape {
    /// Rounds a shape to integers, halves to even, and checks it.
    pub(super) fn quantize(shape: &Shape) -> Result<Self, BrushError> {
        let solid = match *shape {
            Shape::Sphere { center, radius } => {
                Self::Sphere { center: point("center", center)?, radius: size("radius", radius)? }
            }
            Shape::Cuboid { center, half, rotation } => Self::Cuboid {
                center: point("center", center)?,
                half: [size("half", half.x)?, size("half", half.y)?, size("half", half.z)?],
                rotation: turn(rotation)?,
            },
            Shape::Cylinder { base, axis, radius } => Self::Cylinder {
                base: point("base", base)?,
                axis: arrow(axis)?,
                radius: size("radius", radius)?,
            },
            Shape::Capsule { from, to, radius } => Self::Capsule {
                from: point("from", from)?,
                to: point("to", to)?,
                radius: size("radius", radius)?,
            },
            Shape::Cone { base, axis, radius } => {
                Self::Cone { base: point("base", base)?, axis: arrow(axis)?, radius: size("radius", radius)? }
            }
        };
        solid.check()?;
        Ok(solid)
    }

    /// The shape as a brush has it.
    pub(super) fn shape(&self) -> Shape {
        let vector = |v: [i32; 3]| Vec3::from_array(v.map(voxels));
        match *self {
            Self::Sphere { center, radius } => Shape::sphere(vector(center), voxels(radius)),
            Self::Cuboid { center, half, rotation } => {
                let rotation = Quat::from_array(rotation.map(f32::from)).normalize();
                Shape::turned_cuboid(vector(center), vector(half), rotation)
            }
            Self::Cylinder { base, axis, radius } => {
                Shape::cylinder(vector(base), vector(axis), voxels(radius))
            }
            Self::Capsule { from, to, radius } => Shape::capsule(vector(from), vector(to), voxels(radius)),
            Self::Cone { base, axis, radius } => Shape::cone(vector(base), vector(axis), voxels(radius)),
        }
    }

    /// Is the shape within every limit? Any integers may be asked about; all else here relies on it.
    pub(super) fn check(&self) -> Result<(), BrushError> {
        match *self {
            Self::Sphere { center, radius } => {
                check_point("center", center)?;
                check_size("radius", radius)?;
            }
            Self::Cuboid { center, half, rotation } => {
                check_point("center", center)?;
                half.into_iter().try_for_each(|side| check_size("half", side))?;
                check_turn(rotation)?;
            }
            Self::Cylinder { base, axis, radius } | Self::Cone { base, axis, radius } => {
                check_point("base", base)?;
                check_arrow(axis)?;
                check_point("end", sum(base, axis))?;
                check_size("radius", radius)?;
            }
            Self::Capsule { from, to, radius } => {
                check_point("from", from)?;
                check_point("to", to)?;
                check_size("radius", radius)?;
            }
        }
        let (low, high) = self.bounds();
        let side = (high - low).max_element();
        if side > LONGEST {
            return Err(too_large("box", voxels(side), voxels(LONGEST)));
        }
        let volume = self.volume();
        if volume > VOLUME { Err(too_large("volume", volume as f32, VOLUME as f32)) } else { Ok(()) }
    }

    /// The point that distances are computed relative to.
    pub(super) fn origin(&self) -> IVec3 {
        let (Self::Sphere { center: origin, .. }
        | Self::Cuboid { center: origin, .. }
        | Self::Cylinder { base: origin, .. }
        | Self::Capsule { from: origin, .. }
        | Self::Cone { base: origin, .. }) = *self;
        IVec3::from_array(origin)
    }

    /// Lowest and highest corner of a box around the shape, at most 1 too wide on each side.
    pub(super) fn bounds(&self) -> (IVec3, IVec3) {
        let origin = self.origin();
        let ball = |center: IVec3, radius: i32| (center - radius, center + radius);
        match *self {
            Self::Sphere { radius, .. } => ball(origin, radius),
            Self::Cuboid { half, rotation, .. } => {
                let (rows, squared) = matrix(rotation);
                let reach = IVec3::from_array(rows.map(|row| {
                    let reach: i64 = (0..3).map(|i| row[i].abs() * i64::from(half[i])).sum();
                    ((reach + squared - 1) / squared) as i32
                }));
                (origin - reach, origin + reach)
            }
            Self::Cylinder { axis, radius, .. } => {
                let (disc, end) = (disc(axis, radius), origin + IVec3::from_array(axis));
                (origin.min(end) - disc, origin.max(end) + disc)
            }
            Self::Capsule { to, radius, .. } => {
                let to = IVec3::from_array(to);
                (origin.min(to) - radius, origin.max(to) + radius)
            }
            Self::Cone { axis, radius, .. } => {
                let (disc, apex) = (disc(axis, radius), origin + IVec3::from_array(axis));
                ((origin - disc).min(apex), (origin + disc).max(apex))
            }
        }
    }

    /// How deep inside the shape its middle lies, rounded down: at least 1.
    pub(super) fn deepest(&self) -> i32 {
        let deepest = match *self {
            Self::Sphere { radius, .. } | Self::Capsule { radius, .. } => radius,
            Self::Cuboid { half, .. } => half.into_iter().fold(i32::MAX, i32::min),
            Self::Cylinder { axis, radius, .. } => radius.min((length(axis) / 2.0) as i32),
            Self::Cone { axis, radius, .. } => {
                let (height, radius) = (length(axis), f64::from(radius));
                let slant = (height * height + radius * radius).sqrt();
                (radius * height / (radius + slant)) as i32
            }
        };
        deepest.max(1)
    }

    /// Volume in cubic voxels.
    fn volume(&self) -> f64 {
        use std::f64::consts::PI;
        let volume = match *self {
            Self::Sphere { radius, .. } => ball(radius),
            Self::Cuboid { half, .. } => 8.0 * half.map(f64::from).iter().product::<f64>(),
            Self::Cylinder { axis, radius, .. } => PI * square(radius) * length(axis),
            Self::Capsule { from, to, radius } => {
                let between = difference(to, from);
                PI * square(radius) * length(between) + ball(radius)
            }
            Self::Cone { axis, radius, .. } => PI / 3.0 * square(radius) * length(axis),
        };
        return volume / f64::from(ONE * ONE * ONE);

        fn square(v: i32) -> f64 {
            f64::from(v) * f64::from(v)
        }
        fn ball(radius: i32) -> f64 {
            PI * 4.0 / 3.0 * square(radius) * f64::from(radius)
        }
    }
}

/// The rotation matrix of an integer quaternion as exact integers, by rows, and what to divide them by.
pub(super) fn matrix([x, y, z, w]: [i16; 4]) -> ([[i64; 3]; 3], i64) {
    let [x, y, z, w] = [x, y, z, w].map(i64::from);
    let (xx, yy, zz, ww) = (x * x, y * y, z * z, w * w);
    let rows = [
        [ww + xx - yy - zz, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), ww - xx + yy - zz, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), ww - xx - yy + zz],
    ];
    (rows, xx + yy + zz + ww)
}

/// Half the sides of a box around a disc across `axis`. Needs an axis that is not zero.
fn disc(axis: [i32; 3], radius: i32) -> IVec3 {
    let along = axis.map(|v| i64::from(v) * i64::from(v));
    let whole: i64 = along.iter().sum();
    let reach = |own: i64| ((whole - own) as f64 / whole as f64).sqrt() * f64::from(radius);
    IVec3::from_array(along.map(|own| reach(own).ceil() as i32))
}

fn length(axis: [i32; 3]) -> f64 {
    let squared: f64 = axis.map(f64::from).iter().map(|v| v * v).sum();
    squared.sqrt()
}

fn sum(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|i| a[i].saturating_add(b[i]))
}

/// `a - b`; both must have passed [`check_point`].
pub(super) fn difference(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn voxels(units: i32) -> f32 {
    units as f32 / ONE as f32
}

fn too_large(what: &'static str, value: f32, most: f32) -> BrushError {
    BrushError::TooLarge { what, value, most }
}

fn too_small(what: &'static str, value: f32) -> BrushError {
    BrushError::TooSmall { what, value, least: voxels(LEAST) }
}

fn finite(what: &'static str, value: f32) -> Result<f32, BrushError> {
    if value.is_finite() { Ok(value) } else { Err(BrushError::NotFinite { what, value }) }
}

/// Rounds a length of at most a few times [`LIMIT`] voxels.
fn round(length: f32) -> i32 {
    (length * ONE as f32).round_ties_even() as i32
}

pub(super) fn point(what: &'static str, at: Vec3) -> Result<[i32; 3], BrushError> {
    for value in at.to_array() {
        if finite(what, value)?.abs() > LIMIT as f32 {
            return Err(BrushError::OutOfRange { what, value, most: LIMIT as f32 });
        }
    }
    Ok(at.to_array().map(round))
}

pub(super) fn check_point(what: &'static str, at: [i32; 3]) -> Result<(), BrushError> {
    match at.into_iter().find(|v| v.unsigned_abs() > (LIMIT * ONE) as u32) {
        Some(v) => Err(BrushError::OutOfRange { what, value: voxels(v), most: LIMIT as f32 }),
        None => Ok(()),
    }
}

pub(super) fn size(what: &'static str, value: f32) -> Result<i32, BrushError> {
    if finite(what, value)? > voxels(LONGEST) {
        return Err(too_large(what, value, voxels(LONGEST)));
    }
    if value < 0.0 || round(value) < LEAST { Err(too_small(what, value)) } else { Ok(round(value)) }
}

pub(super) fn check_size(what: &'static str, value: i32) -> Result<(), BrushError> {
    if value > LONGEST {
        return Err(too_large(what, voxels(value), voxels(LONGEST)));
    }
    if value < LEAST { Err(too_small(what, voxels(value))) } else { Ok(()) }
}

fn arrow(axis: Vec3) -> Result<[i32; 3], BrushError> {
    for value in axis.to_array() {
        if finite("axis", value)?.abs() > voxels(LONGEST) {
            return Err(too_large("axis", value, voxels(LONGEST)));
        }
    }
    Ok(axis.to_array().map(round))
}

fn check_arrow(axis: [i32; 3]) -> Result<(), BrushError> {
    if let Some(v) = axis.into_iter().find(|v| v.unsigned_abs() > LONGEST as u32) {
        return Err(too_large("axis", voxels(v), voxels(LONGEST)));
    }
    let length = length(axis);
    if length < f64::from(LEAST) {
        let length = (length / f64::from(ONE)) as f32;
        return Err(BrushError::ZeroAxis { length, least: voxels(LEAST) });
    }
    Ok(())
}

pub(super) fn turn(rotation: Quat) -> Result<[i16; 4], BrushError> {
    for value in rotation.to_array() {
        finite("rotation", value)?;
    }
    let parts = rotation.to_array().map(f64::from);
    let length = parts.iter().map(|v| v * v).sum::<f64>().sqrt();
    if (length - 1.0).abs() > 0.01 {
        return Err(BrushError::ZeroRotation { length: length as f32 });
    }
    let parts = parts.map(|v| (v / length * UNIT).round_ties_even() as i16);
    Ok(if is_positive(parts) { parts } else { parts.map(|v| v.saturating_neg()) })
}

pub(super) fn check_turn(rotation: [i16; 4]) -> Result<(), BrushError> {
    let length = rotation.map(f64::from).iter().map(|v| v * v).sum::<f64>().sqrt() / UNIT;
    if (length - 1.0).abs() > 0.01 {
        return Err(BrushError::ZeroRotation { length: length as f32 });
    }
    if is_positive(rotation) { Ok(()) } else { Err(BrushError::RotationSign { rotation }) }
}

/// Is the first non-zero component of w, x, y, z positive? Of q and -q, which mean one rotation, one is.
fn is_positive([x, y, z, w]: [i16; 4]) -> bool {
    [w, x, y, z].into_iter().find(|&v| v != 0).is_some_and(|v| v > 0)
}

#[cfg(test)]
mod tests {
    use super::super::distance::{Distance, Form};
    use super::*;

    fn depth(form: &Form, at: Vec3) -> f32 {
        let [x, y, z] = at.to_array();
        -match form {
            Form::Sphere(form) => form.at(x, y, z),
            Form::Cuboid(form) => form.at(x, y, z),
            Form::Cylinder(form) => form.at(x, y, z),
            Form::Capsule(form) => form.at(x, y, z),
            Form::Cone(form) => form.at(x, y, z),
        }
    }

    /// The greatest depth, by trying places in a box that closes in on the best of them.
    fn deepest_by_trying(solid: &QuantizedShape) -> f32 {
        let (form, origin, (low, high)) = (Form::of(solid), solid.origin(), solid.bounds());
        let mut middle = (low + high).as_vec3() / 2.0 - origin.as_vec3();
        let (mut half, mut best) = ((high - low).as_vec3() / 2.0, f32::MIN);
        for _ in 0..60 {
            let around = middle;
            for i in 0..11 * 11 * 11 {
                let step = IVec3::new(i % 11, i / 11 % 11, i / 121).as_vec3() / 5.0 - 1.0;
                let at = around + step * half;
                if depth(&form, at) > best {
                    (middle, best) = (at, depth(&form, at));
                }
            }
            half *= 0.8;
        }
        best
    }

    #[test]
    fn the_middle_is_as_deep_as_it_is_said_to_be() {
        let base = Vec3::new(-3.3, 100.7, 8.05);
        for shape in [
            Shape::sphere(base, 7.77),
            Shape::turned_cuboid(base, Vec3::new(5.0, 9.1, 3.6), Quat::from_xyzw(0.36, -0.48, 0.64, 0.48)),
            Shape::capsule(base, base + Vec3::new(9.0, 2.0, -3.0), 3.9),
            // A pole and a disc.
            Shape::cylinder(base, Vec3::new(5.5, -9.25, 17.125), 4.4),
            Shape::cylinder(base, Vec3::new(1.0, 2.5, -0.5), 9.0),
            // A needle, a tent and a lid.
            Shape::cone(base, Vec3::new(1.0, 21.0, -3.0), 2.5),
            Shape::cone(base, Vec3::new(5.0, -9.0, 7.0), 11.5),
            Shape::cone(base, Vec3::new(0.5, 2.0, 0.0), 12.0),
        ] {
            let solid = QuantizedShape::quantize(&shape).unwrap();
            let (said, found) = (solid.deepest() as f32, deepest_by_trying(&solid));
            // Rounded down.
            assert!((-0.2..1.2).contains(&(found - said)), "{shape:?}: {said} said, {found} found");
        }
    }
}
