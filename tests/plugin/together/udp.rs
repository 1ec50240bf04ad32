//! Over UDP, with the code of the examples: players need tokens, and come back by themselves.

#[path = "../../../examples/shared/party.rs"]
#[allow(dead_code, reason = "programs use its port")]
mod party;
#[path = "../../../examples/shared/reconnect.rs"]
mod reconnect;
#[path = "../../../examples/shared/tokens.rs"]
mod tokens;

use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_burrow::net::{Server, ServerSettings};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{GroundServer, SharedTerrain, SharingError, TogetherPlugin};
use bevy_replicon::prelude::*;
use bevy_replicon_renet::RepliconRenetPlugins;

use super::ground;
use reconnect::{ReconnectPlugin, StayConnected};
use tokens::Key;

/// Nobody waits longer for anything here.
const PATIENCE: Duration = Duration::from_secs(60);

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, StatesPlugin, RepliconPlugins, RepliconRenetPlugins)).add_plugins((
        BurrowPlugins,
        TogetherPlugin,
        ReconnectPlugin,
    ));
    app.finish();
    app.cleanup();
    app
}

/// A server with this key, and the address that it listens at.
fn server(address: SocketAddr, key: Key, ground: GroundServer) -> (App, SocketAddr) {
    let mut app = app();
    app.insert_resource(ground);
    let world = app.world_mut();
    let start = Instant::now();
    // The address may still be that of a server that was just ended.
    loop {
        match party::listen_as(world, address, None, 8, key.server()) {
            Ok(address) => return (app, address),
            Err(why) => assert!(start.elapsed() < PATIENCE, "{why}"),
        }
    }
}

/// A player who asks for a token at each try.
fn player(address: SocketAddr, key: Key, number: u64) -> (App, Entity) {
    let mut app = app();
    let connect =
        move |world: &mut World| party::connect_as(world, address, key.issue(number, vec![address])?);
    app.insert_resource(StayConnected::new(Duration::from_millis(300), connect));
    let terrain = app.world_mut().spawn((ground(), SharedTerrain::default())).id();
    (app, terrain)
}

fn shared((app, terrain): &(App, Entity)) -> &SharedTerrain {
    app.world().get(*terrain).expect("it is shared")
}

fn hash((app, terrain): &(App, Entity)) -> u64 {
    app.world().get::<Terrain>(*terrain).expect("it is there").world().hash()
}

fn frames_until(what: &str, apps: &mut [&mut App], mut is_so: impl FnMut(&mut [&mut App]) -> bool) {
    let start = Instant::now();
    while !is_so(apps) {
        assert!(start.elapsed() < PATIENCE, "never: {what}");
        apps.iter_mut().for_each(|app| app.update());
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Updates a server and a player until the player is so.
fn until(what: &str, server: &mut App, player: &mut (App, Entity), is_so: impl Fn(&(App, Entity)) -> bool) {
    let start = Instant::now();
    while !is_so(player) {
        assert!(start.elapsed() < PATIENCE, "never: {what}");
        server.update();
        player.0.update();
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn who_has_no_token_of_the_server_does_not_connect() {
    let key = Key::random();
    let ground = || GroundServer::new(Server::new(super::ground(), ServerSettings::default()));
    let (mut server, address) = server((Ipv4Addr::LOCALHOST, 0).into(), key, ground());
    let stranger_to = |address: SocketAddr| {
        let mut app = app();
        let connect = move |world: &mut World| party::connect(world, address, 1);
        app.insert_resource(StayConnected::new(Duration::from_millis(300), connect));
        app
    };
    let mut stranger = stranger_to(address);
    let mut forger = player(address, Key::random(), 1);
    let mut honest = player(address, key, 1);
    until("the player with a token joins", &mut server, &mut honest, |player| shared(player).has_joined());
    let is_connected = |app: &App| *app.world().resource::<State<ClientState>>() == ClientState::Connected;
    frames_until("a second passes", &mut [&mut server, &mut honest.0, &mut stranger, &mut forger.0], {
        let start = Instant::now();
        move |_| start.elapsed() > Duration::from_secs(2)
    });
    assert!(is_connected(&honest.0) && !is_connected(&stranger) && !is_connected(&forger.0));
    let clients = server.world_mut().query::<&ConnectedClient>().iter(server.world()).count();
    assert_eq!(clients, 1);
    // A control: a server that asks for no token.
    let mut open = app();
    let address = party::listen(open.world_mut(), (Ipv4Addr::LOCALHOST, 0).into(), 8).expect("a free port");
    let mut stranger = stranger_to(address);
    frames_until("anybody connects", &mut [&mut open, &mut stranger], |apps| is_connected(apps[1]));
}

#[test]
fn the_key_of_a_file_is_made_once() {
    let folder = std::env::temp_dir().join(format!("burrow-key-{}", std::process::id()));
    drop(std::fs::remove_dir_all(&folder));
    let file = folder.join("server.key");
    let read = || std::fs::read_to_string(&file).expect("it is there");
    Key::of_file(&file).expect("there is room");
    let text = read();
    Key::of_file(&file).expect("it is a key");
    assert_eq!((read(), text.trim().len()), (text.clone(), 64));
    std::fs::write(&file, "no key").expect("there is room");
    assert!(Key::of_file(&file).is_err());
    drop(std::fs::remove_dir_all(&folder));
}

#[test]
fn players_come_back_by_themselves() {
    let folder = std::env::temp_dir().join(format!("burrow-come-back-{}", std::process::id()));
    drop(std::fs::remove_dir_all(&folder));
    let ground =
        || GroundServer::saved(&SavedWorld::new(&folder), &super::ground(), ServerSettings::default());
    let key = Key::random();
    let (mut first, address) = server((Ipv4Addr::LOCALHOST, 0).into(), key, ground());
    let mut player = player(address, key, 5);
    until("it joins", &mut first, &mut player, |player| shared(player).has_joined());
    let dig = |player: &mut (App, Entity), x: f32| {
        let brush = Brush::dig(Shape::sphere(Vec3::new(x, 20.0, 40.0), 5.0));
        player.0.world_mut().write_message(brush);
    };
    dig(&mut player, 20.0);
    player.0.update();
    until("it is done", &mut first, &mut player, |player| shared(player).pending() == 0);
    first.world_mut().resource_mut::<GroundServer>().finish();
    party::leave(first.world_mut());
    first.update();
    drop(first);
    frames_until("the loss is noticed", &mut [&mut player.0], |apps| {
        let mut terrains = apps[0].world_mut().query::<&SharedTerrain>();
        let shared = terrains.single(apps[0].world()).expect("it is shared");
        shared.error() == Some(SharingError::ConnectionLost)
    });
    // It digs on.
    dig(&mut player, 70.0);
    player.0.update();
    let before = hash(&player);
    let (mut second, _) = server(address, key, ground());
    until("it is back, and what it dug is done", &mut second, &mut player, |player| {
        shared(player).has_joined() && shared(player).pending() == 0
    });
    until("all of it is shown", &mut second, &mut player, |player| {
        hash(player) != before || shared(player).number() > 1
    });
    let shown = player.0.world().get::<Terrain>(player.1).expect("it is there").world();
    for x in [20.0, 70.0] {
        assert!(!shown.is_solid(DVec3::new(x, 20.0, 40.0)), "the dig at {x} is lost");
    }
    drop(std::fs::remove_dir_all(&folder));
}
