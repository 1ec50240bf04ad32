//! A session can start again at any moment: whatever happens to connections, clients and servers, all clients end with
//! the server's world.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::net::{Client, ClientEvent, ClientId, Lane, Rate, Server, ServerSettings, UndoPolicy};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{SimulatedDisk, Store, StoreOptions};
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::follower::{count, hills, terrain};
use crate::pair::{ID, TICK, joins_again, new_client, pump, quick};

const SIDE: u32 = 64;

/// A client and the lanes between it and the server.
struct Player {
    id: ClientId,
    client: Client,
    /// Whether there is a connection, even if a side has not noticed yet.
    is_connected: bool,
    up: VecDeque<Vec<u8>>,
    down: [VecDeque<Vec<u8>>; 2],
    kicked: usize,
    /// Edits of this client that are not answered, by tag.
    asked: BTreeSet<u64>,
    /// Answers to edits that were answered before.
    twice: usize,
}

impl Player {
    fn new(id: ClientId, client: Client) -> Self {
        let (up, down, asked) = Default::default();
        Self { id, client, is_connected: false, up, down, kicked: 0, asked, twice: 0 }
    }

    fn take_events(&mut self) {
        for event in self.client.take_events() {
            match event {
                ClientEvent::Kicked(_) => self.kicked += 1,
                ClientEvent::Confirmed { tag, .. } | ClientEvent::Refused { tag, .. } => {
                    self.twice += usize::from(!self.asked.remove(&tag));
                }
                _ => {}
            }
        }
    }
}

struct Play {
    ground: Arc<Ground>,
    server: Server,
    store: Option<(Store, SimulatedDisk)>,
    players: Vec<Player>,
    now: Duration,
    rng: Rng,
}

fn random_settings(rng: &mut Rng) -> ServerSettings {
    let rate = [4 << 10, 64 << 10, 1 << 20][rng.usize(0..3)];
    ServerSettings {
        undo: UndoPolicy::Own,
        log_bytes: [0, 400, 8 << 20][rng.usize(0..3)],
        bulk: Rate { per_second: rate, burst: rate / 4 },
        window: [3_000, 30_000, 512 << 10][rng.usize(0..3)],
        // A connection may end at any byte of the stream.
        piece: [7 + rng.usize(0..40), 100, 1 << 10][rng.usize(0..3)],
        work: [1, 200, 100_000][rng.usize(0..3)],
        ..ServerSettings::default()
    }
}

fn options() -> StoreOptions {
    StoreOptions { loss_window: Duration::ZERO, ..StoreOptions::default() }
}

fn random_dig(rng: &mut Rng) -> Edit {
    let at = Vec3::new(rng.f32() * SIDE as f32, 14.0 + 8.0 * rng.f32(), rng.f32() * SIDE as f32);
    let brush = Brush::dig(Shape::sphere(at, 1.0 + 3.0 * rng.f32()));
    Edit::quantize(&brush.with_stroke(rng.u64(0..4))).expect("a valid brush")
}

fn dug(ground: &Arc<Ground>, digs: u32, rng: &mut Rng) -> Terrain {
    let mut terrain = terrain(ground);
    (0..digs).for_each(|_| terrain.submit(random_dig(rng)));
    while let Some(transaction) = terrain.begin() {
        terrain.commit(transaction.run()).expect("it waits for it");
    }
    terrain
}

impl Play {
    fn new(seed: u64, ground: &Arc<Ground>) -> Self {
        let mut rng = Rng::with_seed(seed);
        let settings = random_settings(&mut rng);
        let digs = rng.u32(0..60);
        let server = Server::new(dug(ground, digs, &mut rng), settings);
        let mut play = Self {
            ground: Arc::clone(ground),
            server,
            store: None,
            players: Vec::new(),
            now: Duration::from_secs(1),
            rng,
        };
        for id in 1..=play.rng.u64(1..4) {
            play.players.push(Player::new(ClientId(id), play.client()));
        }
        play
    }

    fn client(&self) -> Client {
        let settings = TerrainSettings::default();
        let mut client = Client::new(Arc::clone(&self.ground), &settings).expect("valid settings");
        client.set_position(IVec3::new(30, 18, 30));
        client
    }

    /// A frame: some of the messages in transit arrive.
    fn tick(&mut self) {
        self.now += TICK;
        for player in &mut self.players {
            for _ in 0..self.rng.usize(0..=player.up.len()) {
                let Some(message) = player.up.pop_front() else { break };
                self.server.receive(player.id, &message, self.now);
            }
        }
        self.send();
        self.server.advance(self.now);
        if let Some((store, _)) = &mut self.store {
            self.server.save(store).expect("the store's thread runs");
        }
        self.send();
        for player in &mut self.players {
            for (lane, messages) in [Lane::Main, Lane::Bulk].into_iter().zip(&mut player.down) {
                for _ in 0..self.rng.usize(0..=messages.len()) {
                    messages.pop_front().into_iter().for_each(|message| player.client.receive(lane, message));
                }
            }
            while player.client.advance(self.now) {}
            drop(player.client.take_shown());
            player.take_events();
            let messages = player.client.take_outgoing();
            if player.is_connected {
                player.up.extend(messages);
            }
        }
    }

