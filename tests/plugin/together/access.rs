//! Only clients that replicon has authorised take part.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_burrow::net::{self, ClientEvent, KickReason};
use bevy_burrow::together::{EditOutcome, GroundJoined, GroundServer, SharedTerrain, SharingError};
use bevy_replicon::prelude::*;
use bevy_replicon::shared::backend::connected_client::NetworkId;

use super::{Party, ground, player, server};
use crate::stage::Stage;

/// Whether the server has anything to send to this client.
fn is_spoken_to(party: &Party, client: Entity) -> bool {
    let messages = party.server.world().resource::<ServerMessages>();
    messages.iter_sent().any(|(to, ..)| to == client)
}

#[test]
fn who_has_not_logged_in_gets_no_world_and_digs_nothing() {
    let mut party = Party::without_ground(AuthMethod::Custom);
    party.server.insert_resource(server());
    party.join_with(ground(), AuthMethod::Custom);
    party.join_with(ground(), AuthMethod::Custom);
    let client = party.client(1);
    party.server.world_mut().entity_mut(client).insert(AuthorizedClient);
    party.rounds_until("the player that has logged in joins", |party| party.shared(1).has_joined());
    party.dig_at(1, 30.0, 30.0);
    party.dig_at(0, 60.0, 60.0);
    let stranger = party.client(0);
    for _ in 0..200 {
        party.server.update();
        assert!(!is_spoken_to(&party, stranger), "something is sent to a client that has not logged in");
        party.round();
    }
    let dug = party.terrain_hash(1);
    assert_ne!(dug, ground().world().hash(), "the player that has logged in digs");
    assert!(!party.shared(0).has_joined() && party.shared(0).number() == 0 && party.shared(0).id().is_none());
    // The game lets the stranger in, and the earlier dig is done.
    party.server.world_mut().entity_mut(stranger).insert(AuthorizedClient);
    party.rounds_until("it joins, and both show the digs of both", |party| {
        party.agrees() && party.terrain_hash(0) != dug
    });
}

/// Hands messages from app to app, as this client.
fn exchange(party: &mut Party, client: Entity, stage: &mut Stage) {
    let mut sent = stage.app.world_mut().resource_mut::<ClientMessages>();
    let sent: Vec<_> = sent.drain_sent().collect();
    let mut server = party.server.world_mut().resource_mut::<ServerMessages>();
    sent.into_iter().for_each(|(channel, bytes)| server.insert_received(client, channel, bytes));
    server.retain_sent(|(to, ..)| *to != client);
}

#[test]
fn who_never_says_which_protocol_it_speaks_gets_no_world() {
    let mut party = Party::new(1);
    party.all_join();
    let mut stage = player();
    stage.app.world_mut().spawn((ground(), SharedTerrain::default()));
    let client = party.server.world_mut().spawn(ConnectedClient { max_size: 1200 }).id();
    stage.app.world_mut().resource_mut::<NextState<ClientState>>().set(ClientState::Connected);
    stage.app.update();
    // Replicon's own message is lost.
    assert!(stage.app.world_mut().resource_mut::<ClientMessages>().drain_sent().count() > 0);
    for _ in 0..200 {
        exchange(&mut party, client, &mut stage);
        party.server.update();
        assert!(!is_spoken_to(&party, client));
        stage.app.update();
    }
}

#[test]
fn who_speaks_another_protocol_gets_no_world() {
    let mut party = Party::new(0);
    let mut stage = player();
    // It changes the hash of what is registered.
    stage.app.world_mut().insert_resource(other_protocol());
    let terrain = stage.app.world_mut().spawn((ground(), SharedTerrain::default())).id();
    party.connect(stage, terrain);
    let client = party.client(0);
    party.rounds(100);
    assert!(party.server.world().get::<AuthorizedClient>(client).is_none());
    assert!(!party.shared(0).has_joined() && party.shared(0).id().is_none());
}

