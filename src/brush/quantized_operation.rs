//! An operation in integers, as edits hold it.

use std::sync::Arc;

use glam::IVec3;
use serde::{Deserialize, Serialize};

use super::content::{Content, ContentMut};
use super::paste::QuantizedPaste;
use super::quantize::{
    check_direction, check_point, direction, in_range, measure, point, restored_direction, restored_point,
    voxels,
};
use super::stamp::QuantizedStamp;
use super::{BrushError, Kind, Operation, Prefab, Rounding};
use crate::ground::{GreyImage, MaterialId};
use crate::lattice::{LIMIT, ONE};

/// The maximum number of voxels that a raise or a lower moves the surface.
const AMOUNT: f32 = 64.0;

/// The minimum and maximum height of a terrace's steps.
const STEP: (f32, f32) = (1.0, 256.0);

/// An [`Operation`] in integers. Lengths are in 1/256 voxel.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum QuantizedOperation {
    Dig,
    Add { material: MaterialId },
    Paint { material: MaterialId },
    Smooth,
    Sharpen,
    Flatten { point: [i32; 3], normal: [i16; 3] },
    Level { height: i32 },
    Raise { amount: i32 },
    Lower { amount: i32 },
    Stamp { stamp: QuantizedStamp },
    Terrace { step: i32, base: i32 },
    Reset,
    Road,
    Paste { paste: QuantizedPaste },
    Fill,
    Carve,
}

impl QuantizedOperation {
    /// Rounds an operation to integers and checks it.
    pub fn quantize(operation: &Operation) -> Result<Self, BrushError> {
        let height = |what, height| in_range(what, height, -LIMIT as f32, LIMIT as f32);
        Ok(match operation {
            Operation::Dig => Self::Dig,
            Operation::Add { material } => Self::Add { material: *material },
            Operation::Paint { material } => Self::Paint { material: *material },
            Operation::Smooth => Self::Smooth,
            Operation::Sharpen => Self::Sharpen,
            Operation::Flatten { point: at, normal } => {
                Self::Flatten { point: point("point", *at)?, normal: direction("normal", *normal)? }
            }
            Operation::Level { height: at } => Self::Level { height: height("height", *at)? },
            Operation::Raise { amount: by } => Self::Raise { amount: amount(*by)? },
            Operation::Lower { amount: by } => Self::Lower { amount: amount(*by)? },
            Operation::Stamp { stamp } => Self::Stamp { stamp: QuantizedStamp::quantize(stamp)? },
            Operation::Terrace { step, base } => {
                Self::Terrace { step: in_range("step", *step, STEP.0, STEP.1)?, base: height("base", *base)? }
            }
            Operation::Reset => Self::Reset,
            Operation::Road => Self::Road,
            Operation::Fill => Self::Fill,
            Operation::Carve => Self::Carve,
            Operation::Paste { paste } => Self::Paste { paste: QuantizedPaste::quantize(paste)? },
        })
    }

    /// Checks every limit.
    pub fn check(&self) -> Result<(), BrushError> {
        match self {
            Self::Flatten { point, normal } => {
                check_point("point", *point)?;
                check_direction("normal", *normal)
            }
            Self::Level { height } => check_point("height", [0, *height, 0]),
            Self::Raise { amount: by } | Self::Lower { amount: by } => amount(voxels(*by)).map(drop),
            Self::Stamp { stamp } => stamp.check(),
            Self::Paste { paste } => paste.check(),
            Self::Terrace { step, base } => {
                in_range("step", voxels(*step), STEP.0, STEP.1)?;
                check_point("base", [0, *base, 0])
            }
            Self::Dig | Self::Add { .. } | Self::Paint { .. } | Self::Fill | Self::Carve => Ok(()),
            Self::Smooth | Self::Sharpen | Self::Reset | Self::Road => Ok(()),
        }
    }

