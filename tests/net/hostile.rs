//! Any received bytes: no panic, bounded memory, everything counted. `BURROW_FUZZ` is the number of messages.

use std::sync::Arc;
use std::time::Duration;

use allocation_counter::measure;
use bevy_burrow::brush::Edit;
use bevy_burrow::lattice::RegionPos;
use bevy_burrow::net::{
    BulkReader, ClientId, ContentTable, Entries, Epoch, Hello, KickReason, Lane, Rate, Reach, Refusal,
    Server, ServerSettings, ToClient, ToServer, UndoPolicy,
};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Vec2, Vec3};

use crate::follower::{FRAME, Follower, count, hills, play, terrain};
use crate::worlds::{any_random_brush, contents as random_contents};

/// Bytes that a decoder may take regardless of the size of its input.
const BASE_BYTES: u64 = 1 << 20;
/// Bytes that a message to the server may take for each of its bytes: an edit is some 200 bytes, and at least 4 in a
/// message.
const TO_SERVER: u64 = 400;
/// Bytes that a message to a client may take for each of its bytes: a brick of few bits takes a thousand bytes.
const TO_CLIENT: u64 = 800;

/// Changes bytes somehow; they may stay the same.
fn damage(rng: &mut Rng, bytes: &mut Vec<u8>) {
    let length = bytes.len();
    if length == 0 {
        bytes.push(rng.u8(..));
        return;
    }
    let at = rng.usize(0..length);
    match rng.u8(..6) {
        0 | 1 => bytes[at] ^= 1 << rng.u8(..8),
        2 => bytes[at] = rng.u8(..),
        3 => bytes.truncate(at),
        4 => bytes.insert(at, rng.choice([0, 127, 128, 255]).unwrap_or(0)),
        _ => {
            let to = rng.usize(0..length);
            let count = rng.usize(1..32).min(length - at.max(to));
            bytes.copy_within(at..at + count, to);
        }
    }
}

/// Random bytes, or a message that was changed.
fn hostile(rng: &mut Rng, valid: &[Vec<u8>]) -> Vec<u8> {
    if rng.u8(..8) == 0 {
        return (0..rng.usize(0..200)).map(|_| rng.u8(..)).collect();
    }
    let mut bytes = valid[rng.usize(0..valid.len())].clone();
    (0..rng.u8(0..4)).for_each(|_| damage(rng, &mut bytes));
    bytes
}

struct Messages {
    ground: Arc<Ground>,
    contents: ContentTable,
    image: Arc<GreyImage>,
    to_server: Vec<Vec<u8>>,
    to_client: Vec<Vec<u8>>,
}

