//! Limits on a player, regardless of the number of connections, in memory, numbers and time; and that honest players
//! lose nothing by them.

use std::sync::Arc;
use std::time::Duration;

use allocation_counter::measure;
use bevy_burrow::lattice::RegionPos;
use bevy_burrow::net::{
    ClientEvent, ClientId, ContentTable, KickReason, Lane, MAX_SEQUENCE_JUMP, Rate, Reach, Server,
    ServerSettings, ToClient, ToServer,
};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{SimulatedDisk, Store, StoreOptions};
use bevy_burrow::terrain::Patch;
use glam::{DVec3, IVec3, Vec3};

use crate::follower::terrain;
use crate::play::{BEGIN, FRAME, ONE, Play, ball, edit, flat, let_in, send};

/// Additional bytes that the server holds after ten seconds in which a client digs, with or without fetching regions.
/// It acknowledges nothing, and yet all of its edits are done.
fn held(fetches: bool) -> i64 {
    let ground = flat(512);
    let mut dug = terrain(&ground);
    let pit = |x: f32, z: f32| Shape::cuboid(Vec3::new(x, 0.0, z), Vec3::new(100.0, 30.0, 100.0));
    dug.apply([(128.0, 128.0), (384.0, 384.0)].map(|(x, z)| Brush::dig(pit(x, z))));
    let mut server = Server::new(dug, ServerSettings::default());
    let mut now = BEGIN;
    let_in(&mut server, ONE, &ground, now);
    let held = measure(|| {
        for own in 1..=600 {
            let brush = [ball(256.0, 256.0, 1.0), Brush::add(ball(256.0, 256.0, 1.0).shape, MaterialId(1))];
            send(&mut server, ONE, own, vec![edit(&brush[own as usize % 2])], now);
            if fetches {
                let (number, regions) = (server.applied(), vec![RegionPos(IVec3::ZERO)]);
                server.receive(ONE, &ToServer::Fetch { number, regions }.to_bytes(), now);
            }
            server.advance(now);
            drop(server.take_outgoing());
            now += Duration::from_secs(1) / 60;
        }
    })
    .bytes_current;
    assert_eq!(server.figures().kicked + server.figures().refused + server.figures().malformed, 0);
    println!("fetches: {fetches}: {} MiB more", held >> 20);
    held
}

#[test]
fn fetches_that_nobody_takes_keep_one_world_in_memory() {
    let without = held(false);
    assert!(held(true) < without + (8 << 20));
}

/// Bytes that a server holds in addition to its world, all of which changes in a second: after `clients` clients that
/// acknowledge nothing have connected within eight seconds, and after `frames` more frames; and the size of the world.
/// Measured as bytes freed at the end, on this thread.
fn held_beside(clients: u64, frames: u32) -> (i64, i64) {
    let ground = flat(128);
    let settings = ServerSettings { log_bytes: 64 << 10, window: 32 << 10, ..ServerSettings::default() };
    // No order leads to this world from the pristine one, so that regions are sent.
    let mut dug = terrain(&ground);
    dug.apply([ball(64.0, 64.0, 3.0)]);
    let mut server = Server::new(dug, settings);
    let mut now = BEGIN;
    for turn in 0..360 + frames {
        let (x, z) = (12.0 + (turn * 37 % 104) as f32, 12.0 + (turn * 53 % 104) as f32);
        let shape = Shape::sphere(Vec3::new(x, 14.0, z), 14.0);
        let brush = if turn % 3 == 0 { Brush::add(shape, MaterialId(1)) } else { Brush::dig(shape) };
        server.submit(edit(&brush)).expect("no stamp");
        now += FRAME;
        server.advance(now);
        drop(server.take_outgoing());
        if (200..360).contains(&turn) && u64::from(turn - 200) < 4 * clients && turn % 4 == 0 {
            let_in(&mut server, ClientId(u64::from(turn)), &ground, now);
        }
    }
    let figures = server.figures();
    assert_eq!(figures.kicked, 0);
    assert!(frames < 200 || figures.stuck == clients, "{} of {clients}", figures.stuck);
    let world = server.terrain().world().memory().edits() as i64;
    (-measure(|| drop(server)).bytes_current - world, world)
}

#[test]
fn clients_that_take_nothing_share_worlds_and_lose_them() {
    let ((quiet, _), (kept, world), (left, _)) =
        (held_beside(0, 0), held_beside(40, 0), held_beside(40, 200));
    println!("{quiet} bytes, {kept} with 40 clients, {left} later, in addition to a world of {world}");
    assert!(kept - quiet > world / 2, "no world was kept");
    assert!(kept - quiet < 10 * world, "{kept} bytes for 40 clients instead of {quiet}");
    assert!(left - quiet < world / 2, "{left} bytes are left instead of {quiet}");
}

