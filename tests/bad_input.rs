//! Whatever comes in from outside: no panic, no lost edit, no broken surface.

mod worlds;

use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::{Column, LIMIT};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::TerrainError;
use fastrand::Rng;
use glam::{DVec3, Quat, Vec3};
use proptest::prelude::*;
use worlds::{random_brush, random_brush_at_a_face, random_ground};

fn terrain(ground: Ground, chunk_size: u32) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings")
}

/// Level ground with a step, small enough that any brush is soon done.
fn small_terrain() -> Terrain {
    let height = |x: i32, z: i32| if x < 6 { 4.0 } else { 9.5 + f64::from(z) / 4.0 };
    terrain(Ground::from_fn(14, 12, height).expect("finite heights"), 8)
}

fn assert_flawless(terrain: &Terrain, what: impl std::fmt::Debug) {
    let report = terrain.world().check_seams();
    assert!(report.is_flawless(), "{what:?}: {report}");
}

/// Any bits, special numbers, and numbers that make sense.
fn number() -> impl Strategy<Value = f32> {
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
    fn any_brushes_get_receipts_and_leave_a_closed_surface(brushes in prop::collection::vec(brush(), 1..6)) {
        let mut terrain = small_terrain();
        // Brushes of the greatest size are valid; here they would only take long.
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
    fn any_json_is_an_edit_or_an_error(numbers in prop::array::uniform8(any::<i32>()), small: bool, shape in 0..5usize) {
        let [a, b, c, d, e, f, g, seed] = if small { numbers.map(|n| n % 4000) } else { numbers };
        let shape = match shape {
            0 => format!(r#"{{"sphere":{{"center":[{a},{b},{c}],"radius":{d}}}}}"#),
            1 => format!(
                r#"{{"cuboid":{{"center":[{a},{b},{c}],"half":[{d},{e},{f}],"rotation":[{},{},{},{}]}}}}"#,
                a as i16, b as i16, c as i16, d as i16
            ),
            2 => format!(r#"{{"cylinder":{{"base":[{a},{b},{c}],"axis":[{d},{e},{f}],"radius":{g}}}}}"#),
            3 => format!(r#"{{"capsule":{{"from":[{a},{b},{c}],"to":[{d},{e},{f}],"radius":{g}}}}}"#),
            _ => format!(r#"{{"cone":{{"base":[{a},{b},{c}],"axis":[{d},{e},{f}],"radius":{g}}}}}"#),
        };
        let roughness = if seed % 2 == 0 { "null".into() } else {
            format!(r#"{{"amplitude":{},"scale":{},"seed":{}}}"#, g % 3000, f, seed.unsigned_abs())
        };
        let json = format!(r#"{{"shape":{shape},"operation":"dig","roughness":{roughness},"tag":9}}"#);
        let Ok(edit) = serde_json::from_str::<Edit>(&json) else { return Ok(()) };
        prop_assert!(edit.check().is_ok());
        let mut terrain = small_terrain();
        terrain.submit_edit(&edit);
        let receipts = terrain.begin().map(|transaction| transaction.run()).map(|commit| terrain.commit(commit));
        prop_assert!(matches!(receipts, Some(Ok(ref receipts)) if receipts.len() == 1 && receipts[0].tag == 9));
        prop_assert!(terrain.world().check_seams().is_flawless(), "{}", json);
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

/// Digs, fills and paints at a few places of the surface and over rim and corners, and checks after each edit.
fn work_over(mut terrain: Terrain, rng: &mut Rng, what: &str) -> Terrain {
    let grid = terrain.world().grid();
    let (width, depth) = (grid.width(), grid.depth());
    for step in 0..6 {
        let (x, z) = match step % 3 {
            0 => ([0, width][rng.usize(0..2)], [0, depth][rng.usize(0..2)]),
            1 => (rng.i32(0..=width), [0, depth][rng.usize(0..2)]),
            _ => (rng.i32(0..=width), rng.i32(0..=depth)),
        };
        let height = terrain.world().ground().height(Column::new(x, z)) as f32 / 256.0;
        let y = (height + rng.f32() * 6.0 - 3.0).clamp(-(LIMIT as f32), LIMIT as f32);
        let shape = Shape::sphere(Vec3::new(x as f32, y, z as f32), [1.0, 2.5, 4.0][rng.usize(0..3)]);
        let brush = match rng.u32(0..4) {
            0 => Brush::add(shape, MaterialId(3)),
            1 => Brush::paint(shape, MaterialId(4)),
            _ => Brush::dig(shape),
        };
        let receipt = terrain.apply([&brush]).remove(0);
        assert!(receipt.outcome.is_ok(), "{what}: {brush:?}: {receipt:?}");
        assert_flawless(&terrain, format!("{what}, step {step}: {brush:?}"));
        // Queries answer there, too.
        let world = terrain.world();
        let spans = world.spans(x.into(), z.into());
        assert!(!spans.is_empty(), "{what}, step {step}: nothing at ({x}, {z})");
        let top = spans[spans.len() - 1].floor;
        let above = DVec3::new(x.into(), top + 10.0, z.into());
        let hit = world.raycast(above, DVec3::NEG_Y, 1e6);
        // On a cliff's edge the ray may fall past it, or the column lie beside it.
        assert!(hit.is_some(), "{what}, step {step}: a ray from {above} down hits nothing");
    }
    terrain
}

#[test]
fn the_smallest_and_narrowest_worlds_are_dug_without_a_hole() {
    for (width, depth) in
        [(1, 1), (1, 2), (2, 1), (1, 9), (7, 1), (1, 40), (40, 1), (8, 8), (9, 8), (8, 9), (3, 17)]
    {
        for chunk_size in [8, 9, 25, 128] {
            let mut rng = Rng::with_seed(u64::from(width * 100 + depth + chunk_size));
            for relief in [0.0, 1.5, 40.0] {
                let seed = rng.i32(0..1000);
                let height = |x: i32, z: i32| {
                    f64::from((x * 7919 + z * 104_729 + seed * 31).rem_euclid(64)) / 64.0 * relief
                };
                let ground = Ground::from_fn(width, depth, height).expect("finite heights");
                let what = format!("{width} x {depth} cells, relief {relief}, chunks of {chunk_size}");
                work_over(terrain(ground, chunk_size), &mut rng, &what);
            }
        }
    }
}

#[test]
fn worlds_at_the_ends_of_the_lattice_are_dug_without_a_hole() {
    let limit = f64::from(LIMIT);
    for height in [
        limit,
        limit - 1.0 / 256.0,
        limit - 1.0,
        32_767.5,
        -limit,
        1.0 / 256.0 - limit,
        1.0 - limit,
        -32_766.5,
    ] {
        for chunk_size in [8, 25, 128] {
            let mut rng = Rng::with_seed(chunk_size.into());
            let ground = Ground::flat(12, 11, height).expect("heights within the limit");
            let mut terrain = work_over(terrain(ground, chunk_size), &mut rng, &format!("level at {height}"));
            // From one end of the lattice to the next chunk, and as far out as a brush may be.
            let end = Vec3::new(6.0, (limit * height.signum()) as f32, 6.0);
            terrain.apply([Brush::add(Shape::sphere(end, 3.0), MaterialId(2))]);
            assert_flawless(&terrain, format!("added at the end, level at {height}"));
            terrain.apply([Brush::dig(Shape::capsule(end, end * 0.9995, 1.5))]);
            assert_flawless(&terrain, format!("shaft at the end, level at {height}"));
        }
    }
}

#[test]
fn edits_at_the_ends_of_the_lattice_far_from_the_ground_are_closed() {
    let limit = LIMIT as f32;
    let ground = Ground::flat(12, 11, 3.0).expect("finite heights");
    let mut terrain = terrain(ground, 25);
    for y in [limit, -limit, limit - 0.5, 2.0 - limit] {
        for shape in [
            Shape::sphere(Vec3::new(6.0, y, 6.0), 3.0),
            Shape::cuboid(Vec3::new(0.0, y, 11.0), Vec3::splat(2.25)),
        ] {
            for brush in
                [Brush::add(shape, MaterialId(1)), Brush::dig(shape), Brush::paint(shape, MaterialId(2))]
            {
                assert!(terrain.apply([&brush])[0].outcome.is_ok());
                assert_flawless(&terrain, &brush);
            }
        }
    }
    for y in [limit, -limit] {
        // What is added at the very top is closed by the pristine air beyond, what is dug at the bottom by the rock.
        terrain.apply([Brush::add(Shape::sphere(Vec3::new(6.0, y, 6.0), 3.0), MaterialId(1))]);
        assert_flawless(&terrain, "a ball at the end");
    }
}

#[test]
fn cliffs_of_thousands_of_voxels_are_dug_without_a_hole() {
    let cliffs: [(&str, fn(i32, i32) -> f64); 5] = [
        ("one step", |x, _| if x < 5 { -2000.25 } else { 3000.5 }),
        ("a needle", |x, z| if (x, z) == (4, 4) { 4000.0 } else { 0.0 }),
        ("a shaft", |x, z| if (x, z) == (4, 4) { -4000.0 } else { 0.0 }),
        ("a chessboard", |x, z| if (x + z) % 2 == 0 { 1500.125 } else { -1500.0 }),
        ("a stair", |x, z| f64::from(x * 700 - z * 450) + 0.5),
    ];
    for (name, height) in cliffs {
        for chunk_size in [8, 32] {
            let mut rng = Rng::with_seed(3);
            let ground = Ground::from_fn(9, 8, height).expect("heights within the limit");
            let mut terrain = terrain(ground, chunk_size);
            let top = terrain.world().height(4.0, 4.0).expect("a column of the world") as f32;
            for (x, y, z, radius) in [
                (4.0, top, 4.0, 2.0),
                (4.5, top * 0.5, 4.5, 2.5),
                (5.0, 7.0, 3.0, 3.0),
                (0.0, 0.25, 8.0, 1.5),
            ] {
                let shape = Shape::sphere(Vec3::new(x, y, z), radius);
                let brush = if rng.bool() { Brush::dig(shape) } else { Brush::add(shape, MaterialId(1)) };
                assert!(terrain.apply([&brush])[0].outcome.is_ok());
                assert_flawless(&terrain, format!("{name}, chunks of {chunk_size}: {brush:?}"));
            }
        }
    }
}

#[test]
fn a_cliff_over_the_whole_lattice_is_dug_without_a_hole() {
    let ground = Ground::from_fn(3, 2, |x, _| if x < 2 { -32_000.0 } else { 32_000.0 })
        .expect("heights within the limit");
    let mut terrain = terrain(ground, 128);
    for y in [-31_999.0, 0.0, 31_999.5] {
        terrain.apply([Brush::dig(Shape::sphere(Vec3::new(1.5, y, 1.0), 2.0))]);
    }
    assert_flawless(&terrain, "a cliff of 64000 voxels");
}

#[test]
fn a_stale_commit_is_refused_and_loses_nothing() {
    let dig = |x: f32, tag: u64| Brush::dig(Shape::sphere(Vec3::new(x, 8.0, 6.0), 2.0)).with_tag(tag);
    let expected = {
        let mut terrain = small_terrain();
        terrain.apply([dig(3.0, 1), dig(7.0, 2), dig(11.0, 3)]);
        terrain.world().hash()
    };

    // Edits that are applied at once overtake a transaction under way, which is then done again with them.
    let mut terrain = small_terrain();
    terrain.submit(&dig(3.0, 1));
    let stale = terrain.begin().expect("an edit waits").run();
    terrain.submit(&dig(7.0, 2));
    let receipts = terrain.apply([dig(11.0, 3)]);
    assert_eq!(receipts.iter().map(|receipt| receipt.tag).collect::<Vec<_>>(), [3]);
    assert_eq!(terrain.world().hash(), expected, "the edits under way and queued went in as well");
    let before = terrain.snapshot();
    terrain.commit(stale).expect_err("the world has changed since");
    assert_eq!((terrain.world().hash(), terrain.world().revision()), (before.hash(), before.revision()));
    assert!(!terrain.is_busy() && terrain.queued() == 0);
    assert_flawless(&terrain, "after a stale commit");
}

#[test]
fn a_transaction_that_was_given_up_is_not_committed_beside_its_successor() {
    let dig = |x: f32, tag: u64| Brush::dig(Shape::sphere(Vec3::new(x, 8.0, 6.0), 2.0)).with_tag(tag);
    let mut terrain = small_terrain();
    terrain.submit(&dig(3.0, 1));
    let first = terrain.begin().expect("an edit waits");
    // Its task seems lost, so it is given up, and done again together with what came since.
    terrain.abandon();
    terrain.submit(&dig(11.0, 2));
    let second = terrain.begin().expect("edits wait");
    assert_eq!(second.len(), 2);
    // The lost one turns up after all.
    let late = terrain.commit(first.run()).map_or(0, |receipts| receipts.len());
    let receipts = terrain.commit(second.run()).map_or(0, |receipts| receipts.len());
    let rest = terrain
        .begin()
        .map(|rest| rest.run())
        .and_then(|rest| terrain.commit(rest).ok())
        .map_or(0, |r| r.len());
    assert_eq!(late + receipts + rest, 2, "each brush gets exactly one receipt");
    let expected = {
        let mut terrain = small_terrain();
        terrain.apply([dig(3.0, 1), dig(11.0, 2)]);
        terrain.world().hash()
    };
    assert_eq!(terrain.world().hash(), expected, "an edit was lost");
}

#[test]
fn a_commit_of_another_terrain_is_refused() {
    let mut one = small_terrain();
    let mut other = terrain(Ground::flat(30, 30, 2.0).expect("finite heights"), 25);
    one.submit(&Brush::dig(Shape::sphere(Vec3::new(6.0, 5.0, 6.0), 2.0)));
    other.submit(&Brush::dig(Shape::sphere(Vec3::new(20.0, 2.0, 20.0), 2.0)));
    let commit = other.begin().expect("an edit waits").run();
    let before = one.world().hash();
    assert!(one.commit(commit).is_err(), "samples of a world of 30 x 30 cells went into one of 14 x 12");
    assert_eq!(one.world().hash(), before);
}

#[test]
fn edits_that_were_given_up_are_queued_again_in_order() {
    let mut terrain = small_terrain();
    let tags = |terrain: &mut Terrain| -> Vec<u64> {
        let transaction = terrain.begin().expect("edits wait");
        let receipts = terrain.commit(transaction.run()).expect("nothing came in between");
        receipts.iter().map(|receipt| receipt.tag).collect()
    };
    let brush = |tag: u64| Brush::dig(Shape::sphere(Vec3::new(tag as f32, 8.0, 6.0), 1.5)).with_tag(tag);
    assert!(terrain.begin().is_none(), "nothing waits");
    terrain.abandon();
    assert_eq!(terrain.queued(), 0, "nothing was under way");

    for tag in 0..3 {
        terrain.submit(&brush(tag));
    }
    let lost = terrain.begin().expect("edits wait");
    assert!(terrain.is_busy() && terrain.queued() == 0);
    for tag in 3..5 {
        terrain.submit(&brush(tag));
    }
    assert!(terrain.begin().is_none(), "one at a time");
    assert_eq!(terrain.queued(), 2);
    // The task dies, and the transaction with it.
    drop(lost);
    assert!(terrain.is_busy(), "nobody told the terrain");
    terrain.abandon();
    assert!(!terrain.is_busy());
    assert_eq!(terrain.queued(), 5);
    // Twice is not more.
    terrain.abandon();
    assert_eq!(terrain.queued(), 5);
    assert_eq!(tags(&mut terrain), [0, 1, 2, 3, 4]);

    // A commit that was computed and dropped is no different.
    terrain.submit(&brush(7));
    drop(terrain.begin().expect("an edit waits").run());
    terrain.submit(&brush(8));
    terrain.abandon();
    assert_eq!(tags(&mut terrain), [7, 8]);
    assert!(!terrain.is_busy() && terrain.queued() == 0);
}

#[test]
fn edits_overtaken_by_apply_keep_their_order() {
    // Add over dig and dig over add differ, so the hash tells the order.
    let place = Shape::sphere(Vec3::new(7.0, 9.0, 6.0), 3.0);
    let nearby = Shape::sphere(Vec3::new(8.0, 9.0, 6.0), 3.0);
    let script = [
        Brush::dig(place),
        Brush::add(nearby, MaterialId(2)),
        Brush::dig(nearby),
        Brush::add(place, MaterialId(3)),
    ];
    let mut expected = small_terrain();
    expected.apply(&script);
    let mut terrain = small_terrain();
    terrain.submit(&script[0]);
    let _under_way = terrain.begin().expect("an edit waits");
    terrain.submit(&script[1]);
    terrain.submit(&script[2]);
    terrain.apply([&script[3]]);
    assert_eq!(terrain.world().hash(), expected.world().hash());
}

#[test]
fn snapshots_stay_as_they_were() {
    let mut rng = Rng::with_seed(8);
    let (ground, chunk_size) = random_ground(&mut rng, 1);
    let brushes: Vec<Brush> = (0..10)
        .map(|i| match i % 2 {
            0 => random_brush(&mut rng, &ground),
            _ => random_brush_at_a_face(&mut rng, &ground, chunk_size),
        })
        .collect();
    let mut terrain = terrain(ground, chunk_size);
    let mut snapshots = Vec::new();
    for brush in &brushes {
        let snapshot = terrain.snapshot();
        snapshots.push((snapshot.hash(), snapshot.revision(), snapshot.check_seams(), snapshot));
        terrain.apply([brush]);
    }
    for (hash, revision, report, snapshot) in snapshots {
        assert_eq!((snapshot.hash(), snapshot.revision()), (hash, revision));
        assert_eq!(snapshot.check_seams(), report);
    }
}
