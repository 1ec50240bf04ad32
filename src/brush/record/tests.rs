//! Lines and the brushes that they are.

use glam::{Quat, Vec2, Vec3};

use super::BrushRecord;
use crate::brush::{Brush, Operation, Roughness, Shape, Stamp};
use crate::ground::{GreyImage, MaterialId};

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
            Brush { operation: Operation::Terrace { step: 3.0, base: 1.5 }, ..Brush::terrace(shape, 3.0) },
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
        (r#"{"shape":"sphere","center":[0,0,0],"op":"dig"}"#, "missing field `radius`, which `sphere` needs"),
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
