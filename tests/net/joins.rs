//! How fast late joiners get all regions over lines of different kinds.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::net::{Client, ClientId, Lane, Rate, Server, ServerSettings};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::IVec3;

use crate::bots::{FRAME, TICK};
use crate::follower::{count, hills, terrain};
use crate::link::{Line, Way};
use crate::worlds::any_random_brush;

const ID: ClientId = ClientId(1);

/// A line of 10 Mbit/s.
const USUAL: Line = Line {
    latency: Duration::from_millis(25),
    jitter: Duration::from_millis(5),
    lost: 1,
    timeout: Duration::from_millis(120),
    rate: 1_250_000,
};

/// A line with more latency and more loss.
const FAR: Line = Line {
    latency: Duration::from_millis(120),
    jitter: Duration::from_millis(40),
    lost: 3,
    timeout: Duration::from_millis(500),
    ..USUAL
};

/// A terrain with many edits.
fn dug(ground: &Arc<Ground>, edits: u64) -> Terrain {
    let (mut terrain, mut rng) = (terrain(ground), Rng::with_seed(3));
    let mut left = edits;
    while left > 0 {
        let brushes = std::iter::repeat_with(|| any_random_brush(&mut rng, ground));
        let brushes = brushes.filter(|brush| Edit::quantize(brush).is_ok()).take(left.min(500) as usize);
        let brushes: Vec<Brush> = brushes.collect();
        left -= brushes.len() as u64;
        terrain.apply(brushes);
    }
    terrain
}

/// How a client joined.
struct Joined {
    playable: Duration,
    whole: Duration,
    bytes: u64,
    /// The most bytes of the bulk lane on their way.
    most: usize,
}

/// Lets a client with the pristine world join over a line.
fn join(ground: &Arc<Ground>, world: &Terrain, line: &Line, settings: ServerSettings) -> Joined {
    let served = Terrain::restore(Arc::clone(ground), &TerrainSettings::default(), world.parts());
    let mut server = Server::new(served.expect("its own parts"), settings);
    let mut client = Client::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    client.set_position(IVec3::new(20, 20, 20));
    let [mut up, mut order, mut bulk] = std::array::from_fn(|_| Way::default());
    let (mut free, mut rng, mut now) = ([Duration::ZERO; 2], Rng::with_seed(8), Duration::from_secs(1));
    let begin = now;
    let mut playable = None;
    server.connect(ID, now);
    client.connect(now);
    for frame in 0.. {
        now += FRAME;
        if frame % 2 == 0 {
            while let Some((_, message)) = up.next(now) {
                server.receive(ID, &message, now);
            }
            server.advance(now);
            for (_, lane, message) in server.take_outgoing() {
                let way = if lane == Lane::Main { &mut order } else { &mut bulk };
                way.send(message, now, &mut free[0], line, &mut rng);
            }
        }
        for (lane, way) in [(Lane::Main, &mut order), (Lane::Bulk, &mut bulk)] {
            while let Some((_, message)) = way.next(now) {
                client.receive(lane, message);
            }
        }
        client.advance(now);
        let is_playable = |event: &_| matches!(event, bevy_burrow::net::ClientEvent::Playable);
        if client.take_events().iter().any(is_playable) {
            playable.get_or_insert(now - begin);
        }
        client
            .take_outgoing()
            .into_iter()
            .for_each(|message| up.send(message, now, &mut free[1], line, &mut rng));
        if client.has_joined() {
            break;
        }
        assert!(now < Duration::from_secs(1200), "{:?}", client.figures());
    }
    assert_eq!(client.world().hash(), server.terrain().world().hash());
    assert_eq!((server.figures().malformed, server.figures().kicked, client.figures().malformed), (0, 0, 0));
    let bytes = server.figures().bulk_bytes;
    Joined { playable: playable.expect("it plays"), whole: now - begin, bytes, most: bulk.most }
}

/// A line carries all regions in hardly more than the time that their bytes need, after some seconds in which the server learns
/// how fast it is; at the first rate, they would take several times as long.
#[test]
fn all_regions_come_as_fast_as_a_line_carries_them() {
    let edits = count("BURROW_EDITS", 3000);
    let ground = hills(if edits > 20_000 { 512 } else { 256 });
    let world = dug(&ground, edits);
    let slow = Rate { per_second: 256 << 10, burst: 32 << 10 };
    for (what, line) in [("usual", USUAL), ("far", FAR)] {
        let before = join(&ground, &world, &line, ServerSettings { bulk: slow, ..ServerSettings::default() });
        let joined = join(&ground, &world, &line, ServerSettings::default());
        for (name, joined) in [("256 KiB/s", &before), ("adapted", &joined)] {
            let Joined { playable, whole, bytes, most } = joined;
            println!(
                "{edits} edits, {what} line, {name}: {bytes} bytes in {whole:?}, playable after {playable:?}, {most} on their way"
            );
        }
        let least = joined.bytes as f64 / line.rate as f64;
        assert!(joined.playable <= before.playable && joined.whole <= before.whole, "it is slower");
        let learning = if what == "usual" { 5.0 } else { 10.0 };
        assert!(
            joined.whole.as_secs_f64() <= learning + least * 1.4,
            "{:?} instead of {least:.1} s",
            joined.whole
        );
    }
}

/// The rate of the settings is a limit, however fast the line is.
#[test]
fn no_more_is_sent_than_the_settings_allow() {
    let ground = hills(160);
    let world = dug(&ground, 800);
    for per_second in [100 << 10, 600 << 10] {
        let bulk = Rate { per_second, burst: per_second / 8 };
        let line = Line { rate: 20 << 20, lost: 0, ..USUAL };
        let joined = join(&ground, &world, &line, ServerSettings { bulk, ..ServerSettings::default() });
        let least = (joined.bytes as f64 - bulk.burst as f64) / per_second as f64;
        // Headers of pieces are not counted.
        let took = (joined.whole + TICK).as_secs_f64();
        assert!(took >= least * 0.97, "{} bytes in {took} s", joined.bytes);
    }
}