    fn send(&mut self) {
        for (to, lane, message) in self.server.take_outgoing() {
            if let Some(player) =
                self.players.iter_mut().find(|player| player.id == to && player.is_connected)
            {
                player.down[lane as usize].push_back(message);
            }
        }
    }

    fn connect(&mut self, at: usize) {
        let player = &mut self.players[at];
        player.is_connected = true;
        (player.up, player.down) = Default::default();
        self.server.connect(player.id, self.now);
        player.client.connect(self.now);
    }

    /// Ends the connection; some of the messages in transit have arrived.
    fn cut(&mut self, at: usize) {
        let player = &mut self.players[at];
        for _ in 0..self.rng.usize(0..=player.up.len()) {
            player
                .up
                .pop_front()
                .into_iter()
                .for_each(|bytes| self.server.receive(player.id, &bytes, self.now));
        }
        for (lane, messages) in [Lane::Main, Lane::Bulk].into_iter().zip(&mut player.down) {
            for _ in 0..self.rng.usize(0..=messages.len()) {
                messages.pop_front().into_iter().for_each(|bytes| player.client.receive(lane, bytes));
            }
        }
        if self.rng.bool() {
            player.client.advance(self.now);
        }
        player.is_connected = false;
        player.client.disconnect();
        self.server.disconnect(player.id);
    }

    /// Replaces the server while connections persist and messages to the old one are in transit.
    fn replace(&mut self, server: Server) {
        self.server = server;
        for player in self.players.iter().filter(|player| player.is_connected) {
            self.server.connect(player.id, self.now);
        }
    }

    /// The disk after the power or the process was lost, and perhaps a part of the journal.
    fn lost(rng: &mut Rng, disk: &SimulatedDisk) -> SimulatedDisk {
        if rng.u32(0..3) == 0 {
            return disk.image().lose_power(|| rng.bool());
        }
        let disk = disk.image().lose_process();
        let logs: Vec<String> = disk.paths().into_iter().filter(|path| path.ends_with(".log")).collect();
        if let (true, Some(log)) = (rng.u32(0..3) == 0, rng.choice(&logs)) {
            let (is_cut, part, bit) = (rng.bool(), rng.f32(), rng.u32(0..8));
            disk.damage(log, |bytes| {
                let at = (part * bytes.len() as f32) as usize;
                match bytes.get_mut(at) {
                    Some(byte) if !is_cut => *byte ^= 1 << bit,
                    _ => bytes.truncate(at),
                }
            });
        }
        disk
    }

    fn restart(&mut self) {
        let disk = match self.store.take() {
            // It is killed: waiting commits are not saved.
            Some((store, disk)) => {
                let disk = Self::lost(&mut self.rng, &disk);
                drop(store);
                disk
            }
            None => {
                let disk = SimulatedDisk::new();
                let mut saved = dug(&self.ground, 20, &mut self.rng);
                let store =
                    Store::create_in(Arc::new(disk.clone()), &mut saved, options()).expect("a new world");
                drop(store);
                disk
            }
        };
        let disk_of_store = Arc::new(disk.clone());
        let (store, opened) =
            Store::open_in(disk_of_store, Arc::clone(&self.ground), options()).expect("a saved world");
        let server = Server::open(opened.terrain, &store, random_settings(&mut self.rng));
        self.replace(server);
        self.store = Some((store, disk));
    }

    fn act(&mut self) {
        let at = self.rng.usize(0..self.players.len());
        match self.rng.u32(0..20) {
            0..3 => self.connect(at),
            3..5 => self.cut(at),
            // With or without a connection.
            5 | 6 => self.players[at].client.connect(self.now),
            7 | 8 => {
                self.players[at].client = self.client();
                self.players[at].asked.clear();
                self.players[at].client.connect(self.now);
            }
            9 => {
                let settings = random_settings(&mut self.rng);
                let digs = self.rng.u32(0..60);
                let terrain = dug(&self.ground, digs, &mut self.rng);
                self.store = None;
                self.replace(Server::new(terrain, settings));
            }
            10 => self.restart(),
            // The server starts a new session without a message to the client.
            11 if self.players[at].is_connected => self.server.connect(self.players[at].id, self.now),
            12 => self.players[at].client.undo(None),
            _ => {
                for _ in 0..self.rng.u32(1..8) {
                    let (tag, edit) = (self.rng.u64(..), random_dig(&mut self.rng));
                    self.players[at].asked.insert(tag);
                    self.players[at].client.submit(edit.clone().with_labels(tag, edit.stroke()));
                }
            }
        }
    }

