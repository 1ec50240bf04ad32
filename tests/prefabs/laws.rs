//! What a paste changes, and what it leaves alone.

use std::sync::Arc;

use bevy_burrow::brush::Edit;
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use bevy_burrow::volume::Sample;
use fastrand::Rng;
use glam::{IVec3, Quat, Vec3};

use crate::worlds::{any_random_brush, random_ground, random_rules, random_strata, world_count};

pub fn terrain(ground: &Arc<Ground>, chunk_size: u32) -> Terrain {
    let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
    Terrain::new(Arc::clone(ground), &settings).expect("valid settings")
}

/// A random world with some edits, some of them over strata.
pub fn edited_on(rng: &mut Rng, index: u64) -> (Arc<Ground>, Terrain) {
    let (ground, chunk_size) = random_ground(rng, index);
    let (low, high) = ground.height_range();
    let strata = random_strata(rng, [low as f32 / 256.0 - 20.0, high as f32 / 256.0 + 2.0]);
    let ground = if rng.bool() { ground.with_strata(&strata).expect("valid strata") } else { ground };
    let ground = Arc::new(ground);
    let mut terrain = terrain(&ground, chunk_size);
    let brushes: Vec<Brush> = (0..10).map(|_| any_random_brush(rng, &ground)).collect();
    terrain.apply(brushes);
    (ground, terrain)
}

pub fn edited(rng: &mut Rng, index: u64) -> Terrain {
    edited_on(rng, index).1
}

/// A box of the world, with edits in it if there are any.
pub fn some_box(rng: &mut Rng, world: &World) -> LatticeBox {
    let bricks: Vec<IVec3> = world.bricks().map(|(pos, _)| pos.origin()).collect();
    let rim = IVec3::new(world.ground().width(), 1 << 14, world.ground().depth());
    let size = IVec3::new(rng.i32(1..30), rng.i32(1..40), rng.i32(1..30)).min(rim);
    let middle = if bricks.is_empty() { rim.with_y(0) / 2 } else { bricks[rng.usize(..bricks.len())] };
    let min = (middle - size / 2).clamp(IVec3::ZERO.with_y(-(1 << 14)), rim - size);
    LatticeBox { min, max: min + size }
}

/// The samples with their materials, pristine ones as they look.
fn look(world: &World, point: IVec3) -> (i32, Option<MaterialId>) {
    let samples = world.samples();
    let density = samples.distance(point).clamp(-32767, 32767);
    (density, (density < 0).then(|| samples.material(point)))
}

fn stored(world: &World, point: IVec3) -> (Sample, MaterialId) {
    (world.samples().sample(point), world.samples().stored_material(point))
}

/// Checks that two worlds have equal samples outside a box.
pub fn check_outside(before: &World, after: &World, samples: LatticeBox) {
    let bricks = before.bricks().chain(after.bricks()).flat_map(|(pos, _)| pos.samples().points());
    let around = samples.grown(3).points();
    for point in bricks.chain(around).filter(|point| !samples.contains(*point)) {
        assert_eq!(stored(before, point), stored(after, point), "{point} outside of {samples:?}");
    }
}

