//! Brushes as flat objects, such as lines of JSON.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::de::{Error, IgnoredAny};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{AnyShape, Brush, FULL_POWER, Operation, Roughness, is_default};
use crate::ground::MaterialId;

impl Serialize for Brush {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Line::from(self.clone()).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Brush {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Line::deserialize(deserializer)?.try_into().map_err(Error::custom)
    }
}

/// A [`Brush`] in its written form, without fields that may be left out.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Brush")]
pub(super) struct Line {
    #[serde(flatten)]
    shape: AnyShape,
    #[serde(flatten)]
    operation: Operation,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    roughness: Option<Roughness>,
    #[serde(default, skip_serializing_if = "is_default")]
    tag: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    stroke: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    strength: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    falloff: Option<f32>,
    #[serde(flatten)]
    new_ground: NewGround,
    #[serde(default = "full", skip_serializing_if = "is_full")]
    power: u8,
    /// The fields of the shape and the operation, and those that nothing has.
    #[serde(flatten, skip_serializing)]
    fields: BTreeMap<String, IgnoredAny>,
}

/// The material of an operation that sculpts, under the same name as that of an add.
#[derive(Serialize, Deserialize)]
struct NewGround {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialId>,
}

fn full() -> u8 {
    FULL_POWER
}

fn is_full(power: &u8) -> bool {
    *power == FULL_POWER
}

impl TryFrom<Line> for Brush {
    type Error = String;

    fn try_from(line: Line) -> Result<Self, String> {
        let shape = line.shape.fields();
        let brush = Self::plain(line.shape, line.operation);
        let operation = brush.operation.fields();
        let is_sculpting = brush.operation.is_sculpting();
        let material = line.new_ground.material;
        let is_own = |field: &str| {
            let tags = ["shape", "op"];
            tags.iter().chain(&shape).chain(operation).any(|own| *own == field)
        };
        let blend = [
            ("strength", line.strength.is_some()),
            ("falloff", line.falloff.is_some()),
            ("material", material.is_some() && brush.operation.material().is_none()),
        ];
        let idle = blend.iter().filter(|(_, is_given)| *is_given && !is_sculpting).map(|(field, _)| *field);
        let unknown = line.fields.keys().map(String::as_str).filter(|field| !is_own(field));
        if let Some(field) = unknown.chain(idle).next() {
            return Err(format!("field `{field}` belongs neither to this shape nor to this operation"));
        }
        let mut blend = brush.blend;
        if is_sculpting {
            blend.strength = line.strength.unwrap_or(blend.strength);
            blend.falloff = line.falloff.unwrap_or(blend.falloff);
            blend.material = material;
        }
        let Line { roughness, tag, stroke, power, .. } = line;
        Ok(Self { roughness, tag, stroke, blend, power, ..brush })
    }
}

impl From<Brush> for Line {
    fn from(brush: Brush) -> Self {
        let Brush { shape, custom, operation, roughness, tag, stroke, blend, power } = brush;
        // Only what differs from the default blend of such a brush.
        let like = Brush::plain(shape, operation.clone()).blend;
        let is_sculpting = operation.is_sculpting();
        Self {
            shape: custom.map_or_else(|| shape.into(), |custom| Arc::unwrap_or_clone(custom).into()),
            operation,
            roughness,
            tag,
            stroke,
            strength: (is_sculpting && blend.strength != like.strength).then_some(blend.strength),
            falloff: (is_sculpting && blend.falloff != like.falloff).then_some(blend.falloff),
            new_ground: NewGround { material: blend.material.filter(|_| is_sculpting) },
            power,
            fields: BTreeMap::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec2, Vec3};

    use super::*;
    use crate::brush::{Shape, Stamp};
    use crate::ground::GreyImage;

    fn parse(json: &str) -> Result<Brush, String> {
        serde_json::from_str(json).map_err(|error| error.to_string())
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
            Shape::torus(a, b, 4.0, 1.5),
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
                let line = serde_json::to_string(&brush).unwrap();
                assert_eq!(parse(&line).unwrap(), brush, "{line}");
            }
        }
    }

    #[test]
    fn the_written_form_is_the_documented_one() {
        let line = r#"{"shape":"sphere","center":[8.0,0.0,8.0],"radius":4.0,"op":"dig"}"#;
        let brush = Brush::dig(Shape::sphere(Vec3::new(8.0, 0.0, 8.0), 4.0));
        assert_eq!(serde_json::to_string(&brush).unwrap(), line);
        assert_eq!(parse(r#"{"op":"dig","radius":4,"center":[8,0,8],"shape":"sphere"}"#).unwrap(), brush);
    }

    #[test]
    fn mistakes_are_named() {
        for (json, message) in [
            (r#"{"shape":"sphere","center":[0,0,0],"op":"dig"}"#, "missing field `radius`"),
            (r#"{"shape":"box","center":[0,0,0],"op":"dig"}"#, "missing field `half`"),
            (
                r#"{"shape":"box","center":[0,0,0],"half":[1,1,1],"radius":1,"op":"dig"}"#,
                "field `radius` belongs neither",
            ),
            (r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"add"}"#, "missing field `material`"),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"dig","material":1}"#,
                "field `material` belongs neither",
            ),
            (r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"add","material":300}"#, "300"),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"dig","strength":1}"#,
                "field `strength` belongs neither",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"level","amount":1}"#,
                "missing field `height`",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"flatten","point":[0,0,0]}"#,
                "missing field `normal`",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"stamp","stamp":{"center":[0,0,0],"size":[2,2],"height":1,"image":{"width":3,"height":3,"samples":[1,2]}}}"#,
                "takes 9 samples, but 2",
            ),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"level","height":1,"amount":1}"#,
                "field `amount` belongs neither",
            ),
            (r#"{"shape":"sphere","center":[0,0,0],"radius":1}"#, "missing field `op`"),
            (r#"{"center":[0,0,0],"radius":1,"op":"dig"}"#, "missing field `shape`"),
            (
                r#"{"shape":"sphere","center":[0,0,0],"radius":1,"radios":1,"op":"dig"}"#,
                "field `radios` belongs neither",
            ),
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
