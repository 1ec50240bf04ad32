//! From a record to the brush.

use glam::{Quat, Vec3};
use thiserror::Error;

use super::{BrushRecord, OperationName, ShapeName};
use crate::brush::{Blend, Brush, FULL_POWER, Operation, Shape};

/// The fields of a [`Blend`].
const BLEND: [&str; 3] = ["strength", "falloff", "material"];

/// Why a record is no brush.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A field is missing that the shape or operation needs.
    #[error("missing field `{field}`, which `{owner}` needs")]
    Missing {
        /// The shape or operation.
        owner: &'static str,
        /// The missing field.
        field: &'static str,
    },
    /// A field is given that the shape or operation does not have.
    #[error("field `{field}` does not belong to `{owner}`")]
    Foreign {
        /// The shape or operation.
        owner: &'static str,
        /// The field too many.
        field: &'static str,
    },
    /// The image of a stamp does not have as many samples as its sides say, or too many by far.
    #[error("the `image` of `stamp` does not have `width` x `height` samples")]
    Image,
}

impl TryFrom<BrushRecord> for Brush {
    type Error = RecordError;

    fn try_from(record: BrushRecord) -> Result<Self, RecordError> {
        let brush = Self::plain(record.read_shape()?, record.read_operation()?);
        Ok(Self {
            roughness: record.roughness,
            tag: record.tag.unwrap_or(0),
            stroke: record.stroke,
            blend: record.read_blend(brush.blend),
            power: record.power.unwrap_or(FULL_POWER),
            ..brush
        })
    }
}

impl BrushRecord {
    fn read_shape(&self) -> Result<Shape, RecordError> {
        let owner = self.shape.as_str();
        let given = [
            ("center", self.center.is_some()),
            ("half", self.half.is_some()),
            ("rotation", self.rotation.is_some()),
            ("base", self.base.is_some()),
            ("axis", self.axis.is_some()),
            ("from", self.from.is_some()),
            ("to", self.to.is_some()),
            ("radius", self.radius.is_some()),
        ];
        refuse_foreign(owner, &given, |field| self.shape.fields().contains(field))?;
        let vector = |field, value: Option<[f32; 3]>| {
            value.map(Vec3::from_array).ok_or(RecordError::Missing { owner, field })
        };
        let radius = || self.radius.ok_or(RecordError::Missing { owner, field: "radius" });
        Ok(match self.shape {
            ShapeName::Sphere => Shape::sphere(vector("center", self.center)?, radius()?),
            ShapeName::Box => Shape::turned_cuboid(
                vector("center", self.center)?,
                vector("half", self.half)?,
                self.rotation.map_or(Quat::IDENTITY, Quat::from_array),
            ),
            ShapeName::Cylinder => {
                Shape::cylinder(vector("base", self.base)?, vector("axis", self.axis)?, radius()?)
            }
            ShapeName::Capsule => {
                Shape::capsule(vector("from", self.from)?, vector("to", self.to)?, radius()?)
            }
            ShapeName::Cone => Shape::cone(vector("base", self.base)?, vector("axis", self.axis)?, radius()?),
        })
    }

    fn read_operation(&self) -> Result<Operation, RecordError> {
        let owner = self.op.as_str();
        let given = [
            ("material", self.material.is_some()),
            ("strength", self.strength.is_some()),
            ("falloff", self.falloff.is_some()),
            ("point", self.point.is_some()),
            ("normal", self.normal.is_some()),
            ("height", self.height.is_some()),
            ("amount", self.amount.is_some()),
            ("step", self.step.is_some()),
            ("stamp", self.stamp.is_some()),
        ];
        refuse_foreign(owner, &given, |field| {
            self.op.fields().contains(field) || self.op.is_sculpting() && BLEND.contains(field)
        })?;
        let missing = |field| RecordError::Missing { owner, field };
        let vector =
            |field, value: Option<[f32; 3]>| value.map(Vec3::from_array).ok_or_else(|| missing(field));
        let number = |field, value: Option<f32>| value.ok_or_else(|| missing(field));
        let material = || self.material.ok_or_else(|| missing("material"));
        Ok(match self.op {
            OperationName::Dig => Operation::Dig,
            OperationName::Add => Operation::Add { material: material()? },
            OperationName::Paint => Operation::Paint { material: material()? },
            OperationName::Smooth => Operation::Smooth,
            OperationName::Sharpen => Operation::Sharpen,
            OperationName::Flatten => Operation::Flatten {
                point: vector("point", self.point)?,
                normal: vector("normal", self.normal)?,
            },
            OperationName::Level => Operation::Level { height: number("height", self.height)? },
            OperationName::Raise => Operation::Raise { amount: number("amount", self.amount)? },
            OperationName::Lower => Operation::Lower { amount: number("amount", self.amount)? },
            OperationName::Stamp => {
                let stamp = self.stamp.as_ref().ok_or_else(|| missing("stamp"))?;
                Operation::Stamp(stamp.try_into()?)
            }
            OperationName::Terrace => {
                Operation::Terrace { step: number("step", self.step)?, base: self.height.unwrap_or_default() }
            }
        })
    }

    fn read_blend(&self, like: Blend) -> Blend {
        Blend {
            strength: self.strength.unwrap_or(like.strength),
            falloff: self.falloff.unwrap_or(like.falloff),
            material: self.material.filter(|_| self.op.is_sculpting()),
        }
    }
}

/// Refuses a field that is given and does not belong to its shape or operation.
fn refuse_foreign(
    owner: &'static str,
    fields: &[(&'static str, bool)],
    is_own: impl Fn(&&'static str) -> bool,
) -> Result<(), RecordError> {
    match fields.iter().find(|(field, is_given)| *is_given && !is_own(field)) {
        Some(&(field, _)) => Err(RecordError::Foreign { owner, field }),
        None => Ok(()),
    }
}
