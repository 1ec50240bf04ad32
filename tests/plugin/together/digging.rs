//! What players dig, what the server refuses, and what they take back.

use bevy::prelude::*;
use bevy_burrow::net::{ClientEvent, Refusal};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{EditOutcome, GroundEdited, GroundJoined, SharedTerrain};
use bevy_replicon::prelude::*;

use super::{Party, ground, player, server};
use crate::stage::dig;

#[test]
fn what_one_digs_all_see() {
    let mut party = Party::new(3);
    party.all_join();
    let pristine = ground().world().hash();
    for turn in 0..30 {
        let player = turn % 3;
        let (x, z) = (20.0 + (turn * 7 % 50) as f64, 20.0 + (turn * 13 % 50) as f64);
        let height = party.height_at(player, x, z);
        party.send(player, dig(x as f32, height, z as f32, 4.0));
        party.round();
    }
    party.rounds_until("all agree", |party| {
        let (stage, terrain) = &party.players[0];
        party.agrees() && party.shared(0).number() >= 30 && stage.terrain(*terrain).world().hash() != pristine
    });
    for player in 0..3 {
        let (stage, terrain) = &mut party.players[player];
        let terrain = *terrain;
        stage.assert_whole(terrain, "digging together");
        let edited = stage.recorded::<GroundEdited>();
        let count = |is_such: fn(&EditOutcome) -> bool| {
            edited.iter().filter(|edited| is_such(&edited.outcome)).count()
        };
        assert_eq!(count(|outcome| matches!(outcome, EditOutcome::Predicted(_))), 10);
        assert_eq!(count(|outcome| matches!(outcome, EditOutcome::Confirmed(Some(_)))), 10);
        let receipts = stage.receipts();
        assert_eq!(receipts.iter().filter(|receipt| receipt.receipt.outcome.is_ok()).count(), 10);
        let events = stage.recorded::<GroundJoined>();
        let repairs = events.iter().filter(|joined| matches!(joined.event, ClientEvent::Repaired(_)));
        assert_eq!(repairs.count(), 0);
    }
    // A player that joins later sees the same.
    party.join();
    party.rounds_until("the late one agrees", Party::agrees);
}

#[test]
fn what_the_server_refuses_is_gone_again_and_undo_takes_back() {
    let mut party = Party::new(2);
    party.all_join();
    let pristine = ground().world().hash();
    let high = Brush::add(Shape::sphere(Vec3::new(40.0, 66.0, 40.0), 5.0), MaterialId(3)).with_tag(7);
    party.send(0, high);
    party.rounds_until("the answer comes", |party| {
        let (stage, terrain) = &party.players[0];
        party.agrees() && stage.terrain(*terrain).world().revision() > 1
    });
    let (stage, terrain) = &mut party.players[0];
    assert_eq!(stage.terrain(*terrain).world().hash(), pristine);
    let edited: Vec<EditOutcome> =
        stage.recorded::<GroundEdited>().into_iter().map(|edited| edited.outcome).collect();
    assert!(
        matches!(edited[..], [EditOutcome::Predicted(_), EditOutcome::Refused(Some(Refusal::Forbidden))]),
        "{edited:?}"
    );
    let receipt = stage.receipts().last().expect("an answer").receipt.clone();
    assert_eq!((receipt.tag, receipt.outcome), (7, Err(Rejection::Refused)));

    let height = party.height_at(1, 50.0, 50.0);
    party.send(1, dig(50.0, height, 50.0, 5.0));
    party.rounds_until("it is dug", |party| {
        let (stage, terrain) = &party.players[0];
        party.agrees() && stage.terrain(*terrain).world().hash() != pristine
    });
    party.players[1].0.app.world_mut().write_message(Undo::default());
    party.rounds_until("it is taken back", |party| {
        let (stage, terrain) = &party.players[0];
        party.agrees() && stage.terrain(*terrain).world().hash() == pristine
    });
}

#[test]
fn a_host_plays_too() {
    let mut stage = player();
    stage.app.insert_resource(server());
    stage.app.world_mut().resource_mut::<NextState<ServerState>>().set(ServerState::Running);
    let terrain = stage.app.world_mut().spawn((ground(), SharedTerrain::default())).id();
    let pristine = ground().world().hash();
    stage.frames_until("it has joined", |stage| {
        stage.app.world().get::<SharedTerrain>(terrain).is_some_and(SharedTerrain::has_joined)
    });
    stage.send(dig(40.0, 20.0, 40.0, 6.0));
    stage.frames_until("it is dug and confirmed", |stage| {
        let shared = stage.app.world().get::<SharedTerrain>(terrain).expect("it is shared");
        shared.pending() == 0 && shared.number() > 0 && stage.terrain(terrain).world().hash() != pristine
    });
    stage.assert_whole(terrain, "the host's world");
}

/// A game may take a while for the requests of one frame, and send more.
#[test]
fn undos_and_brushes_of_several_frames_keep_their_order() {
    let mut party = Party::new(1);
    party.all_join();
    let pristine = party.terrain_hash(0);
    for _ in 0..5 {
        // Its client is at work for some frames.
        let large = Brush::dig(Shape::sphere(Vec3::new(48.0, 20.0, 48.0), 30.0));
        party.send(0, large.with_roughness(Roughness::new(3.0, 4.0, 7)));
        party.round();
        party.players[0].0.write(Undo::default());
        party.round();
        party.send(0, dig(40.0, 20.0, 40.0, 5.0));
        party.round();
        party.players[0].0.write(Undo::default());
        party.rounds_until("all of it is answered", |party| {
            party.agrees() && party.terrain_hash(0) == pristine
        });
        let outcomes: Vec<_> = party.players[0]
            .0
            .recorded::<HistoryMoved>()
            .into_iter()
            .map(|moved| moved.receipt.outcome.map(|restored| restored.added.total() > 10_000))
            .collect();
        assert_eq!(outcomes, [Ok(true), Ok(false)], "the large one comes back first");
    }
}
