//! Where the parts of a session meet: levels, play alone, undos under way, changes of server while somebody joins, and
//! players who come twice.

use std::sync::mpsc::channel;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_burrow::format::Level;
use bevy_burrow::net::{KickReason, Server, ServerSettings};
use bevy_burrow::plugin::Held;
use bevy_burrow::prelude::*;
use bevy_burrow::together::{EditOutcome, GroundServer, SharedTerrain, SharingError};
use bevy_replicon::prelude::*;
use bevy_replicon::shared::backend::connected_client::NetworkId;
use bevy_replicon::test_app::TestClientEntity;

use super::{Party, dug, ground, large_ground, other_ground, player, server, settings};
use crate::stage::dig;

/// The network id of clients that connect from now on.
#[derive(Resource)]
struct NextId(u64);

impl Party {
    /// A party whose transport has network ids.
    fn with_ids() -> Self {
        let mut party = Self::new(0);
        party.server.insert_resource(NextId(1)).add_observer(
            |new: On<Add, ConnectedClient>, mut commands: Commands, id: Res<NextId>| {
                commands.entity(new.entity).insert(NetworkId::new(id.0));
            },
        );
        party
    }

    /// A round in which the server hears a player, and the player does not hear the server.
    fn round_to_server(&mut self, player: usize) {
        let app = &mut self.players[player].0.app;
        app.update();
        let client = *app.world().resource::<TestClientEntity>();
        let said: Vec<_> = app.world_mut().resource_mut::<ClientMessages>().drain_sent().collect();
        let mut heard = self.server.world_mut().resource_mut::<ServerMessages>();
        said.into_iter().for_each(|(channel, bytes)| heard.insert_received(*client, channel, bytes));
        self.server.update();
        std::thread::sleep(Duration::from_millis(1));
    }

    /// Asks the server for something.
    fn ask<T: Send + 'static>(&mut self, what: impl FnOnce(&mut Server) -> T + Send + Sync + 'static) -> T {
        self.ask_in(Self::round, what)
    }

    /// Asks the server for something, with such rounds until it answers.
    fn ask_in<T: Send + 'static>(
        &mut self,
        round: impl Fn(&mut Self),
        what: impl FnOnce(&mut Server) -> T + Send + Sync + 'static,
    ) -> T {
        let (sender, receiver) = channel();
        let sender = Mutex::new(sender);
        self.server.world_mut().resource_mut::<GroundServer>().with(move |server| {
            let answer = what(server);
            // Somebody waits for it.
            let _ = sender.lock().unwrap_or_else(PoisonError::into_inner).send(answer);
        });
        loop {
            round(self);
            if let Ok(answer) = receiver.try_recv() {
                return answer;
            }
        }
    }

    fn serve(&mut self, terrain: Terrain) -> u64 {
        let hash = terrain.world().hash();
        self.server.insert_resource(GroundServer::new(Server::new(terrain, settings())));
        hash
    }

    /// Steps through history that were answered since the last call.
    fn steps(&mut self, player: usize) -> usize {
        self.players[player].0.recorded::<HistoryMoved>().len()
    }
}

/// Bytes that are sent to a player that joins this level and begins with a terrain, which is held until a level is
/// loaded if `is_asset`.
fn bytes_to_join(level: &Terrain, begins: Terrain, is_asset: bool) -> u64 {
    let mut built = copy_of(level, large_ground());
    built.apply([Brush::dig(Shape::sphere(Vec3::new(200.0, 40.0, 200.0), 8.0))]);
    let mut party = Party::without_ground(AuthMethod::ProtocolCheck);
    let hash = party.serve(built);
    let mut stage = player();
    let entity = stage.app.world_mut().spawn((begins, SharedTerrain::default())).id();
    if is_asset {
        let asset = BurrowLevel::new(&Level::of(level)).expect("it can be written");
        let handle = stage.app.world_mut().resource_mut::<Assets<BurrowLevel>>().add(asset);
        stage.app.world_mut().entity_mut(entity).insert(StartLevel(handle));
    }
    party.connect(stage, entity);
    party.rounds_until("it joins", |party| party.all_show(hash));
    party.ask(|server| server.figures().bulk_bytes)
}

