//! Receipts are correct: volumes balance, bounds are tight, and nothing changes out of reach.

mod worlds;

use std::collections::BTreeMap;

use bevy_burrow::brush::BAND;
use bevy_burrow::ground::{Ground, MaterialControl};
use bevy_burrow::lattice::{LIMIT, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use bevy_burrow::volume::MaterialCounts;
use fastrand::Rng;
use glam::{IVec3, Vec3};
use worlds::{
    any_random_brush, random_brush, random_brush_at_a_face, random_ground, random_strata, reference_density,
};

/// The difference of two worlds within a box, sample by sample.
#[derive(Default, Debug)]
struct Difference {
    bounds: Option<LatticeBox>,
    removed: BTreeMap<MaterialId, u64>,
    added: BTreeMap<MaterialId, u64>,
    painted: BTreeMap<MaterialId, u64>,
    solid: [u64; 2],
    newly_edited: i64,
    /// Samples that are pristine again.
    returned: u64,
}

impl Difference {
    fn between(before: &World, after: &World, place: LatticeBox) -> Self {
        let mut found = Self::default();
        let (old, new) = (before.samples(), after.samples());
        for point in place.points() {
            let solid = [old.is_solid(point), new.is_solid(point)];
            found.solid[0] += u64::from(solid[0]);
            found.solid[1] += u64::from(solid[1]);
            if old.sample(point) == new.sample(point)
                && old.stored_material(point) == new.stored_material(point)
            {
                assert_eq!(solid[0], solid[1], "the same sample at {point} changed sides");
                continue;
            }
            found.newly_edited += i64::from(new.is_edited(point)) - i64::from(old.is_edited(point));
            found.returned += u64::from(!new.is_edited(point));
            LatticeBox::include(&mut found.bounds, LatticeBox::point(point));
            let (was, is) = (old.material(point), new.material(point));
            let (counts, material) = match solid {
                [true, false] => (&mut found.removed, was),
                [false, true] => (&mut found.added, is),
                [true, true] if was != is => (&mut found.painted, is),
                _ => continue,
            };
            *counts.entry(material).or_default() += 1;
        }
        found
    }
}

fn by_material(counts: &MaterialCounts) -> BTreeMap<MaterialId, u64> {
    counts.iter().filter(|&(_, voxels)| voxels > 0).collect()
}

fn edited_samples(world: &World) -> i64 {
    world
        .bricks()
        .map(|(_, brick)| brick.edited().iter().map(|layer| i64::from(layer.count_ones())).sum::<i64>())
        .sum()
}

/// Adds materials to a ground: rock with patches of grass and sand on top.
fn with_materials(ground: Ground) -> Ground {
    let rules = vec![
        MaterialRule { overlay: MaterialId(11), slope: (0.8, f64::INFINITY), ..Default::default() },
        MaterialRule {
            overlay: MaterialId(12),
            height: (-5.0, 20.0),
            height_fade: 6.0,
            ..Default::default()
        },
    ];
    ground.with_materials(&MaterialControl::Rules { base: MaterialId(10), rules }).expect("valid rules")
}

#[test]
fn a_thousand_receipts_balance_with_the_world() {
    let (mut edits, mut split, mut totals) = (0, 0, [0u64; 3]);
    for seed in 0.. {
        if edits >= 1200 {
            break;
        }
        let mut rng = Rng::with_seed(seed);
        // Chunks of small and medium size; counting large ones takes too long.
        let (ground, chunk_size) = random_ground(&mut rng, [0, 0, 1, 2][seed as usize % 4]);
        let mut ground = with_materials(ground);
        if seed % 3 == 2 {
            let (low, high) = ground.height_range();
            let heights = [low as f32 / 256.0 - 20.0, high as f32 / 256.0 + 2.0];
            ground = ground.with_strata(&random_strata(&mut rng, heights)).expect("valid strata");
        }
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        for number in 0..30 {
            let ground = terrain.world().ground();
            let brush = match rng.u32(0..4) {
                0 => random_brush_at_a_face(&mut rng, ground, chunk_size),
                1 => random_brush(&mut rng, ground),
                _ => any_random_brush(&mut rng, ground),
            };
            let Ok(edit) = Edit::quantize(&brush) else { continue };
            let is_reset = matches!(brush.operation, Operation::Reset);
            let Some(place) = edit.reach().grown(3).intersection(terrain.world().grid().edit_bounds()) else {
                continue;
            };
            if place.volume() > 200_000 {
                continue;
            }
            let what = format!("world {seed}, edit {number}: {brush:?}");
            let before = terrain.snapshot();
            let receipts = terrain.apply([&brush]);
            let after = terrain.world();
            let [Receipt { kind: OrderKind::Edit, tag: 0, outcome: Ok(applied) }] = receipts.as_slice()
            else {
                // The edit's reach may end outside the world, although its enlarged box meets it.
                assert_eq!(receipts[0].outcome, Err(Rejection::OutsideWorld), "{what}");
                assert_eq!(after.hash(), before.hash(), "{what}");
                continue;
            };
            let found = Difference::between(&before, after, place);
            assert_eq!(by_material(&applied.removed), found.removed, "removed; {what}");
            assert_eq!(by_material(&applied.added), found.added, "added; {what}");
            assert_eq!(by_material(&applied.painted), found.painted, "painted; {what}");
            assert_eq!(applied.bounds, found.bounds, "bounds; {what}");
            let change = applied.removed.total() as i64 - applied.added.total() as i64;
            assert_eq!(change, found.solid[0] as i64 - found.solid[1] as i64, "volume; {what}");
            assert!(is_reset || found.returned == 0, "a changed sample does not count as edited; {what}");
            // Nothing changed elsewhere either.
            assert_eq!(edited_samples(after) - edited_samples(&before), found.newly_edited, "{what}");
            assert_eq!(applied.bounds.is_none(), after.hash() == before.hash(), "{what}");

            // Each chunk is named once, and contains some of the change.
            let mut chunks: Vec<_> = applied.chunks.iter().map(|part| part.chunk).collect();
            chunks.dedup();
            assert_eq!(chunks.len(), applied.chunks.len(), "{what}");
            assert_eq!(applied.is_split(), chunks.len() > 1, "{what}");
            assert_eq!(applied.chunks.is_empty(), applied.bounds.is_none(), "{what}");
            for part in &applied.chunks {
                let field = after.fields_of(part.chunk).and_then(|fields| fields.get(part.field));
                let Some(field) = field else {
                    assert!(is_reset, "the receipt names a field that is not there; {what}");
                    continue;
                };
                assert!(
                    is_reset
                        || applied.bounds.is_some_and(|bounds| bounds.intersection(field.bounds).is_some()),
                    "{what}"
                );
            }
            edits += 1;
            split += usize::from(applied.is_split());
            for (total, counts) in totals.iter_mut().zip([&applied.removed, &applied.added, &applied.painted])
            {
                *total += counts.total();
            }
        }
    }
    println!("{edits} edits, {split} split over chunks; removed, added, painted: {totals:?} voxels");
    assert!(split > 100 && totals.iter().all(|&total| total > 5000), "the edits are not varied enough");
}

#[test]
fn the_sum_of_receipts_is_the_change_of_the_whole_world() {
    for seed in 0..20 {
        let mut rng = Rng::with_seed(1000 + seed);
        let (ground, _) = random_ground(&mut rng, 0);
        let (width, depth, heights) = (ground.width(), ground.depth(), ground.height_range());
        let brushes: Vec<Brush> = (0..25).map(|_| any_random_brush(&mut rng, &ground)).collect();
        let settings = TerrainSettings { chunk_size: 8, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        let low = IVec3::new(0, heights.0 / 256 - 70, 0);
        let high = IVec3::new(width, heights.1 / 256 + 70, depth);
        let whole = LatticeBox::new(low, high).expect("a world is not empty");
        let before = terrain.world().samples().solid_count(whole);
        let (mut removed, mut added) = (MaterialCounts::default(), MaterialCounts::default());
        // All in one transaction: each receipt is relative to the edits before it.
        for receipt in terrain.apply(&brushes) {
            if let Ok(applied) = receipt.outcome {
                removed.add(&applied.removed);
                added.add(&applied.added);
                assert!(
                    applied.bounds.is_none_or(|bounds| whole.encloses(bounds)),
                    "the test's box is too small"
                );
            }
        }
        let after = terrain.world().samples().solid_count(whole);
        assert_eq!(
            removed.total() as i64 - added.total() as i64,
            before as i64 - after as i64,
            "world {seed}"
        );
    }
}

#[test]
fn samples_farther_than_two_voxels_outside_a_shape_stay_as_they_are() {
    let (mut near, mut far, mut untouched) = (0, 0, 0);
    for seed in 2000..2200 {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = random_ground(&mut rng, [0, 1][seed as usize % 2]);
        let brushes: Vec<Brush> = (0..4).map(|_| random_brush(&mut rng, &ground)).collect();
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        for brush in &brushes {
            let Ok(edit) = Edit::quantize(brush) else { continue };
            let Some(place) = edit.reach().grown(3).intersection(terrain.world().grid().edit_bounds()) else {
                continue;
            };
            if place.volume() > 200_000 {
                continue;
            }
            let before = terrain.snapshot();
            terrain.apply([brush]);
            let (old, new) = (before.samples(), terrain.world().samples());
            let evaluator = edit.evaluator();
            for point in place.points() {
                let outside = evaluator.distance(point);
                let same = old.sample(point) == new.sample(point)
                    && old.stored_material(point) == new.stored_material(point);
                assert!(
                    edit.reach().contains(point) || outside > BAND,
                    "the reach does not contain {point} of {brush:?}"
                );
                if outside > BAND {
                    assert!(
                        same,
                        "world {seed}: {point} is {outside}/256 voxel outside {brush:?} and yet changed"
                    );
                    far += 1;
                    continue;
                }
                near += 1;
                untouched += usize::from(same);
                // Near the shape, samples are exactly what the operation gives.
                let expected = reference_density(&brush.operation, old.distance(point), outside);
                let stored = expected.clamp(-32_767, 32_767);
                let unedited = !new.is_edited(point) && new.distance(point) == expected;
                assert!(unedited || new.distance(point) == stored, "world {seed}: {point} of {brush:?}");
            }
        }
    }
    println!(
        "{near} samples near a shape, {untouched} of them unchanged; {far} farther off, all of them unchanged"
    );
    assert!(near > 100_000 && far > 100_000);
}

#[test]
fn every_brush_gets_its_receipt_in_order_and_under_its_tag() {
    let ground = Ground::flat(40, 40, 10.0).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let valid = Shape::sphere(Vec3::new(20.0, 10.0, 20.0), 3.0);
    let air = Shape::sphere(Vec3::new(20.0, 60.0, 20.0), 3.0);
    let outside = Shape::sphere(Vec3::new(-90.0, 10.0, 20.0), 3.0);
    let broken = Shape::sphere(Vec3::new(20.0, f32::NAN, 20.0), 3.0);
    let mut rng = Rng::with_seed(4);
    let brushes: Vec<Brush> = (0..100)
        .map(|_| {
            let shape = [valid, air, outside, broken][rng.usize(0..4)];
            let brush = if rng.bool() { Brush::dig(shape) } else { Brush::add(shape, MaterialId(2)) };
            brush.with_tag(rng.u64(..))
        })
        .collect();
    let receipts = terrain.apply(&brushes);
    assert_eq!(receipts.len(), brushes.len());
    for (brush, receipt) in brushes.iter().zip(&receipts) {
        assert_eq!(receipt.tag, brush.tag);
        let outcome = &receipt.outcome;
        match brush.shape {
            shape if shape == outside => assert_eq!(*outcome, Err(Rejection::OutsideWorld)),
            shape if shape == valid || shape == air => assert!(outcome.is_ok(), "{outcome:?}"),
            _ => assert!(matches!(
                outcome,
                Err(Rejection::Brush(BrushError::NotFinite { what: "center", .. }))
            )),
        }
    }
}

#[test]
fn queued_edits_get_their_receipts_before_later_ones() {
    let ground = Ground::flat(40, 40, 10.0).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let at = |x: f32| Shape::sphere(Vec3::new(x, 10.0, 20.0), 3.0);
    for tag in 0..10 {
        terrain.submit(Brush::dig(at(tag as f32 * 4.0)).with_tag(tag));
        if tag % 3 == 1 {
            let edit = Edit::quantize(&Brush::dig(at(3.0)).with_tag(100 + tag)).expect("a valid brush");
            terrain.submit(&edit);
        }
    }
    let transaction = terrain.begin().expect("queued edits");
    assert_eq!(transaction.len(), 13);
    let receipts = terrain.commit(transaction.run()).expect("no other commit");
    let tags: Vec<u64> = receipts.iter().map(|receipt| receipt.tag).collect();
    assert_eq!(tags, [0, 1, 101, 2, 3, 4, 104, 5, 6, 7, 107, 8, 9]);
}

#[test]
fn a_rejected_brush_changes_nothing() {
    let ground = Ground::flat(40, 40, 10.0).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.apply([Brush::dig(Shape::sphere(Vec3::new(20.0, 10.0, 20.0), 4.0))]);
    let before = terrain.snapshot();
    let (at, up) = (Vec3::new(20.0, 10.0, 20.0), Vec3::Y * 3.0);
    for shape in [
        Shape::sphere(at, -1.0),
        Shape::sphere(at, 0.0),
        Shape::sphere(at, f32::MIN_POSITIVE / 2.0),
        Shape::sphere(at, f32::INFINITY),
        Shape::sphere(at, 1e9),
        Shape::sphere(Vec3::new(f32::NAN, 0.0, 0.0), 2.0),
        Shape::sphere(Vec3::new(0.0, 1e30, 0.0), 2.0),
        Shape::sphere(Vec3::new(-100.0, 10.0, 20.0), 4.0),
        Shape::sphere(Vec3::new(20.0, 10.0, 32_000.0), 4.0),
        Shape::cylinder(at, Vec3::ZERO, 2.0),
        Shape::cone(at, up, f32::NAN),
        Shape::capsule(at, at * 1e6, 2.0),
        Shape::turned_cuboid(at, Vec3::ONE, glam::Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        Shape::cuboid(at, Vec3::new(1.0, 0.0, 1.0)),
    ] {
        for brush in [Brush::dig(shape), Brush::add(shape, MaterialId(1)), Brush::paint(shape, MaterialId(1))]
        {
            let receipts = terrain.apply([&brush]);
            assert!(
                matches!(receipts.as_slice(), [Receipt { outcome: Err(_), .. }]),
                "{brush:?}: {receipts:?}"
            );
            assert_eq!(terrain.world().hash(), before.hash(), "{brush:?}");
            assert_eq!(terrain.world().bricks().count(), before.bricks().count(), "{brush:?}");
            assert!(terrain.world().fields().all(|(chunk, fields)| before.fields_of(chunk) == Some(fields)));
        }
    }
    let rough = Brush::dig(Shape::sphere(at, 2.0)).with_roughness(Roughness::new(f32::NAN, 4.0, 1));
    assert!(terrain.apply([rough])[0].outcome.is_err());
    assert_eq!(terrain.world().hash(), before.hash());
}

#[test]
fn a_brush_that_finds_nothing_to_change_has_an_empty_receipt() {
    let ground = Ground::flat(40, 40, 10.0).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let untouched = terrain.world().hash();
    let (high, deep) = (Vec3::new(20.0, 40.0, 20.0), Vec3::new(20.0, -40.0, 20.0));
    for brush in [
        Brush::dig(Shape::sphere(high, 5.0)),
        Brush::paint(Shape::sphere(high, 5.0), MaterialId(3)),
        Brush::add(Shape::sphere(deep, 5.0), MaterialId(3)),
        // The lattice ends far above any ground.
        Brush::dig(Shape::sphere(Vec3::new(20.0, LIMIT as f32, 20.0), 5.0)),
    ] {
        let receipts = terrain.apply([&brush]);
        assert_eq!(receipts[0].outcome, Ok(Applied::default()), "{brush:?}");
        assert_eq!(terrain.world().hash(), untouched, "{brush:?}");
    }
    assert_eq!(terrain.world().bricks().count(), 0, "edits that change nothing store nothing");
    assert_eq!(terrain.world().fields().filter(|(_, fields)| !fields.is_empty()).count(), 0);

    // An equal edit again changes nothing.
    let dig = Brush::dig(Shape::sphere(Vec3::new(20.0, 10.0, 20.0), 4.0));
    let first = terrain.apply([&dig]).remove(0).outcome.expect("a valid brush");
    assert!(first.removed.total() > 100 && first.added.total() == 0);
    assert_eq!(terrain.apply([&dig])[0].outcome, Ok(Applied::default()));
}

#[test]
fn a_brush_in_the_air_adds_as_many_voxels_as_it_counts() {
    let axis = Vec3::new(1.5, 2.0, -1.0);
    for (number, place) in
        [Vec3::splat(30.0), Vec3::splat(30.5), Vec3::new(30.2, 31.7, 29.4)].into_iter().enumerate()
    {
        for shape in [
            Shape::sphere(place, 3.3),
            Shape::cuboid(place, Vec3::splat(2.5)),
            Shape::capsule(place, place + axis, 2.0),
            Shape::torus(place, axis, 5.0, 1.5),
        ] {
            for roughness in [0.0, 0.8] {
                let brush = Brush::add(shape, MaterialId(0));
                let brush = brush.with_roughness(Roughness::new(roughness, 2.0, number as u32));
                let ground = Ground::flat(64, 64, 5.0).expect("valid");
                let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
                let receipts = terrain.apply([&brush]);
                let added = receipts[0].outcome.as_ref().expect("a valid brush").added.total();
                assert_eq!(brush.voxel_count(), Ok(added), "{shape:?}, roughness {roughness}");
            }
        }
    }
    assert!(Brush::dig(Shape::sphere(Vec3::NAN, 1.0)).voxel_count().is_err());
}
