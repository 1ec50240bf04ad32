//! The server's log, its refusals, the policies of undo, and how clients join and reconnect.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::net::{
    ClientId, Entry, Hello, KickReason, Lane, OrderError, Rate, Reach, Refusal, Server, ServerEvent,
    ServerSettings, ToClient, ToServer, UndoPolicy,
};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{SimulatedDisk, Store, StoreOptions};
use bevy_burrow::volume::RulesError;
use glam::{IVec3, Vec3};

use crate::follower::{Follower, agreed, count, hills, play, terrain};
use crate::worlds::{any_random_brush, has_content, random_rules};

fn dig(x: f32, z: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 20.0, z), 3.0))
}

/// Nothing is refused for its cost.
fn generous() -> ServerSettings {
    ServerSettings { cost: Rate { per_second: 1 << 40, burst: 1 << 40 }, ..ServerSettings::default() }
}

struct Scene {
    server: Server,
    ground: Arc<Ground>,
    now: Duration,
}

impl Scene {
    fn new(settings: ServerSettings) -> Self {
        let ground = hills(128);
        let server = Server::new(terrain(&ground), settings);
        Self { server, ground, now: Duration::from_secs(1) }
    }

    fn join(&mut self, id: u64) -> Follower {
        let mut follower = Follower::new(id, &self.ground);
        follower.connect(&mut self.server, self.now);
        self.play(&mut [&mut follower], 3);
        follower
    }

    fn play(&mut self, followers: &mut [&mut Follower], frames: u32) {
        play(&mut self.server, followers, &mut self.now, frames);
    }
}

#[test]
fn all_have_the_world_of_the_order() {
    let mut rng = fastrand::Rng::with_seed(count("BURROW_SEED", 1));
    let mut scene = Scene::new(ServerSettings { undo: UndoPolicy::Own, work: 300, ..generous() });
    let (mut a, mut b, mut c) = (scene.join(1), scene.join(2), scene.join(3));
    for round in 0..count("BURROW_ROUNDS", 60) {
        for follower in [&mut a, &mut b, &mut c] {
            let brushes = (0..rng.u32(0..4)).map(|_| any_random_brush(&mut rng, &scene.ground));
            let brushes: Vec<Brush> = brushes.filter(|brush| !has_content(brush)).collect();
            follower.edit(brushes);
            if rng.u32(0..9) == 0 {
                follower.undo(follower.id.0);
            }
        }
        match round % 13 {
            3 => {
                scene.server.submit(Order::rules(random_rules(&mut rng, &scene.ground))).expect("valid rules")
            }
            5 => scene.server.submit(Order::rules(DiggingRules::default())).expect("valid rules"),
            7 => {
                let loose = LooseSettings { largest: 4096, crumbs: 8, debris: 100 };
                scene.server.submit(Order::Loose(Some(loose))).expect("it can be shared");
            }
            11 => scene.server.submit(Order::Loose(None)).expect("it can be shared"),
            _ => {}
        }
        scene.play(&mut [&mut a, &mut b, &mut c], 2);
    }
    scene.play(&mut [&mut a, &mut b, &mut c], 400);
    agreed(&scene.server, &[&a, &b, &c]);
    assert_eq!([a.repairs, b.repairs, c.repairs], [0; 3]);
    let figures = scene.server.figures();
    assert_eq!((figures.malformed, figures.failed, figures.repairs), (0, 0, 0));
    // Each edit and undo is answered once.
    for follower in [&a, &b, &c] {
        let mut answers: Vec<u64> = follower.refused.iter().map(|(own, _)| *own).collect();
        answers.extend(&follower.confirmed);
        answers.sort_unstable();
        assert_eq!(answers, (1..=follower.last_sequence).collect::<Vec<_>>());
    }
    assert!(a.confirmed.len() > 20, "{} edits only", a.confirmed.len());
}

