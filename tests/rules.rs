//! Digging rules: protected ground stays, allowed edits happen, and the result does not depend on batching or threads.

mod worlds;

use std::sync::Arc;

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::{MeshKey, World};
use bevy_burrow::volume::{MaterialCounts, RulesError};
use fastrand::Rng;
use glam::{IVec3, Vec3};
use worlds::{any_random_brush, random_brush_at_a_face, random_ground, random_rules};

/// A ground, its chunk size, rules, and brushes of any power.
fn script(seed: u64) -> (Arc<Ground>, u32, DiggingRules, Vec<Brush>) {
    let mut rng = Rng::with_seed(seed);
    let (ground, chunk_size) = random_ground(&mut rng, seed);
    let rules = random_rules(&mut rng, &ground);
    let brush = |rng: &mut Rng| match rng.u32(0..4) {
        0 => random_brush_at_a_face(rng, &ground, chunk_size),
        _ => any_random_brush(rng, &ground),
    };
    let brushes: Vec<Brush> = (0..10)
        .map(|_| {
            let power = rng.u8(..) | rng.u8(..);
            brush(&mut rng).with_power(power)
        })
        .collect();
    (ground.into(), chunk_size, rules, brushes)
}

fn terrain(ground: &Arc<Ground>, chunk_size: u32, rules: &DiggingRules) -> Terrain {
    let settings = TerrainSettings { chunk_size, ..Default::default() };
    let mut terrain = Terrain::new(Arc::clone(ground), &settings).expect("valid settings");
    terrain.set_rules(rules.clone()).expect("valid rules");
    terrain
}

fn drawn(world: &World) -> Vec<(MeshKey, SurfaceMesh)> {
    world.drawn().collect()
}

#[test]
fn rules_for_the_ground_placeholder_material_are_refused() {
    let ground = Ground::flat(32, 32, 10.0).expect("valid ground");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let hard = DiggingRules::default().with_hardness(MaterialId(0), 100);
    terrain.set_rules(hard.clone()).expect("valid rules");
    let none = DiggingRules::default;
    for rules in [none().with_unbreakable(MaterialId::GROUND), none().with_hardness(MaterialId::GROUND, 9)] {
        assert_eq!(terrain.set_rules(rules), Err(RulesError::Ground));
        assert_eq!(terrain.rules(), Some(&hard));
    }
}

#[test]
fn what_is_protected_or_unbreakable_stays() {
    let (mut protected, mut unbreakable) = (0, 0);
    for seed in 0..worlds::world_count(60) {
        let (ground, chunk_size, rules, brushes) = script(seed);
        let mut terrain = terrain(&ground, chunk_size, &rules);
        for brush in &brushes {
            let before = terrain.snapshot();
            let receipts = terrain.apply([brush]);
            let Ok(applied) = &receipts[0].outcome else { continue };
            protected += applied.refused.protected.total();
            unbreakable += applied.refused.unbreakable.total();
            let Some(bounds) = applied.bounds else { continue };
            let (old, new) = (before.samples(), terrain.world().samples());
            for point in bounds.points() {
                let is_same = old.sample(point) == new.sample(point)
                    && old.stored_material(point) == new.stored_material(point);
                let is_in = |samples: &LatticeBox| samples.contains(point);
                let is_protected = rules.protected.iter().any(is_in);
                assert!(is_same || !is_protected, "world {seed} at {point}: {brush:?}");
                let is_bedrock = rules.bedrock.is_some_and(|bedrock| point.y < bedrock);
                let is_hard = rules.unbreakable.contains(&old.material(point));
                if old.is_solid(point) && (is_bedrock || is_hard) {
                    // Stored densities end at 128 voxels.
                    let is_kept = new.distance(point) <= old.distance(point).max(-32_767);
                    assert!(is_kept, "world {seed} at {point}: {brush:?}");
                    assert!(is_bedrock || new.material(point) == old.material(point), "{seed} at {point}");
                }
            }
        }
        let report = terrain.world().check_seams();
        assert!(report.is_flawless(), "world {seed}: {report}");
    }
    assert!(protected > 200 && unbreakable > 1000, "{protected} {unbreakable}");
}

