//! How long the log lasts: its cost in addition to commits.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{Files, SimulatedDisk, Store, StoreOptions, inspect_in};
use bevy_burrow::terrain::Meshing;
use glam::Vec3;

use crate::play::{open, options};

/// Bytes that can't be compressed.
fn noise(bytes: usize, seed: u64) -> Vec<u8> {
    let mut rng = fastrand::Rng::with_seed(seed);
    (0..bytes).map(|_| rng.u8(..)).collect()
}

struct Game {
    disk: SimulatedDisk,
    ground: Arc<Ground>,
    terrain: Terrain,
    store: Store,
    digs: u32,
}

impl Game {
    fn new(side: u32, options: StoreOptions) -> Self {
        let (disk, ground) = (SimulatedDisk::new(), Ground::flat(side, side, 30.0));
        let ground = Arc::new(ground.expect("valid heights"));
        let mut terrain = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid");
        terrain.set_meshing(Meshing::Never);
        let store = Store::create_in(Arc::new(disk.clone()), &mut terrain, options).expect("a new world");
        Self { disk, ground, terrain, store, digs: 0 }
    }

    fn dig_at(&mut self, x: f32, z: f32) {
        self.digs += 1;
        self.terrain.apply([Brush::dig(Shape::sphere(Vec3::new(x, 30.0, z), 2.5))]);
        self.store.follow(&mut self.terrain).expect("the thread runs");
    }

    fn dig(&mut self) {
        let number = self.digs;
        self.dig_at(10.0 + (number * 37 % 200) as f32, 10.0 + (number * 91 % 200) as f32);
    }

    /// The segments of the log, and their bytes.
    fn log(&self) -> (usize, u64) {
        let names = self.disk.list("journal").expect("it is there");
        let segments = names.iter().filter(|name| name.ends_with(".log"));
        let lengths =
            segments.map(|name| self.disk.read(&format!("journal/{name}")).expect("it is there").len());
        let lengths: Vec<usize> = lengths.collect();
        (lengths.len(), lengths.iter().sum::<usize>() as u64)
    }
}

/// A value is logged once for each change, and not once for each checkpoint, and so is the list of regions.
#[test]
fn checkpoints_take_no_room_in_the_log() {
    let mut lengths = Vec::new();
    for checkpoints in [1, 60] {
        let mut game = Game::new(220, options(u64::MAX));
        game.store.put("map", noise(1 << 20, 1));
        for number in 1..=60 {
            game.dig();
            game.store.flush().expect("the disk works");
            if number % (60 / checkpoints) == 0 {
                game.store.checkpoint().expect("the disk works");
            }
        }
        let (segments, bytes) = game.log();
        assert!(segments <= 3, "{segments} files for {bytes} bytes");
        lengths.push(bytes);
        let Game { disk, ground, store, .. } = game;
        drop(store);
        // Sessions take no room either.
        for _ in 0..20 {
            let (mut store, mut opened) = open(&disk, &ground).expect("a saved world");
            assert!(opened.is_log_whole && opened.warnings.is_empty(), "{:?}", opened.warnings);
            opened.terrain.apply([Brush::dig(Shape::sphere(Vec3::splat(30.0), 2.0))]);
            store.follow(&mut opened.terrain).expect("the thread runs");
        }
        let (store, _) = open(&disk, &ground).expect("a saved world");
        assert_eq!(store.get("map"), Some(&noise(1 << 20, 1)[..]));
    }
    assert!(lengths[1] < lengths[0] + 64 * 60, "{lengths:?}");
}

#[test]
fn a_value_that_is_put_again_and_again_is_logged_once_in_each_frame_and_only_if_it_changed() {
    let logged = |puts: u64, differs: bool| {
        let loss_window = Duration::from_secs(60);
        let mut game = Game::new(100, StoreOptions { loss_window, ..options(u64::MAX) });
        for number in 0..puts {
            game.store.put("inventory", noise(64 << 10, if differs { number } else { 0 }));
            game.store.put("hour", number.to_le_bytes());
            game.store.follow(&mut game.terrain).expect("the thread runs");
            if !differs {
                game.store.flush().expect("the disk works");
            }
        }
        game.store.remove("hour");
        game.store.flush().expect("the disk works");
        let bytes = game.log().1;
        let Game { disk, ground, store, .. } = game;
        drop(store);
        let (store, _) = open(&disk, &ground).expect("a saved world");
        let last = if differs { puts - 1 } else { 0 };
        assert_eq!(store.get("inventory"), Some(&noise(64 << 10, last)[..]), "the last one counts");
        assert_eq!(store.get("hour"), None);
        bytes
    };
    assert!(logged(1, true) > 64 << 10);
    assert!(logged(60, true) < 2 * (64 << 10), "only the last one in a frame counts");
    assert!(logged(60, false) < 2 * (64 << 10), "an equal value is not a change");
}

#[test]
fn the_log_takes_no_more_of_the_disk_than_it_may() {
    let log_bytes = 200_000;
    let mut game = Game::new(220, StoreOptions { log_bytes, ..options(u64::MAX) });
    for number in 0..600 {
        game.store.put("note", noise(1000, number));
        game.dig();
        game.store.flush().expect("the disk works");
        if number % 7 == 0 {
            game.store.checkpoint().expect("the disk works");
        }
    }
    game.store.checkpoint().expect("the disk works");
    game.store.checkpoint().expect("the disk works");
    let names = game.disk.list("journal").expect("it is there");
    let on_disk: u64 = names
        .iter()
        .filter(|name| name.ends_with(".log"))
        .map(|name| game.disk.read(&format!("journal/{name}")).expect("it is there").len() as u64)
        .map(|bytes| bytes.next_multiple_of(4096))
        .sum();
    assert!(on_disk <= log_bytes && on_disk > log_bytes / 2, "{on_disk} in {names:?}");
    let Game { disk, store, .. } = game;
    drop(store);
    let info = inspect_in(&disk).expect("a saved world");
    assert!(!info.is_log_whole && info.log_bytes >= on_disk && info.log_bytes <= log_bytes + 8192);
}
