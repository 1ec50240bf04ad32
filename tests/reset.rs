//! Resets: ground returns to what it was, by shape, exactly, and nothing is stored for it any more. `BURROW_WORLDS` is
//! the number of random worlds, `BURROW_EDITS` that of edits before everything is reset.

use std::sync::Arc;

use bevy_burrow::brush::{BAND, Edit, Operation};
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use bevy_burrow::volume::Sample;
use fastrand::Rng;
use glam::{IVec3, Vec3};

mod worlds;

use worlds::{any_random_brush, random_ground, random_rules, random_strata, world_count};

fn terrain(ground: &Arc<Ground>, chunk_size: u32) -> Terrain {
    let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
    Terrain::new(Arc::clone(ground), &settings).expect("valid settings")
}

/// Boxes that hold all edited samples of a world.
fn over_everything(world: &World) -> Vec<Brush> {
    let samples = world.bricks().map(|(pos, _)| pos.samples()).reduce(LatticeBox::union);
    let Some(LatticeBox { min, max }) = samples else { return Vec::new() };
    let half = 80;
    let along = |axis: usize| (min[axis]..=max[axis]).step_by(2 * half as usize).collect::<Vec<_>>();
    let mut boxes = Vec::new();
    for x in along(0) {
        for y in along(1) {
            for z in along(2) {
                let center = (IVec3::new(x, y, z) + half).as_vec3();
                let shape = Shape::cuboid(center, Vec3::splat(half as f32));
                boxes.push(Brush::reset(shape));
            }
        }
    }
    boxes
}

/// A random world's ground, some with strata.
fn ground(rng: &mut Rng, index: u64) -> (Arc<Ground>, u32) {
    let (ground, chunk_size) = random_ground(rng, index);
    if index.is_multiple_of(2) {
        return (Arc::new(ground), chunk_size);
    }
    let (low, high) = ground.height_range();
    let strata = random_strata(rng, [low as f32 / 256.0 - 20.0, high as f32 / 256.0 + 2.0]);
    (Arc::new(ground.with_strata(&strata).expect("valid strata")), chunk_size)
}

fn edit_count() -> usize {
    std::env::var("BURROW_EDITS").ok().and_then(|count| count.parse().ok()).unwrap_or(300)
}

#[test]
fn a_reset_of_everything_leaves_the_pristine_world() {
    for index in 0..world_count(6) {
        let mut rng = Rng::with_seed(index + 700);
        let (ground, chunk_size) = ground(&mut rng, index);
        let mut edited = terrain(&ground, chunk_size);
        let (pristine, drawn) = (edited.world().hash(), edited.world().drawn().collect::<Vec<_>>());
        let memory = edited.world().memory();
        for _ in 0..edit_count().div_ceil(10) {
            let brushes: Vec<Brush> = (0..10).map(|_| any_random_brush(&mut rng, &ground)).collect();
            edited.apply(brushes);
        }
        let before = edited.world().hash();
        assert_ne!(before, pristine);
        let resets: Vec<Brush> =
            over_everything(edited.world()).into_iter().map(|own| own.with_stroke(9)).collect();
        let receipts = edited.apply(resets);
        assert!(receipts.iter().all(|receipt| receipt.outcome.is_ok()));
        let world = edited.world();
        assert_eq!(world.hash(), pristine, "world {index}");
        assert_eq!((world.bricks().count(), world.fields().count(), world.mask().len()), (0, 0, 0));
        assert_eq!(world.drawn_chunks().count(), 0);
        assert!(world.drawn().collect::<Vec<_>>() == drawn, "world {index} is drawn as before");
        // Undo holds what was reset.
        let undo = edited.undo();
        assert!(undo.outcome.is_ok());
        assert_eq!(edited.world().hash(), before, "all resets are one stroke");
        assert!(edited.world().check_seams().is_flawless());
        edited.redo();
        assert_eq!(edited.world().hash(), pristine);
        edited.clear_history();
        let after = edited.world().memory();
        assert_eq!(
            (after.samples, after.materials, after.meshes),
            (memory.samples, memory.materials, memory.meshes)
        );
        assert!(after.index <= memory.index + 4096, "{after:?} after {memory:?}");
    }
}

