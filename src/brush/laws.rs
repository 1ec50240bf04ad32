//! Tests: laws that the edits of any brush obey.

use glam::{DQuat, DVec3, IVec3, Quat, Vec2, Vec3};
use proptest::prelude::*;
use serde_json::json;

use super::shapes::{Capsule, Cone, Cuboid, Curve, Cylinder, Sphere, Torus};
use super::*;
use crate::ground::{GreyImage, MaterialId};
use crate::lattice::{LatticeBox, hash::mix};

fn vector(most: f32) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-most..most).prop_map(Vec3::from_array)
}

fn rotation() -> impl Strategy<Value = Quat> {
    (vector(1.0), -3.2f32..3.2)
        .prop_map(|(axis, angle)| Quat::from_axis_angle(axis.normalize_or(Vec3::Y), angle))
}

/// Shapes up to `size` voxels around places up to `far` voxels out.
fn shape(far: f32, size: f32) -> impl Strategy<Value = Shape> {
    let axis = move || vector(size).prop_filter("too short", |axis| axis.length() > 0.3);
    let radius = move || 0.25..size;
    prop_oneof![
        (vector(far), radius()).prop_map(|(center, radius)| Shape::sphere(center, radius)),
        (vector(far), prop::array::uniform3(radius()), rotation())
            .prop_map(|(center, half, turn)| Shape::turned_cuboid(center, Vec3::from_array(half), turn)),
        (vector(far), axis(), radius()).prop_map(|(base, axis, radius)| Shape::cylinder(base, axis, radius)),
        (vector(far), vector(size), radius()).prop_map(|(from, by, radius)| Shape::capsule(
            from,
            from + by,
            radius
        )),
        (vector(far), axis(), radius()).prop_map(|(base, axis, radius)| Shape::cone(base, axis, radius)),
        (vector(far), axis(), radius(), 0.0f32..1.0).prop_map(|(center, axis, radius, tube)| {
            Shape::torus(center, axis, radius, (radius * tube).max(0.25))
        }),
        (vector(far), prop::array::uniform3(vector(size / 2.0)), radius(), radius()).prop_map(
            |(from, [a, b, c], first, last)| Shape::curve(
                [from, from + a, from + a + b, from + b + c],
                [first, last]
            )
        ),
    ]
}

/// Paths and corridors up to about `size` voxels around places up to `far` voxels out.
fn custom_shape(far: f32, size: f32) -> impl Strategy<Value = AnyShape> {
    let points = prop::collection::vec((vector(size / 2.0), 0.25..(size / 2.0).max(0.5)), 2..6);
    let path = (vector(far), points, any::<bool>()).prop_map(|(at, points, is_smooth)| {
        let points = points.into_iter().map(|(by, radius)| (at + by, radius));
        if is_smooth { BrushPath::spline(points) } else { BrushPath::polyline(points) }
    });
    (path, any::<bool>(), 0.5..size, 0.0..size).prop_map(
        |(path, is_corridor, above, below)| match is_corridor {
            true => Corridor::new(path, above, below).into(),
            false => path.into(),
        },
    )
}

/// Shapes and custom shapes.
fn any_shape(far: f32, size: f32) -> impl Strategy<Value = AnyShape> {
    prop_oneof![3 => shape(far, size).prop_map(AnyShape::from), 2 => custom_shape(far, size)]
}

fn roughness() -> impl Strategy<Value = Option<Roughness>> {
    prop::option::of(
        (0.0f32..8.0, 1.0f32..20.0, any::<u32>(), prop_oneof![Just(Vec3::ZERO), vector(9000.0)])
            .prop_map(|(a, s, seed, origin)| Roughness::new(a, s, seed).with_origin(origin)),
    )
}

fn edit(shape: impl Into<AnyShape>, roughness: Option<Roughness>) -> Edit {
    Edit::quantize(&Brush { roughness, ..Brush::dig(shape) }).unwrap()
}

/// Any bits at all, ordinary numbers among them.
fn wild() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<u32>().prop_map(f32::from_bits),
        -10.0f32..10.0,
        -40_000.0f32..40_000.0,
        Just(0.0),
        Just(1.0),
        Just(32_768.0),
        Just(262_144.0),
        Just(1024.0),
    ]
}

