//! A fast server and one client, with lanes that deliver everything at once.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::net::{Client, ClientId, Server, ServerSettings};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::follower::terrain;

pub const TICK: Duration = Duration::from_millis(20);

/// A fast server, a world of `digs` rough digs, and one player with lanes that deliver everything at once.
pub fn quick(side: u32, digs: u32) -> (Server, Arc<Ground>) {
    let ground = Arc::new(Ground::flat(side, side, 0.0).expect("valid"));
    let mut dug = terrain(&ground);
    let mut rng = Rng::with_seed(7);
    for _ in 0..digs {
        let at = Vec3::new(rng.f32() * side as f32, rng.f32() * 8.0 - 6.0, rng.f32() * side as f32);
        let brush = Brush::dig(Shape::sphere(at, 4.0 + rng.f32() * 4.0));
        dug.submit(Edit::quantize(&brush).expect("a valid brush"));
    }
    while let Some(transaction) = dug.begin() {
        dug.commit(transaction.run()).expect("it waits for it");
    }
    (Server::new(dug, ServerSettings::default()), ground)
}

pub const ID: ClientId = ClientId(1);

pub fn new_client(ground: &Arc<Ground>, now: Duration) -> Client {
    let mut client = Client::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid");
    client.set_position(IVec3::new(64, 2, 64));
    client.connect(now);
    client
}

pub fn pump(server: &mut Server, client: &mut Client, now: &mut Duration) {
    *now += TICK;
    client.take_outgoing().iter().for_each(|message| server.receive(ID, message, *now));
    server.advance(*now);
    server.take_outgoing().into_iter().for_each(|(_, lane, message)| client.receive(lane, message));
    client.advance(*now);
    drop((client.take_shown(), client.take_events()));
}

/// Joins over the connection of a previous client; returns the time that this took.
pub fn joins_again(server: &mut Server, ground: &Arc<Ground>, now: &mut Duration) -> Option<Duration> {
    let (mut client, began) = (new_client(ground, *now), *now);
    while !client.has_joined() && *now - began < Duration::from_secs(60) {
        pump(server, &mut client, now);
    }
    let is_same = client.world().hash() == server.terrain().world().hash();
    (client.has_joined() && is_same).then(|| *now - began)
}

/// A server and a client that has joined.
pub fn joined() -> (Server, Client, Arc<Ground>, Duration) {
    let ((mut server, ground), mut now) = (quick(128, 20), Duration::from_secs(1));
    server.connect(ID, now);
    let mut client = new_client(&ground, now);
    while !client.has_joined() {
        pump(&mut server, &mut client, &mut now);
    }
    (server, client, ground, now)
}