#[test]
fn a_reset_returns_the_samples_in_its_reach_and_no_others() {
    for index in 0..world_count(10) {
        let mut rng = Rng::with_seed(index + 900);
        let (ground, chunk_size) = ground(&mut rng, index);
        let mut terrain = terrain(&ground, chunk_size);
        let brushes: Vec<Brush> = (0..12).map(|_| any_random_brush(&mut rng, &ground)).collect();
        terrain.apply(brushes);
        for _ in 0..4 {
            let brush = Brush { operation: Operation::Reset, ..any_random_brush(&mut rng, &ground) };
            let edit = Edit::quantize(&brush).expect("a valid brush");
            let before = terrain.snapshot();
            let receipt = terrain.apply([brush]).remove(0);
            let Ok(applied) = receipt.outcome else { continue };
            let (after, evaluator) = (terrain.world(), edit.evaluator());
            let samples = before.bricks().map(|(pos, _)| pos.samples()).reduce(LatticeBox::union);
            let (mut removed, mut added, mut bounds) = (0, 0, None::<LatticeBox>);
            for point in samples.into_iter().flat_map(|samples| samples.points()) {
                let old = before.samples().sample(point);
                let is_reset = evaluator.distance(point) <= BAND;
                let new = if is_reset { Sample::PRISTINE } else { old };
                assert_eq!(after.samples().sample(point), new, "world {index} at {point}");
                let material =
                    if is_reset { MaterialId::GROUND } else { before.samples().stored_material(point) };
                assert_eq!(after.samples().stored_material(point), material);
                let [was, is] = [&*before, after].map(|world| world.samples().is_solid(point));
                removed += u64::from(was && !is);
                added += u64::from(is && !was);
                if old != new {
                    let own = LatticeBox::point(point);
                    bounds = Some(bounds.map_or(own, |bounds| bounds.union(own)));
                }
            }
            assert_eq!((applied.removed.total(), applied.added.total()), (removed, added));
            assert_eq!(applied.bounds, bounds);
            assert!(after.check_seams().is_flawless(), "world {index}");
            // Fields hold what is edited, and nothing else.
            let edited = |point| after.samples().is_edited(point);
            for (_, fields) in after.fields() {
                for field in fields.iter() {
                    assert!(field.bounds.points().any(edited), "a field of world {index} is empty");
                }
            }
            for (pos, brick) in after.bricks() {
                assert!(brick.edited().iter().any(|layer| *layer != 0), "{pos:?} holds nothing");
            }
        }
    }
}

#[test]
fn a_reset_takes_back_a_dig_of_the_same_shape() {
    for index in 0..world_count(60) {
        let mut rng = Rng::with_seed(index + 1300);
        let (ground, chunk_size) = ground(&mut rng, index);
        let mut terrain = terrain(&ground, chunk_size);
        let pristine = terrain.world().hash();
        let brush = any_random_brush(&mut rng, &ground);
        // Wide roundings reach farther than a reset.
        let rounds = matches!(brush.operation, Operation::Fill | Operation::Carve);
        let brush =
            if rounds { Brush { blend: Blend { falloff: 2.0, ..brush.blend }, ..brush } } else { brush };
        terrain.apply([brush.clone()]);
        terrain.apply([Brush { operation: Operation::Reset, ..brush }]);
        assert_eq!(terrain.world().hash(), pristine, "world {index}");
        assert_eq!(terrain.world().bricks().count(), 0);
    }
}

#[test]
fn resets_among_other_edits_apply_in_order_in_one_step_of_undo() {
    for index in 0..world_count(20) {
        let mut rng = Rng::with_seed(index + 1700);
        let (ground, chunk_size) = ground(&mut rng, index);
        let brushes: Vec<Brush> = (0..9)
            .map(|_| {
                let brush = any_random_brush(&mut rng, &ground);
                if rng.u8(0..3) == 0 { Brush { operation: Operation::Reset, ..brush } } else { brush }
            })
            .collect();
        let (mut together, mut apart) = (terrain(&ground, chunk_size), terrain(&ground, chunk_size));
        let first = any_random_brush(&mut rng, &ground);
        for terrain in [&mut together, &mut apart] {
            terrain.apply([first.clone()]);
        }
        let start = together.world().hash();
        let edits: Vec<Edit> = brushes.iter().map(|brush| Edit::quantize(brush).expect("valid")).collect();
        let draft = together.draft(&edits);
        together.keep_log(Some(1 << 30));
        let receipts = together.apply(&brushes);
        let one_by_one: Vec<Receipt> = brushes.iter().flat_map(|brush| apart.apply([brush])).collect();
        assert_eq!(receipts, one_by_one, "world {index}");
        assert_eq!(together.world().hash(), apart.world().hash());
        assert_eq!((draft.hash, &draft.receipts), (together.world().hash(), &receipts));

        // Another machine replays the log, or puts the draft in place.
        let mut put = terrain(&ground, chunk_size);
        put.apply([first.clone()]);
        put.apply_one(Order::parts(draft.change, Some(draft.hash))).outcome.expect("it fits");
        assert!(put.world().check_seams().is_flawless());
        let mut replayed = terrain(&ground, chunk_size);
        replayed.apply([first.clone()]);
        for record in together.take_log() {
            replayed.replay(&record).expect("the same world");
        }
        assert_eq!(replayed.world().hash(), together.world().hash());

        let is_changed = together.world().hash() != start;
        together.undo();
        if is_changed {
            assert_eq!(together.world().hash(), start, "world {index}: one step");
            together.redo();
            assert_eq!(together.world().hash(), apart.world().hash());
        }
    }
}

