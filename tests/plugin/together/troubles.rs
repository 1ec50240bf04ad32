//! Errors in multiplayer: every pending edit gets an answer, and each error is reported once.

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_burrow::net::{Refusal, Server, ServerSettings};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{EditOutcome, GroundServer, SharedTerrain, SharingError, TogetherPlugin};
use bevy_replicon::prelude::*;

use super::{Party, ground, player, server_app};
use crate::stage::{Stage, dig};

fn is_refused(outcomes: &[EditOutcome]) -> bool {
    outcomes.iter().any(|outcome| matches!(outcome, EditOutcome::Refused(None)))
}

#[test]
fn a_server_that_is_removed_is_reported_and_digs_are_answered() {
    let mut party = Party::new(2);
    party.all_join();
    let hash = party.terrain_hash(0);
    party.server.world_mut().remove_resource::<GroundServer>();
    // It is on its way when the server goes.
    party.dig_at(0, 30.0, 30.0);
    party.rounds_until("it is told", |party| !party.shared(0).has_joined());
    party.rounds_until("it is answered", |party| party.shared(0).pending() == 0);
    assert!(is_refused(&party.outcomes(0)));
    party.dig_at(0, 60.0, 60.0);
    party.rounds(20);
    assert!(is_refused(&party.outcomes(0)), "later digs are answered too");
    assert_eq!(party.errors(0), [SharingError::NotServed], "once");
    party.rounds_until("nothing of it is shown", |party| party.terrain_hash(0) == hash);
    let receipt = &party.players[0].0.receipts().last().expect("an answer").receipt;
    assert_eq!(receipt.outcome, Err(Rejection::Refused));
}

#[test]
fn a_lost_connection_is_reported_and_digs_wait_for_the_next_one() {
    let mut party = Party::new(2);
    party.all_join();
    let hash = party.terrain_hash(1);
    party.disconnect(0);
    party.rounds(5);
    assert!(!party.shared(0).has_joined());
    assert_eq!(party.errors(0), [SharingError::ConnectionLost]);
    for turn in 0..5 {
        party.dig_at(0, 20.0 + 10.0 * turn as f32, 30.0);
        party.rounds(5);
    }
    party.rounds_until("its digs are shown", |party| party.terrain_hash(0) != hash);
    assert_eq!((party.shared(0).pending(), party.terrain_hash(1)), (5, hash));
    party.reconnect(0);
    party.rounds_until("they are done", |party| party.agrees() && party.terrain_hash(1) != hash);
    let confirmed = party.outcomes(0);
    let is_confirmed = |outcome: &&EditOutcome| matches!(outcome, EditOutcome::Confirmed(_));
    assert_eq!(confirmed.iter().filter(is_confirmed).count(), 5);
    assert_eq!(party.shared(0).error(), None);
}

#[test]
fn everything_is_answered_when_the_terrain_goes() {
    let mut party = Party::new(1);
    party.all_join();
    let terrain = party.players[0].1;
    party.server.world_mut().remove_resource::<GroundServer>();
    for tag in 1..=3 {
        party.send(0, dig(30.0, 20.0, 30.0, 4.0).with_tag(tag));
        party.players[0].0.frame();
    }
    party.send(0, dig(30.0, 20.0, 30.0, 4.0).with_tag(4));
    party.players[0].0.write(Undo::default());
    party.players[0].0.frame();
    party.world_mut(0).despawn(terrain);
    party.players[0].0.frame();
    let mut tags = party.players[0].0.tags();
    tags.sort_unstable();
    assert_eq!(tags, [1, 2, 3, 4]);
    assert_eq!(party.players[0].0.recorded::<HistoryMoved>().len(), 1);
}

#[test]
fn a_shared_terrain_without_the_plugin_is_a_terrain() {
    let mut stage = Stage::server();
    let terrain = stage.app.world_mut().spawn((ground(), SharedTerrain::default())).id();
    stage.send(dig(30.0, 20.0, 30.0, 6.0));
    stage.frames_until("it is dug", |stage| !stage.receipts().is_empty());
    assert_ne!(stage.hash(terrain), ground().world().hash());
}

#[test]
fn missing_plugins_cause_no_panic() {
    // Without replicon nothing is shared, and nothing panics.
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, BurrowPlugins, TogetherPlugin))
        .insert_resource(GroundServer::new(Server::new(ground(), ServerSettings::default())))
        .finish();
    (0..3).for_each(|_| app.update());
    // The plugins of terrains may come later.
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, StatesPlugin, RepliconPlugins, TogetherPlugin)).finish();
    (0..3).for_each(|_| app.update());
}