#[test]
fn entries_go_out_before_the_server_applies_them_and_without_labels() {
    let mut scene = Scene::new(generous());
    let mut a = scene.join(1);
    a.edit([dig(30.0, 30.0).with_tag(77).with_stroke(5)]);
    a.send(&mut scene.server, scene.now);
    let before = scene.server.terrain().world().hash();
    let sent = scene.server.take_outgoing();
    assert_eq!((scene.server.terrain().world().hash(), sent.len()), (before, 1));
    let ToClient::Entries(entries) = ToClient::from_bytes(&sent[0].2, &scene.ground, &a.contents).unwrap()
    else {
        panic!("no entries")
    };
    let [Entry::Order { by: Some((ClientId(1), 1)), order: Order::Edit(edit) }] = &entries.entries[..] else {
        panic!("{entries:?}")
    };
    assert_eq!((edit.tag(), edit.stroke()), (0, None));
    scene.server.advance(scene.now);
    assert_ne!(scene.server.terrain().world().hash(), before);
}

#[test]
fn edits_that_come_twice_are_done_once() {
    let mut scene = Scene::new(generous());
    let mut a = scene.join(1);
    a.edit([dig(30.0, 30.0), dig(40.0, 30.0)]);
    let message = a.out[0].clone();
    scene.play(&mut [&mut a], 1);
    let ordered = scene.server.figures().ordered;
    a.out.push(message);
    scene.play(&mut [&mut a], 1);
    assert_eq!(scene.server.figures().ordered, ordered);
    assert_eq!(a.confirmed, [1, 2]);
}

#[test]
fn an_edit_is_refused_where_its_player_does_not_reach() {
    let reach = Reach { distance: 8, speed: 10, latency: Duration::from_millis(500) };
    assert_eq!(reach.allowed(), 13);
    let mut scene = Scene::new(ServerSettings { reach: Some(reach), ..generous() });
    let mut a = scene.join(1);
    a.edit([dig(30.0, 30.0)]);
    scene.play(&mut [&mut a], 1);
    assert_eq!(a.refused, [(1, Refusal::TooFar)], "the player's position is unknown");
    scene.server.set_position(ClientId(1), Some(IVec3::new(30, 20, 30)));
    // All of a ball of 3 has to be within 13.
    a.edit([dig(30.0, 39.0), dig(30.0, 42.0), dig(20.5, 30.0), dig(10.0, 30.0)]);
    scene.play(&mut [&mut a], 1);
    assert_eq!(a.refused[1..], [(3, Refusal::TooFar), (5, Refusal::TooFar)]);
    assert_eq!(a.confirmed, [2, 4]);
    agreed(&scene.server, &[&a]);
}

#[test]
fn an_edit_is_refused_that_costs_more_than_is_left() {
    let cost = Rate { per_second: 100, burst: 400 };
    let mut scene = Scene::new(ServerSettings { cost, flood: 1000, ..ServerSettings::default() });
    let mut a = scene.join(1);
    let (small, large) = (dig(30.0, 30.0), Brush::dig(Shape::sphere(Vec3::new(64.0, 20.0, 64.0), 30.0)));
    a.edit([large]);
    // Each costs 28 to 47.
    a.edit((0..20).map(|_| small.clone()));
    scene.play(&mut [&mut a], 1);
    let accepted = a.confirmed.len();
    assert!((8..16).contains(&accepted), "{accepted} are accepted");
    assert_eq!(a.confirmed, (2..2 + accepted as u64).collect::<Vec<_>>());
    assert!(a.refused.iter().all(|(_, why)| *why == Refusal::Cost));
    scene.now += Duration::from_secs(60);
    a.edit([small]);
    scene.play(&mut [&mut a], 1);
    assert_eq!(a.confirmed.len(), accepted + 1, "nothing came back");
    // Sculpting costs four times as much, except for the fixed 20 of each edit.
    let mut b = scene.join(2);
    b.edit((0..20).map(|_| Brush::smooth(Shape::sphere(Vec3::new(30.0, 20.0, 30.0), 3.0), 0.5)));
    scene.play(&mut [&mut a, &mut b], 1);
    assert!(b.confirmed.len() < accepted, "{} are accepted", b.confirmed.len());
}

#[test]
fn the_game_forbids_and_the_world_ends() {
    let mut scene = Scene::new(generous());
    scene.server.set_permission(|client, edit| client != ClientId(2) || edit.power() < 100);
    let (mut a, mut b) = (scene.join(1), scene.join(2));
    a.edit([dig(30.0, 30.0), dig(900.0, 30.0)]);
    b.edit([dig(50.0, 30.0), dig(50.0, 40.0).with_power(50)]);
    scene.play(&mut [&mut a, &mut b], 1);
    assert_eq!(a.refused, [(2, Refusal::OutsideWorld)]);
    assert_eq!(b.refused, [(1, Refusal::Forbidden)]);
    assert_eq!((&a.confirmed[..], &b.confirmed[..]), (&[1][..], &[2][..]));
    agreed(&scene.server, &[&a, &b]);
}