fn wild_brush() -> impl Strategy<Value = Brush> {
    let vector = || prop::array::uniform3(wild()).prop_map(Vec3::from_array);
    let turn = prop_oneof![rotation(), prop::array::uniform4(wild()).prop_map(Quat::from_array)];
    let shape = (0..7, vector(), vector(), turn, wild()).prop_map(|(kind, a, b, turn, radius)| match kind {
        0 => Shape::sphere(a, radius),
        1 => Shape::turned_cuboid(a, b, turn),
        2 => Shape::cylinder(a, b, radius),
        3 => Shape::capsule(a, b, radius),
        4 => Shape::cone(a, b, radius),
        5 => Shape::torus(a, b, radius, turn.x),
        _ => Shape::curve([a, b, b, a + b], [radius, turn.x]),
    });
    let origin = prop_oneof![Just(Vec3::ZERO), vector()];
    let roughness = (wild(), wild(), any::<u32>(), origin)
        .prop_map(|(a, s, seed, origin)| Roughness::new(a, s, seed).with_origin(origin));
    let blend = (wild(), wild(), prop::option::of(any::<u8>().prop_map(MaterialId)))
        .prop_map(|(strength, falloff, material)| Blend { strength, falloff, material });
    let blend = prop_oneof![Just(Blend::default()), blend];
    let stroke = prop::option::of(any::<u64>());
    let roughness = prop::option::of(roughness);
    (shape, wild_operation(), blend, roughness, any::<u64>(), stroke, any::<u8>()).prop_map(
        |(shape, operation, blend, roughness, tag, stroke, power)| Brush {
            shape,
            custom: None,
            operation,
            blend,
            roughness,
            tag,
            stroke,
            power,
        },
    )
}

fn wild_operation() -> impl Strategy<Value = Operation> {
    let vector = || prop::array::uniform3(wild()).prop_map(Vec3::from_array);
    let image = (1..5u32, 1..5u32).prop_map(|(width, height)| {
        let samples = (0..width * height).map(|at| at as u16 * 3001).collect();
        GreyImage::from_samples(width, height, samples).unwrap()
    });
    let turn = prop_oneof![rotation(), prop::array::uniform4(wild()).prop_map(Quat::from_array)];
    let stamp =
        (image, vector(), turn, wild(), wild(), wild()).prop_map(|(image, center, turn, x, y, height)| {
            let stamp = Stamp::new(image, center, Vec2::new(x, y), height).with_rotation(turn);
            Operation::Stamp { stamp }
        });
    prop_oneof![
        Just(Operation::Dig),
        any::<u8>().prop_map(|material| Operation::Add { material: MaterialId(material) }),
        any::<u8>().prop_map(|material| Operation::Paint { material: MaterialId(material) }),
        Just(Operation::Smooth),
        Just(Operation::Sharpen),
        (vector(), vector()).prop_map(|(point, normal)| Operation::Flatten { point, normal }),
        wild().prop_map(|height| Operation::Level { height }),
        wild().prop_map(|amount| Operation::Raise { amount }),
        wild().prop_map(|amount| Operation::Lower { amount }),
        (wild(), wild()).prop_map(|(step, base)| Operation::Terrace { step, base }),
        stamp,
        prop_oneof![
            Just(Operation::Reset),
            Just(Operation::Road),
            Just(Operation::Fill),
            Just(Operation::Carve)
        ],
    ]
}

