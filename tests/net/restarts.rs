//! Clients that come back after a restart of the server get what they miss as entries, as far as the saved order
//! reaches back and leads from their world to the server's; otherwise they get the regions that differ.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::net::{Rate, Server, ServerSettings, UndoPolicy};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{Files, SimulatedDisk, Store, StoreOptions};
use fastrand::Rng;
use glam::{Vec2, Vec3};
use xxhash_rust::xxh3::Xxh3Default;

use crate::follower::{Follower, agreed, count, hills, play, terrain};
use crate::gated::{Gate, GatedDisk, Gatekeeper};

fn settings() -> ServerSettings {
    let cost = Rate { per_second: 1 << 40, burst: 1 << 40 };
    ServerSettings { cost, undo: UndoPolicy::Own, ..ServerSettings::default() }
}

fn dig(x: f32, z: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 20.0, z), 3.0))
}

fn options() -> StoreOptions {
    StoreOptions { loss_window: Duration::ZERO, ..StoreOptions::default() }
}

/// A server of a world on a disk.
struct Scene {
    ground: Arc<Ground>,
    disk: SimulatedDisk,
    settings: ServerSettings,
    server: Server,
    /// `None` while it is closed.
    store: Option<Store>,
    now: Duration,
}

impl Scene {
    fn new() -> Self {
        Self::of(settings(), |_| {})
    }

    /// With a world that something happened to before it was saved.
    fn of(settings: ServerSettings, before: impl FnOnce(&mut Terrain)) -> Self {
        let (ground, disk) = (hills(128), SimulatedDisk::new());
        let mut saved = terrain(&ground);
        before(&mut saved);
        let store = Store::create_in(Arc::new(disk.clone()), &mut saved, options()).expect("a new world");
        let server = Server::open(saved, &store, settings);
        Self { ground, disk, settings, server, store: Some(store), now: Duration::from_secs(1) }
    }

    fn join(&mut self, id: u64) -> Follower {
        let mut follower = Follower::new(id, &self.ground);
        self.connect(&mut follower);
        follower
    }

    fn connect(&mut self, follower: &mut Follower) {
        follower.connect(&mut self.server, self.now);
        self.play(&mut [follower], 4);
    }

    fn join_all(&mut self) -> [Follower; 3] {
        let mut all = [1, 2, 3].map(|id| Follower::new(id, &self.ground));
        let [a, b, c] = &mut all;
        self.connect_all(&mut [a, b, c]);
        all
    }

    fn play(&mut self, followers: &mut [&mut Follower], frames: u32) {
        for _ in 0..frames {
            play(&mut self.server, followers, &mut self.now, 1);
            self.server.save(self.store.as_mut().expect("it is open")).expect("the thread runs");
        }
    }

    /// The first of these, which are all that are connected, digs somewhere with each of these numbers.
    fn dig(&mut self, followers: &mut [&mut Follower], numbers: std::ops::Range<u32>) {
        for number in numbers {
            let at = [number * 37 % 116, number * 53 % 116].map(|at| 6.0 + at as f32);
            followers[0].edit([dig(at[0], at[1])]);
            self.play(followers, 1);
        }
    }

    /// Connects all of these at once.
    fn connect_all(&mut self, followers: &mut [&mut Follower]) {
        for follower in followers.iter_mut() {
            follower.connect(&mut self.server, self.now);
        }
        self.play(followers, 4);
    }

    fn store(&mut self) -> &mut Store {
        self.store.as_mut().expect("it is open")
    }

    /// Ends the server, and starts another one with the same disk, or with a copy of it.
    fn restart(&mut self, on: impl FnOnce(SimulatedDisk) -> SimulatedDisk) {
        self.store().flush().expect("the disk works");
        let disk = on(self.disk.clone());
        self.store = None;
        self.disk = disk;
        let (store, terrain) = self.open();
        self.server = Server::open(terrain, &store, self.settings);
        self.store = Some(store);
    }

    fn open(&self) -> (Store, Terrain) {
        let opened = Store::open_in(Arc::new(self.disk.clone()), Arc::clone(&self.ground), options());
        let (store, opened) = opened.expect("a saved world");
        (store, opened.terrain)
    }
}