#[test]
fn what_rules_refuse_is_what_would_have_changed_without_them() {
    let mut by_kind = [0; 3];
    for seed in 600..600 + worlds::world_count(24) {
        let (ground, chunk_size, rules, mut brushes) = script(seed);
        // Of what the others did.
        let resets = brushes[..5].iter().map(|brush| Brush { operation: Operation::Reset, ..brush.clone() });
        brushes.extend(resets.collect::<Vec<_>>());
        let mut terrain = terrain(&ground, chunk_size, &DiggingRules::default());
        for brush in &brushes {
            terrain.set_rules(DiggingRules::default()).expect("valid rules");
            let before = terrain.snapshot();
            terrain.apply([brush]);
            let plain = terrain.snapshot();
            if plain.hash() != before.hash() {
                assert!(terrain.undo().outcome.is_ok());
            }
            terrain.set_rules(rules.clone()).expect("valid rules");
            let Ok(applied) = terrain.apply([brush]).remove(0).outcome else { continue };
            // Voxels that turned to ground, to air, or to another material.
            let bricks = plain.bricks().chain(before.bricks()).map(|(pos, _)| pos);
            let bricks: std::collections::BTreeSet<_> = bricks.collect();
            let voxel =
                |world: &World, at: IVec3| world.samples().is_solid(at).then(|| world.samples().material(at));
            let changed = |world: &World| {
                let points = bricks.iter().flat_map(|pos| pos.samples().points());
                points.filter(|&at| voxel(world, at) != voxel(&before, at)).count() as u64
            };
            let (all, allowed) = (changed(&plain), changed(terrain.world()));
            let own = applied.refused.total();
            assert_eq!(all - allowed, own, "world {seed}: {brush:?} under {rules:?}");
            let kind = match brush.operation {
                Operation::Reset => 0,
                Operation::Paste { .. } => 1,
                _ => 2,
            };
            by_kind[kind] += own;
        }
    }
    assert!(by_kind.iter().all(|&voxels| voxels > 50), "voxels of resets, pastes, and others: {by_kind:?}");
}

#[test]
fn rules_that_refuse_nothing_change_nothing() {
    let (none, nowhere) = (DiggingRules::default, MaterialId(200));
    let far = LatticeBox::point(IVec3::new(3, 32_000, 3));
    // The first applies to every edit, the second to those of less than full power, the last to almost none.
    let rules = [
        none().with_unbreakable(nowhere),
        none().with_hardness(nowhere, 255),
        none().with_protected(far).with_hardness(nowhere, 9),
    ];
    for seed in 100..100 + worlds::world_count(40) {
        let (ground, chunk_size, _, brushes) = script(seed);
        let mut without = terrain(&ground, chunk_size, &none());
        let mut under = rules.each_ref().map(|rules| terrain(&ground, chunk_size, rules));
        for brushes in brushes.chunks(3) {
            let expected = without.apply(brushes);
            for (with, rules) in under.iter_mut().zip(&rules) {
                assert_eq!(with.apply(brushes), expected, "world {seed}, {rules:?}");
            }
        }
        let expected = drawn(without.world());
        for (with, rules) in under.iter().zip(&rules) {
            assert_eq!(with.world().hash(), without.world().hash(), "world {seed}, {rules:?}");
            assert!(drawn(with.world()) == expected, "world {seed}, {rules:?}");
        }
    }
}

/// Boxes that protect no existing ground: far away, outside the world, inverted, and at the limits of the integers.
fn boxes_without_effect() -> Vec<LatticeBox> {
    let far = |i: i32| LatticeBox::point(IVec3::new(i % 100 - 50, 20_000 + i, i / 10 - 50)).grown(i % 7);
    let (low, high) = (IVec3::MIN, IVec3::MAX);
    let strange = [
        LatticeBox { min: IVec3::splat(9), max: IVec3::splat(-9) },
        LatticeBox { min: high, max: low },
        LatticeBox { min: low.with_x(5), max: high.with_x(4) },
        LatticeBox::point(low),
        LatticeBox::point(high),
        LatticeBox { min: low, max: high.with_y(-32_770) },
        LatticeBox { min: low.with_x(i32::MAX - 1), max: high },
    ];
    (0..1000).map(far).chain(strange).collect()
}

#[test]
fn protected_boxes_elsewhere_change_nothing() {
    let protected = boxes_without_effect();
    for seed in 300..300 + worlds::world_count(30) {
        let (ground, chunk_size, own, brushes) = script(seed);
        // Without other rules, and in addition to rules that matter.
        for rules in [DiggingRules::default(), own] {
            let more = DiggingRules { protected: [&*protected, &*rules.protected].concat(), ..rules.clone() };
            let [mut with, mut without] = [more, rules].map(|rules| {
                let mut terrain = terrain(&ground, chunk_size, &rules);
                // Protected boxes also restrict the removal of loose pieces.
                terrain
                    .set_loose((seed % 2 == 0).then(|| LooseSettings { debris: 400, ..Default::default() }));
                terrain
            });
            for brushes in brushes.chunks(4) {
                assert_eq!(with.apply(brushes), without.apply(brushes), "world {seed}");
            }
            assert_eq!(with.world().hash(), without.world().hash(), "world {seed}");
        }
    }
}