#[test]
fn whoever_has_not_joined_is_refused() {
    let mut scene = Scene::new(generous());
    let mut a = Follower::new(1, &scene.ground);
    scene.server.connect(a.id, scene.now);
    a.edit([dig(30.0, 30.0)]);
    scene.play(&mut [&mut a], 1);
    assert_eq!(a.refused, [(1, Refusal::NotJoined)]);
    let mut stranger = Follower::new(9, &scene.ground);
    stranger.edit([dig(30.0, 30.0)]);
    scene.play(&mut [&mut stranger], 1);
    assert_eq!((scene.server.figures().strays, scene.server.figures().ordered), (1, 0));
}

#[test]
fn clients_of_another_kind_are_sent_away() {
    let change = |change: &dyn Fn(&mut Hello)| {
        let mut scene = Scene::new(generous());
        let mut a = Follower::new(1, &scene.ground);
        a.connect(&mut scene.server, scene.now);
        let mut hello = a.hello();
        change(&mut hello);
        a.out = vec![ToServer::Hello(hello)];
        scene.play(&mut [&mut a], 2);
        assert_eq!(scene.server.clients().count(), usize::from(a.kicked.is_none()));
        (a.kicked, a.joins.len())
    };
    assert_eq!(change(&|_| {}), (None, 1));
    assert_eq!(change(&|hello| hello.protocol += 1), (Some(KickReason::Protocol), 0));
    assert_eq!(change(&|hello| hello.simulation += 1), (Some(KickReason::Simulation), 0));
    assert_eq!(change(&|hello| hello.ground += 1), (Some(KickReason::Ground), 0));
    assert_eq!(change(&|hello| hello.chunk_size += 1), (Some(KickReason::ChunkSize), 0));
}

#[test]
fn who_may_undo_what() {
    // The policy, whether the second is an administrator and may undo the first's strokes, whether the first may undo
    // its own.
    for (undo, is_administrator, foreign, own) in [
        (UndoPolicy::Nobody, true, false, false),
        (UndoPolicy::Administrators, true, true, false),
        (UndoPolicy::Administrators, false, false, false),
        (UndoPolicy::Own, true, true, true),
        (UndoPolicy::Own, false, false, true),
    ] {
        let mut scene = Scene::new(ServerSettings { undo, ..generous() });
        let (mut a, mut b) = (scene.join(1), scene.join(2));
        scene.server.set_administrator(ClientId(2), is_administrator);
        let pristine = scene.server.terrain().world().hash();
        a.edit([dig(30.0, 30.0)]);
        scene.play(&mut [&mut a, &mut b], 1);
        let once = scene.server.terrain().world().hash();
        a.edit([dig(31.0, 30.0), dig(60.0, 30.0)].map(|brush| brush.with_stroke(7)));
        scene.play(&mut [&mut a, &mut b], 1);
        let twice = agreed(&scene.server, &[&a, &b]);
        b.undo(1);
        scene.play(&mut [&mut a, &mut b], 1);
        let expected = if foreign { once } else { twice };
        assert_eq!(agreed(&scene.server, &[&a, &b]), expected, "{undo:?} {is_administrator}");
        assert_eq!(b.refused, if foreign { vec![] } else { vec![(1, Refusal::Forbidden)] });
        a.undo(1);
        scene.play(&mut [&mut a, &mut b], 1);
        let expected = if own && foreign {
            pristine
        } else if own {
            once
        } else {
            expected
        };
        assert_eq!(agreed(&scene.server, &[&a, &b]), expected, "{undo:?} {is_administrator}");
        assert_eq!(a.refused.len(), usize::from(!own));
    }
}

