//! Sculpting operations with arbitrary numbers, from brushes and from JSON.

use bevy_burrow::lattice::LIMIT;
use bevy_burrow::prelude::*;
use glam::{Quat, Vec2, Vec3};
use proptest::prelude::*;

use crate::brushes::number;
use crate::terrains::small_terrain;

/// A sculpting brush with a valid shape, and numbers that may be invalid.
pub fn sculpting() -> impl Strategy<Value = Brush> {
    let place = prop::array::uniform3(-3.0f32..17.0);
    let numbers = prop::array::uniform10(number());
    let image = (1..5u32, 1..5u32, prop::array::uniform16(any::<u16>()));
    let blend = (number(), number(), any::<Option<u8>>(), any::<u8>());
    (place, 0.3f32..6.0, 0..8u8, numbers, image, blend).prop_map(
        |(place, radius, operation, n, (width, height, samples), (strength, falloff, material, power))| {
            let shape = Shape::sphere(Vec3::from_array(place), radius);
            let (a, b) = (Vec3::new(n[0], n[1], n[2]), Vec3::new(n[3], n[4], n[5]));
            let image = || {
                let samples = samples[..(width * height) as usize].to_vec();
                GreyImage::from_samples(width, height, samples).expect("as many samples as it has")
            };
            let operation = match operation {
                0 => Operation::Smooth,
                1 => Operation::Sharpen,
                2 => Operation::Flatten { point: a, normal: b },
                3 => Operation::Level { height: n[0] },
                4 => Operation::Raise { amount: n[0] },
                5 => Operation::Lower { amount: n[0] },
                6 => Operation::Terrace { step: n[0], base: n[1] },
                _ => {
                    let stamp = Stamp::new(image(), a, Vec2::new(n[3], n[4]), n[5]);
                    let turned = Quat::from_xyzw(n[6], n[7], n[8], n[9]);
                    // Few random quadruples are a rotation.
                    let stamp = if n[6] > 0.0 { stamp.onto(b) } else { stamp.with_rotation(turned) };
                    Operation::Stamp { stamp }
                }
            };
            let plain = Brush::smooth(shape, strength).with_falloff(falloff).with_power(power);
            Brush {
                operation,
                ..material.map_or(plain.clone(), |material| plain.with_material(MaterialId(material)))
            }
        },
    )
}

/// Plausible integers, extreme integers and arbitrary integers.
fn integer() -> impl Strategy<Value = i32> {
    let (limit, most) = (LIMIT * 256, i32::from(i16::MAX));
    let special = [i32::MIN, i32::MAX, 0, 1, 64, 255, 256, 257, most, -most, limit, -limit, limit + 1, 1024];
    prop_oneof![5 => -2000..4000i32, 3 => prop::sample::select(special.to_vec()), 1 => any::<i32>()]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_operation_in_json_is_an_edit_or_an_error(
        numbers in prop::array::uniform8(integer()), operation in 0..8usize, straight: bool, is_faded: bool, power: u8,
        stroke in prop::option::of(any::<u64>()),
    ) {
        let [a, b, c, d, e, f, g, h] = numbers;
        let blend = if is_faded { [256, 1024] } else { [g, h] };
        let blend = format!(r#"{{"strength":{},"falloff":{},"material":null}}"#, blend[0], blend[1]);
        let normal = if straight { [0, i16::MAX, 0] } else { [d, e, f].map(|n| n as i16) };
        let turn = if straight { [0, 0, 0, i16::MAX] } else { [a, b, c, d].map(|n| n as i16) };
        let own = match operation {
            0 => r#""smooth""#.to_string(),
            1 => r#""sharpen""#.into(),
            2 => format!(r#"{{"flatten":{{"point":[{a},{b},{c}],"normal":{normal:?}}}}}"#),
            3 => format!(r#"{{"level":{{"height":{a}}}}}"#),
            4 => format!(r#"{{"raise":{{"amount":{a}}}}}"#),
            5 => format!(r#"{{"lower":{{"amount":{a}}}}}"#),
            6 => format!(r#"{{"terrace":{{"step":{a},"base":{b}}}}}"#),
            _ => {
                let relief = format!(r#"{{"width":2,"height":3,"samples":[0,{},65535,9,{},1]}}"#, a as u16, b as u16);
                format!(
                    r#"{{"stamp":{{"stamp":{{"center":[{a},{b},{c}],"rotation":{turn:?},"half":[{d},{e}],"height":{f},"relief":{relief}}}}}}}"#
                )
            }
        };
        let stroke = stroke.map_or("null".into(), |stroke| stroke.to_string());
        let json = format!(
            r#"{{"shape":{{"sphere":{{"center":[1792,2304,1536],"radius":900}}}},"operation":{own},"blend":{blend},"power":{power},"roughness":null,"tag":9,"stroke":{stroke}}}"#
        );
        let json = json.replace(' ', "");
        let Ok(edit) = serde_json::from_str::<Edit>(&json) else { return Ok(()) };
        prop_assert!(edit.check().is_ok());
        prop_assert_eq!(&serde_json::to_string(&edit).expect("edits are written"), &json);
        // Ground that was moved far is moved again.
        let mut terrain = small_terrain();
        (0..3).for_each(|_| terrain.submit(&edit));
        terrain.submit(Brush::smooth(Shape::sphere(Vec3::new(7.0, 9.0, 6.0), 5.0), 1.0));
        let commit = terrain.begin().map(|transaction| transaction.run());
        let receipts = commit.and_then(|commit| terrain.commit(commit).ok()).unwrap_or_default();
        prop_assert!(receipts.len() == 4 && receipts.iter().all(|receipt| receipt.outcome.is_ok()), "{}", json);
        let report = terrain.world().check_seams();
        prop_assert!(report.is_flawless(), "{}: {}", json, report);
    }
}