    /// The operation as a brush has it.
    pub fn operation(&self) -> Operation {
        match self {
            Self::Dig => Operation::Dig,
            Self::Add { material } => Operation::Add { material: *material },
            Self::Paint { material } => Operation::Paint { material: *material },
            Self::Smooth => Operation::Smooth,
            Self::Sharpen => Operation::Sharpen,
            Self::Flatten { point, normal } => {
                Operation::Flatten { point: restored_point(*point), normal: restored_direction(*normal) }
            }
            Self::Level { height } => Operation::Level { height: voxels(*height) },
            Self::Raise { amount } => Operation::Raise { amount: voxels(*amount) },
            Self::Lower { amount } => Operation::Lower { amount: voxels(*amount) },
            Self::Stamp { stamp } => Operation::Stamp { stamp: stamp.stamp() },
            Self::Terrace { step, base } => Operation::Terrace { step: voxels(*step), base: voxels(*base) },
            Self::Reset => Operation::Reset,
            Self::Road => Operation::Road,
            Self::Fill => Operation::Fill,
            Self::Carve => Operation::Carve,
            Self::Paste { paste } => Operation::Paste { paste: paste.paste() },
        }
    }

    /// The image of a stamp.
    pub fn stamp_image(&self) -> Option<&Arc<GreyImage>> {
        match self {
            Self::Stamp { stamp } => Some(stamp.image()),
            _ => None,
        }
    }

    /// The image or the prefab that the operation uses.
    pub fn content(&self) -> Option<Content<'_>> {
        match self {
            Self::Stamp { stamp } => Some(Content::Image(stamp.image())),
            Self::Paste { paste } => Some(Content::Prefab(paste.prefab())),
            _ => None,
        }
    }

    /// The place of its image or its prefab. The operation has to be [checked](Self::check) then.
    pub fn content_mut(&mut self) -> Option<ContentMut<'_>> {
        match self {
            Self::Stamp { stamp } => Some(ContentMut::Image(stamp.image_mut())),
            Self::Paste { paste } => Some(ContentMut::Prefab(paste.prefab_mut())),
            _ => None,
        }
    }

    /// What is pasted, and where.
    pub fn paste(&self) -> Option<&QuantizedPaste> {
        if let Self::Paste { paste } = self { Some(paste) } else { None }
    }

    /// The prefab that is pasted.
    pub fn prefab(&self) -> Option<&Arc<Prefab>> {
        self.paste().map(QuantizedPaste::prefab)
    }

    /// How it rounds edges with this falloff, if it does.
    pub fn rounding(&self, falloff: i32) -> Option<Rounding> {
        match self {
            Self::Fill => Some(Rounding { radius: falloff, is_dig: false }),
            Self::Carve => Some(Rounding { radius: falloff, is_dig: true }),
            _ => None,
        }
    }

    /// The kind of its operation.
    pub fn kind(&self) -> Kind {
        match *self {
            Self::Dig => Kind::Dig,
            Self::Add { material } => Kind::Add { material },
            Self::Paint { material } => Kind::Paint { material },
            Self::Reset => Kind::Reset,
            Self::Paste { .. } => Kind::Paste,
            Self::Smooth | Self::Sharpen | Self::Flatten { .. } | Self::Level { .. } => Kind::Sculpt,
            Self::Raise { .. } | Self::Lower { .. } | Self::Stamp { .. } | Self::Terrace { .. } => {
                Kind::Sculpt
            }
            Self::Road | Self::Fill | Self::Carve => Kind::Sculpt,
        }
    }
}

fn amount(by: f32) -> Result<i32, BrushError> {
    in_range("amount", by, 0.0, AMOUNT)
}

/// Distance of a lattice point from a plane, positive on the side of its normal, in 1/256 voxel. Needs a normal that is
/// not zero.
pub(super) fn above_plane(at: IVec3, point: [i32; 3], normal: [i16; 3]) -> i32 {
    let from = at.as_i64vec3() * i64::from(ONE) - IVec3::from_array(point).as_i64vec3();
    let along: i64 = from.to_array().iter().zip(normal).map(|(&from, n)| from * i64::from(n)).sum();
    // Both are integers that f64 holds exactly; root, quotient and rounding are exact to the last bit.
    ((along as f64 / measure(normal.map(i32::from))).round_ties_even() as i64).clamp(-(1 << 25), 1 << 25)
        as i32
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

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
            let normal = direction("normal", normal).unwrap();
            let found = above_plane(IVec3::from_array(at), [0, 5 * 256, 0], normal);
            assert!((found - above).abs() <= 1, "{at:?}: {found} instead of {above}");
        }
    }
}