impl Messages {
    /// Messages of every kind.
    fn new() -> Self {
        let (ground, mut rng) = (hills(128), Rng::with_seed(7));
        let samples = (0..64).map(|at: u16| at * 1000).collect();
        let image = Arc::new(GreyImage::from_samples(8, 8, samples).unwrap());
        let mut contents = ContentTable::default();
        contents.add(Arc::clone(&image));
        let (grids, prefabs) = random_contents();
        for grid in grids {
            contents.add(Arc::clone(grid.image()));
        }
        for prefab in prefabs {
            contents.add_prefab(Arc::clone(prefab)).expect("it is small");
        }
        let settings = ServerSettings {
            undo: UndoPolicy::Own,
            cost: Rate { per_second: 1 << 40, burst: 1 << 40 },
            log_bytes: 2000,
            ..ServerSettings::default()
        };
        let mut server = Server::new(terrain(&ground), settings);
        *server.contents_mut() = contents.clone();
        let mut bots: Vec<Follower> = (1..4).map(|id| Follower::new(id, &ground)).collect();
        bots.iter_mut().for_each(|bot| bot.contents = contents.clone());
        let (mut to_server, mut to_client) = (Vec::new(), Vec::new());
        let mut now = Duration::ZERO;
        for round in 0..60 {
            now += FRAME;
            if round % 20 == 0 {
                bots.iter_mut().for_each(|bot| bot.connect(&mut server, now));
            } else {
                for bot in &mut bots {
                    let brushes = (0..rng.u32(0..3)).map(|_| any_random_brush(&mut rng, &ground));
                    let kept = brushes
                        .filter(|brush| Edit::quantize(brush).is_ok_and(|edit| contents.can_send(&edit)));
                    let place = Vec3::new(64.0, 20.0, 64.0);
                    let stamp = Stamp::new(Arc::clone(&image), place, Vec2::splat(9.0), 3.0);
                    bot.edit(
                        kept.chain([Brush::stamp(Shape::sphere(place, 6.0), stamp)]).collect::<Vec<_>>(),
                    );
                }
                bots[round % 3].undo(round as u64 % 3 + 1);
                // That of another player is refused.
                bots[0].undo(2);
            }
            match round % 20 {
                5 => server.submit(Order::rules(DiggingRules::default().with_bedrock(3))).unwrap(),
                9 => server.submit(Order::Loose(Some(LooseSettings::default()))).unwrap(),
                13 => bots[0].spoil(Vec3::new(64.0, 20.0, 64.0)),
                _ => {}
            }
            for bot in &mut bots {
                to_server.extend(bot.out.iter().map(ToServer::to_bytes));
                bot.send(&mut server, now);
            }
            server.advance(now);
            for (to, lane, bytes) in server.take_outgoing() {
                let bot = bots.iter_mut().find(|bot| bot.id == to).unwrap();
                if lane == Lane::Main {
                    to_client.push(bytes.clone());
                }
                bot.receive(lane, &bytes);
            }
        }
        to_server.push(ToServer::Ack { bulk: 300, number: 9 }.to_bytes());
        let region = server.terrain().world().regions().next().unwrap();
        to_server.push(ToServer::Fetch { number: 3, regions: vec![region; 40] }.to_bytes());
        // The messages of the bulk lane: all regions, then the table of them.
        for epoch in [None, Some(Epoch { run: 0, ..server.epoch() })] {
            let (mut bulk, mut late) = (BulkReader::default(), Follower::new(9, &ground));
            late.epoch = epoch;
            late.connect(&mut server, now);
            late.send(&mut server, now);
            for frame in 0..400 {
                now += FRAME;
                server.advance(now);
                for (to, lane, bytes) in server.take_outgoing() {
                    if (to, lane) == (late.id, Lane::Bulk)
                        && let Ok(ToClient::Piece(piece)) = ToClient::from_bytes(&bytes, &ground, &contents)
                    {
                        to_client.extend((frame == 0).then_some(bytes));
                        bulk.add(&piece);
                        let ack = ToServer::Ack { bulk: bulk.received(), number: 0 };
                        server.receive(late.id, &ack.to_bytes(), now);
                    }
                }
                while let Some(message) = bulk.next(&ground, &contents).unwrap() {
                    to_client.push(message.to_bytes());
                }
            }
        }
        to_client.push(ToClient::Kicked(KickReason::Flood).to_bytes());
        to_client.push(ToClient::Failed { number: 70 }.to_bytes());
        to_client.push(ToClient::Durable { number: 70 }.to_bytes());
        for messages in [&mut to_server, &mut to_client] {
            messages.sort();
            messages.dedup();
        }
        Self { ground, contents, image, to_server, to_client }
    }
}

#[test]
fn messages_of_every_kind_come_back_from_their_bytes() {
    let Messages { ground, contents, to_server, to_client, .. } = Messages::new();
    let mut tags = [[0; 10]; 2];
    for bytes in &to_server {
        let message = ToServer::from_bytes(bytes, &contents).unwrap();
        assert_eq!(&message.to_bytes(), bytes);
        tags[0][usize::from(bytes[0])] += 1;
    }
    let mut entries = [0; 5];
    for bytes in &to_client {
        let message = ToClient::from_bytes(bytes, &ground, &contents).unwrap();
        assert_eq!(&message.to_bytes(), bytes);
        tags[1][usize::from(bytes[0])] += 1;
        let ToClient::Entries(Entries { entries: own, .. }) = &message else { continue };
        for entry in own {
            entries[match entry.order() {
                Some(Order::Edit(_)) => 0,
                Some(Order::Rules(_)) => 1,
                Some(Order::Loose(_)) => 2,
                Some(_) => 3,
                None => 4,
            }] += 1;
        }
    }
    assert!(tags[0][..5].iter().all(|&count| count > 0), "{tags:?}");
    assert!(tags[1].iter().all(|&count| count > 0), "{tags:?}");
    assert!(entries.iter().all(|&count| count > 0), "{entries:?}");
}