/// Distance by another road: f64, polygons instead of formulas, the brush's own numbers instead of the edit's.
fn plain_distance(shape: &Shape, p: DVec3) -> f64 {
    match *shape {
        Shape::Sphere(Sphere { center, radius }) => p.distance(center.as_dvec3()) - f64::from(radius),
        Shape::Capsule(Capsule { from, to, radius }) => {
            to_segment(p, from.as_dvec3(), to.as_dvec3()) - f64::from(radius)
        }
        Shape::Cuboid(Cuboid { center, half, rotation }) => {
            let turn = DQuat::from_array(rotation.to_array().map(f64::from)).normalize();
            let (own, half) = (turn.inverse() * (p - center.as_dvec3()), half.as_dvec3());
            let nearest = own.clamp(-half, half);
            if nearest == own { -(half - own.abs()).min_element() } else { own.distance(nearest) }
        }
        Shape::Curve(Curve { from, from_control, to_control, to, from_radius, to_radius }) => {
            // Balls along it, much denser than its pieces. The pieces' corners lie on the curve, and are rounded.
            let corners = [from, from_control, to_control, to].map(|corner| corner.as_dvec3());
            let [a, b, c, d] = corners;
            let at = |t: f64| {
                let s = 1.0 - t;
                a * (s * s * s) + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * (t * t * t)
            };
            let radius =
                |t: f64| f64::from(from_radius) + (f64::from(to_radius) - f64::from(from_radius)) * t;
            let point = |index: i32| {
                let (piece, part) = (f64::from(index / 64), f64::from(index % 64) / 64.0);
                let (low, high) = (piece / 32.0, (piece + 1.0) / 32.0);
                (at(low).lerp(at(high), part), radius(low) + (radius(high) - radius(low)) * part)
            };
            let ball = |(center, radius): (DVec3, f64)| p.distance(center) - radius;
            (0..32 * 64).map(point).map(ball).fold(ball((d, to_radius.into())), f64::min)
        }
        Shape::Torus(Torus { center, axis, radius, tube }) => {
            // To the point of the circle that lies the way the point lies.
            let (from, axis) = (p - center.as_dvec3(), axis.as_dvec3().normalize());
            let way = (from - axis * from.dot(axis)).try_normalize().unwrap_or(axis.any_orthonormal_vector());
            from.distance(way * f64::from(radius)) - f64::from(tube)
        }
        Shape::Cylinder(Cylinder { base, axis, radius }) | Shape::Cone(Cone { base, axis, radius }) => {
            let (base, axis, radius) = (base.as_dvec3(), axis.as_dvec3(), f64::from(radius));
            let (length, unit) = (axis.length(), axis.normalize());
            let along = (p - base).dot(unit);
            let off = (p - base).cross(unit).length();
            // The outline in the half-plane (off, along), as far as it is surface.
            let at = |x, y| DVec3::new(x, y, 0.0);
            let is_cone = matches!(shape, Shape::Cone(_));
            let outline: &[DVec3] = if is_cone {
                &[at(0.0, 0.0), at(radius, 0.0), at(0.0, length)]
            } else {
                &[at(0.0, 0.0), at(radius, 0.0), at(radius, length), at(0.0, length)]
            };
            let here = at(off, along);
            let distance = outline.windows(2).map(|s| to_segment(here, s[0], s[1])).fold(f64::MAX, f64::min);
            let width = if is_cone { radius * (1.0 - along / length) } else { radius };
            if (0.0..=length).contains(&along) && off <= width { -distance } else { distance }
        }
    }
}

fn to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let t = if a == b { 0.0 } else { (p - a).dot(b - a) / (b - a).length_squared() };
    p.distance(a.lerp(b, t.clamp(0.0, 1.0)))
}

