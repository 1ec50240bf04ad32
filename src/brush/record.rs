//! Brushes as one flat JSON object each, for scripts and exports.
//!
//! ```json
//! {"shape":"sphere","center":[8,0,8],"radius":4,"op":"dig"}
//! {"shape":"box","center":[8,0,8],"half":[2,3,2],"rotation":[0,0,0,1],"op":"add","material":3,"tag":7}
//! {"shape":"cone","base":[0,0,0],"axis":[0,9,0],"radius":4,"op":"paint","material":1,
//!  "roughness":{"amplitude":1,"scale":6,"seed":5}}
//! {"shape":"sphere","center":[8,0,8],"radius":6,"op":"flatten","point":[8,0,8],"normal":[0,1,0.2],"falloff":2}
//! {"shape":"sphere","center":[8,0,8],"radius":6,"op":"smooth","strength":0.5}
//! ```

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::stamp::StampRecord;
use super::{Blend, Brush, FULL_POWER, Operation, Roughness, Shape};
use crate::ground::MaterialId;

/// A brush as one flat object. Lengths are in voxels of terrain space.
///
/// | `shape` | its fields |
/// | --- | --- |
/// | `sphere` | `center`, `radius` |
/// | `box` | `center`, `half`, perhaps `rotation` (x, y, z, w) |
/// | `cylinder`, `cone` | `base`, `axis`, `radius` |
/// | `capsule` | `from`, `to`, `radius` |
///
/// | `op` | its fields |
/// | --- | --- |
/// | `dig` | |
/// | `add`, `paint` | `material` |
/// | `smooth`, `sharpen` | |
/// | `flatten` | `point`, `normal` |
/// | `level` | `height` |
/// | `raise`, `lower` | `amount` |
/// | `stamp` | `stamp`: `image` (`width`, `height`, `samples` from 0 to 65535), `center`, `size`, `height`, perhaps `rotation` |
/// | `terrace` | `step`, perhaps `height` (of a tread, else 0) |
///
/// All but the first three may have `strength`, `falloff` and `material`, which are those of a [`Blend`]; `roughness`,
/// `power` and `tag` may be left out. Deserialising refuses fields of any other name, and turning the record into a [`Brush`] refuses those that its shape and operation
/// do not have. The numbers themselves are checked by [`Edit::quantize`](super::Edit::quantize).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the table above says which field is for what")]
pub struct BrushRecord {
    pub shape: ShapeName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f32; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f32>,
    pub op: OperationName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<MaterialId>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness: Option<Roughness>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tag: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amount: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp: Option<StampRecord>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub falloff: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<u8>,
}

/// Name of a [`Shape`] in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeName {
    /// [`Shape::Sphere`].
    Sphere,
    /// [`Shape::Cuboid`].
    Box,
    /// [`Shape::Cylinder`].
    Cylinder,
    /// [`Shape::Capsule`].
    Capsule,
    /// [`Shape::Cone`].
    Cone,
}

/// Name of an [`Operation`] in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperationName {
    /// [`Operation::Dig`].
    Dig,
    /// [`Operation::Add`].
    Add,
    /// [`Operation::Paint`].
    Paint,
    /// [`Operation::Smooth`].
    Smooth,
    /// [`Operation::Sharpen`].
    Sharpen,
    /// [`Operation::Flatten`].
    Flatten,
    /// [`Operation::Level`].
    Level,
    /// [`Operation::Raise`].
    Raise,
    /// [`Operation::Lower`].
    Lower,
    /// [`Operation::Stamp`].
    Stamp,
    /// [`Operation::Terrace`].
    Terrace,
}

impl OperationName {
    fn as_str(self) -> &'static str {
        match self {
            Self::Dig => "dig",
            Self::Add => "add",
            Self::Paint => "paint",
            Self::Smooth => "smooth",
            Self::Sharpen => "sharpen",
            Self::Flatten => "flatten",
            Self::Level => "level",
            Self::Raise => "raise",
            Self::Lower => "lower",
            Self::Stamp => "stamp",
            Self::Terrace => "terrace",
        }
    }

    /// The fields that the operation may have, beside those that all may have which sculpt.
    fn fields(self) -> &'static [&'static str] {
        match self {
            Self::Dig | Self::Smooth | Self::Sharpen => &[],
            Self::Add | Self::Paint => &["material"],
            Self::Flatten => &["point", "normal"],
            Self::Level => &["height"],
            Self::Raise | Self::Lower => &["amount"],
            Self::Stamp => &["stamp"],
            Self::Terrace => &["step", "height"],
        }
    }

    fn is_sculpting(self) -> bool {
        !matches!(self, Self::Dig | Self::Add | Self::Paint)
    }
}

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

impl ShapeName {
    fn as_str(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Box => "box",
            Self::Cylinder => "cylinder",
            Self::Capsule => "capsule",
            Self::Cone => "cone",
        }
    }

    /// The fields that the shape may have.
    fn fields(self) -> &'static [&'static str] {
        match self {
            Self::Sphere => &["center", "radius"],
            Self::Box => &["center", "half", "rotation"],
            Self::Cylinder | Self::Cone => &["base", "axis", "radius"],
            Self::Capsule => &["from", "to", "radius"],
        }
    }
}