#[test]
fn who_stops_for_long_while_it_joins_begins_again_and_gets_the_world() {
    let ground = flat(256);
    let mut dug = terrain(&ground);
    dug.apply((0..300).map(|at| ball(8.0 + (at * 37 % 240) as f32, 8.0 + (at * 53 % 240) as f32, 7.0)));
    let bulk = Rate { per_second: 8 << 10, burst: 2 << 10 };
    let server = Server::new(dug, ServerSettings { bulk, ..ServerSettings::default() });
    let mut play = Play::of(&ground, server);
    let at = play.join(1);
    play.frames(10);
    assert!(!play.players[at].client.has_joined());
    play.players[at].is_connected = false;
    for turn in 0..400 {
        play.server.submit(edit(&ball(20.0 + (turn % 200) as f32, 100.0, 5.0))).expect("no stamp");
        play.frames(1);
    }
    assert_eq!(play.server.figures().stuck, 1);
    play.players[at].is_connected = true;
    play.frames(1200);
    let client = &play.players[at].client;
    assert!(client.has_joined() && client.world().hash() == play.hash());
    assert_eq!((play.players[at].kicked(), client.figures().repairs, play.server.figures().stuck), (0, 0, 1));
}

#[test]
fn what_a_player_may_spend_does_not_grow_with_connections() {
    let ground = flat(64);
    let ordered = |connections: u64| {
        let mut server = Server::new(terrain(&ground), ServerSettings::default());
        for round in 0..10 {
            let now = BEGIN + FRAME * round as u32;
            if round < connections {
                let_in(&mut server, ONE, &ground, now);
            }
            for part in 0..3 {
                let edits = vec![edit(&ball(30.0, 30.0, 2.0)); 200];
                send(&mut server, ONE, 1 + 600 * round + 200 * part, edits, now);
            }
            server.advance(now);
        }
        assert!(connections > 1 || server.figures().kicked == 1);
        server.figures().ordered
    };
    let (one, ten) = (ordered(1), ordered(10));
    assert!(ten <= one + one / 5, "{ten} edits instead of {one}");
}

#[test]
fn bytes_of_the_bulk_lane_are_those_of_a_player() {
    let ground = flat(512);
    let sent = |connections: u32| {
        let mut dug = terrain(&ground);
        dug.apply((0..400).map(|at| ball(8.0 + (at * 37 % 490) as f32, 8.0 + (at * 53 % 490) as f32, 7.0)));
        let mut server = Server::new(dug, ServerSettings::default());
        for round in 0..40 {
            let now = BEGIN + FRAME * round;
            if round < connections {
                let_in(&mut server, ONE, &ground, now);
            }
            server.advance(now);
        }
        server.figures().bulk_bytes
    };
    let (one, many) = (sent(1), sent(40));
    assert!(one > 100 << 10 && many <= one + one / 5, "{many} bytes instead of {one}");
}

/// The results of digs by player 7, after another client connected under that number and sent an edit with the number
/// `first`: confirmed, pending, kicked.
fn after_a_stranger(first: u64) -> (usize, usize, usize) {
    let ground = flat(128);
    let mut server = Server::new(terrain(&ground), ServerSettings::default());
    let_in(&mut server, ClientId(7), &ground, BEGIN);
    send(&mut server, ClientId(7), first, vec![edit(&ball(30.0, 30.0, 2.0))], BEGIN);
    server.advance(BEGIN);
    server.disconnect(ClientId(7));
    drop(server.take_outgoing());
    let mut play = Play::of(&ground, server);
    let at = play.join(7);
    for turn in 0..12 {
        play.dig(at, &ball(20.0 + 8.0 * turn as f32, 60.0, 3.0));
        play.frames(3);
    }
    play.frames(40);
    let player = &play.players[at];
    (player.confirmed(), player.client.pending(), player.kicked())
}

#[test]
fn whoever_comes_under_a_players_number_can_not_lock_that_player_out() {
    for first in [1, MAX_SEQUENCE_JUMP, 1_000_000, u64::MAX / 2, u64::MAX - 4, u64::MAX - 1] {
        assert_eq!(after_a_stranger(first), (12, 0, 0), "{first}");
    }
}

#[test]
fn numbers_at_the_end_of_their_range_are_counted() {
    let ground = flat(64);
    for (first, count) in [(u64::MAX, 1), (u64::MAX - 1, 1), (u64::MAX - 1, 2), (1 << 40, 3), (0, 0), (0, 1)]
    {
        let mut server = Server::new(terrain(&ground), ServerSettings::default());
        let_in(&mut server, ONE, &ground, BEGIN);
        send(&mut server, ONE, first, vec![edit(&ball(30.0, 30.0, 2.0)); count], BEGIN);
        server.receive(ONE, &ToServer::Undo { sequence: first, of: ONE }.to_bytes(), BEGIN);
        server.advance(BEGIN);
        assert_eq!((server.figures().malformed, server.figures().ordered), (2, 0), "{first} {count}");
    }
}

