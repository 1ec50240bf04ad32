//! What must not depend on frame timing: undo steps, rules and overload; and changes that a game makes to the model
//! itself.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_burrow::plugin::{CommitAction, Part, ShownSurface, SurfaceProcessor, SurfaceProcessors};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::WorkLimits;

use crate::entities::assert_entities;
use crate::stage::{Stage, dig, level, random_brushes, steep};

fn model(stage: &mut Stage, terrain: Entity) -> Mut<'_, Terrain> {
    stage.app.world_mut().get_mut(terrain).expect("the terrain is there")
}

#[test]
fn a_stroke_over_many_frames_and_transactions_is_one_undo_step() {
    for pause in [0, 1, 5] {
        let mut stage = Stage::drawing().recording::<HistoryMoved>();
        let terrain = stage.show(steep());
        let pristine = stage.hash(terrain);
        for (number, brush) in random_brushes(41, 24).into_iter().enumerate() {
            stage.send(brush.with_stroke(number as u64 / 8));
            // Some frames have one brush each, some transactions have many.
            (0..pause).for_each(|_| stage.rest());
            stage.frame();
            if pause == 5 {
                stage.settle();
            }
        }
        stage.settle();
        assert_eq!(stage.terrain(terrain).history().undos, 3, "{pause}");
        for stroke in (0..3).rev() {
            stage.write(Undo::default());
            stage.settle();
            let recorded = stage.recorded::<HistoryMoved>();
            let tags =
                recorded.iter().flat_map(|moved| &moved.receipt.outcome).flat_map(|restored| &restored.tags);
            let tags: Vec<u64> = tags.copied().collect();
            assert!(!tags.is_empty() && tags.iter().all(|tag| tag / 8 == stroke), "{pause}: {tags:?}");
            assert!(tags.is_sorted());
        }
        assert_eq!(stage.hash(terrain), pristine);
        stage.assert_whole(terrain, "all strokes are undone");
    }
}

#[test]
fn brushes_of_one_frame_are_one_step_and_those_of_another_are_not() {
    let mut stage = Stage::server();
    let terrain = stage.show(level(1.0));
    for x in [12.0, 24.0, 36.0] {
        stage.send(dig(x, 8.0, 20.0, 3.0));
        stage.send_to(terrain, dig(x, 8.0, 44.0, 3.0));
        // These come while the first ones are being applied.
        stage.frame();
    }
    stage.settle();
    assert_eq!(stage.terrain(terrain).history().undos, 3);
}

#[test]
fn rules_apply_only_to_brushes_sent_after_them() {
    let mut stage = Stage::server();
    let terrain = stage.show(level(1.0));
    let rock = DiggingRules::default().with_bedrock(i32::MAX);
    stage.send(dig(12.0, 8.0, 20.0, 3.0));
    stage.frame();
    // Sent and queued before the rules, so they do not apply, whenever the transaction begins.
    stage.send(dig(24.0, 8.0, 20.0, 3.0));
    stage.frame();
    model(&mut stage, terrain).set_rules(rock).expect("valid rules");
    stage.send(dig(36.0, 8.0, 20.0, 3.0));
    stage.frame();
    model(&mut stage, terrain).set_rules(DiggingRules::default()).expect("valid rules");
    stage.send(dig(48.0, 8.0, 20.0, 3.0));
    stage.settle();
    let world = stage.terrain(terrain).world();
    let is_solid = [12.0, 24.0, 36.0, 48.0].map(|x| world.is_solid(glam::DVec3::new(x, 7.0, 20.0)));
    assert_eq!(is_solid, [false, false, true, false]);
}