proptest! {
    #[test]
    fn reach_encloses_every_sample_that_may_change(shape in any_shape(30.0, 7.0), roughness in roughness()) {
        let edit = edit(shape, roughness);
        let (reach, evaluator) = (edit.reach(), edit.evaluator());
        let beyond = reach.grown(3);
        let mut row = vec![0; beyond.size().x as usize];
        for y in beyond.min.y..=beyond.max.y {
            for z in beyond.min.z..=beyond.max.z {
                evaluator.row(IVec3::new(beyond.min.x, y, z), &mut row);
                for (x, &distance) in (beyond.min.x..).zip(&row) {
                    prop_assert!(distance > BAND || reach.contains(IVec3::new(x, y, z)), "{x} {y} {z}: {distance}");
                }
            }
        }
    }

    #[test]
    fn the_brush_of_an_edit_asks_for_that_edit(
        shape in any_shape(30_000.0, 60.0), roughness in roughness(), operation in wild_operation(), tag: u64, power: u8,
    ) {
        let brush = Brush { operation, roughness, ..Brush::dig(shape.clone()) }.with_tag(tag).with_power(power);
        let Ok(edit) = Edit::quantize(&brush) else { return Ok(()) };
        let again = Edit::quantize(&Brush::from(&edit)).unwrap();
        let is_turned = matches!(shape, AnyShape::Cuboid(_) | AnyShape::Torus(_));
        if !is_turned && !matches!(edit.operation(), Operation::Flatten { .. } | Operation::Stamp { .. }) {
            prop_assert_eq!(&again, &edit);
        }
        // A rotation or a direction may be rounded once more, and no further.
        let grown = |reach: LatticeBox, other: LatticeBox| {
            (reach.min - other.min).abs().max_element().max((reach.max - other.max).abs().max_element())
        };
        prop_assert!(grown(again.reach(), edit.reach()) <= 1);
    }

    #[test]
    fn reach_is_tight_without_roughness(shape in any_shape(30.0, 20.0)) {
        let edit = edit(shape, None);
        let (reach, evaluator) = (edit.reach(), edit.evaluator());
        // On every side, some sample of the outermost two layers is within the band or nearly so.
        for axis in 0..3 {
            for side in [reach.min[axis], reach.max[axis]] {
                let mut face = reach;
                face.min[axis] = side;
                face.max[axis] = side;
                let nearest = face.points().map(|p| evaluator.distance(p)).min().unwrap();
                prop_assert!(nearest <= BAND + 256, "axis {axis} at {side}: {nearest}");
            }
        }
    }

    #[test]
    fn out_of_reach_is_never_a_lie(
        shape in any_shape(20.0, 8.0), roughness in roughness(), size in prop::array::uniform3(1..70),
    ) {
        let (edit, size) = (edit(shape, roughness), IVec3::from_array(size));
        let (around, evaluator) = (edit.reach().grown(12), edit.evaluator());
        // The surroundings, cut into boxes.
        let counts = LatticeBox { min: IVec3::ZERO, max: around.size() / size };
        for min in counts.points().map(|step| around.min + step * size) {
            let samples = LatticeBox { min, max: min + size - 1 };
            let nearest = samples.points().map(|p| evaluator.distance(p)).min().unwrap();
            if evaluator.is_out_of_reach(samples) {
                prop_assert!(nearest > BAND, "{samples:?} holds {nearest}");
            } else {
                // And it does see what is far away: a diagonal off, and the roughness twice.
                let slack = 256.0 * (size.as_vec3().length() + 2.0 * 8.0) + 64.0;
                prop_assert!((nearest as f32) < BAND as f32 + slack, "{samples:?}: {nearest}");
            }
        }
    }

    #[test]
    fn a_row_is_its_samples(
        shape in any_shape(32_000.0, 60.0), roughness in roughness(), start in prop::array::uniform3(-90..90), length in 0usize..100,
    ) {
        let edit = edit(shape, roughness);
        let start = edit.reach().min + IVec3::from_array(start);
        let mut row = vec![0; length];
        edit.evaluator().row(start, &mut row);
        for (x, &distance) in (start.x..).zip(&row) {
            prop_assert_eq!(distance, edit.evaluator().distance(IVec3::new(x, start.y, start.z)));
        }
    }

    #[test]
    fn distance_changes_no_faster_than_the_point(
        shape in any_shape(100.0, 90.0), p in prop::array::uniform3(-300..300), by in prop::array::uniform3(-9..=9)
    ) {
        let evaluator = edit(shape, None).evaluator();
        let (p, by) = (IVec3::from_array(p), IVec3::from_array(by));
        let change = evaluator.distance(p + by) - evaluator.distance(p);
        prop_assert!(f64::from(change).abs() <= by.as_dvec3().length() * 256.0 + 2.0);
    }

    #[test]
    fn distance_is_the_euclidean_one(shape in shape(100.0, 150.0), p in prop::array::uniform3(-400..400)) {
        prop_assume!(Edit::quantize(&Brush::dig(shape)).is_ok());
        let p = IVec3::from_array(p);
        let distance = f64::from(edit(shape, None).evaluator().distance(p));
        let plain = plain_distance(&shape, p.as_dvec3()) * 256.0;
        // Quantisation of position, axis and radius: about 1 unit each; of a rotation: 1/32767 of the shape's size.
        let size = match shape {
            Shape::Cuboid(Cuboid { half, .. }) => half.length(),
            Shape::Torus(Torus { radius, .. }) => radius,
            _ => 0.0,
        };
        let turned = f64::from(size) * 256.0 / 32767.0;
        prop_assert!((distance - plain).abs() < 4.0 + turned, "{} instead of {}", distance, plain);
    }

    #[test]
    fn roughness_stays_in_its_amplitude(shape in any_shape(30.0, 20.0), roughness in roughness(), p in prop::array::uniform3(-60..60)) {
        let p = IVec3::from_array(p);
        let amplitude = roughness.map_or(0.0, |roughness| roughness.amplitude * 256.0);
        let change = edit(shape.clone(), roughness).evaluator().distance(p) - edit(shape, None).evaluator().distance(p);
        prop_assert!((change.abs() as f32) <= amplitude + 1.5);
    }

    #[test]
    fn any_bits_are_refused_or_give_an_edit(brush in wild_brush(), p in prop::array::uniform3(any::<i32>()), length in 0usize..70) {
        match Edit::quantize(&brush) {
            Err(error) => prop_assert!(!error.to_string().is_empty()),
            Ok(edit) => {
                prop_assert_eq!(edit.check(), Ok(()));
                let json = serde_json::to_string(&edit).unwrap();
                prop_assert_eq!(&serde_json::from_str::<Edit>(&json).unwrap(), &edit);
                let p = IVec3::from_array(p);
                let evaluator = edit.evaluator();
                let mut row = vec![0; length];
                evaluator.row(p, &mut row);
                prop_assert!(row.first().is_none_or(|&first| first == evaluator.distance(p)));
                let _ = evaluator.is_out_of_reach(LatticeBox { min: p, max: IVec3::MAX });
                let _ = evaluator.is_out_of_reach(LatticeBox { min: IVec3::MIN, max: p });
                prop_assert!(!evaluator.is_out_of_reach(edit.reach()));
                // What the edit says of itself makes the same edit again, and any sample may be asked about.
                let again = Brush {
                    operation: edit.operation(),
                    blend: edit.blend().unwrap_or_default(),
                    ..brush.clone()
                };
                prop_assert_eq!(Edit::quantize(&again), Ok(edit.clone()));
                if let Some(sculptor) = edit.sculptor() {
                    for (density, cut) in [(0, 0), (-1024, (1 << 27) - 1), (1 << 24, 5), (-(1 << 24), 0)] {
                        let around = || Stencil { densities: [density; 27], cut, moved: cut };
                        let near = (edit.reach().min + edit.reach().max) / 2;
                        for (at, outside) in [(near, -5000), (near + 3, -1), (near, i32::MIN + 1)] {
                            let _ = sculptor.density(at, outside, around);
                        }
                    }
                }
            }
        }
        let _ = Edit::quantize(&brush.transformed(Quat::from_xyzw(0.6, 0.0, 0.0, 0.8), Vec3::ONE, 0.5));
        // A round trip through JSON gives an equal brush, or an equally invalid one.
        let read = Brush::try_from(json::Line::from(brush.clone())).unwrap();
        match (Edit::quantize(&read), Edit::quantize(&brush)) {
            (Ok(read), Ok(edit)) => prop_assert_eq!(read, edit),
            (read, edit) => prop_assert_eq!(format!("{read:?}"), format!("{edit:?}")),
        }
    }

    #[test]
    fn any_integers_are_checked(
        a in prop::array::uniform3(wild_integer()),
        b in prop::array::uniform3(wild_integer()),
        turn in prop_oneof![Just([0i16, 0, 0, 32_767]), any::<[i16; 4]>()],
        kind in 0..4,
        amplitude in prop_oneof![0..2049, any::<i32>()],
        scale in prop_oneof![256..65_537, any::<i32>()],
    ) {
        let (shape, is_shape) = match kind {
            0 => (json!({"sphere": {"center": a, "radius": b[0]}}), is_sphere(a, b[0])),
            1 => (json!({"cuboid": {"center": a, "half": b, "rotation": turn}}), is_cuboid(a, b, turn)),
            2 => (json!({"capsule": {"from": a, "to": b, "radius": 64}}), is_capsule(a, b, 64)),
            _ => (json!({"cone": {"base": a, "axis": b, "radius": 64}}), is_cone(a, b, 64)),
        };
        let roughness = json!({"amplitude": amplitude, "scale": scale, "seed": 0});
        let edit = json!({"shape": shape, "operation": "dig", "blend": null, "power": 255, "roughness": roughness, "tag": 0, "stroke": null});
        let is_roughness = (0..=2048).contains(&amplitude) && (256..=65_536).contains(&scale);
        match serde_json::from_value::<Edit>(edit.clone()) {
            Ok(found) => {
                prop_assert!(is_shape != Some(false) && is_roughness, "{edit}");
                prop_assert_eq!(found.check(), Ok(()));
                let [own, written] = [edit, serde_json::to_value(&found).unwrap()];
                prop_assert_eq!(&own["shape"], &written["shape"]);
                // A bump without height is left out.
                prop_assert_eq!(written["roughness"].is_null(), amplitude == 0);
            }
            Err(error) => {
                prop_assert!(is_shape != Some(true) || !is_roughness, "{edit}: {error}");
                // For what they are, not for how they are written.
                let message = error.to_string();
                let form = ["field", "variant", "expected", "invalid"];
                prop_assert!(form.iter().all(|word| !message.contains(word)), "{message}");
            }
        }
    }
}