#[test]
fn what_is_pasted_elsewhere_has_the_same_bits_and_all_around_it_stays() {
    for index in 0..world_count(25) {
        let mut rng = Rng::with_seed(index + 100);
        let mut terrain = edited(&mut rng, index);
        let from = some_box(&mut rng, terrain.world());
        let prefab = terrain.world().copy(from, from.min).expect("it lies in the world");
        assert_eq!(prefab.size(), from.size());
        let rim = IVec3::new(terrain.world().ground().width(), 0, terrain.world().ground().depth());
        let shift = IVec3::new(
            rng.i32(-from.min.x..=rim.x - from.max.x),
            rng.i32(-30..30),
            rng.i32(-from.min.z..=rim.z - from.max.z),
        );
        let to = LatticeBox { min: from.min + shift, max: from.max + shift };
        let brush = Brush::paste(Paste::new(prefab, to.min.as_vec3()));
        let (before, history) = (terrain.snapshot(), terrain.history());
        let draft = terrain.draft(&[Edit::quantize(&brush).expect("a valid brush")]);
        terrain.keep_log(Some(1 << 30));
        let receipt = terrain.apply([brush.clone()]).remove(0);
        let applied = receipt.outcome.clone().expect("it lies in the world");
        let world = terrain.snapshot();
        for point in from.points() {
            assert_eq!(look(&before, point), look(&world, point + shift), "world {index} at {point}");
        }
        check_outside(&before, &world, to);
        assert!(world.check_seams().is_flawless(), "world {index}");
        assert!(applied.bounds.is_none_or(|bounds| to.encloses(bounds)));
        let count = |world: &World| world.samples().solid_count(to) as i64;
        let added = applied.added.total() as i64 - applied.removed.total() as i64;
        assert_eq!(count(&world) - count(&before), added, "the receipt counts what changed");
        assert_eq!((draft.hash, &draft.receipts[0]), (world.hash(), &receipt));

        // Pasting once more changes nothing, and neither is a step of undo.
        terrain.apply([brush.clone()]);
        assert_eq!(terrain.world().hash(), world.hash());
        let is_changed = world.hash() != before.hash();
        assert_eq!(terrain.history().undos, history.undos + usize::from(is_changed));
        if is_changed {
            terrain.undo();
            assert_eq!(terrain.world().hash(), before.hash(), "world {index}: one step");
            assert!(terrain.world().check_seams().is_flawless());
            terrain.redo();
            assert_eq!(terrain.world().hash(), world.hash());
        }

        // Another machine replays the log.
        let mut rng = Rng::with_seed(index + 100);
        let mut replayed = edited(&mut rng, index);
        for record in terrain.take_log() {
            replayed.replay(&record).expect("the same world");
        }
        assert_eq!(replayed.world().hash(), world.hash());
    }
}

#[test]
fn only_edited_samples_are_pasted_if_the_paste_says_so() {
    for index in 0..world_count(15) {
        let mut rng = Rng::with_seed(index + 300);
        let mut terrain = edited(&mut rng, index);
        let from = some_box(&mut rng, terrain.world());
        let before = terrain.snapshot();
        let prefab = before.copy(from, from.min).expect("it lies in the world");
        let edited = from.points().filter(|&point| before.samples().is_edited(point)).count();
        assert_eq!(prefab.edited_count(), edited as u64);
        let shift = IVec3::new(0, 70, 0);
        let paste = Paste::new(prefab, (from.min + shift).as_vec3()).edited_only();
        terrain.apply([Brush::paste(paste)]);
        for point in from.points() {
            let to = point + shift;
            if before.samples().is_edited(point) {
                assert_eq!(look(&before, point), look(terrain.world(), to), "world {index} at {point}");
            } else {
                assert_eq!(stored(&before, to), stored(terrain.world(), to), "world {index} at {to}");
            }
        }
        assert!(terrain.world().check_seams().is_flawless());
    }
}

#[test]
fn a_free_rotation_or_scale_stays_in_its_box_and_is_closed() {
    for index in 0..world_count(15) {
        let mut rng = Rng::with_seed(index + 500);
        let mut terrain = edited(&mut rng, index);
        let from = some_box(&mut rng, terrain.world());
        let middle = (from.min + from.max) / 2;
        let prefab = terrain.world().copy(from, middle).expect("it lies in the world");
        let turn = Quat::from_scaled_axis(Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 3.0);
        let at = middle.as_vec3() + Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 5.0;
        let paste = Paste { scale: 0.5 + rng.f32(), ..Paste::new(prefab, at).rotated(turn) };
        let edit = Edit::quantize(&Brush::paste(paste)).expect("a valid brush");
        let (before, reach) = (terrain.snapshot(), edit.reach());
        if terrain.apply([edit.clone()])[0].outcome.is_err() {
            continue;
        }
        check_outside(&before, terrain.world(), reach);
        assert!(terrain.world().check_seams().is_flawless(), "world {index}");
        let evaluator = edit.evaluator();
        for point in reach.points().filter(|&point| evaluator.distance(point) > 0) {
            assert_eq!(stored(&before, point), stored(terrain.world(), point), "{point} outside the shape");
        }
    }
}