#[test]
fn a_protected_box_equals_the_parts_that_it_is_cut_into() {
    for seed in 400..400 + worlds::world_count(20) {
        let (ground, chunk_size, rules, brushes) = script(seed);
        let cut = |own: &LatticeBox| own.points().map(LatticeBox::point).collect::<Vec<_>>();
        let protected = rules.protected.iter().flat_map(cut).rev().collect();
        let [mut whole, mut pieces] = [rules.clone(), DiggingRules { protected, ..rules }]
            .map(|rules| terrain(&ground, chunk_size, &rules));
        for brushes in brushes.chunks(3) {
            assert_eq!(whole.apply(brushes), pieces.apply(brushes), "world {seed}");
        }
        assert_eq!(whole.world().hash(), pieces.world().hash(), "world {seed}");
    }
}

#[test]
fn a_box_over_the_whole_integer_range_protects_everything() {
    let all = LatticeBox { min: IVec3::MIN, max: IVec3::MAX };
    for seed in 500..510 {
        let (ground, chunk_size, _, brushes) = script(seed);
        let mut terrain = terrain(&ground, chunk_size, &DiggingRules::default().with_protected(all));
        terrain.set_loose(Some(LooseSettings { crumbs: 100, debris: 400, ..Default::default() }));
        let before = terrain.world().hash();
        for receipt in terrain.apply(&brushes) {
            let applied = receipt.outcome.expect("a valid brush");
            assert!(applied.bounds.is_none() && applied.loose.is_empty(), "world {seed}");
            let changed = [&applied.removed, &applied.added, &applied.painted].map(MaterialCounts::total);
            assert_eq!(changed, [0; 3], "world {seed}");
        }
        assert_eq!(terrain.world().hash(), before, "world {seed}");
    }
}

#[test]
fn removing_a_loose_piece_changes_no_protected_sample() {
    let ground = Arc::new(Ground::flat(64, 64, 10.0).expect("valid"));
    let cuboid = |center: Vec3, half: Vec3| Brush::add(Shape::cuboid(center, half), MaterialId(2));
    let pillar = cuboid(Vec3::new(32.0, 14.0, 32.0), Vec3::new(1.2, 8.0, 1.2));
    let slab = cuboid(Vec3::new(32.0, 22.0, 32.0), Vec3::new(6.2, 2.2, 6.2));
    // What changes in a box when the pillar is dug away, and the fate of the slab.
    let fall = |rules: DiggingRules, own: LatticeBox| {
        let mut terrain = terrain(&ground, 16, &DiggingRules::default());
        terrain.apply([&pillar, &slab]);
        terrain.set_rules(rules).expect("valid rules");
        terrain.set_loose(Some(LooseSettings { crumbs: 10_000, ..Default::default() }));
        let before = terrain.snapshot();
        let dig = Brush::dig(Shape::sphere(Vec3::new(32.0, 15.0, 32.0), 4.0));
        let applied = terrain.apply([dig]).remove(0).outcome.expect("a valid brush");
        let (old, new) = (before.samples(), terrain.world().samples());
        let changed = own.points().filter(|&at| old.sample(at) != new.sample(at)).count();
        assert!(terrain.world().check_seams().is_flawless());
        (changed, applied.loose.iter().map(|piece| piece.fate).collect::<Vec<_>>())
    };
    // Air next to the slab, among a thousand boxes far away.
    let beside = LatticeBox::new(IVec3::new(39, 18, 20), IVec3::new(42, 26, 44)).expect("not empty");
    let rules = DiggingRules { protected: boxes_without_effect(), ..Default::default() };
    let (changed, fates) = fall(rules.clone(), beside);
    assert!(changed > 50 && fates == [PieceFate::Removed]);
    assert_eq!(fall(rules.clone().with_protected(beside), beside), (0, vec![PieceFate::Removed]));
    // One voxel of the slab itself.
    let corner = LatticeBox::point(IVec3::new(38, 22, 32));
    assert_eq!(fall(rules.with_protected(corner), beside), (0, vec![PieceFate::Left]));
}