/// The hash of an app that registers other messages.
fn other_protocol() -> ProtocolHash {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, bevy::state::app::StatesPlugin, RepliconPlugins)).finish();
    *app.world().resource()
}

#[test]
fn who_is_no_longer_authorised_is_told_and_joins_again_once_it_is() {
    let mut party = Party::new(2);
    party.all_join();
    let client = party.client(0);
    party.server.world_mut().entity_mut(client).remove::<AuthorizedClient>();
    party.rounds_until("it is told", |party| !party.shared(0).has_joined());
    assert_eq!(party.errors(0), [SharingError::NotServed]);
    let before = party.terrain_hash(1);
    party.dig_at(0, 30.0, 30.0);
    party.rounds(50);
    assert_eq!(party.terrain_hash(1), before, "its digs are not taken");
    assert!(matches!(party.outcomes(0)[..], [EditOutcome::Refused(None)]));
    party.dig_at(1, 60.0, 60.0);
    party.rounds(50);
    party.server.world_mut().entity_mut(client).insert(AuthorizedClient);
    party.all_join();
    assert_ne!(party.terrain_hash(0), before);
}

#[test]
fn who_is_kicked_stays_out_of_the_ground_while_connected() {
    let mut party = Party::new(2);
    party.all_join();
    let player = party.shared(0).id().expect("it has joined");
    party.server.world_mut().resource_mut::<GroundServer>().with(move |server| server.kick(player));
    party.rounds_until("it is told", |party| party.shared(0).error().is_some());
    let kicked = SharingError::Kicked(KickReason::ByGame);
    assert_eq!(party.shared(0).error(), Some(kicked));
    let joined = party.players[0].0.recorded::<GroundJoined>();
    assert!(joined.iter().any(|joined| joined.event == ClientEvent::Kicked(KickReason::ByGame)));
    // This transport closes no connections.
    let before = party.terrain_hash(1);
    party.dig_at(0, 30.0, 30.0);
    party.rounds(100);
    assert!(!party.shared(0).has_joined());
    assert!(matches!(party.outcomes(0)[..], [EditOutcome::Refused(None)]), "digs are answered");
    assert_eq!((party.terrain_hash(1), party.terrain_hash(0)), (before, before));
    // Over another connection it is asked in again: bans are the game's.
    party.disconnect(0);
    party.reconnect(0);
    party.all_join();
}

#[test]
fn numbers_of_players_are_never_those_of_others() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, bevy::state::app::StatesPlugin, RepliconPlugins)).finish();
    let world = app.world_mut();
    let ids = [0, 1, 7, u64::MAX - 3, u64::MAX - 2, u64::MAX - 1, u64::MAX];
    let clients: Vec<Entity> = ids.map(|id| world.spawn(NetworkId::new(id)).id()).to_vec();
    let number = move |ids: Query<&NetworkId>| -> Vec<net::ClientId> {
        clients.iter().map(|client| GroundServer::player((*client).into(), &ids)).collect()
    };
    let numbers = world.run_system_once(number).expect("it runs");
    let expected = [1, 2, 8, u64::MAX - 2, u64::MAX - 1].map(net::ClientId);
    assert_eq!(numbers[..5], expected);
    assert_eq!(numbers[5..], [net::ClientId::SERVER; 2], "they have none");
    let host = world.run_system_once(|ids: Query<&NetworkId>| GroundServer::player(ClientId::Server, &ids));
    assert_eq!(host.expect("it runs"), net::ClientId(0));
}

#[test]
fn who_has_a_network_id_without_a_number_is_not_served() {
    let mut party = Party::new(1);
    let mut stage = player();
    let terrain = stage.app.world_mut().spawn((ground(), SharedTerrain::default())).id();
    party.connect(stage, terrain);
    let client = party.client(1);
    party.server.world_mut().entity_mut(client).insert(NetworkId::new(u64::MAX));
    party.rounds(100);
    party.dig_at(0, 30.0, 30.0);
    party.rounds_until("the other one continues", |party| {
        party.shared(0).has_joined() && party.shared(0).pending() == 0
    });
}
