//! Scripts of random steps: whatever happened, all join in the end and show the same, and each dig has one answer.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_burrow::net::Server;
use bevy_burrow::prelude::*;
use bevy_burrow::together::{EditOutcome, GroundEdited, GroundServer, SharedTerrain};
use fastrand::Rng;

use super::{Party, dug, ground, other_ground, settings};
use crate::stage::dig;

/// How many scripts there are; each takes some tenths of a second.
fn count() -> u64 {
    std::env::var("BURROW_SCRIPTS").ok().and_then(|count| count.parse().ok()).unwrap_or(12)
}

/// Steps of a script.
const STEPS: usize = 40;

/// Ground as a player may have it: pristine, or with digs of another time.
fn some_ground(rng: &mut Rng) -> Terrain {
    dug(ground(), rng.u64(0..3) * 8)
}

/// A step that may come at any moment. A dig has this tag.
fn step(party: &mut Party, rng: &mut Rng, tag: u64, asked: &mut [BTreeSet<u64>]) -> String {
    let player = rng.usize(0..party.players.len());
    let terrain = party.players[player].1;
    let name = match rng.u32(0..16) {
        0..3 => {
            if party.world_mut(player).get::<Terrain>(terrain).is_some() {
                let (x, z) = (20.0 + 60.0 * rng.f32(), 20.0 + 60.0 * rng.f32());
                let y = party.height_at(player, x.into(), z.into());
                party.send(player, dig(x, y, z, 4.0).with_tag(tag));
                asked[player].insert(tag);
            }
            "dig"
        }
        3 => {
            party.players[player].0.write(Undo::default());
            "undo"
        }
        4 if party.is_connected(player) => {
            party.disconnect(player);
            "disconnect"
        }
        4..6 if !party.is_connected(player) => {
            party.reconnect(player);
            "connect"
        }
        6 => {
            party.world_mut(player).entity_mut(terrain).remove::<SharedTerrain>();
            "no longer shared"
        }
        7 => {
            party.world_mut(player).entity_mut(terrain).insert(SharedTerrain::default());
            "shared"
        }
        8 => {
            let world = party.world_mut(player);
            world.despawn(terrain);
            party.players[player].1 = world.spawn((some_ground(rng), SharedTerrain::default())).id();
            "spawned again"
        }
        9 => {
            party.world_mut(player).entity_mut(terrain).insert(some_ground(rng));
            "another terrain"
        }
        10 => {
            party.world_mut(player).entity_mut(terrain).insert(other_ground());
            "another ground"
        }
        11 => {
            party.world_mut(player).entity_mut(terrain).remove::<Terrain>();
            "without terrain"
        }
        12 => {
            party.server.world_mut().remove_resource::<GroundServer>();
            "without server"
        }
        13 => {
            let built = dug(ground(), rng.u64(0..3) * 15);
            party.server.insert_resource(GroundServer::new(Server::new(built, settings())));
            "another server"
        }
        _ => "nothing",
    };
    format!("{name} ({player})")
}

/// Each dig has one `BrushApplied`, whatever happened, and at most one `GroundEdited` that says the same.
fn check_answers(party: &mut Party, player: usize, asked: &BTreeSet<u64>, what: &str) {
    let edited = party.players[player].0.recorded::<GroundEdited>();
    let mut said: Vec<u64> = edited
        .iter()
        .filter(|edited| !matches!(edited.outcome, EditOutcome::Predicted(_)))
        .map(|edited| edited.tag)
        .collect();
    let mut applied = party.players[player].0.tags();
    for tags in [&mut said, &mut applied] {
        let count = tags.len();
        tags.sort_unstable();
        tags.dedup();
        assert_eq!(tags.len(), count, "{what}: player {player} was answered twice");
    }
    assert_eq!(BTreeSet::from_iter(applied), *asked, "{what}: answers of player {player}");
    assert!(
        said.iter().all(|tag| asked.contains(tag)),
        "{what}: player {player} got an answer to a dig that nobody sent"
    );
}

#[test]
fn after_any_script_all_join_and_show_the_same() {
    let first = std::env::var("BURROW_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(0);
    for seed in first..first + count() {
        let mut rng = Rng::with_seed(seed);
        let mut party = Party::new(1 + rng.usize(0..3));
        let mut steps = Vec::new();
        let mut asked = vec![BTreeSet::new(); party.players.len()];
        for tag in 1..=STEPS {
            steps.push(step(&mut party, &mut rng, tag as u64, &mut asked));
            party.rounds(rng.usize(0..6));
        }
        // What has to be there in the end.
        if !party.server.world().contains_resource::<GroundServer>() {
            party.server.insert_resource(super::server());
        }
        for player in 0..party.players.len() {
            let terrain = party.players[player].1;
            let hash = ground().world().ground().hash();
            let mut entity = party.world_mut(player).entity_mut(terrain);
            if entity.get::<Terrain>().is_none_or(|terrain| terrain.world().ground().hash() != hash) {
                entity.insert(ground());
            }
            if !entity.contains::<SharedTerrain>() {
                entity.insert(SharedTerrain::default());
            }
            if !party.is_connected(player) {
                party.reconnect(player);
            }
        }
        let start = std::time::Instant::now();
        while !party.agrees() {
            party.round();
            assert!(start.elapsed() < super::PATIENCE, "seed {seed}: never joined after {steps:?}");
        }
        // What has come may not be shown yet.
        loop {
            let hash = server_hash(&mut party);
            if party.all_show(hash) {
                break;
            }
            assert!(start.elapsed() < super::PATIENCE, "seed {seed}: another world after {steps:?}");
        }
        assert!((0..party.players.len()).all(|player| party.shared(player).error().is_none()));
        for (player, asked) in asked.iter().enumerate() {
            check_answers(&mut party, player, asked, &format!("seed {seed}, after {steps:?}"));
        }
    }
}

/// The hash of the server's world.
fn server_hash(party: &mut Party) -> u64 {
    let (sender, receiver) = std::sync::mpsc::channel();
    let sender = std::sync::Mutex::new(sender);
    party.server.world_mut().resource_mut::<GroundServer>().with(move |server| {
        // Somebody waits for it.
        let _ = sender.lock().map(|sender| sender.send(server.terrain().world().hash()));
    });
    loop {
        party.round();
        if let Ok(hash) = receiver.try_recv() {
            return hash;
        }
    }
}