#[test]
fn a_cave_stays_a_cave_by_any_rotation_and_scale() {
    let ground = Arc::new(Ground::flat(128, 128, 90.0).expect("valid"));
    let mut terrain = terrain(&ground, 32);
    let middle = Vec3::new(40.0, 30.0, 40.0);
    terrain.apply([Brush::dig(Shape::capsule(middle - Vec3::X * 8.0, middle + Vec3::X * 8.0, 4.0))]);
    let around = LatticeBox::point(middle.as_ivec3()).grown(16);
    let prefab = Arc::new(terrain.world().copy(around, middle.as_ivec3()).expect("it lies in the world"));
    let pristine = terrain.world().hash();
    for step in 0..12 {
        let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.64, 0.48), step as f32 * 0.5);
        let (at, scale) = (Vec3::new(80.3, 30.6, 80.1), 1.0 + step as f32 / 16.0);
        let paste = Paste { scale, ..Paste::new(Arc::clone(&prefab), at) }.rotated(turn).edited_only();
        terrain.apply([Brush::paste(paste)]);
        let ends = [-8.0, 8.0].map(|end| at + turn * Vec3::X * end * scale);
        for point in LatticeBox::point(at.as_ivec3()).grown(30).points() {
            let (from, along) = (point.as_vec3() - ends[0], ends[1] - ends[0]);
            let part = (from.dot(along) / along.length_squared()).clamp(0.0, 1.0);
            let outside = (from - along * part).length() - 4.0 * scale;
            if outside.abs() > 0.6 {
                assert_eq!(terrain.world().samples().is_solid(point), outside > 0.0, "{point}: {outside}");
            }
        }
        assert!(terrain.world().check_seams().is_flawless());
        terrain.undo();
        assert_eq!(terrain.world().hash(), pristine);
    }
}

#[test]
fn a_shape_cuts_what_is_pasted() {
    let ground = Arc::new(Ground::flat(64, 64, 20.0).expect("valid"));
    let mut terrain = terrain(&ground, 32);
    terrain.apply([Brush::dig(Shape::cuboid(Vec3::new(16.0, 20.0, 16.0), Vec3::splat(6.0)))]);
    let from = LatticeBox { min: IVec3::new(8, 12, 8), max: IVec3::new(24, 24, 24) };
    let prefab = terrain.world().copy(from, IVec3::new(16, 20, 16)).expect("it lies in the world");
    let (before, at) = (terrain.snapshot(), Vec3::new(44.0, 20.0, 44.0));
    let brush = Brush { shape: Shape::sphere(at, 5.0), ..Brush::paste(Paste::new(prefab, at)) };
    let evaluator = Edit::quantize(&brush).expect("a valid brush").evaluator();
    terrain.apply([brush]);
    for point in from.points() {
        let to = point + IVec3::new(28, 0, 28);
        let like = if evaluator.distance(to) <= 0 { point } else { to };
        assert_eq!(look(terrain.world(), to), look(&before, like), "{to}");
    }
    assert!(terrain.world().check_seams().is_flawless());
}

/// A way from the anchor of a prefab, mirrored along x and then turned by quarter turns about the y axis.
fn turned(way: IVec3, is_mirrored: bool, turns: i32) -> IVec3 {
    let way = if is_mirrored { way.with_x(-way.x) } else { way };
    (0..turns).fold(way, |way, _| IVec3::new(way.z, way.y, -way.x))
}