/// A copy of a disk as it is if the process is killed.
fn killed(disk: SimulatedDisk) -> SimulatedDisk {
    disk.image().lose_process()
}

#[test]
fn after_a_restart_clients_get_what_they_miss_as_entries() {
    for kill in [false, true] {
        let mut scene = Scene::new();
        let [mut a, mut b, mut away] = scene.join_all();
        scene
            .server
            .submit(Order::rules(DiggingRules::default().with_unbreakable(MaterialId(9))))
            .expect("valid");
        scene.dig(&mut [&mut a, &mut b, &mut away], 0..5);
        scene.play(&mut [&mut a, &mut b, &mut away], 40);
        // This one misses digs, an undo, and settings.
        scene.server.disconnect(away.id);
        scene.dig(&mut [&mut a, &mut b], 5..60);
        a.undo(1);
        scene.server.submit(Order::Loose(Some(LooseSettings::default()))).expect("it can be shared");
        scene.play(&mut [&mut a, &mut b], 40);
        agreed(&scene.server, &[&a, &b]);
        let before = scene.server.epoch();
        scene.restart(if kill { killed } else { |disk| disk });
        let epoch = scene.server.epoch();
        assert_eq!(
            (epoch.world, epoch.number, epoch.run == before.run),
            (before.world, before.number, false)
        );
        scene.connect_all(&mut [&mut a, &mut b, &mut away]);
        agreed(&scene.server, &[&a, &b, &away]);
        scene.dig(&mut [&mut b, &mut a, &mut away], 60..64);
        scene.play(&mut [&mut a, &mut b, &mut away], 60);
        agreed(&scene.server, &[&a, &b, &away]);
        for follower in [&a, &b, &away] {
            assert_eq!((&follower.joins[..], follower.repairs), (&["log", "log"][..], 0), "{kill}");
        }
        // A new one, after the others have gone, begins with the pristine world, from which the log leads here.
        [&a, &b, &away].iter().for_each(|follower| scene.server.disconnect(follower.id));
        let new = scene.join(4);
        assert_eq!(
            (agreed(&scene.server, &[&new]), &new.joins[..]),
            (agreed(&scene.server, &[&a]), &["log"][..])
        );
        // And so after further restarts.
        for _ in 0..3 {
            scene.restart(|disk| disk);
            scene.connect(&mut a);
            scene.dig(&mut [&mut a], 64..67);
        }
        scene.connect(&mut away);
        agreed(&scene.server, &[&a, &away]);
        assert!(away.joins.iter().all(|join| *join == "log"), "{:?}", away.joins);
    }
}

#[test]
fn clients_that_know_more_than_was_saved_compare_however_many_servers_follow() {
    let mut scene = Scene::new();
    let [mut ahead, mut b, mut c] = scene.join_all();
    scene.dig(&mut [&mut b, &mut ahead, &mut c], 0..10);
    scene.play(&mut [&mut ahead, &mut b, &mut c], 2);
    scene.store().flush().expect("the disk works");
    let image = killed(scene.disk.clone());
    // This is lost.
    scene.dig(&mut [&mut b, &mut ahead, &mut c], 10..14);
    scene.play(&mut [&mut ahead, &mut b, &mut c], 2);
    scene.restart(|_| image);
    assert!(scene.server.epoch().number < ahead.number);
    // Others get the numbers of what was lost.
    scene.connect(&mut c);
    scene.dig(&mut [&mut c], 20..40);
    assert!(scene.server.epoch().number > ahead.number);
    scene.restart(|disk| disk);
    scene.connect(&mut ahead);
    agreed(&scene.server, &[&ahead]);
    assert_eq!((&ahead.joins[..], ahead.repairs), (&["log", "compare"][..], 0));
}