#[test]
fn what_others_touched_is_not_undone() {
    let mut scene = Scene::new(ServerSettings { undo: UndoPolicy::Own, ..generous() });
    let (mut a, mut b) = (scene.join(1), scene.join(2));
    a.edit([dig(30.0, 30.0)]);
    scene.play(&mut [&mut a, &mut b], 1);
    a.edit([dig(60.0, 30.0)]);
    scene.play(&mut [&mut a, &mut b], 1);
    // One next to both holes, and one into the second.
    b.edit([dig(90.0, 90.0), dig(62.0, 30.0)]);
    scene.play(&mut [&mut a, &mut b], 1);
    let before = agreed(&scene.server, &[&a, &b]);
    let undone = a.undo(1);
    scene.play(&mut [&mut a, &mut b], 1);
    assert_eq!(a.refused, [(undone, Refusal::Touched)]);
    assert_eq!(agreed(&scene.server, &[&a, &b]), before);
    // The first hole is unchanged.
    a.undo(1);
    scene.play(&mut [&mut a, &mut b], 1);
    assert_ne!(agreed(&scene.server, &[&a, &b]), before);
    let last = a.undo(1);
    scene.play(&mut [&mut a, &mut b], 1);
    assert_eq!(a.refused[1..], [(last, Refusal::Nothing)]);
    // A stroke between whose edits another player dug is touched too.
    let stroke = |x: f32| dig(x, 60.0).with_stroke(3);
    a.edit([stroke(30.0)]);
    scene.play(&mut [&mut a, &mut b], 1);
    b.edit([dig(30.0, 62.0)]);
    scene.play(&mut [&mut a, &mut b], 1);
    a.edit([stroke(32.0)]);
    let undone = a.undo(1);
    scene.play(&mut [&mut a, &mut b], 1);
    assert_eq!(a.refused[2..], [(undone, Refusal::Touched)]);
    agreed(&scene.server, &[&a, &b]);
}

#[test]
fn strokes_are_forgotten_from_the_oldest_on() {
    let settings = ServerSettings { undo: UndoPolicy::Own, undo_bytes: 40_000, ..generous() };
    let mut scene = Scene::new(settings);
    let mut a = scene.join(1);
    for x in 0..12 {
        a.edit([dig(8.0 + 9.0 * x as f32, 30.0)]);
        scene.play(&mut [&mut a], 1);
    }
    for _ in 0..12 {
        a.undo(1);
    }
    scene.play(&mut [&mut a], 2);
    let forgotten = a.refused.len();
    assert!((1..11).contains(&forgotten), "{forgotten} are forgotten");
    assert!(a.refused.iter().all(|(_, why)| *why == Refusal::Nothing));
    agreed(&scene.server, &[&a]);
}

#[test]
fn an_undo_is_of_what_was_ordered_before_it() {
    // One edit at a time is applied, so that the undo has to wait.
    let mut scene = Scene::new(ServerSettings { undo: UndoPolicy::Own, work: 1, ..generous() });
    let (mut a, mut b) = (scene.join(1), scene.join(2));
    let pristine = scene.server.terrain().world().hash();
    b.edit((0..5).map(|at| dig(20.0 + 8.0 * at as f32, 90.0)));
    a.edit([dig(30.0, 30.0)]);
    a.undo(1);
    scene.play(&mut [&mut b, &mut a], 12);
    assert_eq!(a.confirmed, [1, 2]);
    for _ in 0..5 {
        b.undo(2);
    }
    scene.play(&mut [&mut b, &mut a], 12);
    assert_eq!(agreed(&scene.server, &[&a, &b]), pristine);
}

#[test]
fn an_order_of_the_game_that_can_not_be_shared_is_rejected() {
    let mut scene = Scene::new(generous());
    let number = scene.server.epoch().number;
    let rules = DiggingRules::default().with_unbreakable(MaterialId::GROUND);
    for (order, why) in [
        (Order::Undo, OrderError::Step(OrderKind::Undo)),
        (Order::Redo, OrderError::Step(OrderKind::Redo)),
        (Order::Ground(Arc::clone(&scene.ground)), OrderError::Ground),
        (Order::rules(rules), OrderError::Rules(RulesError::Ground)),
    ] {
        assert_eq!(scene.server.submit(order), Err(why));
    }
    let endless = Brush::dig(Shape::sphere(Vec3::splat(20.0), f32::INFINITY));
    assert!(matches!(scene.server.submit(endless), Err(OrderError::Brush(_))));
    assert_eq!(scene.server.epoch().number, number);
    scene.server.submit(dig(30.0, 30.0)).expect("a valid brush");
    assert_eq!(scene.server.epoch().number, number + 1);
}