#[test]
fn a_paste_over_the_rim_changes_what_lies_in_the_world_and_a_copy_of_it_is_the_same() {
    let (mut cut, mut outside) = (0, 0);
    for index in 0..world_count(30) {
        let mut rng = Rng::with_seed(index + 900);
        let mut terrain = edited(&mut rng, index);
        let (from, bounds) = (some_box(&mut rng, terrain.world()), terrain.world().grid().edit_bounds());
        let anchor = (from.min + from.max) / 2;
        let prefab = terrain.world().copy(from, anchor).expect("it lies in the world");
        let (is_mirrored, turns, edited_only) = (rng.bool(), rng.i32(0..4), rng.u32(0..3) == 0);
        // Its anchor lies on the rim or not far beyond it.
        let rim = [0, bounds.max.x][rng.usize(0..2)] + rng.i32(-3..4);
        let at = IVec3::new(rim, anchor.y + rng.i32(-9..9), rng.i32(0..=bounds.max.z));
        let at = if rng.bool() { at } else { IVec3::new(at.z, at.y, at.x) };
        let paste = Paste::new(prefab, at.as_vec3()).turned_about_y(turns);
        let paste = Paste { mirror: is_mirrored, edited_only, ..paste };
        let before = terrain.snapshot();
        let outcome = terrain.apply([Brush::paste(paste)]).remove(0).outcome;
        let pasted = |point: IVec3| at + turned(point - anchor, is_mirrored, turns);
        let ends = [pasted(from.min), pasted(from.max)];
        let to = LatticeBox { min: ends[0].min(ends[1]), max: ends[0].max(ends[1]) };
        let Some(inside) = to.intersection(bounds) else {
            let is_nothing = matches!(outcome, Ok(ref applied) if *applied == Applied::default());
            assert!(is_nothing || outcome == Err(Rejection::OutsideWorld), "world {index}: {outcome:?}");
            assert_eq!(terrain.world().hash(), before.hash());
            outside += 1;
            continue;
        };
        let applied = outcome.expect("some of it lies in the world");
        assert!(applied.bounds.is_none_or(|changed| inside.encloses(changed)), "world {index}");
        check_outside(&before, terrain.world(), inside);
        for point in from.points() {
            let place = pasted(point);
            if !bounds.contains(place) {
                cut += 1;
            } else if !edited_only || before.samples().is_edited(point) {
                assert_eq!(look(&before, point), look(terrain.world(), place), "world {index} at {place}");
            } else {
                assert_eq!(
                    stored(&before, place),
                    stored(terrain.world(), place),
                    "world {index} at {place}"
                );
            }
        }
        assert!(terrain.world().check_seams().is_flawless(), "world {index}");
        // A copy of it, turned and mirrored back, looks the same where it came from.
        let anchor_of_copy = inside.min;
        let again = terrain.world().copy(inside, anchor_of_copy).expect("it lies in the world");
        let after = terrain.snapshot();
        terrain.apply([Brush::paste(Paste::new(again, anchor_of_copy.as_vec3()))]);
        assert_eq!(terrain.world().hash(), after.hash(), "world {index}: it is there already");
    }
    assert!(cut > 10_000 && outside < 15, "{cut} samples beyond the rim, {outside} pastes");
}