#[test]
fn clients_compare_where_something_else_changed_the_saved_world() {
    type Change = fn(&mut Terrain);
    let changes: [(&str, Change); 4] = [
        ("a dig", |terrain| drop(terrain.apply([dig(90.0, 90.0)]))),
        ("a dig and its undo", |terrain| {
            terrain.set_undo_budget(1 << 20);
            terrain.apply([dig(90.0, 90.0)]);
            terrain.undo();
        }),
        ("rules", |terrain| {
            terrain.set_rules(DiggingRules::default().with_unbreakable(MaterialId(3))).expect("valid rules");
        }),
        ("loose settings", |terrain| terrain.set_loose(Some(LooseSettings::default()))),
    ];
    for (what, change) in changes {
        let mut scene = Scene::new();
        let mut a = scene.join(1);
        scene.dig(&mut [&mut a], 0..10);
        // A game without a server.
        scene.store = None;
        let (mut store, mut alone) = scene.open();
        change(&mut alone);
        store.follow(&mut alone).expect("the thread runs");
        scene.store = Some(store);
        scene.restart(|disk| disk);
        scene.connect(&mut a);
        agreed(&scene.server, &[&a]);
        assert_eq!((&a.joins[..], a.repairs), (&["log", "compare"][..], 0), "{what}");
        // From there on, the log is saved again.
        scene.dig(&mut [&mut a], 10..20);
        scene.restart(|disk| disk);
        scene.connect(&mut a);
        agreed(&scene.server, &[&a]);
        assert_eq!(a.joins.last(), Some(&"log"), "{what}");
    }
}

#[test]
fn clients_compare_where_the_saved_order_does_not_reach_back() {
    let mut scene = Scene::of(ServerSettings { log_bytes: 1500, ..settings() }, |_| {});
    let mut away = scene.join(2);
    scene.server.disconnect(away.id);
    let mut a = scene.join(1);
    scene.dig(&mut [&mut a], 0..200);
    scene.play(&mut [&mut a], 60);
    scene.restart(|disk| disk);
    scene.connect_all(&mut [&mut a, &mut away]);
    scene.play(&mut [&mut a, &mut away], 100);
    agreed(&scene.server, &[&a, &away]);
    assert_eq!((a.joins.last(), away.joins.last()), (Some(&"log"), Some(&"compare")));
    assert_eq!((a.repairs, away.repairs), (0, 0));
}

#[test]
fn worlds_that_were_dug_before_their_server_send_new_clients_regions() {
    let mut scene = Scene::of(settings(), |terrain| drop(terrain.apply([dig(40.0, 40.0)])));
    let mut a = scene.join(1);
    scene.dig(&mut [&mut a], 0..10);
    scene.restart(|disk| disk);
    let mut new = Follower::new(2, &scene.ground);
    scene.connect_all(&mut [&mut a, &mut new]);
    agreed(&scene.server, &[&a, &new]);
    assert_eq!((&a.joins[..], &new.joins[..]), (&["regions", "log"][..], &["regions"][..]));
}

#[test]
fn a_server_that_lacks_content_of_saved_entries_sends_regions() {
    let samples = (0..64).map(|at| at * 900).collect();
    let image = Arc::new(GreyImage::from_samples(8, 8, samples).expect("a valid image"));
    for knows in [true, false] {
        let mut scene = Scene::new();
        let mut away = scene.join(1);
        away.contents.add(Arc::clone(&image));
        scene.server.disconnect(away.id);
        scene.server.contents_mut().add(Arc::clone(&image));
        let at = Vec3::new(60.0, 20.0, 60.0);
        let stamp = Stamp::new(Arc::clone(&image), at, Vec2::splat(9.0), 3.0);
        let edit = Edit::quantize(&Brush::stamp(Shape::sphere(at, 6.0), stamp)).expect("a valid brush");
        scene.server.submit(edit).expect("its image is known");
        scene.play(&mut [], 3);
        scene.restart(|disk| disk);
        if knows {
            scene.server.contents_mut().add(Arc::clone(&image));
        }
        scene.connect(&mut away);
        agreed(&scene.server, &[&away]);
        let how = if knows { "log" } else { "compare" };
        assert_eq!((&away.joins[..], away.repairs), (&["log", how][..], 0));
    }
}

