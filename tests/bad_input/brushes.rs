//! Brushes and settings with arbitrary numbers.

use std::cell::Cell;

use bevy_burrow::lattice::LIMIT;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::TerrainError;
use glam::{Quat, Vec3};
use proptest::prelude::*;

use crate::operations::sculpting;
use crate::terrains::small_terrain;

/// Arbitrary bit patterns, special values, and plausible numbers.
pub fn number() -> impl Strategy<Value = f32> {
    let limit = LIMIT as f32;
    let special = [
        0.0,
        -0.0,
        0.25,
        0.249,
        1.0,
        -1.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN,
        f32::MIN_POSITIVE,
        f32::EPSILON,
        1e-45,
        limit,
        -limit,
        limit + 0.01,
        8.0 * limit,
        8.0 * limit + 0.1,
        1024.0,
        1024.1,
        16_777_216.0,
    ];
    prop_oneof![
        2 => any::<u32>().prop_map(f32::from_bits),
        2 => prop::sample::select(special.to_vec()),
        12 => -3.0f32..17.0,
        2 => (-8i32..40).prop_map(|n| n as f32 / 2.0),
    ]
}

fn brush() -> impl Strategy<Value = Brush> {
    let numbers = prop::array::uniform12(number());
    let unit = (any::<bool>(), prop::array::uniform4(-1.0f32..1.0));
    let rough = (any::<bool>(), prop::array::uniform2(number()), any::<u32>());
    (numbers, unit, 0..6u8, 0..3u8, any::<u8>(), rough, any::<u64>()).prop_map(
        |(n, (turned, q), shape, operation, material, (is_rough, [amplitude, scale], seed), tag)| {
            let (a, b) = (Vec3::new(n[0], n[1], n[2]), Vec3::new(n[3], n[4], n[5]));
            let rotation = if turned {
                Quat::from_array(q).normalize()
            } else {
                Quat::from_xyzw(n[6], n[7], n[8], n[9])
            };
            let shape = match shape {
                0 => Shape::sphere(a, n[3]),
                1 => Shape::turned_cuboid(a, b, rotation),
                2 => Shape::cuboid(a, b),
                3 => Shape::cylinder(a, b, n[6]),
                4 => Shape::capsule(a, b, n[6]),
                _ => Shape::cone(a, b, n[6]),
            };
            let material = MaterialId(material);
            let brush = match operation {
                0 => Brush::dig(shape),
                1 => Brush::add(shape, material),
                _ => Brush::paint(shape, material),
            };
            let brush = brush.with_tag(tag);
            if is_rough { brush.with_roughness(Roughness::new(amplitude, scale, seed)) } else { brush }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_brushes_get_receipts_and_leave_a_closed_surface(brushes in prop::collection::vec(prop_oneof![brush(), sculpting()], 1..6)) {
        let mut terrain = small_terrain();
        // Brushes of the largest size are valid, but too slow for this test.
        let affordable = |brush: &&Brush| {
            let Ok(edit) = Edit::quantize(brush) else { return true };
            let reach = edit.reach().intersection(terrain.world().grid().edit_bounds());
            reach.is_none_or(|reach| reach.volume() < 100_000)
        };
        let brushes: Vec<Brush> = brushes.iter().filter(affordable).cloned().collect();
        for brush in &brushes {
            let before = terrain.world().hash();
            let receipts = terrain.apply([brush]);
            prop_assert_eq!(receipts.len(), 1);
            prop_assert_eq!(receipts[0].tag, brush.tag);
            prop_assert_eq!(Edit::quantize(brush).is_err(), matches!(receipts[0].outcome, Err(Rejection::Brush(_))));
            prop_assert_eq!(receipts[0].outcome.as_ref().is_ok_and(|applied| applied.bounds.is_some()), terrain.world().hash() != before);
            if let Err(rejection) = &receipts[0].outcome {
                prop_assert!(!rejection.to_string().is_empty());
            }
        }
        let report = terrain.world().check_seams();
        prop_assert!(report.is_flawless(), "{}", report);
    }

    #[test]
    fn any_settings_make_a_terrain_or_an_error(chunk_size in prop_oneof![0u32..200, any::<u32>()], bits: u32, power in -5i32..6, plain: bool) {
        let voxel_size = if plain { 2f32.powi(power) } else { f32::from_bits(bits) };
        let ground = Ground::flat(5, 5, 1.0).expect("finite heights");
        let made = Terrain::new(ground, &TerrainSettings { chunk_size, voxel_size });
        let sizes = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
        match made {
            Ok(terrain) => {
                prop_assert!((8..=128).contains(&chunk_size) && sizes.contains(&voxel_size));
                prop_assert_eq!(terrain.voxel_size(), voxel_size);
                prop_assert_eq!(terrain.world().grid().size(), chunk_size as i32);
            }
            Err(TerrainError::ChunkSize(size)) => prop_assert!(size == chunk_size && !(8..=128).contains(&size)),
            Err(TerrainError::VoxelSize(size)) => {
                prop_assert!(size.to_bits() == voxel_size.to_bits() && !sizes.contains(&size));
            }
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}

/// Lengths and positions in 1/256 voxel, and a seed, as in JSON: arbitrary, small or plausible numbers.
fn units() -> impl Strategy<Value = [i32; 8]> {
    let sensible = (prop::array::uniform3(-4000i32..4000), prop::array::uniform5(64i32..4000));
    prop_oneof![
        1 => any::<[i32; 8]>(),
        1 => prop::array::uniform8(-4000i32..4000),
        2 => sensible.prop_map(|([a, b, c], [d, e, f, g, seed])| [a, b, c, d, e, f, g, seed]),
    ]
}

#[test]
fn any_json_is_an_edit_or_an_error() {
    let accepted: [Cell<u32>; 5] = Default::default();
    let config = ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() };
    proptest!(config, |(numbers in units(), is_turned in any::<bool>(), number in 0..5usize)| {
        let [a, b, c, d, e, f, g, seed] = numbers;
        let rotation = if is_turned { [a, b, c, d].map(|part| part as i16) } else { [0, 0, 0, 32_767] };
        let shape = match number {
            0 => format!(r#"{{"sphere":{{"center":[{a},{b},{c}],"radius":{d}}}}}"#),
            1 => format!(
                r#"{{"cuboid":{{"center":[{a},{b},{c}],"half":[{d},{e},{f}],"rotation":{rotation:?}}}}}"#
            ),
            2 => format!(r#"{{"cylinder":{{"base":[{a},{b},{c}],"axis":[{d},{e},{f}],"radius":{g}}}}}"#),
            3 => format!(r#"{{"capsule":{{"from":[{a},{b},{c}],"to":[{d},{e},{f}],"radius":{g}}}}}"#),
            _ => format!(r#"{{"cone":{{"base":[{a},{b},{c}],"axis":[{d},{e},{f}],"radius":{g}}}}}"#),
        };
        let roughness = match seed % 2 {
            0 => "null".to_string(),
            _ => format!(r#"{{"amplitude":{},"scale":{f},"seed":{}}}"#, g % 3000, seed.unsigned_abs()),
        };
        let json = format!(r#"{{"shape":{shape},"operation":"dig","roughness":{roughness},"tag":9}}"#);
        let Ok(edit) = serde_json::from_str::<Edit>(&json) else { return Ok(()) };
        accepted[number].set(accepted[number].get() + 1);
        prop_assert!(edit.check().is_ok());
        let mut terrain = small_terrain();
        terrain.submit(&edit);
        let receipts = terrain.begin().map(|transaction| transaction.run()).map(|commit| terrain.commit(commit));
        prop_assert!(matches!(receipts, Some(Ok(ref receipts)) if receipts.len() == 1 && receipts[0].tag == 9));
        prop_assert!(terrain.world().check_seams().is_flawless(), "{}", json);
    });
    // About eighty of each shape are drawn. Half have plausible numbers; half of those boxes are not rotated.
    assert!(accepted.iter().all(|count| count.get() > 0), "{accepted:?}");
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let ground = || Ground::flat(5, 5, 1.0).expect("finite heights");
    for chunk_size in [0, 1, 7, 129, 1 << 31, u32::MAX] {
        let made = Terrain::new(ground(), &TerrainSettings { chunk_size, ..Default::default() });
        assert_eq!(made.err(), Some(TerrainError::ChunkSize(chunk_size)));
    }
    for chunk_size in [8, 9, 127, 128] {
        assert!(Terrain::new(ground(), &TerrainSettings { chunk_size, ..Default::default() }).is_ok());
    }
    for voxel_size in [0.0, -0.0, -1.0, 0.3, 0.0625, 16.0, 3.0, f32::INFINITY, f32::MIN_POSITIVE, f32::MAX] {
        let made = Terrain::new(ground(), &TerrainSettings { voxel_size, ..Default::default() });
        assert_eq!(made.err(), Some(TerrainError::VoxelSize(voxel_size)));
    }
    let made = Terrain::new(ground(), &TerrainSettings { voxel_size: f32::NAN, ..Default::default() });
    let message = made.err().map(|error| error.to_string());
    assert_eq!(message.as_deref(), Some("voxel size NaN is not one of 1/8, 1/4, 1/2, 1, 2, 4, 8"));
}