    fn is_settled(&self) -> bool {
        let last = self.server.epoch().number;
        // A client that has not noticed yet that its server was replaced may be at an equal number of the other order
        // by chance: it has sent this server nothing about it.
        self.server.applied() == last
            && self.players.iter().all(|player| {
                let is_here = self.server.acknowledged(player.id) == Some(last);
                let client = &player.client;
                is_here && client.has_joined() && client.number() == last && client.pending() == 0
            })
    }

    /// Plays a script. Returns an error if the end state is wrong.
    fn run(&mut self) -> Result<Duration, String> {
        for _ in 0..self.rng.u32(4..16) {
            self.act();
            (0..self.rng.u32(0..12)).for_each(|_| self.tick());
        }
        for at in 0..self.players.len() {
            if !self.players[at].is_connected {
                self.connect(at);
            }
        }
        let began = self.now;
        while !self.is_settled() {
            if self.now - began > Duration::from_secs(180) {
                let players = self.players.iter().map(|player| {
                    let client = &player.client;
                    (client.has_joined(), client.number(), client.pending(), client.figures())
                });
                return Err(format!("stuck: {:?} {:?}", self.server, players.collect::<Vec<_>>()));
            }
            self.tick();
        }
        let hash = self.server.terrain().world().hash();
        for player in &self.players {
            if player.client.world().hash() != hash {
                return Err(format!("{:?} has another world", player.id));
            }
            if player.client.shown_hash() != hash {
                return Err(format!("{:?} shows another world than it has", player.id));
            }
            if player.twice > 0 || !player.asked.is_empty() {
                let (id, left) = (player.id, player.asked.len());
                return Err(format!("{id:?}: {} answers too many, {left} missing", player.twice));
            }
            if player.kicked > 0 || player.client.figures().repairs > 0 {
                return Err(format!("{:?} kicked or repaired: {:?}", player.id, player.client.figures()));
            }
        }
        Ok(self.now - began)
    }
}

#[test]
fn whatever_happens_everybody_ends_with_the_world() {
    let ground = hills(SIDE);
    let first = count("BURROW_SEED", 1);
    let (mut longest, mut failed) = (Duration::ZERO, Vec::new());
    for seed in first..first + count("BURROW_SCRIPTS", 60) {
        match Play::new(seed, &ground).run() {
            Ok(took) => longest = longest.max(took),
            Err(why) => {
                println!("BURROW_SEED={seed}: {why}");
                failed.push(seed);
            }
        }
    }
    println!("joined after {longest:?} at the latest");
    assert!(failed.is_empty(), "failing seeds: {failed:?}");
}

#[test]
fn a_client_that_takes_the_place_of_another_on_its_connection_gets_all_of_the_world() {
    let step = count("BURROW_STEP", 9) as usize;
    for ticks in (0..70).step_by(step) {
        let ((mut server, ground), mut now) = (quick(512, 400), Duration::from_secs(1));
        server.connect(ID, now);
        let mut first = new_client(&ground, now);
        (0..ticks).for_each(|_| pump(&mut server, &mut first, &mut now));
        assert!(joins_again(&mut server, &ground, &mut now).is_some(), "after {ticks} ticks");
    }
}

#[test]
fn a_client_that_comes_after_more_than_a_window_was_sent_joins() {
    let ((mut server, ground), mut now) = (quick(1024, 1500), Duration::from_secs(1));
    server.connect(ID, now);
    let mut first = new_client(&ground, now);
    while !first.has_joined() {
        pump(&mut server, &mut first, &mut now);
    }
    assert!(server.figures().bulk_bytes > 512 << 10);
    assert!(joins_again(&mut server, &ground, &mut now).is_some());
}

#[test]
fn a_greeting_that_nobody_heard_is_repeated() {
    let ((mut server, ground), mut now) = (quick(128, 20), Duration::from_secs(1));
    let mut client = new_client(&ground, now);
    // There is no server yet, so messages are lost.
    for _ in 0..100 {
        now += TICK;
        drop(client.take_outgoing());
        client.advance(now);
    }
    server.connect(ID, now);
    (0..200).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert!(client.has_joined());
    // A client that follows silently does not fall behind either if the server forgets its session.
    server.connect(ID, now);
    server.submit(random_dig(&mut Rng::with_seed(1))).expect("no stamp");
    (0..200).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert_eq!(client.world().hash(), server.terrain().world().hash());
    assert_eq!(server.figures().malformed, 0);
}