/// A new server that replaces another one does not refuse the numbers of players that have dug for a long time.
#[test]
fn who_has_dug_for_long_goes_on_at_a_server_that_knows_less() {
    let ground = flat(64);
    let mut play = Play::new(&ground, ServerSettings::default());
    let at = play.join(1);
    // As after hours of play.
    let mut first = 1;
    for _ in 0..3 {
        play.now += Duration::from_secs(1);
        first += MAX_SEQUENCE_JUMP - 1;
        send(&mut play.server, ONE, first, vec![edit(&ball(30.0, 30.0, 2.0))], play.now);
    }
    play.cut(at);
    play.connect(at);
    play.frames(4);
    play.dig(at, &ball(40.0, 40.0, 3.0));
    play.frames(4);
    assert_eq!(play.players[at].confirmed(), 1);
    play.cut(at);
    play.dig(at, &ball(20.0, 40.0, 3.0));
    play.server = Server::new(terrain(&ground), ServerSettings::default());
    play.connect(at);
    play.frames(10);
    assert_eq!((play.players[at].confirmed(), play.players[at].client.pending()), (2, 0));
    assert_eq!(play.server.figures().malformed, 0);
}

#[test]
fn nobody_digs_beyond_the_reach() {
    let ground = flat(128);
    let reach = Some(Reach { distance: 8, speed: 0, latency: Duration::ZERO });
    let is_left = |shape: Shape| {
        let settings = ServerSettings { reach, ..ServerSettings::default() };
        let mut server = Server::new(terrain(&ground), settings);
        server.set_position(ONE, Some(IVec3::new(64, 15, 64)));
        let_in(&mut server, ONE, &ground, BEGIN);
        send(&mut server, ONE, 1, vec![edit(&Brush::dig(shape))], BEGIN);
        server.advance(BEGIN);
        let world = server.terrain().world();
        [10.0, 64.0].map(|x| world.is_solid(DVec3::new(x, 15.0, 64.0)))
    };
    let at = |x: f32| Vec3::new(x, 15.0, 64.0);
    assert_eq!(is_left(Shape::capsule(at(4.0), at(124.0), 2.0)), [true, true]);
    assert_eq!(is_left(Shape::cuboid(at(64.0), Vec3::new(60.0, 2.0, 2.0))), [true, true]);
    assert_eq!(is_left(Shape::sphere(at(10.0), 2.0)), [true, true]);
    assert_eq!(is_left(Shape::sphere(at(66.0), 4.0)), [true, false], "near ground is dug");
}

#[test]
fn games_keys_are_not_those_of_the_server() {
    for key in ["net/number", "net/own/1", "number", "bevy_burrow/net/number"] {
        let (ground, disk) = (flat(64), Arc::new(SimulatedDisk::new()));
        let mut saved = terrain(&ground);
        let mut store =
            Store::create_in(disk.clone(), &mut saved, StoreOptions::default()).expect("a new world");
        let mut server = Server::open(saved, &store, ServerSettings::default());
        for turn in 0..5 {
            server.submit(edit(&ball(10.0 + 8.0 * turn as f32, 30.0, 3.0))).expect("no stamp");
            server.advance(BEGIN);
            server.save(&mut store).expect("the thread runs");
        }
        let applied = server.applied();
        store.put(key, 0_u64.to_le_bytes());
        drop((server, store));
        let (store, opened) = Store::open_in(disk, ground, StoreOptions::default()).expect("a saved world");
        assert_eq!(opened.terrain.world().revision(), 5);
        let server = Server::open(opened.terrain, &store, ServerSettings::default());
        assert_eq!(server.applied(), applied, "{key}");
        assert_eq!(store.get(key), Some(&[0; 8][..]));
    }
}