impl BrushRecord {
    fn empty(shape: ShapeName, op: OperationName) -> Self {
        Self {
            shape,
            center: None,
            half: None,
            rotation: None,
            base: None,
            axis: None,
            from: None,
            to: None,
            radius: None,
            op,
            material: None,
            roughness: None,
            tag: None,
            point: None,
            normal: None,
            height: None,
            amount: None,
            step: None,
            stamp: None,
            strength: None,
            falloff: None,
            power: None,
        }
    }

    fn read_shape(&self) -> Result<Shape, RecordError> {
        let owner = self.shape.as_str();
        for (field, is_given) in [
            ("center", self.center.is_some()),
            ("half", self.half.is_some()),
            ("rotation", self.rotation.is_some()),
            ("base", self.base.is_some()),
            ("axis", self.axis.is_some()),
            ("from", self.from.is_some()),
            ("to", self.to.is_some()),
            ("radius", self.radius.is_some()),
        ] {
            if is_given && !self.shape.fields().contains(&field) {
                return Err(RecordError::Foreign { owner, field });
            }
        }
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
        for (field, is_given) in [
            ("material", self.material.is_some()),
            ("strength", self.strength.is_some()),
            ("falloff", self.falloff.is_some()),
            ("point", self.point.is_some()),
            ("normal", self.normal.is_some()),
            ("height", self.height.is_some()),
            ("amount", self.amount.is_some()),
            ("step", self.step.is_some()),
            ("stamp", self.stamp.is_some()),
        ] {
            let is_own =
                self.op.fields().contains(&field) || self.op.is_sculpting() && BLEND.contains(&field);
            if is_given && !is_own {
                return Err(RecordError::Foreign { owner, field });
            }
        }
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
                Operation::Stamp(stamp.stamp().ok_or(RecordError::Image)?)
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

impl TryFrom<BrushRecord> for Brush {
    type Error = RecordError;

    fn try_from(record: BrushRecord) -> Result<Self, RecordError> {
        let brush = Self::plain(record.read_shape()?, record.read_operation()?);
        Ok(Self {
            roughness: record.roughness,
            tag: record.tag.unwrap_or(0),
            blend: record.read_blend(brush.blend),
            power: record.power.unwrap_or(FULL_POWER),
            ..brush
        })
    }
}

impl From<&Brush> for BrushRecord {
    fn from(brush: &Brush) -> Self {
        let vector = |v: Vec3| Some(v.to_array());
        let of = |op| Self::empty(ShapeName::Sphere, op);
        let record = match &brush.operation {
            Operation::Dig => of(OperationName::Dig),
            Operation::Add { material } => Self { material: Some(*material), ..of(OperationName::Add) },
            Operation::Paint { material } => Self { material: Some(*material), ..of(OperationName::Paint) },
            Operation::Smooth => of(OperationName::Smooth),
            Operation::Sharpen => of(OperationName::Sharpen),
            Operation::Flatten { point, normal } => {
                Self { point: vector(*point), normal: vector(*normal), ..of(OperationName::Flatten) }
            }
            Operation::Level { height } => Self { height: Some(*height), ..of(OperationName::Level) },
            Operation::Raise { amount } => Self { amount: Some(*amount), ..of(OperationName::Raise) },
            Operation::Lower { amount } => Self { amount: Some(*amount), ..of(OperationName::Lower) },
            Operation::Stamp(stamp) => Self { stamp: Some(stamp.into()), ..of(OperationName::Stamp) },
            Operation::Terrace { step, base } => Self {
                step: Some(*step),
                height: (*base != 0.0).then_some(*base),
                ..of(OperationName::Terrace)
            },
        };
        let record = if brush.operation.is_sculpting() {
            let like = Brush::plain(brush.shape, brush.operation.clone()).blend;
            Self {
                strength: (brush.blend.strength != like.strength).then_some(brush.blend.strength),
                falloff: (brush.blend.falloff != like.falloff).then_some(brush.blend.falloff),
                material: brush.blend.material,
                ..record
            }
        } else {
            record
        };
        let shaped = |shape| Self { shape, ..record.clone() };
        let record = match brush.shape {
            Shape::Sphere { center, radius } => {
                Self { center: vector(center), radius: Some(radius), ..shaped(ShapeName::Sphere) }
            }
            Shape::Cuboid { center, half, rotation } => {
                let rotation = (rotation != Quat::IDENTITY).then(|| rotation.to_array());
                Self { center: vector(center), half: vector(half), rotation, ..shaped(ShapeName::Box) }
            }
            Shape::Cylinder { base, axis, radius } => Self {
                base: vector(base),
                axis: vector(axis),
                radius: Some(radius),
                ..shaped(ShapeName::Cylinder)
            },
            Shape::Capsule { from, to, radius } => Self {
                from: vector(from),
                to: vector(to),
                radius: Some(radius),
                ..shaped(ShapeName::Capsule)
            },
            Shape::Cone { base, axis, radius } => Self {
                base: vector(base),
                axis: vector(axis),
                radius: Some(radius),
                ..shaped(ShapeName::Cone)
            },
        };
        Self {
            roughness: brush.roughness,
            tag: (brush.tag != 0).then_some(brush.tag),
            power: (brush.power != FULL_POWER).then_some(brush.power),
            ..record
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::brush::Stamp;
    use crate::ground::GreyImage;

    fn parse(json: &str) -> Result<Brush, String> {
        let record: BrushRecord = serde_json::from_str(json).map_err(|error| error.to_string())?;
        Brush::try_from(record).map_err(|error| error.to_string())
    }

    #[test]
    fn every_shape_comes_back_from_its_line() {
        let (a, b) = (Vec3::new(1.5, -2.0, 0.1), Vec3::new(0.0, 7.25, 3.0));
        let image = GreyImage::from_samples(3, 2, vec![0, 1, 700, 65535, 4, 5]).unwrap();
        let stamp = Stamp::new(image, b, Vec2::new(4.0, 6.5), -2.0);
        for shape in [
            Shape::sphere(a, 4.1),
            Shape::cuboid(a, b),
            Shape::turned_cuboid(a, b, Quat::from_rotation_x(0.7)),
            Shape::cylinder(a, b, 2.0),
            Shape::capsule(a, b, 2.0),
            Shape::cone(a, b, 2.0),
        ] {
            for brush in [
                Brush::dig(shape),
                Brush::add(shape, MaterialId(255)).with_tag(u64::MAX),
                Brush::paint(shape, MaterialId(0)).with_roughness(Roughness::new(0.3, 5.0, u32::MAX)),
                Brush::smooth(shape, 0.25).with_power(3),
                Brush::sharpen(shape, 1.0).with_falloff(0.0),
                Brush::flatten(shape, a, b).with_material(MaterialId(4)),
                Brush::level(shape, -3.5).with_strength(0.1),
                Brush::raise(shape, 2.0).with_tag(3),
                Brush::lower(shape, 0.125),
                Brush::terrace(shape, 2.5),
                Brush {
                    operation: Operation::Terrace { step: 3.0, base: 1.5 },
                    ..Brush::terrace(shape, 3.0)
                },
                Brush::stamp(shape, stamp.clone()),
                Brush::stamp(shape, stamp.clone().onto(Vec3::X)).with_falloff(4.0),
            ] {
                let line = serde_json::to_string(&BrushRecord::from(&brush)).unwrap();
                assert_eq!(parse(&line).unwrap(), brush, "{line}");
            }
        }
    }

    #[test]
    fn the_written_form_is_the_documented_one() {
        let line = r#"{"shape":"sphere","center":[8.0,0.0,8.0],"radius":4.0,"op":"dig"}"#;
        let brush = Brush::dig(Shape::sphere(Vec3::new(8.0, 0.0, 8.0), 4.0));
        assert_eq!(serde_json::to_string(&BrushRecord::from(&brush)).unwrap(), line);
        assert_eq!(parse(r#"{"op":"dig","radius":4,"center":[8,0,8],"shape":"sphere"}"#).unwrap(), brush);
    }

    #[test]
    fn mistakes_are_named() {
        for (json, message) in [
            (
                r#"{"shape":"sphere","center":[0,0,0],"op":"dig"}"#,
                "missing field `radius`, which `sphere` needs",
            ),
            (r#"{"shape":"box","center":[0,0,0],"op":"dig"}"#, "missing field `half`, which `box` needs"),
            (
                r#"{"shape":"box","center":[0,0,0],"half":[1,1,1],"radius":1,"op":"dig"}"#,
                "field `radius` does not belong to `box`",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"add"}"#,
                "missing field `material`, which `add` needs",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"dig","material":1}"#,
                "field `material` does not belong to `dig`",
            ),
            (r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"add","material":300}"#, "300"),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"dig","strength":1}"#,
                "field `strength` does not belong to `dig`",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"level","amount":1}"#,
                "field `amount` does not belong to `level`",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"flatten","point":[0,0,0]}"#,
                "missing field `normal`, which `flatten` needs",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"stamp","stamp":{"center":[0,0,0],"size":[2,2],"height":1,"image":{"width":3,"height":3,"samples":[1,2]}}}"#,
                "does not have `width` x `height` samples",
            ),
            (r#"{"shape":"sphere","center":[0,0,0],"radius":1}"#, "missing field `op`"),
            (r#"{"center":[0,0,0],"radius":1,"op":"dig"}"#, "missing field `shape`"),
            (r#"{"shape":"sphere","center":[0,0,0],"radios":1,"op":"dig"}"#, "unknown field `radios`"),
            (r#"{"shape":"ball","op":"dig"}"#, "unknown variant `ball`"),
            (r#"{"shape":"sphere","center":[0,0],"radius":1,"op":"dig"}"#, "length 2"),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"dig","roughness":{"amplitude":1,"scale":2}}"#,
                "missing field `seed`",
            ),
        ] {
            let error = parse(json).unwrap_err();
            assert!(error.contains(message), "{json}: {error}");
        }
    }
}