/// What a terrain holds, in another terrain of the same ground.
fn copy_of(terrain: &Terrain, mut pristine: Terrain) -> Terrain {
    pristine.apply_one(Order::parts(terrain.parts().change, None)).outcome.expect("it is the same ground");
    pristine
}

#[test]
fn a_dig_that_was_ordered_while_its_player_was_away_is_answered_once() {
    let mut party = Party::with_ids();
    // A client that returns can't get old entries, and compares regions.
    let settings = ServerSettings { log_bytes: 0, ..settings() };
    party.server.insert_resource(GroundServer::new(Server::new(ground(), settings)));
    party.join();
    party.all_join();
    let height = party.height_at(0, 30.0, 30.0);
    party.send(0, dig(30.0, height, 30.0, 4.0).with_tag(7));
    let start = Instant::now();
    while party.ask_in(|party| party.round_to_server(0), |server| server.epoch().number) == 0 {
        assert!(start.elapsed() < super::PATIENCE, "the dig never reaches the server");
    }
    party.disconnect(0);
    party.outcomes(0);
    assert_eq!(party.players[0].0.tags(), [0; 0]);
    party.reconnect(0);
    party.rounds_until("it is answered", Party::agrees);
    assert_eq!(party.outcomes(0), [EditOutcome::Confirmed(None)]);
    let receipts = party.players[0].0.receipts();
    let outcomes: Vec<_> =
        receipts.iter().map(|applied| (applied.receipt.tag, &applied.receipt.outcome)).collect();
    assert_eq!(outcomes, [(7, &Ok(Applied::default()))], "an unknown effect is not counted");
}

#[test]
fn who_begins_with_the_level_gets_only_what_differs() {
    let level = dug(large_ground(), 400);
    let all = bytes_to_join(&level, large_ground(), false);
    for (begins, is_asset) in [(dug(large_ground(), 400), false), (large_ground(), true)] {
        let some = bytes_to_join(&level, begins, is_asset);
        assert!(4 * some < all, "{some} bytes of {all}, as an asset: {is_asset}");
    }
}

/// A brush that was asked for alone may be under way when the terrain becomes shared.
#[test]
fn what_is_under_way_when_a_terrain_becomes_shared_is_not_left_there() {
    for frames in 1..6 {
        let mut party = Party::new(1);
        let hash = ground().world().hash();
        party.all_join();
        let mut stage = player();
        let terrain = stage.app.world_mut().spawn(ground()).id();
        stage.frames(20);
        stage.send(Brush::dig(Shape::sphere(Vec3::new(30.0, 20.0, 30.0), 9.0)));
        stage.frames(frames);
        stage.app.world_mut().entity_mut(terrain).insert(SharedTerrain::default());
        party.connect(stage, terrain);
        party.rounds_until("it shows what is shared", |party| party.all_show(hash));
        party.rounds(100);
        assert!(party.all_show(hash), "after {frames} frames");
    }
}

/// Whatever else changes a shared terrain, it shows the shared world in the end.
#[test]
fn what_a_game_changes_in_a_shared_terrain_is_put_right() {
    let mut party = Party::new(1);
    party.all_join();
    let terrain = party.players[0].1;
    let hash = ground().world().hash();
    for turn in 0..3 {
        let brush = Brush::dig(Shape::sphere(Vec3::new(30.0 + 10.0 * turn as f32, 20.0, 30.0), 6.0));
        let mut shown = party.world_mut(0).get_mut::<Terrain>(terrain).expect("it is there");
        shown.submit(&brush);
        party.rounds(20);
        party.rounds_until("it is put right", |party| party.all_show(hash));
    }
}