/// A long prefab, a flat one, and one of a single sample, at all scales.
#[test]
fn prefabs_of_any_size_are_pasted_at_any_scale_or_refused() {
    let ground = Arc::new(Ground::flat(1100, 24, 20.0).expect("valid"));
    let mut rng = Rng::with_seed(8);
    let mut world = terrain(&ground, 100);
    world.apply([Brush::dig(Shape::sphere(Vec3::new(12.0, 20.0, 12.0), 7.0))]);
    let (mut pasted, mut refused) = (0, 0);
    for size in [
        IVec3::ONE,
        IVec3::new(1024, 1, 1),
        IVec3::new(1, 1024, 2),
        IVec3::new(24, 1, 24),
        IVec3::new(2, 3, 2),
    ] {
        let min = IVec3::new(0, 18, 0);
        let samples = LatticeBox { min, max: min + size - 1 };
        let prefab = Arc::new(world.world().copy(samples, min).expect("it lies in the world"));
        for scale in [0.125, 0.3, 1.0, 8.0] {
            let at = Vec3::new(12.0 + rng.f32(), 20.0, 12.0 + rng.f32());
            let turn = Quat::from_scaled_axis(Vec3::new(rng.f32(), rng.f32(), rng.f32()));
            let paste = Paste { scale, ..Paste::new(Arc::clone(&prefab), at) };
            for paste in [paste.clone(), paste.rotated(turn)] {
                let before = world.world().hash();
                match world.apply([Brush::paste(paste)]).remove(0).outcome {
                    Ok(applied) => {
                        assert_eq!(applied.bounds.is_some(), world.world().hash() != before);
                        pasted += usize::from(applied.bounds.is_some());
                    }
                    Err(error) => {
                        assert!(scale == 8.0 && size.max_element() == 1024, "{size} x {scale}: {error}");
                        assert!(error.to_string().contains("1024"), "{error}");
                        refused += 1;
                    }
                }
                assert!(world.world().check_seams().is_flawless(), "{size} x {scale}");
            }
        }
    }
    assert!(pasted > 7 && refused > 2, "{pasted} {refused}");
    while world.undo().outcome.is_ok() {}
    assert_eq!(world.world().bricks().count(), 0);
}