/// Any integer, ordinary ones among them.
fn wild_integer() -> impl Strategy<Value = i32> {
    prop_oneof![
        any::<i32>(),
        -9000..9000,
        64..4000,
        -(1 << 23)..(1 << 23) + 1,
        Just(i32::MIN),
        Just(i32::MAX),
        Just(64),
        Just(63),
    ]
}

// Whether integers make a shape, by the table of limits; `None` where that takes more than a line.

fn is_in_world(at: [i32; 3]) -> bool {
    at.iter().zip([262_144, 32_768, 262_144]).all(|(v, most)| v.unsigned_abs() <= most * 256)
}

/// Box and volume, of sides and a volume in voxels. What lies on the limit to the last bit is not judged.
fn is_small(sides: [f64; 3], volume: f64) -> Option<bool> {
    let share = sides.into_iter().fold(volume / f64::from(1 << 25), |most, side| most.max(side / 1024.0));
    if (share - 1.0).abs() < 1e-5 { None } else { Some(share < 1.0) }
}

fn is_sphere(center: [i32; 3], radius: i32) -> Option<bool> {
    let r = f64::from(radius) / 256.0;
    if radius < 64 || !is_in_world(center) {
        return Some(false);
    }
    is_small([2.0 * r; 3], r * r * r * 4.0 / 3.0 * std::f64::consts::PI)
}