/// Between a connection and the server's first word nothing is known yet: digs of that time and earlier ones wait.
#[test]
fn who_comes_back_before_the_ground_is_served_loses_nothing() {
    let mut party = Party::new(1);
    party.all_join();
    party.disconnect(0);
    party.server.world_mut().remove_resource::<GroundServer>();
    party.dig_at(0, 30.0, 30.0);
    party.rounds(20);
    party.reconnect(0);
    party.dig_at(0, 60.0, 60.0);
    party.rounds(100);
    assert_eq!(party.shared(0).pending(), 2);
    assert_eq!(party.errors(0), [SharingError::ConnectionLost]);
    assert_eq!(party.shared(0).error(), None);
    let before = party.terrain_hash(0);
    party.server.insert_resource(server());
    party.rounds_until("both digs are done", |party| party.agrees() && party.shared(0).number() >= 2);
    let outcomes = party.outcomes(0);
    assert!(outcomes.iter().all(|outcome| !matches!(outcome, EditOutcome::Refused(_))), "{outcomes:?}");
    assert_eq!(party.terrain_hash(0), before, "they were shown all the time");
}

/// An undo is done or not done, is answered once, and takes nothing else with it.
#[test]
fn an_undo_that_a_lost_connection_interrupts_is_answered_once() {
    for (has_ids, rounds) in (0..10).map(|turn| (turn % 2 == 0, turn / 2)) {
        let mut party = if has_ids { Party::with_ids() } else { Party::new(0) };
        party.join();
        party.all_join();
        party.dig_at(0, 30.0, 30.0);
        party.dig_at(0, 60.0, 60.0);
        party.rounds_until("both are done", |party| party.agrees() && party.shared(0).number() >= 2);
        party.players[0].0.write(Undo::default());
        party.rounds(rounds);
        party.disconnect(0);
        party.rounds(3);
        party.dig_at(0, 30.0, 60.0);
        party.rounds(3);
        party.reconnect(0);
        party.all_join();
        party.rounds(20);
        assert_eq!(party.steps(0), 1, "with ids: {has_ids}, after {rounds} rounds");
        let (shown, served) = (party.terrain_hash(0), party.ask(|server| server.terrain().world().hash()));
        assert_eq!(shown, served);
        assert!(!party.outcomes(0).iter().any(|outcome| matches!(outcome, EditOutcome::Refused(_))));
    }
}

#[test]
fn another_server_is_joined_while_the_first_ones_ground_still_comes() {
    for rounds in [0, 1, 4, 15, 40] {
        let mut party = Party::without_ground(AuthMethod::ProtocolCheck);
        party.serve(dug(large_ground(), 900));
        party.join_with(large_ground(), AuthMethod::ProtocolCheck);
        party.rounds(rounds);
        party.dig_at(0, 100.0, 100.0);
        party.rounds(1);
        let hash = party.serve(dug(large_ground(), 600));
        party.rounds_until("the second one is joined", |party| {
            party.agrees() && (party.terrain_hash(0) == hash || party.shared(0).number() > 0)
        });
        party.rounds(50);
        let served = party.ask(|server| server.terrain().world().hash());
        assert!(party.all_show(served), "after {rounds} rounds");
    }
}

#[test]
fn who_despawns_a_terrain_while_it_joins_joins_with_the_next_one() {
    let mut party = Party::without_ground(AuthMethod::ProtocolCheck);
    let hash = party.serve(dug(large_ground(), 900));
    party.join_with(large_ground(), AuthMethod::ProtocolCheck);
    for rounds in [0, 1, 2, 7, 30] {
        party.rounds(rounds);
        let terrain = party.players[0].1;
        let world = party.world_mut(0);
        world.despawn(terrain);
        party.players[0].1 = world.spawn((large_ground(), SharedTerrain::default())).id();
    }
    party.rounds_until("it joins", |party| party.all_show(hash));
}