#[test]
fn hardness_and_power_have_their_documented_limits() {
    let ground = Arc::new(Ground::flat(40, 40, 20.5).expect("valid"));
    let dig = |power| Brush::dig(Shape::sphere(Vec3::new(20.0, 20.0, 20.0), 5.0)).with_power(power);
    let removed = |hardness, power| {
        let mut terrain =
            terrain(&ground, 32, &DiggingRules::default().with_hardness(MaterialId(0), hardness));
        let applied = terrain.apply([dig(power)]).remove(0).outcome.expect("a valid brush");
        (applied.removed.total(), applied.refused.total())
    };
    let (all, none) = removed(0, 0);
    assert!(all > 100 && none == 0, "material without hardness needs no power");
    assert_eq!(removed(255, 255), (all, 0));
    let (nearly, slowed) = removed(255, 254);
    assert!(nearly + slowed == all && slowed > 0 && slowed < all / 4, "{nearly} and {slowed} of {all}");
    assert_eq!([removed(255, 127), removed(255, 0), removed(1, 0)], [(0, all); 3]);
}

#[test]
fn results_under_rules_do_not_depend_on_batches_or_threads() {
    let pools = [1, 2, 5].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads"));
    for seed in 200..200 + worlds::world_count(30) {
        let (ground, chunk_size, rules, brushes) = script(seed);
        let run = |batch: usize| {
            let mut terrain = terrain(&ground, chunk_size, &rules);
            let receipts: Vec<Receipt> =
                brushes.chunks(batch).flat_map(|brushes| terrain.apply(brushes)).collect();
            (terrain.world().hash(), drawn(terrain.world()), receipts)
        };
        let first = run(1);
        for (pool, batch) in pools.iter().zip([10, 3, 10]) {
            let other = pool.install(|| run(batch));
            assert_eq!(first.0, other.0, "world {seed}: hash in batches of {batch}");
            assert!(first == other, "world {seed}: receipts or meshes in batches of {batch}");
        }
    }
}

#[test]
fn a_weak_tool_needs_more_digs_for_the_same_hole() {
    let ground = Arc::new(Ground::flat(64, 64, 30.25).expect("valid"));
    let shape = Shape::capsule(Vec3::new(28.0, 28.0, 32.0), Vec3::new(36.0, 22.0, 32.0), 5.0);
    let rules = DiggingRules::default().with_hardness(MaterialId(0), 120);
    let air = |terrain: &Terrain| {
        let all = LatticeBox::new(IVec3::new(12, 5, 12), IVec3::new(50, 30, 50)).expect("not empty");
        all.volume() - terrain.world().samples().solid_count(all)
    };
    let mut full = terrain(&ground, 32, &rules);
    let removed = |receipts: &[Receipt]| receipts[0].outcome.as_ref().map_or(0, |a| a.removed.total());
    let all = removed(&full.apply([Brush::dig(shape)]));
    let mut steps = Vec::new();
    for power in [70, 90, 119] {
        let mut slow = terrain(&ground, 32, &rules);
        let (mut sum, mut count) = (0, 0);
        while air(&slow) < air(&full) {
            let receipts = slow.apply([Brush::dig(shape).with_power(power)]);
            let applied = receipts[0].outcome.as_ref().expect("a valid brush");
            assert!(applied.bounds.is_some(), "each dig changes something until nothing is left");
            assert!(count > 0 || power > 100 || applied.refused.slowed.total() > 50);
            sum += applied.removed.total();
            count += 1;
            assert!(count < 200 && air(&slow) <= air(&full));
        }
        assert_eq!(sum, all, "all digs together remove as much as one strong dig");
        steps.push(count);
    }
    assert!(steps[0] > steps[1] && steps[1] > steps[2] && steps[2] > 1, "{steps:?}");
    let mut weak = terrain(&ground, 32, &rules);
    let receipts = weak.apply([Brush::dig(shape).with_power(60)]);
    let applied = receipts[0].outcome.as_ref().expect("a valid brush");
    assert_eq!(
        (applied.bounds, applied.removed.total()),
        (None, 0),
        "half of the needed power is too little"
    );
    assert_eq!(applied.refused.too_hard.iter().collect::<Vec<_>>(), [(MaterialId(0), all)]);
}

