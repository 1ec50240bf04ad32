//! Eight hostile clients, one for each attack, together with eight honest ones: the server's memory, the time of honest
//! edits, and the gain from reconnecting, with the attackers and without.
//!
//! ```text
//! BURROW_SIEGE=300 cargo test --release --no-default-features --features net,store --test net siege -- --nocapture
//! ```

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use allocation_counter::measure;
use bevy_burrow::brush::Edit;
use bevy_burrow::lattice::RegionPos;
use bevy_burrow::net::{
    Client, ClientEvent, ClientId, Hello, Rate, Server, ServerSettings, ToServer, UndoPolicy,
};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::follower::{count, hills, terrain};

const TICK: Duration = Duration::from_micros(16_667);
/// The size of the world. All edits within a few seconds must be a small part of it, because the old world is kept that
/// long for clients that acknowledge nothing.
const SIDE: f32 = 512.0;
/// Ticks between two edits of an honest player.
const EDIT: u64 = 12;
/// The attackers' numbers begin here.
const HOSTILE: u64 = 1000;

fn random_dig(rng: &mut Rng, radius: f32) -> Edit {
    // At many depths, so that most digs still find ground.
    let mut across = || 8.0 + (SIDE - 16.0) * rng.f32();
    let (x, z) = (across(), across());
    let at = Vec3::new(x, 20.0 - 40.0 * rng.f32(), z);
    Edit::quantize(&Brush::dig(Shape::sphere(at, radius))).expect("a valid brush")
}

struct Honest {
    id: ClientId,
    client: Client,
    sent: BTreeMap<u64, u64>,
    edits: u64,
    refused: u64,
}

/// The results of a run.
#[derive(Debug)]
struct Outcome {
    /// Bytes of the server's world at its end, without the ground, which clients here share.
    world: i64,
    /// Bytes that the server held in addition to it.
    beside: i64,
    /// Ticks from an edit to its confirmation, 99th percentile.
    ticks: u64,
    /// The server's time for a tick, 99th percentile.
    took: Duration,
    /// The edits that the constantly reconnecting client got accepted.
    reconnecting: u64,
}

struct Attackers {
    ground: u64,
    rng: Rng,
    own: [u64; 8],
}

impl Attackers {
    fn greet(&self, server: &mut Server, at: usize, now: Duration) {
        let (protocol, simulation, position) = (Server::PROTOCOL, Terrain::SIMULATION, IVec3::splat(20));
        let hello =
            Hello { protocol, simulation, ground: self.ground, chunk_size: 32, epoch: None, position };
        server.receive(ClientId(HOSTILE + at as u64), &ToServer::Hello(hello).to_bytes(), now);
    }

    /// Sends the messages of all of them for a tick. Kicked clients reconnect at once.
    fn act(&mut self, server: &mut Server, tick: u64, now: Duration) {
        for at in 0..8 {
            let id = ClientId(HOSTILE + at as u64);
            if !server.clients().any(|client| client == id) || (at == 1 && tick.is_multiple_of(3)) {
                server.connect(id, now);
                self.greet(server, at, now);
                continue;
            }
            let mut send = |message: ToServer| server.receive(id, &message.to_bytes(), now);
            let own = &mut self.own[at];
            match at {
                // Fetches regions of a changing world, and acknowledges nothing.
                0 => {
                    *own += 1;
                    let edits = vec![random_dig(&mut self.rng, 2.0)];
                    send(ToServer::Edits { first: *own, edits });
                    send(ToServer::Fetch { number: 0, regions: vec![RegionPos(IVec3::ZERO); 8] });
                }
                // Reconnects all the time, and digs as much as it can.
                1 => {
                    let edits = (0..20).map(|_| random_dig(&mut self.rng, 2.0)).collect();
                    send(ToServer::Edits { first: *own + 1, edits });
                    *own += 20;
                }
                2 => (0..4).for_each(|_| self.greet(server, at, now)),
                // Numbers that no honest client has.
                3 => {
                    let edits = vec![random_dig(&mut self.rng, 2.0)];
                    let first = [u64::MAX, u64::MAX - 1, 1 << 40, 0][tick as usize % 4];
                    send(ToServer::Edits { first, edits });
                }
                // Undoes great strokes.
                4 => {
                    let edits = vec![random_dig(&mut self.rng, 9.0).with_labels(0, Some(tick))];
                    send(ToServer::Edits { first: *own + 1, edits });
                    send(ToServer::Undo { sequence: *own + 2, of: id });
                    *own += 2;
                }
                // Floods with edits.
                5 => {
                    let edits = (0..100).map(|_| random_dig(&mut self.rng, 3.0)).collect();
                    send(ToServer::Edits { first: *own + 1, edits });
                    *own += 100;
                }
                // Joins again and again, and acknowledges nothing.
                6 if tick.is_multiple_of(60) => self.greet(server, at, now),
                6 => {}
                _ => {
                    let bytes: Vec<u8> = (0..self.rng.usize(0..200)).map(|_| self.rng.u8(..)).collect();
                    server.receive(id, &bytes, now);
                }
            }
        }
    }
}