#[test]
fn who_connects_twice_plays_over_the_later_connection() {
    let mut party = Party::with_ids();
    party.join();
    party.all_join();
    party.dig_at(0, 30.0, 30.0);
    party.rounds_until("it is done", |party| party.agrees() && party.shared(0).number() >= 1);
    // The first connection continues.
    party.join();
    party.rounds_until("the later one joins", |party| party.shared(1).has_joined());
    party.rounds_until("the earlier one has an error", |party| party.shared(0).error().is_some());
    assert_eq!(party.shared(0).error(), Some(SharingError::Kicked(KickReason::ConnectedAgain)));
    let messages = party.ask(|server| server.figures().messages);
    for turn in 0..10 {
        party.dig_at(0, 20.0 + 5.0 * turn as f32, 20.0);
        party.dig_at(1, 20.0 + 5.0 * turn as f32, 70.0);
        party.rounds(30);
    }
    party.rounds_until("its digs are done", |party| {
        party.shared(1).pending() == 0 && party.shared(1).number() >= 11
    });
    assert!(party.shared(1).has_joined() && !party.shared(0).has_joined());
    assert!(party.outcomes(0).iter().skip(2).all(|outcome| matches!(outcome, EditOutcome::Refused(_))));
    assert_eq!(party.ask(|server| server.clients().count()), 1);
    let messages = party.ask(|server| server.figures().messages) - messages;
    assert!(messages < 1000, "both take the place of each other: {messages} messages");
    // Once the later one is gone, the earlier one may come again.
    party.disconnect(1);
    drop(party.players.pop());
    party.disconnect(0);
    party.reconnect(0);
    party.all_join();
}

