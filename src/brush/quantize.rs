//! From floats to integers, and the limits of both. Lengths are in 1/256 voxel.

use glam::{IVec3, Quat, Vec3};

use super::BrushError;
use crate::lattice::{LIMIT, ONE, REACH};

/// The minimum radius, half side and length of an axis.
const LEAST: i32 = ONE / 4;
/// Longest side of the box around a shape.
pub(super) const LONGEST: i32 = 1024 * ONE;
/// The maximum volume of a shape, in cubic voxels.
const VOLUME: f64 = (1 << 25) as f64;
/// What the components of integer quaternions and directions mean 1 by.
const UNIT: f64 = 32767.0;

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
pub(super) fn disc(axis: [i32; 3], radius: i32) -> IVec3 {
    let along = axis.map(|v| i64::from(v) * i64::from(v));
    let whole: i64 = along.iter().sum();
    let reach = |own: i64| ((whole - own) as f64 / whole as f64).sqrt() * f64::from(radius);
    IVec3::from_array(along.map(|own| reach(own).ceil() as i32))
}

/// How long an arrow is.
pub(super) fn measure(axis: [i32; 3]) -> f64 {
    let squared: f64 = axis.map(f64::from).iter().map(|v| v * v).sum();
    squared.sqrt()
}

pub(super) fn sum(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|i| a[i].saturating_add(b[i]))
}

/// `a - b`; both must have passed [`check_point`].
pub(super) fn difference(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(super) fn voxels(units: i32) -> f32 {
    units as f32 / ONE as f32
}

/// Checks that a shape with this bounding box, and of this volume in cubic voxels, is small enough.
/// The box may have sides up to `longest`.
pub(super) fn check_extent((low, high): (IVec3, IVec3), volume: f64, longest: i32) -> Result<(), BrushError> {
    let side = (high - low).max_element();
    if side > longest {
        return Err(too_large("box", voxels(side), voxels(longest)));
    }
    if volume > VOLUME { Err(too_large("volume", volume as f32, VOLUME as f32)) } else { Ok(()) }
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

/// The largest coordinate along each axis, in voxels.
const MAX: [i32; 3] = [REACH, LIMIT, REACH];

/// Rounds a length of at most a few times [`REACH`] voxels.
fn round(length: f32) -> i32 {
    (length * ONE as f32).round_ties_even() as i32
}

pub(super) fn point(what: &'static str, at: Vec3) -> Result<[i32; 3], BrushError> {
    for (value, most) in at.to_array().into_iter().zip(MAX) {
        if finite(what, value)?.abs() > most as f32 {
            return Err(BrushError::OutOfRange { what, value, most: most as f32 });
        }
    }
    Ok(at.to_array().map(round))
}

/// A move of points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    by: Vec3,
    rounds: bool,
}

impl Shift {
    /// Moves by a vector.
    pub fn by(by: Vec3) -> Self {
        Self { by, rounds: false }
    }

    /// Moves by a vector, into the voxels of a terrain. Points are rounded to the fraction of a voxel that edits have,
    /// and moved by whole voxels only then: so they have the same fraction in all terrains that lie whole voxels apart,
    /// however far that is.
    #[cfg_attr(not(any(test, feature = "plugin")), expect(dead_code))]
    pub fn into_voxels(by: Vec3) -> Self {
        Self { by, rounds: true }
    }

    /// A point after the move.
    pub fn point(self, at: Vec3) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|axis| self.along(at[axis], axis)))
    }

    /// A height after the move.
    pub fn height(self, y: f32) -> f32 {
        self.along(y, 1)
    }

    fn along(self, at: f32, axis: usize) -> f32 {
        let by = self.by[axis];
        if !self.rounds {
            return at + by;
        }
        let whole = by.round();
        let near = at + (by - whole);
        let units = near * ONE as f32;
        // Numbers so large are refused, as they are.
        let rounded = if units.is_finite() { units.round_ties_even() / ONE as f32 } else { near };
        rounded + whole
    }
}

pub(super) fn restored_point(at: [i32; 3]) -> Vec3 {
    Vec3::from_array(at.map(voxels))
}

pub(super) fn check_point(what: &'static str, at: [i32; 3]) -> Result<(), BrushError> {
    match at.into_iter().zip(MAX).find(|(v, most)| v.unsigned_abs() > (most * ONE) as u32) {
        Some((v, most)) => Err(BrushError::OutOfRange { what, value: voxels(v), most: most as f32 }),
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

pub(super) fn arrow(what: &'static str, axis: Vec3) -> Result<[i32; 3], BrushError> {
    for value in axis.to_array() {
        if finite(what, value)?.abs() > voxels(LONGEST) {
            return Err(too_large(what, value, voxels(LONGEST)));
        }
    }
    Ok(axis.to_array().map(round))
}

pub(super) fn check_arrow(what: &'static str, axis: [i32; 3]) -> Result<(), BrushError> {
    if let Some(v) = axis.into_iter().find(|v| v.unsigned_abs() > LONGEST as u32) {
        return Err(too_large(what, voxels(v), voxels(LONGEST)));
    }
    let length = measure(axis);
    if length < f64::from(LEAST) {
        let length = (length / f64::from(ONE)) as f32;
        return Err(BrushError::ZeroAxis { length, least: voxels(LEAST) });
    }
    Ok(())
}

/// A direction of any length but zero, as a unit vector of integers.
pub(super) fn direction(what: &'static str, of: Vec3) -> Result<[i16; 3], BrushError> {
    for value in of.to_array() {
        finite(what, value)?;
    }
    let parts = of.to_array().map(f64::from);
    let length = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
    if length < 1e-6 {
        return Err(BrushError::NoDirection { what, length: length as f32 });
    }
    Ok(parts.map(|part| (part / length * UNIT).round_ties_even() as i16))
}

pub(super) fn check_direction(what: &'static str, of: [i16; 3]) -> Result<(), BrushError> {
    let length = measure(of.map(i32::from)) / UNIT;
    if (length - 1.0).abs() > 0.01 {
        return Err(BrushError::NoDirection { what, length: length as f32 });
    }
    Ok(())
}

pub(super) fn restored_direction(of: [i16; 3]) -> Vec3 {
    Vec3::from_array(of.map(f32::from)).normalize_or(Vec3::Y)
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

pub(super) fn restored_turn(rotation: [i16; 4]) -> Quat {
    Quat::from_array(rotation.map(f32::from)).normalize()
}

/// Returns `true` if the first non-zero component of w, x, y, z is positive. This selects one of q and -q, which mean
/// the same rotation.
fn is_positive([x, y, z, w]: [i16; 4]) -> bool {
    [w, x, y, z].into_iter().find(|&v| v != 0).is_some_and(|v| v > 0)
}

/// A number rounded to 1/256, if it is within its range.
pub(super) fn in_range(what: &'static str, value: f32, least: f32, most: f32) -> Result<i32, BrushError> {
    if !value.is_finite() {
        return Err(BrushError::NotFinite { what, value });
    }
    if value < least || value > most {
        return Err(BrushError::OutOfBounds { what, value, least, most });
    }
    Ok((value * ONE as f32).round_ties_even() as i32)
}