fn run(seconds: u64, is_attacked: bool) -> Outcome {
    let ground = hills(SIDE as u32);
    let mut rng = Rng::with_seed(5);
    let mut dug = terrain(&ground);
    (0..4000).for_each(|_| dug.submit(random_dig(&mut rng, 9.0)));
    while let Some(transaction) = dug.begin() {
        dug.commit(transaction.run()).expect("it waits for it");
    }
    // Undo has its own limit, which a busy player fills in any case.
    let undo_bytes = 1 << 20;
    // Honest players should join quickly.
    let bulk = Rate { per_second: 2 << 20, burst: 64 << 10 };
    let settings = ServerSettings { undo: UndoPolicy::Own, undo_bytes, bulk, ..ServerSettings::default() };
    let mut server = Server::new(dug, settings);
    let edits: Arc<Mutex<BTreeMap<ClientId, u64>>> = Arc::default();
    let counted = Arc::clone(&edits);
    server.set_permission(move |client, _| {
        *counted.lock().expect("nobody panics").entry(client).or_default() += 1;
        true
    });
    let mut now = Duration::from_secs(1);
    let mut players: Vec<Honest> = (1..9)
        .map(|id| {
            let mut client = Client::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid");
            client.connect(now);
            server.connect(ClientId(id), now);
            Honest { id: ClientId(id), client, sent: BTreeMap::new(), edits: 0, refused: 0 }
        })
        .collect();
    let mut attackers = Attackers { ground: ground.hash(), rng: Rng::with_seed(9), own: [0; 8] };
    let (mut ticks, mut took) = (Vec::new(), Vec::new());
    for tick in 0..seconds * 60 {
        now += TICK;
        for player in &mut players {
            if player.client.has_joined() && (tick + player.id.0).is_multiple_of(EDIT) {
                player.edits += 1;
                player.sent.insert(player.edits, tick);
                let edit = random_dig(&mut rng, 3.0).with_labels(player.edits, Some(player.edits));
                player.client.submit(edit);
            }
        }
        let start = Instant::now();
        if is_attacked {
            attackers.act(&mut server, tick, now);
        }
        for player in &mut players {
            for message in player.client.take_outgoing() {
                server.receive(player.id, &message, now);
            }
        }
        server.advance(now);
        let outgoing = server.take_outgoing();
        took.push(start.elapsed());
        for (to, lane, bytes) in outgoing {
            if let Some(player) = players.iter_mut().find(|player| player.id == to) {
                player.client.receive(lane, bytes);
            }
        }
        for player in &mut players {
            while player.client.advance(now) {}
            drop(player.client.take_shown());
            for event in player.client.take_events() {
                match event {
                    ClientEvent::Confirmed { tag, .. } => {
                        ticks.extend(player.sent.remove(&tag).map(|sent| tick - sent));
                    }
                    ClientEvent::Refused { .. } => player.refused += 1,
                    ClientEvent::Kicked(why) => panic!("{:?} was kicked: {why}", player.id),
                    _ => {}
                }
            }
        }
    }
    for player in &players {
        assert!(player.client.has_joined() && player.edits > 0, "{:?}", player.id);
        assert_eq!(player.refused, 0, "{:?}", player.id);
        let is_late = player.client.pending() > 3;
        assert!(!is_late, "{:?}: {} of {} wait", player.id, player.client.pending(), player.edits);
    }
    ticks.sort_unstable();
    took.sort_unstable();
    let reconnecting = edits.lock().expect("nobody panics").get(&ClientId(HOSTILE + 1)).copied();
    let figures = server.figures();
    let world = server.terrain().world().memory().edits() as i64;
    let outcome = Outcome {
        world,
        beside: -measure(|| drop(server)).bytes_current - world,
        ticks: ticks[ticks.len() * 99 / 100],
        took: took[took.len() * 99 / 100],
        reconnecting: reconnecting.unwrap_or_default(),
    };
    println!("attacked: {is_attacked}: {outcome:?}, {figures:?}");
    outcome
}

#[test]
fn eight_attackers_cost_honest_players_little() {
    let seconds = count("BURROW_SIEGE", 10);
    let (quiet, attacked) = (run(seconds, false), run(seconds, true));
    // Edits of attackers are part of the world, as for any player. Other memory for them is less than half of that:
    // there is no copy of the world for each of them, nor of its index, which is a twentieth.
    let more = attacked.beside - quiet.beside;
    assert!(2 * more <= attacked.world, "{more} bytes more, in addition to a world of {}", attacked.world);
    // 50 ms.
    assert!(attacked.ticks <= quiet.ticks + 3, "{} ticks instead of {}", attacked.ticks, quiet.ticks);
    if seconds >= 60 {
        assert!(attacked.took <= quiet.took + Duration::from_millis(50), "{:?}", attacked.took);
    }
    // An edit of radius 2 costs 28 at least.
    let cost = ServerSettings::default().cost;
    let most = (cost.burst + cost.per_second * seconds) / 28;
    assert!(attacked.reconnecting <= most, "{} instead of {most}", attacked.reconnecting);
    assert!(attacked.reconnecting > most / 4, "too few of its edits were accepted");
}
