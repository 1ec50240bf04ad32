//! Sessions begin and end at any moment: servers, terrains and connections come and go in any order.

use bevy::prelude::*;
use bevy_burrow::net::{Server, ServerSettings};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{EditOutcome, GroundServer, SharedTerrain, SharingError};
use bevy_replicon::prelude::*;

use super::{Party, dug, ground, large_ground, other_ground, player, server, settings};
use crate::stage::dig;

/// A server of this terrain.
fn server_of(terrain: Terrain) -> GroundServer {
    GroundServer::new(Server::new(terrain, settings()))
}

/// A party with ground that takes many messages to join, and its hash.
fn large_party() -> (Party, u64) {
    let built = dug(large_ground(), 900);
    let hash = built.world().hash();
    let mut party = Party::without_ground(AuthMethod::ProtocolCheck);
    party.server.insert_resource(GroundServer::new(Server::new(built, ServerSettings::default())));
    party.join_with(large_ground(), AuthMethod::ProtocolCheck);
    (party, hash)
}

#[test]
fn players_who_were_there_before_the_world_was_served_are_let_in() {
    let mut party = Party::without_ground(AuthMethod::ProtocolCheck);
    (0..2).for_each(|_| party.join());
    party.rounds(100);
    // It waits, and is done once there is a server.
    party.dig_at(0, 30.0, 30.0);
    party.rounds(20);
    assert_eq!(party.shared(0).pending(), 1);
    party.server.insert_resource(server());
    party.rounds_until("both join, and their digs are done", |party| {
        party.agrees() && party.terrain_hash(1) != ground().world().hash()
    });
}

#[test]
fn another_server_in_the_place_of_one_is_joined() {
    let mut party = Party::new(2);
    party.all_join();
    party.dig_at(0, 30.0, 30.0);
    party.rounds(30);
    let built = dug(ground(), 20);
    let hash = built.world().hash();
    party.server.insert_resource(server_of(built));
    party.rounds_until("both join the other one", |party| party.all_show(hash));
    party.dig_at(1, 60.0, 60.0);
    party.rounds_until("and dig there", |party| party.agrees() && party.terrain_hash(0) != hash);
    assert!((0..2).all(|player| party.shared(player).error().is_none()));
}

#[test]
fn a_server_that_is_put_in_later_is_joined() {
    let mut party = Party::new(1);
    party.all_join();
    party.server.world_mut().remove_resource::<GroundServer>();
    party.rounds_until("the server is missed", |party| {
        party.shared(0).error() == Some(SharingError::NotServed)
    });
    let built = dug(ground(), 20);
    let hash = built.world().hash();
    party.server.insert_resource(server_of(built));
    party.rounds_until("the next one is joined", |party| party.all_show(hash));
}

#[test]
fn a_host_joins_the_server_that_takes_the_place_of_its_own() {
    let mut stage = player();
    let terrain = stage.app.world_mut().spawn((ground(), SharedTerrain::default())).id();
    let has_joined = |stage: &mut crate::stage::Stage, hash| {
        let shared = stage.app.world().get::<SharedTerrain>(terrain).expect("it is shared");
        shared.has_joined() && stage.hash(terrain) == hash
    };
    for count in [0, 10, 20] {
        let built = dug(ground(), count);
        let hash = built.world().hash();
        stage.app.insert_resource(server_of(built));
        stage.frames_until("it has joined", |stage| has_joined(stage, hash));
    }
    let hash = stage.hash(terrain);
    let server = stage.app.world_mut().remove_resource::<GroundServer>().expect("it was there");
    stage.frames(5);
    let shared = stage.app.world().get::<SharedTerrain>(terrain).expect("it is shared");
    assert!(!shared.has_joined());
    assert_eq!(shared.error(), Some(SharingError::NotServed));
    stage.app.insert_resource(server);
    stage.frames_until("it has joined again", |stage| has_joined(stage, hash));
}

/// Leaves after a number of rounds, and joins again over the same connection.
fn leaves_and_joins_again(after: usize) {
    let (mut party, hash) = large_party();
    party.rounds(after);
    let terrain = party.players[0].1;
    party.world_mut(0).entity_mut(terrain).remove::<SharedTerrain>();
    party.rounds(2);
    party.world_mut(0).entity_mut(terrain).insert((large_ground(), SharedTerrain::default()));
    party.rounds_until("it joins again", |party| party.all_show(hash));
}

#[test]
fn who_leaves_while_the_ground_comes_joins_again() {
    [1, 5, 20, 40, 80].into_iter().for_each(leaves_and_joins_again);
}

#[test]
fn a_shared_terrain_that_is_spawned_anew_joins_again() {
    let (mut party, hash) = large_party();
    for _ in 0..3 {
        party.rounds_until("it joins", |party| party.all_show(hash));
        let terrain = party.players[0].1;
        let world = party.world_mut(0);
        world.despawn(terrain);
        party.players[0].1 = world.spawn((large_ground(), SharedTerrain::default())).id();
    }
    party.rounds_until("it joins again", |party| party.all_show(hash));
}

#[test]
fn another_terrain_in_the_place_of_a_shared_one_shows_the_shared_world() {
    let mut party = Party::new(2);
    party.all_join();
    for turn in 0..10 {
        party.dig_at(0, 20.0 + 5.0 * turn as f32, 40.0);
        party.dig_at(1, 20.0 + 5.0 * turn as f32, 44.0);
        // Some of the changes are under way.
        party.rounds(turn % 4);
        let terrain = party.players[0].1;
        party.world_mut(0).entity_mut(terrain).insert(ground());
        party.rounds(turn % 3);
    }
    let pristine = ground().world().hash();
    party.rounds_until("both show all digs", |party| {
        party.agrees() && party.shared(0).number() >= 20 && party.terrain_hash(0) != pristine
    });
}

