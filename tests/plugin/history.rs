//! Undo and redo as messages: in order with brushes, shown in one frame, and always answered.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::entities::assert_entities;
use crate::stage::{Stage, dig, level, random_brushes, steep};

const ALL: Undo = Undo { terrain: None };

#[test]
fn frames_show_what_was_undone_and_redone() {
    let mut stage = Stage::drawing().recording::<HistoryMoved>();
    let terrain = stage.show(steep());
    let mut states = vec![stage.hash(terrain)];
    for burst in random_brushes(31, 60).chunks(6) {
        burst.iter().for_each(|brush| stage.send(brush.clone()));
        stage.settle();
        states.push(stage.hash(terrain));
    }
    let last = states.len() - 1;
    assert_eq!(stage.terrain(terrain).history().undos, last);
    for (step, expected) in
        (0..last).rev().map(|at| (OrderKind::Undo, at)).chain((1..=last).map(|at| (OrderKind::Redo, at)))
    {
        match step {
            OrderKind::Undo => stage.write(Undo { terrain: Some(terrain) }),
            _ => stage.write(Redo { terrain: Some(terrain) }),
        }
        stage.frames_until("the step is reported", |stage| {
            let is_whole = stage.is_settled();
            let recorded = stage.recorded::<HistoryMoved>();
            assert_eq!(recorded.is_empty(), !is_whole, "it is reported in the frame of its commit");
            assert!(recorded.iter().all(|moved| moved.receipt.outcome.is_ok() && moved.receipt.kind == step));
            is_whole
        });
        assert_eq!(stage.hash(terrain), states[expected]);
        stage.assert_whole(terrain, &format!("{step:?} to {expected}"));
        assert_entities(&mut stage, terrain);
        if expected == 0 {
            assert_eq!((stage.count::<Chunk>(), stage.count::<Field>()), (0, 0), "nothing was ever dug");
        }
    }
}

#[test]
fn steps_come_after_the_brushes_of_their_frame() {
    for stage in [Stage::drawing(), Stage::server()] {
        let mut stage = stage.recording::<HistoryMoved>();
        let terrain = stage.show(level(1.0));
        let pristine = stage.hash(terrain);
        stage.write(ALL);
        stage.send(dig(20.0, 8.0, 20.0, 4.0));
        stage.send_to(terrain, dig(40.0, 8.0, 20.0, 4.0));
        stage.settle();
        assert_eq!(stage.hash(terrain), pristine, "both brushes are one step");
        assert_eq!(stage.receipts().len(), 2);
        stage.write(Redo::default());
        stage.write(ALL);
        stage.settle();
        let steps: Vec<_> = stage.recorded::<HistoryMoved>().into_iter().map(|moved| moved.receipt).collect();
        let outcomes: Vec<_> = steps.iter().map(|receipt| (receipt.kind, receipt.outcome.is_ok())).collect();
        // Undo comes before redo, whichever was sent first.
        let nothing = Err(Rejection::NothingToUndo);
        assert_eq!(outcomes, [(OrderKind::Undo, true), (OrderKind::Undo, false), (OrderKind::Redo, true)]);
        assert_eq!(steps[1].outcome, nothing);
        let restored = steps[2].outcome.as_ref().expect("it was redone");
        let dug: u64 =
            stage.receipts().iter().flat_map(|a| &a.receipt.outcome).map(|a| a.removed.total()).sum();
        assert_eq!(restored.removed.total(), dug);
        assert_ne!(stage.hash(terrain), pristine);
    }
}

#[test]
fn every_step_is_answered_by_every_terrain_that_it_is_for() {
    let mut stage = Stage::server().recording::<HistoryMoved>();
    stage.write(ALL);
    stage.frames(2);
    let recorded = stage.recorded::<HistoryMoved>();
    let [HistoryMoved { terrain: None, receipt }] = &recorded[..] else { panic!("{recorded:?}") };
    assert_eq!(receipt.outcome, Err(Rejection::TerrainGone));

    let (a, b) = (stage.show(level(1.0)), stage.spawn_at(level(1.0), Vec3::X * 500.0));
    stage.settle();
    stage.send(dig(20.0, 8.0, 20.0, 4.0));
    stage.settle();
    stage.write(ALL);
    stage.settle();
    stage.frames(1);
    let recorded = stage.recorded::<HistoryMoved>();
    assert_eq!(recorded.len(), 2);
    let of =
        |terrain| recorded.iter().find(|moved| moved.terrain == Some(terrain)).map(|m| &m.receipt.outcome);
    assert!(of(a).is_some_and(|outcome| outcome.is_ok()));
    assert_eq!(of(b), Some(&Err(Rejection::NothingToUndo)));

    // One terrain that is despawned while a step waits, and one that is despawned already.
    stage.send(dig(20.0, 8.0, 20.0, 4.0));
    stage.write(Undo { terrain: Some(a) });
    stage.frame();
    stage.app.world_mut().despawn(a);
    stage.write(Redo { terrain: Some(a) });
    stage.frames(3);
    let recorded: Vec<_> = stage
        .recorded::<HistoryMoved>()
        .into_iter()
        .map(|moved| (moved.terrain, moved.receipt.outcome))
        .collect();
    let gone = || (Some(a), Err(Rejection::TerrainGone));
    assert_eq!(recorded, [gone(), gone()]);
}