#[test]
fn rules_keep_what_they_protect_from_a_reset() {
    let mut refused = 0;
    for index in 0..world_count(30) {
        let mut rng = Rng::with_seed(index + 2100);
        let (ground, chunk_size) = ground(&mut rng, index);
        let mut terrain = terrain(&ground, chunk_size);
        let brushes: Vec<Brush> = (0..12).map(|_| any_random_brush(&mut rng, &ground)).collect();
        terrain.apply(brushes);
        let rules = random_rules(&mut rng, &ground);
        terrain.set_rules(rules.clone()).expect("valid rules");
        let before = terrain.snapshot();
        let resets: Vec<Brush> =
            over_everything(terrain.world()).into_iter().map(|own| own.with_power(rng.u8(..))).collect();
        for receipt in terrain.apply(resets) {
            refused += receipt.outcome.map_or(0, |applied| applied.refused.total());
        }
        let (before, after) = (before.samples(), terrain.world().samples());
        let samples = terrain.world().bricks().map(|(pos, _)| pos.samples()).reduce(LatticeBox::union);
        for point in samples.into_iter().flat_map(|samples| samples.points()) {
            let (old, new) = (before.sample(point), after.sample(point));
            assert!(new == old || new == Sample::PRISTINE, "entirely or not at all");
            if rules.protected.iter().any(|own| own.contains(point)) {
                assert_eq!(new, old, "world {index}: protected at {point}");
            }
            let is_gone = before.is_solid(point) && !after.is_solid(point);
            let is_held = rules.unbreakable.contains(&before.material(point))
                || rules.bedrock.is_some_and(|bedrock| point.y < bedrock);
            assert!(!(is_gone && is_held), "world {index}: {point} is held");
        }
        assert!(terrain.world().check_seams().is_flawless());
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn a_reset_outside_the_world_is_rejected_and_one_of_pristine_ground_changes_nothing() {
    let ground = Arc::new(Ground::flat(32, 32, 5.0).expect("valid"));
    let mut terrain = terrain(&ground, 16);
    let at = |x: f32| Brush::reset(Shape::sphere(Vec3::new(x, 5.0, 16.0), 4.0)).with_tag(3);
    let outside = terrain.apply([at(-90.0)]).remove(0);
    assert_eq!((outside.tag, outside.outcome), (3, Err(Rejection::OutsideWorld)));
    let nothing = terrain.apply([at(16.0)]).remove(0);
    assert_eq!(nothing.outcome, Ok(Applied::default()));
    assert_eq!(terrain.history(), History::default());
}

#[test]
fn a_reset_is_written_as_one_word() {
    let edit = Edit::quantize(&Brush::reset(Shape::sphere(Vec3::ZERO, 2.0))).expect("valid");
    let json = serde_json::to_string(&edit).expect("valid");
    assert!(json.contains(r#""operation":"reset","blend":null"#), "{json}");
    assert_eq!(serde_json::from_str::<Edit>(&json).expect("the same"), edit);
    let line = r#"{"shape":"sphere","center":[0,0,0],"radius":2,"op":"reset"}"#;
    match serde_json::from_str::<Brush>(line) {
        Ok(brush) => assert_eq!(Edit::quantize(&brush), Ok(edit)),
        Err(error) => panic!("{error}"),
    }
}