#[test]
fn a_server_that_pauses_is_waited_for() {
    let mut party = Party::new(2);
    party.server.world_mut().resource_mut::<Time<Virtual>>().pause();
    party.all_join();
    party.dig_at(0, 30.0, 30.0);
    // Its app stands still for longer than greetings are repeated, while one plays and one joins.
    party.join();
    let start = std::time::Instant::now();
    while start.elapsed().as_secs_f32() < 2.5 {
        for (stage, _) in &mut party.players {
            stage.app.update();
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let pristine = ground().world().hash();
    party.rounds_until("all go on", |party| party.agrees() && party.terrain_hash(2) != pristine);
    assert!((0..3).all(|player| party.shared(player).error().is_none()));
}

/// A host changes levels while somebody joins.
#[test]
fn a_host_changes_levels_while_somebody_joins() {
    for rounds in [0, 1, 3, 10, 30] {
        let mut party = Party::without_ground(AuthMethod::ProtocolCheck);
        party.serve(dug(large_ground(), 900));
        let host = party.server.world_mut().spawn((large_ground(), SharedTerrain::default())).id();
        party.join_with(large_ground(), AuthMethod::ProtocolCheck);
        party.rounds(rounds);
        // As with one system: the server, and the terrain next to it.
        party.server.world_mut().entity_mut(host).insert(other_ground());
        let hash = party.serve(dug(other_ground(), 12));
        party.rounds_until("the player has an error", |party| {
            matches!(party.shared(0).error(), Some(SharingError::OtherGround { .. }))
        });
        let terrain = party.players[0].1;
        party.world_mut(0).entity_mut(terrain).insert(other_ground());
        party.rounds_until("host and player show the next level", |party| {
            let world = party.server.world();
            let shown = world.get::<Terrain>(host).map(|terrain| terrain.world().hash());
            party.all_show(hash) && shown == Some(hash)
        });
        let is_served = party.ask(|server| server.clients().count());
        assert_eq!(is_served, 2, "after {rounds} rounds");
    }
}

/// A player that opens a game to friends and closes it again continues with the same ground.
#[test]
fn a_game_alone_is_opened_and_closed_again() {
    let mut stage = player();
    let terrain = stage.app.world_mut().spawn(dug(ground(), 15)).id();
    stage.frames(5);
    let hash = stage.hash(terrain);
    let served = copy_of(stage.terrain(terrain), ground());
    stage.app.insert_resource(GroundServer::new(Server::new(served, ServerSettings::default())));
    stage.app.world_mut().entity_mut(terrain).insert(SharedTerrain::default());
    let has_joined = |stage: &crate::stage::Stage| {
        stage.app.world().get::<SharedTerrain>(terrain).is_some_and(SharedTerrain::has_joined)
    };
    stage.frames_until("it has joined", |stage| has_joined(stage));
    stage.frames(20);
    assert_eq!(stage.hash(terrain), hash);
    stage.send(Brush::dig(Shape::sphere(Vec3::new(40.0, 20.0, 40.0), 6.0)));
    stage.frames_until("it is dug", |stage| stage.hash(terrain) != hash && !stage.receipts().is_empty());
    let opened = stage.hash(terrain);
    stage.app.world_mut().remove_resource::<GroundServer>();
    stage.app.world_mut().entity_mut(terrain).remove::<SharedTerrain>();
    stage.frames(20);
    assert_eq!(stage.hash(terrain), opened);
    stage.send(Brush::dig(Shape::sphere(Vec3::new(60.0, 20.0, 60.0), 6.0)));
    stage.frames_until("it is dug alone", |stage| stage.hash(terrain) != opened);
}

#[test]
fn a_terrain_that_is_disabled_for_a_while_misses_nothing() {
    // While it joins, while its edits are under way, and while somebody else digs.
    for rounds in [1, 2, 3, 5, 8] {
        let mut party = Party::new(1);
        party.all_join();
        party.join_with(dug(ground(), 3), AuthMethod::ProtocolCheck);
        party.rounds(rounds);
        let terrain = party.players[1].1;
        for place in [20.0, 40.0, 60.0] {
            party.dig_at(1, place, 48.0);
            party.rounds(rounds);
            party.world_mut(1).entity_mut(terrain).insert(Disabled);
            party.dig_at(0, place, 20.0);
            party.rounds(2 + rounds);
            party.world_mut(1).entity_mut(terrain).remove::<Disabled>();
            party.rounds(rounds);
        }
        party.rounds_until("both show all digs", |party| {
            party.agrees()
                && [20.0, 40.0, 60.0].iter().all(|&x| {
                    let pristine = ground().world().height(x, 20.0).unwrap_or_default() as f32;
                    party.height_at(1, x, 20.0) < pristine - 1.0
                })
        });
        let outcomes = party.outcomes(1);
        let is_answer =
            |outcome: &&EditOutcome| matches!(outcome, EditOutcome::Confirmed(_) | EditOutcome::Refused(_));
        assert_eq!(outcomes.iter().filter(is_answer).count(), 3, "{outcomes:?}");
    }
}

#[test]
fn a_player_who_pauses_is_shown_later_what_others_dug() {
    for is_gated in [true, false] {
        let mut party = Party::new(2);
        party.all_join();
        let (pristine, terrain) = (party.terrain_hash(1), party.players[1].1);
        let all = (
            BurrowSystems::Load,
            BurrowSystems::Collect,
            BurrowSystems::Commit,
            BurrowSystems::Begin,
            BurrowSystems::Propagate,
        );
        if is_gated {
            let app = &mut party.players[1].0.app;
            app.insert_resource(Paused).configure_sets(Update, all.run_if(not(resource_exists::<Paused>)));
        } else {
            party.world_mut(1).entity_mut(terrain).insert(Held);
        }
        party.dig_at(0, 30.0, 30.0);
        party.rounds_until("it is dug", |party| party.terrain_hash(0) != pristine);
        party.rounds(30);
        assert_eq!(party.terrain_hash(1), pristine, "nothing is shown");
        party.world_mut(1).remove_resource::<Paused>();
        party.world_mut(1).entity_mut(terrain).remove::<Held>();
        party.rounds_until("it is shown", |party| party.agrees() && party.terrain_hash(1) != pristine);
        assert!(party.shared(1).error().is_none());
    }
}

#[derive(Resource)]
struct Paused;

#[test]
fn what_waits_in_a_shared_terrain_is_answered_when_it_goes_while_it_is_disabled() {
    let mut party = Party::new(1);
    party.all_join();
    let terrain = party.players[0].1;
    party.dig_at(0, 40.0, 40.0);
    party.round();
    party.world_mut(0).entity_mut(terrain).insert(Disabled);
    party.world_mut(0).despawn(terrain);
    party.rounds(3);
    let outcomes = party.outcomes(0);
    let is_answer =
        |outcome: &&EditOutcome| matches!(outcome, EditOutcome::Confirmed(_) | EditOutcome::Refused(_));
    assert_eq!(outcomes.iter().filter(is_answer).count(), 1, "{outcomes:?}");
}