/// A player digs without a connection on one machine, and meanwhile plays on another one.
#[test]
fn what_was_dug_without_a_connection_is_done_though_the_player_dug_elsewhere() {
    for (dug_before, dug_elsewhere) in [(0, 5), (3, 1), (3, 5), (30, 2)] {
        let ((mut server, ground), mut now) = (quick(128, 0), Duration::from_secs(1));
        let (mut first, mut done) = (new_client(&ground, now), BTreeSet::new());
        let mut rng = Rng::with_seed(3);
        let mut dig = |client: &mut Client, tag: u64| {
            client.submit(random_dig(&mut rng).with_labels(tag, None));
        };
        let mut play = |server: &mut Server, client: &mut Client, now: &mut Duration| {
            for _ in 0..100 {
                *now += TICK;
                client.take_outgoing().iter().for_each(|message| server.receive(ID, message, *now));
                server.advance(*now);
                server
                    .take_outgoing()
                    .into_iter()
                    .for_each(|(_, lane, message)| client.receive(lane, message));
                client.advance(*now);
                done.extend(client.take_events().into_iter().filter_map(|event| match event {
                    ClientEvent::Confirmed { tag, receipt: Some(_) } => Some(tag),
                    _ => None,
                }));
            }
        };
        server.connect(ID, now);
        play(&mut server, &mut first, &mut now);
        (0..dug_before).for_each(|tag| dig(&mut first, tag));
        play(&mut server, &mut first, &mut now);
        first.disconnect();
        (100..104).for_each(|tag| dig(&mut first, tag));
        server.connect(ID, now);
        let mut second = new_client(&ground, now);
        play(&mut server, &mut second, &mut now);
        (200..200 + dug_elsewhere).for_each(|tag| dig(&mut second, tag));
        play(&mut server, &mut second, &mut now);
        server.connect(ID, now);
        first.connect(now);
        play(&mut server, &mut first, &mut now);
        let expected = (0..dug_before).chain(100..104).chain(200..200 + dug_elsewhere);
        assert_eq!(done, expected.collect::<BTreeSet<u64>>());
        assert_eq!(server.figures().edits, 4 + dug_before + dug_elsewhere, "each is sent once");
        assert_eq!(first.world().hash(), server.terrain().world().hash());
    }
}

#[test]
fn who_begins_with_the_level_gets_only_what_differs() {
    let ground = hills(SIDE);
    let level = dug(&ground, 300, &mut Rng::with_seed(4));
    let joined = |has_level: bool| {
        let served = Terrain::restore(Arc::clone(&ground), &TerrainSettings::default(), level.parts());
        let mut server = Server::new(served.expect("its own parts"), ServerSettings::default());
        let mut now = Duration::from_secs(1);
        server.submit(random_dig(&mut Rng::with_seed(1))).expect("no stamp");
        server.connect(ID, now);
        let mut client =
            Client::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings");
        if has_level {
            client.begin_with(level.parts().change).expect("it fits");
        }
        client.connect(now);
        let mut shown = terrain(&ground);
        for _ in 0..200 {
            now += TICK;
            client.take_outgoing().iter().for_each(|message| server.receive(ID, message, now));
            server.advance(now);
            server.take_outgoing().into_iter().for_each(|(_, lane, message)| client.receive(lane, message));
            client.advance(now);
            for order in client.take_shown() {
                shown.apply_one(order).outcome.expect("it fits");
            }
        }
        assert!(client.has_joined());
        let hash = server.terrain().world().hash();
        assert_eq!([client.world().hash(), shown.world().hash()], [hash; 2]);
        server.figures().bulk_bytes
    };
    let [all, some] = [false, true].map(joined);
    assert!(some < all, "{some} bytes instead of {all}");
}

#[test]
fn who_is_cut_off_while_thousands_of_regions_come_gets_all_of_them() {
    let ground = Arc::new(Ground::flat(256, 256, 0.0).expect("valid"));
    let mut dug = terrain(&ground);
    let height = 300;
    let places =
        (0..4).flat_map(|x| (-height..height).flat_map(move |y| (0..4).map(move |z| IVec3::new(x, y, z))));
    let dots = places.map(|region| {
        let shape = Shape::sphere((region * 64 + 28).as_vec3(), 1.0);
        if region.y < 0 { Brush::dig(shape) } else { Brush::add(shape, MaterialId(1)) }
    });
    dug.apply(dots.collect::<Vec<_>>());
    assert!(dug.world().regions().count() > 8192);
    let (mut server, mut now) = (Server::new(dug, ServerSettings::default()), Duration::from_secs(1));
    server.connect(ID, now);
    let mut client = new_client(&ground, now);
    (0..10).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert!(!client.has_joined());
    server.disconnect(ID);
    client.disconnect();
    server.connect(ID, now);
    client.connect(now);
    (0..3000).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert!(client.has_joined(), "{:?}", client.figures());
    assert_eq!(client.world().hash(), server.terrain().world().hash());
    assert_eq!((server.figures().malformed, client.figures().malformed), (0, 0));
}