/// The state in a store, as a build with these numbers saves it for a world without rules; without them, as builds did
/// that did not save them.
fn state_of(terrain: &Terrain, is_whole: bool, numbers: Option<[u32; 2]>) -> Vec<u8> {
    let (world, mut hash) = (terrain.world(), Xxh3Default::new());
    for number in [world.hash(), world.revision(), world.next_field()] {
        hash.update(&number.to_le_bytes());
    }
    hash.update(&[0, 0]);
    numbers.iter().flatten().for_each(|number| hash.update(&number.to_le_bytes()));
    [&hash.digest().to_le_bytes()[..], &[is_whole.into()]].concat()
}

/// Edits of another build may lead elsewhere, and its messages may be unreadable.
#[test]
fn the_saved_order_of_another_build_is_not_sent() {
    let builds = [
        (Some([Terrain::SIMULATION, Server::PROTOCOL]), ["log", "log"]),
        (Some([Terrain::SIMULATION - 1, Server::PROTOCOL]), ["regions", "compare"]),
        (Some([Terrain::SIMULATION, Server::PROTOCOL - 1]), ["regions", "compare"]),
        (None, ["regions", "compare"]),
    ];
    // In another build, the digs were elsewhere.
    let mut other = Scene::new();
    let mut digger = other.join(1);
    other.dig(&mut [&mut digger], 20..30);
    for (numbers, expected) in builds {
        let is_other = numbers != Some([Terrain::SIMULATION, Server::PROTOCOL]);
        let mut scene = Scene::new();
        let mut a = scene.join(1);
        scene.dig(&mut [&mut a], 0..10);
        scene.store().flush().expect("the disk works");
        scene.store = None;
        let (mut store, terrain) = scene.open();
        let key = |name: &str| {
            let mut keys = store.game_data().keys().filter(|key| key.ends_with(name));
            keys.next().expect("a server saves it").clone()
        };
        let (state, prefix) = (key("net/state"), key("net/runs").replace("runs", "order/"));
        let number = store.get(&state).expect("it is there")[..8].to_vec();
        store.put(state, [number, state_of(&terrain, true, numbers)].concat());
        if is_other {
            assert_eq!(other.server.epoch().number, scene.server.epoch().number);
            let own: Vec<String> =
                store.game_data().keys().filter(|key| key.starts_with(&prefix)).cloned().collect();
            own.into_iter().for_each(|key| store.remove(key));
            let saved = other.store.as_ref().expect("it is open").game_data();
            let pieces = saved.iter().filter(|(key, _)| key.starts_with(&prefix));
            pieces.for_each(|(key, piece)| store.put(key.clone(), piece.clone()));
        }
        scene.store = Some(store);
        scene.restart(|disk| disk);
        let mut new = Follower::new(2, &scene.ground);
        scene.connect_all(&mut [&mut new, &mut a]);
        scene.play(&mut [&mut new, &mut a], 60);
        agreed(&scene.server, &[&new, &a]);
        assert_eq!((new.joins[0], a.joins[1]), (expected[0], expected[1]), "{numbers:?}");
    }
}

#[test]
fn what_was_not_taken_while_the_disk_hung_is_saved_although_nobody_digs_any_more() {
    let (ground, disk, gate) = (hills(128), SimulatedDisk::new(), Gatekeeper::default());
    let mut saved = terrain(&ground);
    let options = || StoreOptions { waiting_bytes: 0, ..options() };
    let files = Arc::new(GatedDisk::new(&disk, &gate));
    let mut store = Store::create_in(files, &mut saved, options()).expect("a new world");
    let mut server = Server::open(saved, &store, settings());
    let (mut a, mut now) = (Follower::new(1, &ground), Duration::from_secs(1));
    a.connect(&mut server, now);
    play(&mut server, &mut [&mut a], &mut now, 4);
    gate.set(Gate::Shut);
    for number in 0_u8.. {
        // More than may wait, with each dig; how many are taken depends on the store's thread.
        store.put("filler", vec![number; 2 << 20]);
        a.edit([dig(20.0 + 4.0 * f32::from(number), 40.0)]);
        play(&mut server, &mut [&mut a], &mut now, 1);
        server.save(&mut store).expect("the thread runs");
        if store.revision() < server.terrain().world().revision() {
            break;
        }
        assert!(number < 20, "all was taken");
    }
    gate.set(Gate::Open);
    store.flush().expect("the disk answers");
    server.save(&mut store).expect("the thread runs");
    store.flush().expect("the disk works");
    server.save(&mut store).expect("the thread runs");
    assert_eq!(server.durable(), server.applied());
    let disk = killed(disk);
    let (_, opened) = Store::open_in(Arc::new(disk), ground, options()).expect("a saved world");
    assert_eq!(opened.terrain.world().hash(), server.terrain().world().hash());
}

