//! Brushes as one flat JSON object each, for scripts and exports.
//!
//! ```json
//! {"shape":"sphere","center":[8,0,8],"radius":4,"op":"dig"}
//! {"shape":"box","center":[8,0,8],"half":[2,3,2],"rotation":[0,0,0,1],"op":"add","material":3,"tag":7}
//! {"shape":"cone","base":[0,0,0],"axis":[0,9,0],"radius":4,"op":"paint","material":1,
//!  "roughness":{"amplitude":1,"scale":6,"seed":5}}
//! ```

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Brush, Operation, Roughness, Shape};
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
/// `op` is `dig`, `add` or `paint`, the latter two with `material`; `roughness` and `tag` may be left out. Deserialising
/// refuses fields of any other name, and turning the record into a [`Brush`] refuses those that its shape and operation
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
}

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
        let material = |owner| self.material.ok_or(RecordError::Missing { owner, field: "material" });
        match self.op {
            OperationName::Dig if self.material.is_some() => {
                Err(RecordError::Foreign { owner: "dig", field: "material" })
            }
            OperationName::Dig => Ok(Operation::Dig),
            OperationName::Add => Ok(Operation::Add { material: material("add")? }),
            OperationName::Paint => Ok(Operation::Paint { material: material("paint")? }),
        }
    }
}

impl TryFrom<BrushRecord> for Brush {
    type Error = RecordError;

    fn try_from(record: BrushRecord) -> Result<Self, RecordError> {
        Ok(Self {
            shape: record.read_shape()?,
            operation: record.read_operation()?,
            roughness: record.roughness,
            tag: record.tag.unwrap_or(0),
        })
    }
}

impl From<&Brush> for BrushRecord {
    fn from(brush: &Brush) -> Self {
        let (op, material) = match brush.operation {
            Operation::Dig => (OperationName::Dig, None),
            Operation::Add { material } => (OperationName::Add, Some(material)),
            Operation::Paint { material } => (OperationName::Paint, Some(material)),
        };
        let vector = |v: Vec3| Some(v.to_array());
        let shaped = |shape| Self::empty(shape, op);
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
        Self { material, roughness: brush.roughness, tag: (brush.tag != 0).then_some(brush.tag), ..record }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(json: &str) -> Result<Brush, String> {
        let record: BrushRecord = serde_json::from_str(json).map_err(|error| error.to_string())?;
        Brush::try_from(record).map_err(|error| error.to_string())
    }

    #[test]
    fn every_shape_comes_back_from_its_line() {
        let (a, b) = (Vec3::new(1.5, -2.0, 0.1), Vec3::new(0.0, 7.25, 3.0));
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