#[test]
fn brushes_beyond_the_limit_are_refused_at_once_and_a_players_digs_are_applied() {
    let mut stage = Stage::server();
    let mut ground = steep();
    let limits = WorkLimits { transaction: 500, waiting: 5_000 };
    ground.set_work_limits(limits);
    let terrain = stage.show(ground);
    let flood = 2000;
    for (tag, brush) in (0..flood).zip(random_brushes(43, 20).iter().cycle()) {
        stage.send(brush.clone().with_tag(tag));
    }
    stage.frame();
    let is_refused = |applied: &&BrushApplied| applied.receipt.outcome == Err(Rejection::Overloaded);
    let refused = stage.receipts().iter().filter(is_refused).count();
    assert!(refused > 1000, "{refused}");
    assert!(stage.terrain(terrain).waiting_work() <= limits.waiting);
    // A player digs all the while: before each dig, no more work may wait than the limit.
    let mut sent = Vec::new();
    for tag in 10_000..10_040 {
        stage.send(dig(30.0, 8.0, 30.0, 2.0).with_tag(tag));
        sent.push(tag);
        stage.frames(2);
        assert!(stage.terrain(terrain).waiting_work() <= limits.waiting);
    }
    stage.settle();
    let mut answers: BTreeMap<u64, usize> = BTreeMap::new();
    stage.receipts().iter().for_each(|applied| *answers.entry(applied.receipt.tag).or_default() += 1);
    assert_eq!(answers.len(), flood as usize + sent.len());
    assert!(answers.values().all(|&count| count == 1), "each is answered once");
    let is_done = |tag: &u64| {
        let mut own = stage.receipts().iter().filter(|applied| applied.receipt.tag == *tag);
        own.any(|applied| applied.receipt.outcome.is_ok())
    };
    assert!(sent.iter().filter(|tag| is_done(tag)).count() > 30, "a small dig finds room");
}

/// Whether the shown ground is up to date.
fn shows_all(stage: &mut Stage) -> bool {
    let ask = |terrains: Terrains| terrains.is_ready(Vec3::NEG_INFINITY, Vec3::INFINITY);
    stage.app.world_mut().run_system_cached(ask).expect("it can be asked")
}

/// What each tile and chunk entity shows, by revision.
fn shown(stage: &mut Stage) -> BTreeMap<Entity, u64> {
    let world = stage.app.world_mut();
    let mut query = world.query_filtered::<(Entity, &ShownSurface), Or<(With<Tile>, With<Chunk>)>>();
    query.iter(world).map(|(entity, shown)| (entity, shown.revision)).collect()
}

#[test]
fn only_changed_parts_of_a_games_own_edits_are_meshed_again() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(steep());
    stage.send(dig(50.0, 8.0, 50.0, 4.0));
    stage.settle();
    let mut before = shown(&mut stage);
    // A dig, an undo, a commit without its meshes, and several edits with an undo among them.
    for turn in 0..4 {
        let swaps = stage.figures().swaps;
        let mut own = model(&mut stage, terrain);
        match turn {
            0 => drop(own.apply([dig(8.0, 8.0, 8.0, 4.0)])),
            1 => drop(own.undo()),
            2 => {
                own.submit(dig(20.0, 8.0, 8.0, 3.0));
                let mut commit = own.begin().expect("a queued brush").run();
                // The game takes the meshes for itself.
                drop(std::mem::take(&mut commit.meshes));
                own.commit(commit).expect("no other commit");
            }
            _ => {
                own.apply([dig(9.0, 8.0, 8.0, 3.0)]);
                own.apply([dig(10.0, 8.0, 9.0, 3.0)]);
                own.undo();
            }
        }
        let expected = own.world().version();
        stage.frames_until("the change is shown", |stage| {
            stage.is_settled() && stage.terrain(terrain).world().version() == expected && shows_all(stage)
        });
        stage.assert_whole(terrain, &format!("turn {turn}"));
        assert_entities(&mut stage, terrain);
        let after = shown(&mut stage);
        let same = after.iter().filter(|(entity, revision)| before.get(*entity) == Some(*revision)).count();
        assert!(same >= 15, "turn {turn}: {same} of {} parts are as they were", after.len());
        assert!((1..12).contains(&(stage.figures().swaps - swaps)), "turn {turn}");
        before = after;
    }
    // The plugin's brushes work on afterwards.
    stage.send(dig(12.0, 8.0, 12.0, 3.0));
    stage.settle();
    stage.assert_whole(terrain, "a brush after it");
}

struct Faulty;

impl SurfaceProcessor for Faulty {
    fn build(&self, part: &Part, _: &SurfaceMesh) -> Option<CommitAction> {
        assert!(part.revision == 0, "the surface processor fails, as intended");
        None
    }
}

#[test]
fn a_panicking_processor_does_not_stop_commits() {
    let mut stage = Stage::drawing();
    stage.app.world_mut().resource_mut::<SurfaceProcessors>().add(Faulty);
    let terrain = stage.show(steep());
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.settle();
    assert!(stage.receipts()[0].receipt.outcome.is_ok());
    stage.assert_whole(terrain, "after a dig");
}