#[test]
fn stamps_are_sent_by_name() {
    let Messages { contents, image, .. } = Messages::new();
    let at = Vec3::new(64.0, 20.0, 64.0);
    let stamp = |image: &Arc<GreyImage>| {
        let stamp = Stamp::new(Arc::clone(image), at, Vec2::splat(9.0), 3.0);
        let edit = Edit::quantize(&Brush::stamp(Shape::sphere(at, 6.0), stamp)).unwrap();
        (contents.can_send(&edit), ToServer::Edits { first: 1, edits: vec![edit] })
    };
    let (can, message) = stamp(&image);
    let bytes = message.to_bytes();
    assert!(can && bytes.len() < 80, "{} bytes", bytes.len());
    assert_eq!(ToServer::from_bytes(&bytes, &contents), Ok(message));
    let other = Arc::new(GreyImage::from_samples(8, 8, vec![9; 64]).unwrap());
    let (can, message) = stamp(&other);
    assert!(!can && ToServer::from_bytes(&message.to_bytes(), &contents).is_err());
}

#[test]
fn decoders_take_any_bytes() {
    let Messages { ground, contents, to_server, to_client, .. } = Messages::new();
    let mut rng = Rng::with_seed(count("BURROW_SEED", 1));
    let (runs, mut accepted, mut most) = (count("BURROW_FUZZ", 20_000), [0; 2], [0; 2]);
    for _ in 0..runs {
        let bytes = hostile(&mut rng, &to_server);
        let mut message = None;
        let memory = measure(|| message = ToServer::from_bytes(&bytes, &contents).ok()).bytes_max;
        assert!(memory < BASE_BYTES + TO_SERVER * bytes.len() as u64, "{memory} bytes for {}", bytes.len());
        most[0] = memory.max(most[0]);
        if let Some(message) = message {
            accepted[0] += 1;
            assert_eq!(ToServer::from_bytes(&message.to_bytes(), &contents), Ok(message));
        }
    }
    // Those to clients come from a server that is trusted more, and are larger.
    for _ in 0..runs / 20 {
        let bytes = hostile(&mut rng, &to_client);
        let mut message = None;
        let memory = measure(|| message = ToClient::from_bytes(&bytes, &ground, &contents).ok()).bytes_max;
        assert!(memory < BASE_BYTES + TO_CLIENT * bytes.len() as u64, "{memory} bytes for {}", bytes.len());
        most[1] = memory.max(most[1]);
        if let Some(message) = message {
            accepted[1] += 1;
            let again = message.to_bytes();
            let read = ToClient::from_bytes(&again, &ground, &contents).unwrap();
            assert_eq!(read.to_bytes(), again);
        }
        let mut stream = BulkReader::default();
        stream.add(&bytes);
        while let Ok(Some(_)) = stream.next(&ground, &contents) {}
    }
    println!("{runs} messages: {accepted:?} accepted, {most:?} bytes of memory at most");
    assert!(accepted.iter().all(|&count| count > runs / 400), "{accepted:?}");
}

/// The first message of a client.
fn hello(ground: &Ground) -> Vec<u8> {
    let (simulation, ground) = (Terrain::SIMULATION, ground.hash());
    let hello = Hello {
        protocol: Server::PROTOCOL,
        simulation,
        ground,
        chunk_size: 32,
        epoch: None,
        position: IVec3::splat(20),
    };
    ToServer::Hello(hello).to_bytes()
}

