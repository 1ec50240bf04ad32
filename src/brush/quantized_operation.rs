//! An operation in integers, as edits hold it and as it is written.

use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::blend::{QuantizedBlend, is_full};
use super::error::in_range;
use super::quantized_shape::{check_point, point};
use super::stamp::QuantizedStamp;
use super::{Brush, BrushError, FULL_POWER, Operation};
use crate::ground::MaterialId;
use crate::lattice::{LIMIT, ONE};

/// What an integer normal's length means 1 by.
const UNIT: f64 = 32767.0;

/// Most voxels that a raise or a lower moves the surface.
const AMOUNT: f32 = 64.0;

/// Least and most height of a terrace's steps.
const STEP: (f32, f32) = (1.0, 256.0);

/// An [`Operation`] with its [`Blend`](super::Blend), in integers. Lengths are in 1/256 voxel.
///
/// Written, a deed may be limited in power, but only once: that is a variant which no edit holds.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum QuantizedOperation<L = Never> {
    Dig,
    Add {
        material: MaterialId,
    },
    Paint {
        material: MaterialId,
    },
    Smooth {
        fade: QuantizedBlend,
    },
    Sharpen {
        fade: QuantizedBlend,
    },
    Flatten {
        point: [i32; 3],
        normal: [i16; 3],
        fade: QuantizedBlend,
    },
    Level {
        height: i32,
        fade: QuantizedBlend,
    },
    Raise {
        amount: i32,
        fade: QuantizedBlend,
    },
    Lower {
        amount: i32,
        fade: QuantizedBlend,
    },
    Stamp {
        stamp: QuantizedStamp,
        fade: QuantizedBlend,
    },
    Terrace {
        step: i32,
        base: i32,
        fade: QuantizedBlend,
    },
    /// Only as edits are written: an operation of a brush with less than full power.
    Limited(L),
}

/// A deed as it is written.
pub(super) type WrittenOperation = QuantizedOperation<Limit>;

/// A deed of a brush with less than full power.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Limit {
    power: u8,
    operation: Box<QuantizedOperation>,
}

/// Of this there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(super) enum Never {}

impl<L> QuantizedOperation<L> {
    /// The same deed; the limit, if it has one, becomes another thing.
    fn try_map<M, E>(self, limited: impl FnOnce(L) -> Result<M, E>) -> Result<QuantizedOperation<M>, E> {
        Ok(match self {
            Self::Dig => QuantizedOperation::Dig,
            Self::Add { material } => QuantizedOperation::Add { material },
            Self::Paint { material } => QuantizedOperation::Paint { material },
            Self::Smooth { fade } => QuantizedOperation::Smooth { fade },
            Self::Sharpen { fade } => QuantizedOperation::Sharpen { fade },
            Self::Flatten { point, normal, fade } => QuantizedOperation::Flatten { point, normal, fade },
            Self::Level { height, fade } => QuantizedOperation::Level { height, fade },
            Self::Raise { amount, fade } => QuantizedOperation::Raise { amount, fade },
            Self::Lower { amount, fade } => QuantizedOperation::Lower { amount, fade },
            Self::Stamp { stamp, fade } => QuantizedOperation::Stamp { stamp, fade },
            Self::Terrace { step, base, fade } => QuantizedOperation::Terrace { step, base, fade },
            Self::Limited(limit) => QuantizedOperation::Limited(limited(limit)?),
        })
    }
}

impl WrittenOperation {
    /// The operation and its power.
    pub fn unlimited(self) -> Result<(QuantizedOperation, u8), BrushError> {
        match self {
            Self::Limited(Limit { power: FULL_POWER, .. }) => Err(BrushError::Power),
            Self::Limited(Limit { power, operation }) => Ok((*operation, power)),
            plain => Ok((plain.try_map(|_| Err(BrushError::Power))?, FULL_POWER)),
        }
    }
}

impl QuantizedOperation {
    /// Rounds an operation to integers and checks it.
    pub fn quantize(brush: &Brush) -> Result<Self, BrushError> {
        let fade = || QuantizedBlend::quantize(&brush.blend);
        let height = |what, height| in_range(what, height, -LIMIT as f32, LIMIT as f32);
        Ok(match &brush.operation {
            Operation::Dig => Self::Dig,
            Operation::Add { material } => Self::Add { material: *material },
            Operation::Paint { material } => Self::Paint { material: *material },
            Operation::Smooth => Self::Smooth { fade: fade()? },
            Operation::Sharpen => Self::Sharpen { fade: fade()? },
            Operation::Flatten { point: at, normal } => {
                Self::Flatten { point: point("point", *at)?, normal: direction(*normal)?, fade: fade()? }
            }
            Operation::Level { height: at } => Self::Level { height: height("height", *at)?, fade: fade()? },
            Operation::Raise { amount: by } => Self::Raise { amount: amount(*by)?, fade: fade()? },
            Operation::Lower { amount: by } => Self::Lower { amount: amount(*by)?, fade: fade()? },
            Operation::Stamp(stamp) => Self::Stamp { stamp: QuantizedStamp::quantize(stamp)?, fade: fade()? },
            Operation::Terrace { step, base } => Self::Terrace {
                step: in_range("step", *step, STEP.0, STEP.1)?,
                base: height("base", *base)?,
                fade: fade()?,
            },
        })
    }