fn is_cuboid(center: [i32; 3], half: [i32; 3], turn: [i16; 4]) -> Option<bool> {
    if half.iter().any(|&half| half < 64) || !is_in_world(center) {
        return Some(false);
    }
    let sides = half.map(|half| f64::from(half) / 128.0);
    let volume = sides.iter().product();
    match turn {
        [0, 0, 0, 32_767] => is_small(sides, volume),
        // Whatever the turn, and whether it is one.
        _ => is_small([0.0; 3], volume).filter(|&is| !is),
    }
}

fn is_capsule(from: [i32; 3], to: [i32; 3], radius: i32) -> Option<bool> {
    if !is_in_world(from) || !is_in_world(to) {
        return Some(false);
    }
    let [from, to] = [from, to].map(|end| end.map(|v| f64::from(v) / 256.0));
    let (r, apart) = (f64::from(radius) / 256.0, [0, 1, 2].map(|i| (to[i] - from[i]).abs()));
    let length = apart.iter().map(|v| v * v).sum::<f64>().sqrt();
    let volume = std::f64::consts::PI * r * r * (length + r * 4.0 / 3.0);
    is_small(apart.map(|apart| apart + 2.0 * r), volume)
}

fn is_cone(base: [i32; 3], axis: [i32; 3], radius: i32) -> Option<bool> {
    let end = [0, 1, 2].map(|i| base[i].saturating_add(axis[i]));
    let length = axis.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>().sqrt();
    if !is_in_world(base) || !is_in_world(end) || length < 64.0 {
        return Some(false);
    }
    // Somewhere between the axis alone and a cuboid around it.
    let sides = |grow: i32| axis.map(|v| (f64::from(v).abs() + f64::from(grow)) / 256.0);
    match (is_small(sides(0), 0.0)?, is_small(sides(2 * radius + 4), 0.0)?) {
        (false, _) => Some(false),
        (true, true) => Some(true),
        _ => None,
    }
}