/// As a game changes levels: in either order.
#[test]
fn the_next_level_is_joined_whoever_changes_first() {
    for server_first in [true, false] {
        let mut party = Party::new(2);
        party.all_join();
        let other = dug(other_ground(), 12);
        let hash = other.world().hash();
        let mut other = Some(server_of(other));
        if server_first {
            party.server.insert_resource(other.take().expect("it is there"));
            party.rounds(20);
        }
        for player in 0..2 {
            let error = party.shared(player).error();
            assert_eq!(server_first, matches!(error, Some(SharingError::OtherGround { .. })), "{error:?}");
            let terrain = party.players[player].1;
            party.world_mut(player).entity_mut(terrain).insert(other_ground());
        }
        party.rounds(20);
        if let Some(other) = other {
            // A dig is not done on ground that nobody serves, and not confirmed.
            let before = party.terrain_hash(0);
            party.dig_at(0, 50.0, 50.0);
            party.round();
            party.rounds_until("it is answered", |party| party.shared(0).pending() == 0);
            party.round();
            assert!(matches!(party.outcomes(0)[..], [EditOutcome::Refused(None)]));
            assert_eq!(party.terrain_hash(0), before);
            party.server.insert_resource(other);
        }
        party.rounds_until("both join the next level", |party| party.all_show(hash));
    }
}

#[test]
fn a_terrain_may_come_after_its_sharing() {
    let mut party = Party::new(1);
    party.all_join();
    let mut stage = player();
    let entity = stage.app.world_mut().spawn(SharedTerrain::default()).id();
    party.connect(stage, entity);
    party.rounds(20);
    assert_eq!(party.shared(1).error(), Some(SharingError::NoTerrain));
    party.world_mut(1).entity_mut(entity).insert(ground());
    party.all_join();
    // Without its terrain it has left, and answered everything.
    party.send(1, dig(30.0, 20.0, 30.0, 4.0));
    party.world_mut(1).entity_mut(entity).remove::<Terrain>();
    party.rounds(20);
    assert_eq!(party.errors(1), [SharingError::NoTerrain, SharingError::NoTerrain]);
    assert_eq!(party.shared(1).pending(), 0);
    party.world_mut(1).entity_mut(entity).insert(ground());
    party.all_join();
}

#[test]
fn one_of_two_shared_terrains_is_shared() {
    let mut party = Party::new(2);
    party.all_join();
    let far = Transform::from_xyz(1000.0, 0.0, 0.0);
    let second = party.world_mut(0).spawn((ground(), SharedTerrain::default(), far)).id();
    party.rounds(30);
    let first = party.players[0].1;
    assert_eq!(party.errors(0), [SharingError::AnotherIsShared(first)], "once");
    // Digs on it are answered, and the first one continues.
    party.send(0, dig(1030.0, 20.0, 30.0, 4.0));
    party.dig_at(0, 30.0, 30.0);
    party.rounds_until("the first one is dug", |party| {
        party.agrees() && party.terrain_hash(0) != ground().world().hash()
    });
    assert_eq!(
        party.outcomes(0).iter().filter(|outcome| matches!(outcome, EditOutcome::Refused(None))).count(),
        1
    );
    let pristine = ground().world().hash();
    assert_eq!(party.players[0].0.hash(second), pristine);
    // Once the first one is gone, the second one is shared.
    party.world_mut(0).despawn(first);
    party.players[0].1 = second;
    party.rounds_until("the second one joins", |party| party.agrees() && party.terrain_hash(0) != pristine);
}

#[test]
fn nothing_is_sent_to_a_player_that_is_gone() {
    #[derive(Resource, Default)]
    struct Gone(Option<Entity>);

    let mut party = Party::new(0);
    party.server.init_resource::<Gone>().add_systems(
        Update,
        |mut commands: Commands, mut gone: ResMut<Gone>| {
            if let Some(gone) = gone.0.take() {
                commands.entity(gone).despawn();
            }
        },
    );
    party.join();
    party.all_join();
    for turn in 0..20 {
        // One that stays keeps the server talking.
        party.join();
        party.rounds(turn % 5);
        party.dig_at(0, 30.0 + turn as f32, 30.0);
        party.round();
        let client = party.client(1);
        let (mut stage, _) = party.players.pop().expect("it is there");
        if turn % 2 == 0 {
            party.server.world_mut().despawn(client);
        } else {
            party.server.world_mut().resource_mut::<Gone>().0 = Some(client);
        }
        stage.app.update();
        for _ in 0..3 {
            party.server.update();
            let world = party.server.world();
            let messages = world.resource::<ServerMessages>();
            assert!(messages.iter_sent().all(|(to, ..)| world.get::<ConnectedClient>(to).is_some()));
        }
        let connected = |server: &mut App| {
            let numbers = std::sync::Arc::new(std::sync::Mutex::new(usize::MAX));
            let to = std::sync::Arc::clone(&numbers);
            server.world_mut().resource_mut::<GroundServer>().with(move |server| {
                *to.lock().expect("nobody panics") = server.clients().count();
            });
            numbers
        };
        let count = connected(&mut party.server);
        party.rounds_until("the server lists its players", |_| {
            *count.lock().expect("nobody panics") != usize::MAX
        });
        assert_eq!(*count.lock().expect("nobody panics"), 1, "a ghost is left");
    }
}