#[test]
fn the_saved_order_takes_a_small_part_of_the_journal() {
    let mut scene = Scene::new();
    scene.store = None;
    let lazy = StoreOptions { loss_window: Duration::MAX, ..options() };
    let opened = Store::open_in(Arc::new(scene.disk.clone()), Arc::clone(&scene.ground), lazy);
    let (store, opened) = opened.expect("a saved world");
    scene.server = Server::open(opened.terrain, &store, scene.settings);
    scene.store = Some(store);
    let mut a = scene.join(1);
    let journal = |disk: &SimulatedDisk| -> usize {
        let logs = disk.paths().into_iter().filter(|path| path.ends_with(".log"));
        logs.map(|path| disk.read(&path).map_or(0, |bytes| bytes.len())).sum()
    };
    scene.store().flush().expect("the disk works");
    let before = journal(&scene.disk);
    // Five digs a second, and a frame each second.
    for second in 0..100 {
        scene.dig(&mut [&mut a], second * 5..second * 5 + 5);
        scene.store().flush().expect("the disk works");
    }
    let bytes = (journal(&scene.disk) - before) / 500;
    println!("{bytes} bytes of the journal for a dig");
    assert!(bytes < 200, "{bytes}");
}

/// Servers are killed at any moment, with journals that are cut or damaged: clients always end with the server's world.
#[test]
fn damaged_and_cut_journals_never_give_another_world() {
    for seed in 0..count("BURROW_RESTARTS", 12) {
        let mut rng = Rng::with_seed(seed);
        let mut scene = Scene::new();
        let mut all = scene.join_all();
        for _ in 0..6 {
            rng.shuffle(&mut all);
            let mut here: Vec<&mut Follower> = all.iter_mut().take(rng.usize(1..=3)).collect();
            scene.connect_all(&mut here);
            for _ in 0..rng.u32(1..12) {
                let who = rng.usize(0..here.len());
                here.swap(0, who);
                let number = rng.u32(0..1000);
                scene.dig(&mut here, number..number + 1);
                if rng.u32(0..8) == 0 {
                    let id = here[0].id.0;
                    here[0].undo(id);
                }
                if rng.u32(0..8) == 0 {
                    let loose = rng.bool().then(LooseSettings::default);
                    scene.server.submit(Order::Loose(loose)).expect("it can be shared");
                }
                if rng.u32(0..6) == 0 {
                    scene.store().checkpoint().expect("the disk works");
                }
            }
            here.iter().for_each(|follower| scene.server.disconnect(follower.id));
            let how = rng.u32(0..4);
            let mut chance = Rng::with_seed(rng.u64(..));
            let image = scene.disk.image();
            scene.restart(|disk| match how {
                0 => disk,
                1 => image.lose_process(),
                2 => image.lose_power(|| chance.bool()),
                _ => {
                    let image = image.lose_process();
                    let logs: Vec<String> =
                        image.paths().into_iter().filter(|path| path.ends_with(".log")).collect();
                    if let Some(log) = chance.choice(&logs) {
                        let (is_cut, part, bit) = (chance.bool(), chance.f32(), chance.u32(0..8));
                        image.damage(log, |bytes| {
                            let at = (part * bytes.len() as f32) as usize;
                            match bytes.get_mut(at) {
                                Some(byte) if !is_cut => *byte ^= 1 << bit,
                                _ => bytes.truncate(at),
                            }
                        });
                    }
                    image
                }
            });
        }
        let [a, b, c] = &mut all;
        scene.connect_all(&mut [a, b, c]);
        scene.play(&mut [a, b, c], 100);
        agreed(&scene.server, &[a, b, c]);
        assert_eq!([a.repairs, b.repairs, c.repairs], [0; 3], "seed {seed}: {:?}", a.joins);
    }
}