/// Digs of four minutes without a connection.
#[test]
fn what_was_dug_without_a_connection_is_done_when_it_is_back() {
    for digs in [300_u32, 1200, 2400] {
        let ground = flat(128);
        let mut play = Play::new(&ground, ServerSettings::default());
        let at = play.join(1);
        play.cut(at);
        for turn in 0..digs {
            let (x, z) = (16.0 + (turn * 37 % 96) as f32, 16.0 + (turn * 53 % 96) as f32);
            play.dig(at, &ball(x, z, 4.0).with_tag(turn.into()));
            if turn % 4 == 0 {
                play.players[at].client.advance(play.now);
            }
        }
        let drafted = play.players[at].client.figures().drafted;
        assert!(drafted < 2 * u64::from(digs) + 500, "{drafted} edits were worked out for {digs}");
        play.now += Duration::from_secs(240);
        play.connect(at);
        play.frames(1000);
        let player = &play.players[at];
        assert_eq!((player.confirmed(), player.refused(), player.kicked()), (digs as usize, 0, 0));
        assert_eq!((player.client.pending(), player.client.world().hash()), (0, play.hash()));
        assert_eq!(player.client.shown_hash(), play.hash());
        assert_eq!(player.count(|event| matches!(event, ClientEvent::Predicted(_))), digs as usize);
    }
}

/// An honest client with an empty bucket reconnects: its further edits wait until they are allowed.
#[test]
fn who_comes_back_with_an_empty_bucket_is_not_refused() {
    let ground = flat(128);
    let mut play = Play::new(&ground, ServerSettings::default());
    let at = play.join(1);
    for round in 0..6_u32 {
        for turn in 0..150_u32 {
            let (x, z) = (16.0 + (turn * 37 % 96) as f32, 16.0 + ((turn + round) * 53 % 96) as f32);
            play.dig(at, &ball(x, z, 4.0));
        }
        play.frames(2);
        play.cut(at);
        play.connect(at);
    }
    play.frames(1000);
    let player = &play.players[at];
    assert_eq!((player.confirmed(), player.refused(), player.kicked()), (900, 0, 0));
}

#[test]
fn who_is_not_admitted_is_told_why() {
    let ground = flat(64);
    let mut play = Play::new(&ground, ServerSettings::default());
    play.server.set_admission(|client| if client == ClientId(2) { Err(42) } else { Ok(()) });
    let (a, b) = (play.join(1), play.join(2));
    assert!(play.players[a].client.has_joined() && !play.players[b].client.has_joined());
    assert_eq!(play.players[b].events, [ClientEvent::Kicked(KickReason::Refused(42))]);
    assert_eq!(play.server.clients().collect::<Vec<_>>(), [ONE]);
    play.server.kick_for(ONE, KickReason::Refused(7));
    play.frames(2);
    assert_eq!(play.players[a].events.last(), Some(&ClientEvent::Kicked(KickReason::Refused(7))));
}

/// Parts that a game replaces are sent as clients acknowledge them, and reach all in the end; a client that
/// acknowledges nothing gets at most a window.
#[test]
fn the_main_lane_keeps_within_its_window() {
    let ground = flat(512);
    let mut other = terrain(&ground);
    let mut rng = fastrand::Rng::with_seed(2);
    let mut any = || Vec3::new(rng.f32() * 500.0, rng.f32() * 60.0 - 40.0, rng.f32() * 500.0);
    other.apply((0..600).map(|at| match at % 2 {
        0 => Brush::dig(Shape::sphere(any(), 7.0)),
        _ => Brush::add(Shape::sphere(any(), 7.0), MaterialId(1 + (at % 5) as u8)),
    }));
    let bricks = other.parts().change.bricks;
    let mut play = Play::new(&ground, ServerSettings::default());
    let at = play.join(1);
    let_in(&mut play.server, ClientId(9), &ground, play.now);
    let window = play.server.settings().window as usize;
    let (mut silent, mut longest) = (0, 0);
    for part in bricks.chunks(bricks.len() / 6) {
        let change = Patch { bricks: part.to_vec(), ..Patch::default() };
        play.server.submit(Order::parts(change, None)).expect("it is below the limit of a message");
    }
    for _ in 0..100 {
        play.now += FRAME;
        for message in play.players[at].client.take_outgoing() {
            play.server.receive(ONE, &message, play.now);
        }
        play.server.advance(play.now);
        let mut at_once = 0;
        for (to, lane, bytes) in play.server.take_outgoing() {
            let length = bytes.len();
            if to == ONE {
                at_once += if lane == Lane::Main { length } else { 0 };
                play.players[at].client.receive(lane, bytes);
            } else if let Ok(ToClient::Entries(_)) =
                ToClient::from_bytes(&bytes, &ground, &ContentTable::default())
            {
                silent += length;
                longest = longest.max(length);
            }
        }
        assert!(at_once <= window.max(longest) + 4096, "{at_once} bytes at once");
        while play.players[at].client.advance(play.now) {}
    }
    println!("{silent} bytes to one that is silent, {longest} in a message");
    assert_eq!(play.players[at].client.world().hash(), play.hash());
    assert!(play.server.figures().main_bytes as usize > 2 * window, "there is too little to send");
    assert!(silent <= window.max(longest));
}
