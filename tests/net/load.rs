//! The cost of many players: bytes for each edit and client, and the server's time. `cargo bench --no-default-features
//! --features net --bench players` prints a table of it.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::net::{ClientId, Hello, Lane, Server, ServerSettings, ToServer, UndoPolicy};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;
use glam::{IVec3, Vec3};

/// Frames of a server in a second.
const FRAMES: u64 = 30;
/// Edits of a player in a second.
const EDITS: u64 = 5;
/// Approximate bytes of the headers of UDP, IP and a transport for the messages of a frame.
const HEADERS: u64 = 40;

/// A player that walks and digs.
struct Player {
    id: ClientId,
    at: Vec3,
    sequence: u64,
}

impl Player {
    fn edit(&mut self, rng: &mut Rng, side: f32) -> ToServer {
        self.sequence += 1;
        let step = Vec3::new(rng.f32() - 0.5, 0.2 * (rng.f32() - 0.5), rng.f32() - 0.5);
        self.at =
            (self.at + 3.0 * step).clamp(Vec3::new(4.0, 14.0, 4.0), Vec3::new(side - 4.0, 24.0, side - 4.0));
        let shape = Shape::sphere(self.at, 2.0 + 0.5 * (self.sequence / 20 % 3) as f32);
        // A player keeps a tool for some time.
        let brush = match self.sequence / 10 % 8 {
            0..5 => Brush::dig(shape),
            5 | 6 => Brush::add(shape, MaterialId(2)),
            _ => Brush::smooth(shape, 0.5),
        };
        let brush = brush.with_tag(self.sequence).with_stroke(self.sequence / 10);
        ToServer::Edits { first: self.sequence, edits: vec![Edit::quantize(&brush).expect("a valid brush")] }
    }
}

/// What a run costs.
#[allow(dead_code, reason = "the test reads only `bytes`, the benchmark `players` all of it")]
pub struct Load {
    /// To a client, in the main lane, for each edit.
    pub bytes: f64,
    pub with_headers: f64,
    /// From a client, for each edit.
    pub up: f64,
    pub cpu: Duration,
    pub longest: Duration,
}

/// Low hills.
pub fn hills(side: u32) -> Arc<Ground> {
    Arc::new(wavy(side))
}

/// The ground of the hills.
pub fn wavy(side: u32) -> Ground {
    let height = |x: i32, z: i32| 20.0 + (f64::from(x) * 0.11).sin() + (f64::from(z) * 0.07).cos();
    Ground::from_fn(side, side, height).expect("valid heights")
}

/// `clients` players dig for `seconds` seconds.
pub fn load(clients: u64, seconds: u64, undo: UndoPolicy, ground: &Arc<Ground>) -> Load {
    let mut rng = Rng::with_seed(clients);
    let side = ground.width() as f32;
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    let mut server = Server::new(terrain, ServerSettings { undo, ..ServerSettings::default() });
    let mut players: Vec<Player> = (1..=clients)
        .map(|id| {
            let at = Vec3::new(rng.f32() * side, 20.0, rng.f32() * side);
            Player { id: ClientId(id), at, sequence: 0 }
        })
        .collect();
    let hello = Hello {
        protocol: Server::PROTOCOL,
        simulation: Terrain::SIMULATION,
        ground: ground.hash(),
        chunk_size: 32,
        epoch: None,
        position: IVec3::ZERO,
    };
    let mut now = Duration::from_secs(1);
    for player in &players {
        server.connect(player.id, now);
        server.receive(player.id, &ToServer::Hello(hello.clone()).to_bytes(), now);
    }
    server.advance(now);
    drop(server.take_outgoing());
    let (mut bytes, mut packets, mut up, mut edits) = (0, 0, 0, 0);
    let (mut cpu, mut longest) = (Duration::ZERO, Duration::ZERO);
    for frame in 0..seconds * FRAMES {
        now += Duration::from_secs(1) / FRAMES as u32;
        let mut messages = Vec::new();
        for player in &mut players {
            // Players begin at different times.
            let id = player.id.0;
            let phase = |frame: u64| (frame * EDITS + id * 7) / FRAMES;
            if phase(frame + 1) != phase(frame) {
                let message = player.edit(&mut rng, side).to_bytes();
                up += message.len() as u64;
                edits += 1;
                messages.push((player.id, message));
            }
            if (frame + player.id.0) % FRAMES == 0 {
                let number = server.applied();
                messages.push((player.id, ToServer::Ack { bulk: 0, number }.to_bytes()));
            }
        }
        let before = cpu_time();
        for (client, message) in &messages {
            server.receive(*client, message, now);
        }
        let mut outgoing = server.take_outgoing();
        server.advance(now);
        outgoing.extend(server.take_outgoing());
        let took = cpu_time() - before;
        (cpu, longest) = (cpu + took, longest.max(took));
        let first = outgoing.iter().filter(|(to, lane, _)| (*to, *lane) == (ClientId(1), Lane::Main));
        let sent: u64 = first.map(|(.., message)| message.len() as u64).sum();
        bytes += sent;
        packets += u64::from(sent > 0);
    }
    let figures = server.figures();
    assert_eq!((figures.edits, figures.refused, figures.malformed), (edits, 0, 0));
    let each = |bytes: u64| bytes as f64 / edits as f64;
    Load { bytes: each(bytes), with_headers: each(bytes + packets * HEADERS), up: each(up), cpu, longest }
}

/// The CPU time of the process, all threads together.
fn cpu_time() -> Duration {
    #[cfg(target_os = "linux")]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
    }
    #[cfg(not(target_os = "linux"))]
    Duration::ZERO
}

#[test]
fn an_edit_takes_few_bytes_for_each_client() {
    let load = load(64, 4, UndoPolicy::Nobody, &hills(512));
    assert!(load.bytes <= 26.0, "{} bytes", load.bytes);
}