#[test]
fn rules_of_a_shared_terrain_are_the_servers() {
    let mut party = Party::new(2);
    party.all_join();
    let terrain = party.players[0].1;
    let rules = DiggingRules::default().with_unbreakable(MaterialId(0));
    let mut shown = party.world_mut(0).get_mut::<Terrain>(terrain).expect("it is there");
    shown.set_rules(rules.clone()).expect("valid rules");
    party.rounds(20);
    assert_eq!(party.errors(0), [SharingError::RulesIgnored]);
    let before = party.terrain_hash(1);
    party.dig_at(0, 30.0, 30.0);
    party.rounds_until("it is dug all the same", |party| party.agrees() && party.terrain_hash(1) != before);
    // As the report says.
    party.server.world_mut().resource_mut::<GroundServer>().with(move |server| {
        server.submit(Order::rules(rules)).expect("valid rules");
    });
    party.rounds(30);
    let before = party.terrain_hash(1);
    party.dig_at(0, 60.0, 60.0);
    party.rounds_until("it is answered", |party| party.agrees());
    assert_eq!(party.terrain_hash(1), before);
}

#[test]
fn an_undo_that_is_not_allowed_is_not_nothing_to_undo() {
    let mut party = Party::without_ground(AuthMethod::ProtocolCheck);
    party.server.insert_resource(GroundServer::new(Server::new(ground(), ServerSettings::default())));
    party.join();
    party.all_join();
    party.dig_at(0, 30.0, 30.0);
    party.rounds_until("it is done", Party::agrees);
    party.players[0].0.write(Undo::default());
    party.rounds(50);
    let moved = party.players[0].0.recorded::<HistoryMoved>();
    let outcomes: Vec<_> = moved.iter().map(|moved| &moved.receipt.outcome).collect();
    assert_eq!(outcomes, [&Err(Rejection::Refused)]);
    assert_eq!(party.errors(0), [SharingError::UndoRefused(Refusal::Forbidden)]);
    // Where it is allowed, and nothing is there, that is said.
    let mut party = Party::new(1);
    party.all_join();
    party.players[0].0.write(Undo::default());
    party.rounds(50);
    let moved = party.players[0].0.recorded::<HistoryMoved>();
    assert_eq!(moved[0].receipt.outcome, Err(Rejection::NothingToUndo));
    assert_eq!(party.errors(0), []);
}

/// Bytes of memory that this process has.
#[cfg(target_os = "linux")]
fn memory() -> usize {
    let pages = std::fs::read_to_string("/proc/self/statm").expect("linux has it");
    4096 * pages.split(' ').nth(1).and_then(|pages| pages.parse::<usize>().ok()).expect("a number")
}

#[cfg(target_os = "linux")]
#[test]
fn what_comes_before_a_world_is_read_takes_little_memory() {
    let folder = std::env::temp_dir().join(format!("burrow-together-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("there is room");
    std::fs::write(folder.join("regions.redb"), b"no database").expect("there is room");
    let mut server = server_app(AuthMethod::None);
    let saved = SavedWorld::new(&folder);
    server.insert_resource(GroundServer::saved(&saved, &ground(), ServerSettings::default()));
    server.world_mut().resource_mut::<NextState<ServerState>>().set(ServerState::Running);
    let client = server.world_mut().spawn(ConnectedClient { max_size: 1200 }).id();
    server.update();
    let channels = server.world().resource::<RepliconChannels>().client_channels().len();
    let before = memory();
    for _ in 0..400 {
        let mut messages = server.world_mut().resource_mut::<ServerMessages>();
        messages.insert_received(client, channels - 1, vec![0; 1 << 20]);
        // As long as messages may be.
        for _ in 0..100 {
            let mut bytes = vec![0; 40_000];
            bytes[2..5].copy_from_slice(&[0xb0, 0xb8, 0x02]);
            messages.insert_received(client, channels - 1, bytes);
        }
        server.update();
    }
    let more = memory().saturating_sub(before);
    assert!(more < 100 << 20, "{} MiB are kept", more >> 20);
    drop(std::fs::remove_dir_all(&folder));
}

#[test]
fn what_a_host_digs_in_its_last_frame_is_saved() {
    let folder = std::env::temp_dir().join(format!("burrow-last-frame-{}", std::process::id()));
    drop(std::fs::remove_dir_all(&folder));
    let saved = SavedWorld::new(&folder);
    for turn in 0..4 {
        let mut stage = player();
        stage.app.insert_resource(GroundServer::saved(&saved, &ground(), ServerSettings::default()));
        let terrain = stage.app.world_mut().spawn((ground(), SharedTerrain::default())).id();
        stage.frames_until("it has joined", |stage| {
            stage.app.world().get::<SharedTerrain>(terrain).is_some_and(SharedTerrain::has_joined)
        });
        stage.frames(20);
        let depth = |stage: &Stage, turn: i32| {
            let world = stage.terrain(terrain).world();
            (0..turn).all(|turn| !world.is_solid(DVec3::new(20.0 + 15.0 * f64::from(turn), 5.0, 40.0)))
        };
        stage.frames_until("the digs of the last frames are there", |stage| depth(stage, turn));
        stage.send(dig(20.0 + 15.0 * turn as f32, 5.0, 40.0, 3.0));
        stage.write(AppExit::Success);
        stage.frame();
    }
    drop(std::fs::remove_dir_all(&folder));
}