#[test]
fn a_stamp_that_clients_can_not_read_is_not_ordered() {
    let mut scene = Scene::new(generous());
    let mut a = scene.join(1);
    let image =
        Arc::new(GreyImage::from_samples(4, 4, (0..16).map(|at| at * 4000).collect()).expect("an image"));
    let at = Vec3::new(40.0, 20.0, 40.0);
    let stamp = Stamp::new(Arc::clone(&image), at, glam::Vec2::splat(9.0), 3.0);
    let edit = Edit::quantize(&Brush::stamp(Shape::sphere(at, 6.0), stamp)).expect("a valid brush");
    let number = scene.server.epoch().number;
    assert_eq!(scene.server.submit(&edit), Err(OrderError::UnknownContent));
    assert_eq!(scene.server.epoch().number, number);
    scene.server.contents_mut().add(Arc::clone(&image));
    a.contents.add(image);
    assert_eq!(scene.server.submit(edit), Ok(()));
    scene.play(&mut [&mut a], 3);
    agreed(&scene.server, &[&a]);
    assert!(a.number > number);
}

#[test]
fn late_joiners_and_those_who_come_back() {
    let small_log = ServerSettings { log_bytes: 300, ..generous() };
    for (settings, [back, new]) in [(generous(), ["log", "log"]), (small_log, ["compare", "regions"])] {
        let mut scene = Scene::new(settings);
        let (mut a, mut b) = (scene.join(1), scene.join(2));
        let row = |z: usize| (0..12).map(move |x| dig(8.0 + 9.0 * x as f32, 8.0 + 9.0 * z as f32));
        for z in 0..6 {
            a.edit(row(z));
            scene.play(&mut [&mut a, &mut b], 4);
        }
        agreed(&scene.server, &[&a, &b]);
        scene.server.disconnect(b.id);
        for z in 6..12 {
            a.edit(row(z));
            scene.play(&mut [&mut a], 4);
        }
        b.connect(&mut scene.server, scene.now);
        let mut late = Follower::new(3, &scene.ground);
        late.connect(&mut scene.server, scene.now);
        // Others dig meanwhile.
        for z in 0..12 {
            a.edit([dig(13.0, 5.0 + 9.0 * z as f32)]);
            scene.play(&mut [&mut a, &mut b, &mut late], 1);
        }
        scene.play(&mut [&mut a, &mut b, &mut late], 60);
        agreed(&scene.server, &[&a, &b, &late]);
        assert_eq!((b.joins, late.joins), (vec!["log", back], vec![new]));
        assert_eq!(scene.server.figures().repairs, 0);
    }
}

#[test]
fn regions_come_from_the_player_outwards_and_no_faster_than_allowed() {
    let bulk = Rate { per_second: 4000, burst: 1000 };
    let mut scene = Scene::new(ServerSettings { bulk, piece: 500, window: 2000, log_bytes: 0, ..generous() });
    let mut a = scene.join(1);
    a.edit((0..12).flat_map(|x| (0..12).map(move |z| dig(8.0 + 9.0 * x as f32, 8.0 + 9.0 * z as f32))));
    scene.play(&mut [&mut a], 4);
    let mut late = Follower::new(2, &scene.ground);
    late.position = IVec3::new(110, 20, 20);
    late.connect(&mut scene.server, scene.now);
    late.send(&mut scene.server, scene.now);
    let (start, mut regions, mut stream, mut got) = (scene.now, Vec::new(), Default::default(), 0);
    let mut acknowledged = 0;
    while scene.now < start + Duration::from_secs(60) {
        scene.now += crate::follower::FRAME;
        scene.server.advance(scene.now);
        for (to, lane, bytes) in scene.server.take_outgoing() {
            if to != late.id || lane != Lane::Bulk {
                continue;
            }
            let ToClient::Piece(piece) = ToClient::from_bytes(&bytes, &scene.ground, &late.contents).unwrap()
            else {
                panic!("no piece")
            };
            got += piece.len() as u64;
            bevy_burrow::net::BulkReader::add(&mut stream, &piece);
            while let Some(message) = stream.next(&scene.ground, &late.contents).unwrap() {
                let ToClient::Region(content) = message else { panic!("no region") };
                regions.push((content.pos, content.left));
            }
        }
        let passed = (scene.now - start).as_secs_f64();
        assert!(got as f64 <= 1000.0 + 4000.0 * passed, "{got} bytes in {passed} s");
        assert!(got - acknowledged <= 2000, "{} bytes are in transit", got - acknowledged);
        // For the first five seconds nothing is acknowledged.
        if passed > 5.0 {
            acknowledged = got;
            let ack = ToServer::Ack { bulk: got, number: 0 };
            scene.server.receive(late.id, &ack.to_bytes(), scene.now);
        }
    }
    assert_eq!(regions.last().map(|(_, left)| *left), Some(0), "{regions:?}");
    let distance = |at: IVec3| (at * 64 + 32 - late.position).as_i64vec3().length_squared();
    let distances: Vec<i64> = regions.iter().map(|(pos, _)| distance(pos.0)).collect();
    assert!(distances.len() >= 4 && distances.is_sorted(), "{distances:?}");
}