    /// Is it within every limit?
    pub fn check(&self) -> Result<(), BrushError> {
        let units = |value: i32| value as f32 / ONE as f32;
        match self {
            Self::Flatten { point, normal, .. } => {
                check_point("point", *point)?;
                let length = length(*normal) / UNIT;
                if (length - 1.0).abs() > 0.01 {
                    return Err(BrushError::ZeroNormal { length: length as f32 });
                }
            }
            Self::Level { height, .. } => check_point("height", [*height, 0, 0])?,
            Self::Raise { amount: by, .. } | Self::Lower { amount: by, .. } => {
                amount(units(*by))?;
            }
            Self::Stamp { stamp, .. } => stamp.check()?,
            Self::Terrace { step, base, .. } => {
                in_range("step", units(*step), STEP.0, STEP.1)?;
                check_point("base", [*base, 0, 0])?;
            }
            _ => {}
        }
        self.fade().map_or(Ok(()), QuantizedBlend::check)
    }

    /// How it fades, if it sculpts.
    pub fn fade(&self) -> Option<QuantizedBlend> {
        match self {
            Self::Dig | Self::Add { .. } | Self::Paint { .. } => None,
            Self::Smooth { fade }
            | Self::Sharpen { fade }
            | Self::Flatten { fade, .. }
            | Self::Level { fade, .. }
            | Self::Raise { fade, .. }
            | Self::Lower { fade, .. }
            | Self::Stamp { fade, .. }
            | Self::Terrace { fade, .. } => Some(*fade),
            Self::Limited(never) => match *never {},
        }
    }

    /// The operation as a brush has it.
    pub fn operation(&self) -> Operation {
        let units = |value: i32| value as f32 / ONE as f32;
        match self {
            Self::Dig => Operation::Dig,
            Self::Add { material } => Operation::Add { material: *material },
            Self::Paint { material } => Operation::Paint { material: *material },
            Self::Smooth { .. } => Operation::Smooth,
            Self::Sharpen { .. } => Operation::Sharpen,
            Self::Flatten { point, normal, .. } => Operation::Flatten {
                point: Vec3::from_array(point.map(units)),
                normal: Vec3::from_array(normal.map(f32::from)).normalize_or(Vec3::Y),
            },
            Self::Level { height, .. } => Operation::Level { height: units(*height) },
            Self::Raise { amount, .. } => Operation::Raise { amount: units(*amount) },
            Self::Lower { amount, .. } => Operation::Lower { amount: units(*amount) },
            Self::Stamp { stamp, .. } => Operation::Stamp(stamp.stamp()),
            Self::Terrace { step, base, .. } => Operation::Terrace { step: units(*step), base: units(*base) },
            Self::Limited(never) => match *never {},
        }
    }

    /// The operation and its power as one, for writing: full power is not written, so that it reads as it always did.
    pub fn limited(self, power: u8) -> WrittenOperation {
        let limit = |operation| QuantizedOperation::Limited(Limit { power, operation: Box::new(operation) });
        if !is_full(power) {
            return limit(self);
        }
        match self.try_map(|never| -> Result<Limit, Never> { match never {} }) {
            Ok(written) => written,
            Err(never) => match never {},
        }
    }
}

fn amount(by: f32) -> Result<i32, BrushError> {
    in_range("amount", by, 0.0, AMOUNT)
}

fn direction(normal: Vec3) -> Result<[i16; 3], BrushError> {
    let parts = normal.to_array();
    if let Some(&value) = parts.iter().find(|value| !value.is_finite()) {
        return Err(BrushError::NotFinite { what: "normal", value });
    }
    let parts = parts.map(f64::from);
    let length = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
    if length < 1e-6 {
        return Err(BrushError::ZeroNormal { length: length as f32 });
    }
    Ok(parts.map(|part| (part / length * UNIT).round_ties_even() as i16))
}

pub(super) fn length(normal: [i16; 3]) -> f64 {
    normal.map(f64::from).iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// How far a lattice point lies from a plane, on the side of its normal, in 1/256 voxel. Needs a normal that is not zero.
pub(super) fn above_plane(at: IVec3, point: [i32; 3], normal: [i16; 3]) -> i32 {
    let from = at.as_i64vec3() * i64::from(ONE) - IVec3::from_array(point).as_i64vec3();
    let along: i64 = from.to_array().iter().zip(normal).map(|(&from, n)| from * i64::from(n)).sum();
    // Both are integers that f64 holds exactly; root, quotient and rounding are exact to the last bit.
    ((along as f64 / length(normal)).round_ties_even() as i64).clamp(-(1 << 25), 1 << 25) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_from_planes_derived_by_hand() {
        for (at, normal, above) in [
            ([0, 7, 0], Vec3::Y, 512),
            ([9, 5, -4], Vec3::Y * 9.0, 0),
            ([3, 5, 0], Vec3::X, 768),
            ([3, 9, 0], Vec3::new(3.0, 4.0, 0.0), 5 * 256),
            ([0, 7, 0], -Vec3::Y, -512),
        ] {
            let normal = direction(normal).unwrap();
            let found = above_plane(IVec3::from_array(at), [0, 5 * 256, 0], normal);
            assert!((found - above).abs() <= 1, "{at:?}: {found} instead of {above}");
        }
    }
}