#[test]
fn distances_derived_by_hand() {
    let (o, up) = (Vec3::ZERO, Vec3::new(0.0, 8.0, 0.0));
    let quarter = Quat::from_rotation_y(std::f32::consts::FRAC_PI_4);
    let (sphere, cube) = (Shape::sphere(o, 5.0), Shape::cuboid(o, Vec3::splat(2.0)));
    let (cylinder, capsule) = (Shape::cylinder(o, up, 3.0), Shape::capsule(o, up, 3.0));
    let (cone, turned) = (Shape::cone(o, up, 6.0), Shape::turned_cuboid(o, Vec3::splat(2.0), quarter));
    let torus = Shape::torus(o, up, 6.0, 2.0);
    for (name, shape, at, distance) in [
        ("a sphere's centre is a radius deep", sphere, [0, 0, 0], -5 * 256),
        ("3-4-5 on the sphere", sphere, [3, 4, 0], 0),
        ("6-8-10 outside", sphere, [0, -6, 8], 5 * 256),
        ("a box's centre", cube, [0, 0, 0], -2 * 256),
        ("its corner", cube, [2, 2, 2], 0),
        ("one step off the corner on each axis: sqrt(3)", cube, [3, 3, 3], 443),
        ("off an edge: sqrt(2)", cube, [3, 3, 0], 362),
        ("inside, the nearest face counts", cube, [1, 0, 0], -256),
        ("turned by 45 degrees, an edge reaches 2 sqrt(2)", turned, [3, 0, 0], 44),
        ("a cylinder's middle", cylinder, [0, 4, 0], -3 * 256),
        ("nearer to its end", cylinder, [0, 7, 0], -256),
        ("off its rim: 3-4-5", cylinder, [6, -4, 0], 5 * 256),
        ("above it", cylinder, [1, 11, 1], 3 * 256),
        ("a capsule's round end", capsule, [0, -3, 0], 0),
        ("off its round end: 3-4-5", capsule, [3, 12, 0], 2 * 256),
        ("beside it", capsule, [0, 5, 7], 4 * 256),
        ("a cone's apex", cone, [0, 8, 0], 0),
        ("above the apex", cone, [0, 11, 0], 3 * 256),
        ("its rim", cone, [6, 0, 0], 0),
        ("below the base", cone, [2, -3, 0], 3 * 256),
        ("outside the rim: 3-4-5", cone, [9, -4, 0], 5 * 256),
        ("on the axis, the base is nearer than the side", cone, [0, 3, 0], -3 * 256),
        ("off the side along its normal by 5", cone, [7, 7, 0], 5 * 256),
        ("a ring's hole", torus, [0, 0, 0], 4 * 256),
        ("the middle of its tube is a tube's radius deep", torus, [6, 0, 0], -2 * 256),
        ("its inner rim", torus, [0, 0, -4], 0),
        ("off its circle: 3-4-5", torus, [9, 4, 0], 3 * 256),
    ] {
        let at = IVec3::from_array(at);
        assert_eq!(edit(shape, None).evaluator().distance(at), distance, "{name}: {shape:?} at {at}");
    }
}

#[test]
fn overlapping_brushes_of_one_seed_fit_together() {
    let roughness = Some(Roughness::new(2.0, 6.0, 42));
    let smooth = |center| edit(Shape::sphere(center, 9.0), None).evaluator();
    let rough = |center| edit(Shape::sphere(center, 9.0), roughness).evaluator();
    let (a, b) = (Vec3::ZERO, Vec3::new(7.0, 3.0, 0.0));
    for p in LatticeBox::point(IVec3::ZERO).grown(6).points() {
        let bump = |center| rough(center).distance(p) - smooth(center).distance(p);
        assert!((bump(a) - bump(b)).abs() <= 1);
    }
}

#[test]
fn distances_have_the_same_bits_everywhere() {
    let turn = Quat::from_xyzw(0.36, -0.48, 0.64, 0.48);
    let (base, axis) = (Vec3::new(-3.3, 100.7, 8.05), Vec3::new(5.5, -9.25, 17.125));
    let old = [
        Shape::sphere(base, 7.77),
        Shape::turned_cuboid(base, Vec3::new(3.0, 9.1, 5.6), turn),
        Shape::cylinder(base, axis, 4.4),
        Shape::capsule(base, base + axis, 3.9),
        Shape::cone(base, axis, 11.5),
    ];
    let hash = |shapes: &[Shape]| {
        let mut hash = 0;
        for (&shape, amplitude) in shapes.iter().flat_map(|shape| [(shape, 0.0), (shape, 1.75)]) {
            let edit = edit(shape, Some(Roughness::new(amplitude, 5.3, 1234)));
            let evaluator = edit.evaluator();
            for point in edit.reach().points() {
                hash = mix(hash ^ u64::from(evaluator.distance(point) as u32));
            }
        }
        hash
    };
    let hashes = [hash(&old), hash(&[Shape::torus(base, axis, 9.5, 3.3)])];
    assert_eq!(
        hashes,
        [0xbbb8_de26_8cf8_d229, 0xab60_89b1_8a69_5501],
        "Distances changed. On one machine only: find what is not exactly rounded. On all: saved journals will replay \
         to another world, so raise the format's version, then put the new hashes here: {hashes:#018x?}"
    );
}