#[test]
fn a_server_takes_any_messages() {
    let Messages { ground, contents, to_server, .. } = Messages::new();
    let mut rng = Rng::with_seed(count("BURROW_SEED", 1) + 1);
    let reach = Reach { distance: 60, speed: 0, latency: Duration::ZERO };
    let settings = ServerSettings {
        undo: UndoPolicy::Own,
        undo_bytes: 1 << 20,
        reach: Some(reach),
        ..Default::default()
    };
    let mut server = Server::new(terrain(&ground), settings);
    *server.contents_mut() = contents.clone();
    let mut now = Duration::from_secs(1);
    let begin = |server: &mut Server, client: ClientId, now: Duration| {
        server.connect(client, now);
        server.set_position(client, Some(IVec3::new(64, 20, 64)));
        server.receive(client, &hello(&ground), now);
    };
    let mut honest = Follower::new(99, &ground);
    honest.contents = contents.clone();
    honest.connect(&mut server, now);
    server.set_position(honest.id, Some(IVec3::new(64, 20, 64)));
    let mut attackers: Vec<(ClientId, u64)> = (0..8).map(|id| (ClientId(1000 + id), 1)).collect();
    let edits: Vec<Vec<Edit>> = to_server
        .iter()
        .filter_map(|bytes| match ToServer::from_bytes(bytes, &contents) {
            Ok(ToServer::Edits { edits, .. }) => Some(edits),
            _ => None,
        })
        .collect();
    attackers.iter().for_each(|&(client, _)| begin(&mut server, client, now));
    let (runs, mut most, mut begun, mut kicks) = (count("BURROW_FUZZ", 20_000), 0, 8, [0_u64; 2]);
    for run in 0..runs {
        let (client, own) = &mut attackers[rng.usize(0..8)];
        let mut bytes = hostile(&mut rng, &to_server);
        if rng.bool() {
            // With a new number, so that it is not taken for a repeated edit.
            let edits = edits[rng.usize(0..edits.len())].clone();
            let first = *own;
            *own += edits.len() as u64;
            bytes = ToServer::Edits { first, edits }.to_bytes();
            (0..rng.u8(0..3)).for_each(|_| damage(&mut rng, &mut bytes));
        }
        let client = *client;
        let memory = measure(|| server.receive(client, &bytes, now)).bytes_max;
        assert!(memory < BASE_BYTES + TO_SERVER * bytes.len() as u64, "{memory} bytes for {}", bytes.len());
        most = memory.max(most);
        if run % 64 == 63 {
            now += Duration::from_millis(32);
            if run % 8192 == 64 * 9 - 1 {
                let place = Vec3::new(32.0 + 64.0 * rng.f32(), 20.0, 32.0 + 64.0 * rng.f32());
                honest.edit([Brush::dig(Shape::sphere(place, 2.0))]);
            }
            honest.send(&mut server, now);
            server.advance(now);
            for (to, lane, bytes) in server.take_outgoing() {
                if to == honest.id {
                    honest.receive(lane, &bytes);
                } else if bytes.len() == 2
                    && let Ok(ToClient::Kicked(why)) = ToClient::from_bytes(&bytes, &ground, &honest.contents)
                {
                    kicks[usize::from(why == KickReason::Flood)] += 1;
                    begun += 1;
                    // A kicked client reconnects under a new number.
                    let again = ClientId(1000 + begun);
                    attackers.iter_mut().filter(|own| own.0 == to).for_each(|own| *own = (again, 1));
                    begin(&mut server, again, now);
                }
            }
        }
    }
    let figures = server.figures();
    println!(
        "{runs} hostile messages: {kicks:?} kicked as malformed and flooding, {most} bytes at most, {figures:?}"
    );
    let memory = server.terrain().world().memory().total();
    println!(
        "world: {memory} bytes, {} bricks; peak {:?}",
        server.terrain().world().bricks().count(),
        peak()
    );
    assert!(memory < 128 << 20, "{memory} bytes");
    assert!(figures.messages >= runs + begun);
    assert!(figures.malformed > runs / 10 && figures.kicked >= kicks[0] + kicks[1] && kicks[0] > 0);
    assert!(figures.ordered > runs / 1000, "few of them are ordered");
    assert_eq!(figures.failed, 0);
    assert!(server.clients().any(|client| client == honest.id), "an honest client was kicked");
    assert_eq!(honest.confirmed, (1..=honest.last_sequence).collect::<Vec<_>>());
    assert!(honest.last_sequence > 0 && honest.refused.is_empty());
}