#[test]
fn receipts_tell_what_was_refused_and_why() {
    let ground = Arc::new(Ground::flat(64, 64, 20.5).expect("valid"));
    let samples = LatticeBox::new(IVec3::new(30, 18, 20), IVec3::new(34, 40, 44)).expect("not empty");
    let rules =
        DiggingRules::default().with_protected(samples).with_bedrock(17).with_unbreakable(MaterialId(7));
    let mut terrain = terrain(&ground, 25, &rules);
    let ball = Shape::sphere(Vec3::new(32.0, 20.0, 32.0), 6.0);
    let receipts = terrain.apply([
        Brush::dig(ball),
        Brush::add(Shape::sphere(Vec3::new(32.0, 28.0, 32.0), 6.0), MaterialId(7)),
        Brush::paint(ball, MaterialId(3)),
        Brush::dig(Shape::sphere(Vec3::new(32.0, 28.0, 32.0), 7.0)),
    ]);
    let applied: Vec<&Applied> =
        receipts.iter().map(|receipt| receipt.outcome.as_ref().expect("valid brushes")).collect();
    let list = |counts: &MaterialCounts| counts.iter().collect::<Vec<_>>();
    // The part of the ball below the surface is either dug or refused.
    let solid = |points: &mut dyn Iterator<Item = IVec3>| points.count() as u64;
    let inside = |at: IVec3| at.y <= 20 && (at - IVec3::new(32, 20, 32)).length_squared() <= 36;
    let all = LatticeBox::point(IVec3::new(32, 20, 32)).grown(6);
    let boxed = solid(&mut all.points().filter(|&at| inside(at) && samples.contains(at)));
    let rock = solid(&mut all.points().filter(|&at| inside(at) && at.y < 17 && !samples.contains(at)));
    assert_eq!(list(&applied[0].refused.protected), [(MaterialId(0), boxed)]);
    assert_eq!(list(&applied[0].refused.unbreakable), [(MaterialId(0), rock)]);
    let every = solid(&mut all.points().filter(|&at| inside(at)));
    assert_eq!(applied[0].removed.total() + boxed + rock, every);
    // New ground in the box would have been of material 7, which is unbreakable in general.
    assert!(applied[1].refused.protected.of(MaterialId(7)) > 100 && applied[1].added.total() > 100);
    assert_eq!(list(&applied[2].refused.protected), [(MaterialId(0), boxed)]);
    assert!(applied[2].painted.of(MaterialId(3)) > 50);
    assert!(applied[3].refused.unbreakable.of(MaterialId(7)) > 100);
    assert_eq!(applied[3].removed.of(MaterialId(7)), 0);
    assert!(terrain.world().check_seams().is_flawless());
}

#[test]
fn rules_can_be_removed() {
    let ground = Arc::new(Ground::flat(40, 40, 10.0).expect("valid"));
    let mut terrain = terrain(&ground, 32, &DiggingRules::default().with_bedrock(100));
    let dig = Brush::dig(Shape::sphere(Vec3::new(20.0, 10.0, 20.0), 4.0));
    assert!(terrain.rules().is_some());
    terrain.apply([&dig]);
    let held = terrain.snapshot();
    terrain.set_rules(DiggingRules::default()).expect("valid rules");
    // Reading the world must not cause a copy of it.
    assert!(terrain.rules().is_none() && std::ptr::eq(terrain.world(), &*held));
    terrain.apply([&dig]);
    let mut free = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    free.apply([&dig]);
    assert_eq!(free.world().hash(), terrain.world().hash());
}

#[test]
fn additions_on_protected_ground_are_dug_off_without_a_trace() {
    let ground = Arc::new(Ground::flat(32, 32, 19.9).expect("valid"));
    let below = LatticeBox::new(IVec3::new(0, -100, 0), IVec3::new(32, 19, 32)).expect("in order");
    let none = DiggingRules::default;
    for rules in [
        none().with_protected(below),
        none().with_unbreakable(MaterialId(0)),
        none().with_bedrock(20),
        none().with_hardness(MaterialId(0), 100),
    ] {
        let mut terrain = terrain(&ground, 32, &rules);
        let dig = Brush::dig(Shape::sphere(Vec3::new(16.0, 20.0, 16.0), 4.0)).with_power(0);
        terrain.apply([&dig]);
        let height = |terrain: &Terrain| terrain.world().height(16.0, 16.0).expect("inside");
        let before = height(&terrain);
        let bumps = (0..25).map(|i| {
            let place = Vec3::new(14.0 + (i % 5) as f32, 20.0, 14.0 + (i / 5) as f32);
            Brush::add(Shape::sphere(place, 0.3), MaterialId(7))
        });
        terrain.apply(bumps);
        assert!(height(&terrain) > before + 0.1);
        let receipts = terrain.apply([&dig]);
        let applied = receipts[0].outcome.as_ref().expect("applied");
        assert_eq!(applied.removed.total(), 25, "only the bumps are dug");
        assert!((height(&terrain) - before).abs() < 0.01, "{before} became {}", height(&terrain));
    }
}
