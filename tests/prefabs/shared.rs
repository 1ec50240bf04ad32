//! Pastes in saves and over the network.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::format::WorldId;
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::net::{Client, ClientEvent, ClientId, Lane, Server, ServerSettings};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{SimulatedDisk, Store, StoreOptions, WorldFile};
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::laws::{edited_on, some_box, terrain};

#[test]
fn a_world_with_a_paste_is_the_same_after_it_was_saved() {
    for seed in 0..6 {
        let mut rng = Rng::with_seed(seed + 20);
        let (ground, mut world) = edited_on(&mut rng, seed);
        let samples = some_box(&mut rng, world.world());
        let prefab = world.world().copy(samples, samples.min).expect("it lies in the world");
        let disk = SimulatedDisk::default();
        let options = || StoreOptions { loss_window: Duration::ZERO, ..StoreOptions::default() };
        let files = || Arc::new(disk.clone());
        let mut store = Store::create_in(files(), &mut world, options()).expect("an empty disk");
        let paste = Paste::new(prefab, samples.min.as_vec3() + Vec3::Y * 3.0).turned_about_y(seed as i32);
        world.apply([Brush::paste(paste)]);
        store.follow(&mut world).expect("the store's thread runs");
        store.close().wait(Duration::from_secs(60)).expect("saved");
        let (_store, opened) = Store::open_in(files(), Arc::clone(&ground), options()).expect("saved");
        assert_eq!(opened.terrain.world().hash(), world.world().hash());
        assert!(opened.warnings.is_empty(), "{:?}", opened.warnings);

        let bytes = WorldFile::to_bytes(&world, WorldId(1), &BTreeMap::new()).expect("it is small");
        let read = WorldFile::from_bytes(&bytes, ground).expect("its own bytes").terrain;
        assert_eq!(read.world().hash(), world.world().hash());
    }
}

/// A server and its clients, over lines without delay.
struct Play {
    server: Server,
    clients: Vec<Client>,
    now: Duration,
    /// Bytes of all messages to clients, by lane.
    bytes: [usize; 2],
}

impl Play {
    fn run(&mut self) {
        for _ in 0..200 {
            self.now += Duration::from_millis(20);
            for (number, client) in (1..).zip(&mut self.clients) {
                for message in client.take_outgoing() {
                    self.server.receive(ClientId(number), &message, self.now);
                }
            }
            self.server.advance(self.now);
            for (ClientId(number), lane, message) in self.server.take_outgoing() {
                self.bytes[usize::from(lane == Lane::Bulk)] += message.len();
                self.clients[number as usize - 1].receive(lane, message);
            }
            for client in &mut self.clients {
                client.advance(self.now);
            }
        }
    }
}

#[test]
fn clients_that_lack_a_prefab_get_it_once_and_have_the_servers_world() {
    let ground = Arc::new(Ground::flat(96, 96, 20.0).expect("valid"));
    let mut server = Server::new(terrain(&ground, 32), ServerSettings::default());
    let mut own = terrain(&ground, 32);
    own.apply([Brush::dig(Shape::sphere(Vec3::new(20.0, 20.0, 20.0), 7.0))]);
    let around = LatticeBox::point(IVec3::splat(20)).grown(12);
    let prefab = Arc::new(own.world().copy(around, IVec3::splat(20)).expect("it lies in the world"));
    let settings = TerrainSettings::default();
    let mut clients = Vec::new();
    for id in 1..=3 {
        let mut client = Client::new(Arc::clone(&ground), &settings).expect("valid settings");
        client.set_position(IVec3::splat(20));
        server.connect(ClientId(id), Duration::ZERO);
        client.connect(Duration::ZERO);
        clients.push(client);
    }
    server.contents_mut().add_prefab(Arc::clone(&prefab)).expect("it is small");
    clients[0].contents_mut().add_prefab(Arc::clone(&prefab)).expect("it is small");
    let mut play = Play { server, clients, now: Duration::from_secs(1), bytes: [0; 2] };
    play.run();
    let paste = |x: f32, turns| {
        let paste = Paste::new(Arc::clone(&prefab), Vec3::new(x, 20.0, 50.0)).turned_about_y(turns);
        Edit::quantize(&Brush::paste(paste)).expect("a valid brush")
    };
    let before = play.bytes;
    play.clients[0].submit(paste(30.0, 1));
    play.run();
    let first = play.bytes[1] - before[1];
    play.clients[0].submit(paste(70.0, 2));
    play.run();
    let second = play.bytes[1] - before[1] - first;
    assert!(second == 0, "the prefab was sent again: {first}, then {second} bytes");
    let order = play.bytes[0] - before[0];
    for client in &mut play.clients {
        let events = client.take_events();
        assert!(!events.iter().any(|event| matches!(event, ClientEvent::Refused { .. })), "{events:?}");
        assert_eq!(client.world().hash(), play.server.terrain().world().hash());
        assert_eq!(client.figures().malformed, 0);
    }
    assert_ne!(play.server.terrain().world().hash(), terrain(&ground, 32).world().hash());
    // Two edits for three clients, with what else is sent in the lane.
    assert!(order < 3 * 2 * 400, "{order} bytes for two pastes");

    // One that the server does not know is neither sent nor ordered.
    let unknown = own.world().copy(around, IVec3::splat(21)).expect("it lies in the world");
    let edit = Edit::quantize(&Brush::paste(Paste::new(unknown, Vec3::splat(40.0)))).expect("a valid brush");
    assert!(!play.clients[0].contents_mut().can_send(&edit));
    assert!(play.server.submit(edit).is_err());
}