#[test]
fn what_differs_is_found_at_the_next_mark_and_repaired() {
    let mut scene = Scene::new(generous());
    let (mut a, mut b) = (scene.join(1), scene.join(2));
    a.edit([dig(30.0, 30.0)]);
    scene.play(&mut [&mut a, &mut b], 30);
    b.spoil(Vec3::new(32.0, 20.0, 32.0));
    scene.play(&mut [&mut a, &mut b], 30);
    assert_eq!(b.repairs, 0, "no player has dug since");
    a.edit([dig(34.0, 30.0)]);
    scene.play(&mut [&mut a, &mut b], 60);
    agreed(&scene.server, &[&a, &b]);
    assert_eq!((a.repairs, b.repairs > 0), (0, true));
    assert_eq!(scene.server.figures().repairs, b.repairs as u64);
    let events = scene.server.take_events();
    assert!(events.iter().any(|event| matches!(event, ServerEvent::Repaired(ClientId(2), _))));
}

#[test]
fn a_server_goes_on_from_its_store() {
    let (ground, disk) = (hills(128), SimulatedDisk::new());
    let options = || StoreOptions { loss_window: Duration::ZERO, ..StoreOptions::default() };
    let mut saved = terrain(&ground);
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut saved, options()).expect("a new world");
    let mut scene =
        Scene { server: Server::open(saved, &store, generous()), ground, now: Duration::from_secs(1) };
    let (mut a, mut b) = (scene.join(1), scene.join(2));
    let mut hashes = BTreeMap::new();
    for x in 0..12 {
        a.edit([dig(8.0 + 9.0 * x as f32, 30.0)]);
        scene.play(&mut [&mut a, &mut b], 1);
        hashes.insert(scene.server.applied(), scene.server.terrain().world().hash());
        scene.server.save(&mut store).expect("a store that works");
        if x == 8 {
            store.flush().expect("a disk that works");
            scene.server.save(&mut store).expect("a store that works");
        }
    }
    // Not saved: the clients are ahead of the restarted server.
    a.edit([dig(60.0, 60.0)]);
    scene.play(&mut [&mut a, &mut b], 1);
    let (acknowledged, ahead) = (a.durable, a.number);
    assert!(acknowledged > 0 && acknowledged < ahead);
    let world = scene.server.epoch().world;
    drop((store, scene.server));
    let (mut store, opened) =
        Store::open_in(Arc::new(disk.clone()), Arc::clone(&scene.ground), options()).expect("the world");
    scene.server = Server::open(opened.terrain, &store, generous());
    let epoch = scene.server.epoch();
    assert_eq!(epoch.world, world);
    assert!((acknowledged..ahead).contains(&epoch.number), "{epoch:?}");
    assert_eq!(hashes.get(&epoch.number), Some(&scene.server.terrain().world().hash()));
    for follower in [&mut a, &mut b] {
        follower.connect(&mut scene.server, scene.now);
    }
    scene.play(&mut [&mut a, &mut b], 3);
    b.edit([dig(90.0, 90.0)]);
    scene.play(&mut [&mut a, &mut b], 3);
    agreed(&scene.server, &[&a, &b]);
    assert_eq!((&a.joins[..], a.repairs), (&["log", "compare"][..], 0));
    scene.server.save(&mut store).expect("a store that works");
    store.flush().expect("a disk that works");
    scene.server.save(&mut store).expect("a store that works");
    scene.play(&mut [&mut a, &mut b], 1);
    assert_eq!(a.durable, scene.server.durable());
    assert!(a.durable > epoch.number);
}