/// The most memory that the process has taken.
fn peak() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    Some(status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().to_string())
}

#[test]
fn a_flooder_is_kicked_and_nobody_else_notices() {
    let ground = hills(128);
    let settings = ServerSettings::default();
    let mut server = Server::new(terrain(&ground), settings);
    let mut now = Duration::from_secs(1);
    let (mut honest, mut flooder) = (Follower::new(1, &ground), Follower::new(2, &ground));
    honest.connect(&mut server, now);
    flooder.connect(&mut server, now);
    play(&mut server, &mut [&mut honest, &mut flooder], &mut now, 3);
    let mut rng = Rng::with_seed(3);
    let mut small = || {
        let place = Vec3::new(rng.f32() * 128.0, 20.0, rng.f32() * 128.0);
        Brush::dig(Shape::sphere(place, 2.0))
    };
    // Each costs 28, and ten times the rate is 40,000 a second.
    let start = now;
    let mut kicked_at = None;
    for frame in 0..20 * 20 {
        if flooder.kicked.is_none() {
            flooder.edit((0..72).map(|_| small()));
        } else {
            kicked_at.get_or_insert(now - start);
        }
        if frame % 4 == 0 {
            honest.edit([small()]);
        }
        play(&mut server, &mut [&mut flooder, &mut honest], &mut now, 1);
        // Its edit is ordered in the frame in which it arrives, however much others send.
        assert_eq!(honest.confirmed.last().copied().unwrap_or_default(), honest.last_sequence);
    }
    assert_eq!((flooder.kicked, honest.kicked), (Some(KickReason::Flood), None));
    assert!(kicked_at.is_some_and(|after| after < Duration::from_secs(10)), "{kicked_at:?}");
    assert!(honest.refused.is_empty());
    assert!(flooder.refused.iter().all(|(_, why)| *why == Refusal::Cost));
    // Less than three times the rate is not flooding: excess edits are refused.
    let mut eager = Follower::new(3, &ground);
    eager.connect(&mut server, now);
    play(&mut server, &mut [&mut eager], &mut now, 3);
    for _ in 0..20 * 20 {
        eager.edit((0..20).map(|_| small()));
        play(&mut server, &mut [&mut eager], &mut now, 1);
    }
    assert_eq!(eager.kicked, None);
    assert!(eager.refused.len() > eager.confirmed.len());
}

#[test]
fn too_many_invalid_messages_lead_to_a_kick() {
    let ground = hills(64);
    let settings = ServerSettings { malformed: Rate { per_second: 1, burst: 5 }, ..Default::default() };
    let mut server = Server::new(terrain(&ground), settings);
    let now = Duration::from_secs(1);
    server.connect(ClientId(1), now);
    server.receive(ClientId(1), &hello(&ground), now);
    server.advance(now);
    let far = vec![RegionPos(IVec3::splat(i32::MAX))];
    let invalid = [
        vec![],
        vec![99],
        ToServer::Ack { bulk: 1, number: 0 }.to_bytes(),
        ToServer::Ack { bulk: 0, number: 1 }.to_bytes(),
        ToServer::Fetch { number: 0, regions: far }.to_bytes(),
    ];
    for (count, message) in invalid.iter().enumerate() {
        server.receive(ClientId(1), message, now);
        assert_eq!((server.figures().malformed, server.clients().count()), (count as u64 + 1, 1));
    }
    server.receive(ClientId(1), &[99], now);
    assert_eq!((server.figures().malformed, server.clients().count()), (6, 0));
}