#[test]
fn rules_hold_for_pastes() {
    let mut refused = 0;
    for index in 0..world_count(25) {
        let mut rng = Rng::with_seed(index + 700);
        let mut terrain = edited(&mut rng, index);
        let from = some_box(&mut rng, terrain.world());
        let prefab = terrain.world().copy(from, from.min).expect("it lies in the world");
        let rules = random_rules(&mut rng, terrain.world().ground());
        terrain.set_rules(rules.clone()).expect("valid rules");
        let before = terrain.snapshot();
        let to = from.min + IVec3::new(rng.i32(-4..4), rng.i32(-4..4), rng.i32(-4..4));
        let brush = Brush::paste(Paste::new(prefab, to.as_vec3())).with_power(rng.u8(..));
        let applied = terrain.apply([brush]).remove(0).outcome.expect("it lies in the world");
        refused += applied.refused.total();
        for point in from.points() {
            let place = point + to - from.min;
            let (old, new) = (stored(&before, place), stored(terrain.world(), place));
            let is_pasted = look(terrain.world(), place) == look(&before, point);
            assert!(old == new || is_pasted, "world {index} at {place}: entirely or not at all");
            if rules.protected.iter().any(|own| own.contains(place)) {
                assert_eq!(new, old, "world {index}: protected at {place}");
            }
            let is_gone = before.samples().is_solid(place) && !terrain.world().samples().is_solid(place);
            let is_held = rules.unbreakable.contains(&before.samples().material(place))
                || rules.bedrock.is_some_and(|bedrock| place.y < bedrock);
            assert!(!(is_gone && is_held), "world {index}: {place} is held");
        }
        assert!(terrain.world().check_seams().is_flawless());
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn a_paste_finds_the_height_of_the_ground() {
    let ground = Arc::new(Ground::from_fn(100, 100, |x, _| 10.0 + f64::from(x) * 0.5).expect("valid"));
    let mut terrain = terrain(&ground, 32);
    let house = Shape::cuboid(Vec3::new(20.0, 24.0, 20.0), Vec3::new(3.0, 4.0, 3.0));
    terrain.apply([Brush::add(house, MaterialId(7))]);
    let around = LatticeBox { min: IVec3::new(14, 16, 14), max: IVec3::new(26, 32, 26) };
    let prefab = terrain.world().copy(around, IVec3::new(20, 20, 20)).expect("it lies in the world");
    assert_eq!(prefab.above_ground(), 0);
    for (x, y) in [(60, 40), (61, 41), (80, 50)] {
        let paste = Paste::new(prefab.clone(), Vec3::new(x as f32, -300.0, 60.0)).edited_only();
        let paste = paste.onto_ground(&ground);
        assert_eq!(paste.at, Vec3::new(x as f32, y as f32, 60.0));
    }
}

#[test]
fn what_no_prefab_can_be_is_refused_with_a_reason() {
    let ground = Arc::new(Ground::flat(64, 64, 20.0).expect("valid"));
    let terrain = terrain(&ground, 32);
    let copy = |min: IVec3, max: IVec3| terrain.world().copy(LatticeBox { min, max }, min);
    for (min, max) in [
        (IVec3::ZERO, IVec3::splat(-1)),
        (IVec3::MAX, IVec3::MIN),
        (IVec3::MIN, IVec3::MAX),
        (IVec3::ZERO, IVec3::new(0, 1024, 0)),
        (IVec3::ZERO, IVec3::new(64, 4000, 64)),
    ] {
        assert!(matches!(copy(min, max), Err(PrefabError::Size { .. })), "{min} {max}");
    }
    for (min, max) in [
        (IVec3::new(-1, 0, 0), IVec3::splat(5)),
        (IVec3::splat(60), IVec3::splat(65)),
        (IVec3::new(0, 40_000, 0), IVec3::new(4, 40_004, 4)),
        (IVec3::MAX - 3, IVec3::MAX),
    ] {
        let error = copy(min, max).expect_err("outside");
        assert!(matches!(error, PrefabError::OutsideWorld { .. }), "{min} {max}");
        assert!(error.to_string().contains("copy the part from"), "{error}");
    }
    let inside = LatticeBox { min: IVec3::ZERO, max: IVec3::splat(4) };
    for anchor in [IVec3::MIN, IVec3::MAX, IVec3::new(0, 3000, 0)] {
        let copied = terrain.world().copy(inside, anchor);
        assert!(matches!(copied, Err(PrefabError::Anchor { .. })), "{anchor}");
    }
    let prefab = Arc::new(terrain.world().copy(inside, IVec3::ZERO).expect("it lies in the world"));
    let paste = |at: Vec3| Paste::new(Arc::clone(&prefab), at);
    for wrong in [
        paste(Vec3::NAN),
        paste(Vec3::splat(1e9)),
        Paste { scale: 0.0, ..paste(Vec3::ZERO) },
        Paste { scale: 100.0, ..paste(Vec3::ZERO) },
        Paste { scale: f32::INFINITY, ..paste(Vec3::ZERO) },
        paste(Vec3::ZERO).rotated(Quat::from_xyzw(0.0, 0.0, 0.0, 3.0)),
        paste(Vec3::ZERO).rotated(Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0)),
    ] {
        assert!(Edit::quantize(&Brush::paste(wrong.clone())).is_err(), "{wrong:?}");
    }
}

#[test]
fn a_paste_is_written_as_a_line_of_json_and_as_an_edit() {
    let mut rng = Rng::with_seed(3);
    let terrain = edited(&mut rng, 3);
    let from = some_box(&mut rng, terrain.world());
    let prefab = terrain.world().copy(from, from.min).expect("it lies in the world");
    let paste = Paste::new(prefab, Vec3::new(3.5, -2.0, 9.0)).turned_about_z(3).mirrored().edited_only();
    for paste in [paste.clone(), Paste { scale: 2.0, ..paste }] {
        let brush = Brush::paste(paste).with_tag(4).with_power(9);
        let line = serde_json::to_string(&brush).expect("a line");
        assert!(line.contains(r#""op":"paste""#));
        assert_eq!(serde_json::from_str::<Brush>(&line).expect("its own line"), brush);
        let edit = Edit::quantize(&brush).expect("a valid brush");
        let written = serde_json::to_string(&edit).expect("an edit");
        assert_eq!(serde_json::from_str::<Edit>(&written).expect("its own edit"), edit);
        assert_eq!(Edit::quantize(&Brush::from(&edit)).expect("valid"), edit);
        // Damage is refused.
        for (from, to) in [(r#""scale":256"#, r#""scale":0"#), (r#""scale":512"#, r#""scale":-9"#)] {
            if written.contains(from) {
                assert!(serde_json::from_str::<Edit>(&written.replace(from, to)).is_err());
            }
        }
    }
}
