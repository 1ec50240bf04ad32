//! How many digs the journal holds, with different amounts of game data and numbers of regions.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{Files, SimulatedDisk, Store, StoreOptions};
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;
use glam::Vec3;

/// Bytes of the game's data, and regions with edits.
const WORLDS: [(usize, u32); 2] = [(0, 1), (1 << 20, 10_000)];

pub fn print(digs: u32) {
    for (data, regions) in WORLDS {
        print_world(data, regions, digs);
    }
}

/// A world in which a player digs five times a second: a frame each second, a checkpoint each minute.
fn print_world(data: usize, regions: u32, digs: u32) {
    let (across, disk) = (f64::from(regions).sqrt() as u32, SimulatedDisk::new());
    let side = (across * 64).max(128);
    let ground = Ground::flat(side, side, 30.0).expect("valid heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    let options = StoreOptions {
        loss_window: Duration::from_secs(1),
        checkpoint_commits: u64::MAX,
        ..StoreOptions::default()
    };
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut terrain, options).expect("a new world");
    let mut dig = |store: &mut Store, x: f32, z: f32| {
        terrain.apply([Brush::dig(Shape::sphere(Vec3::new(x, 30.0, z), 2.5))]);
        store.follow(&mut terrain).expect("the thread runs");
    };
    for number in 0..regions {
        dig(&mut store, (number % across * 64 + 32) as f32, (number / across * 64 + 32) as f32);
    }
    // Bytes that can't be compressed.
    let mut rng = Rng::with_seed(1);
    store.put("game", (0..data).map(|_| rng.u8(..)).collect::<Vec<u8>>());
    store.checkpoint().expect("the disk works");
    let before = log_bytes(&disk);
    for number in 0..digs {
        let (at, turn) = (f64::from(number) * 1.3, f64::from(number) * 0.013);
        let [x, z] = [turn.cos(), turn.sin()].map(|part| (64.0 + (at * 0.31).min(50.0) * part) as f32);
        dig(&mut store, x, z);
        match number % 300 {
            299 => drop(store.checkpoint().expect("the disk works")),
            _ if number % 5 == 4 => drop(store.flush().expect("the disk works")),
            _ => {}
        }
    }
    let each = (log_bytes(&disk) - before) as f64 / f64::from(digs);
    println!(
        "{data} bytes of data, {regions} regions: {each:.1} bytes a dig, so 64 MiB last {:.0} digs",
        (f64::from(64 << 20) - before as f64) / each
    );
}

/// Bytes of the journal's segments.
fn log_bytes(disk: &SimulatedDisk) -> u64 {
    let names = disk.list("journal").expect("the disk works");
    let segments = names.iter().filter(|name| name.ends_with(".log"));
    segments.map(|name| disk.read(&format!("journal/{name}")).expect("the disk works").len() as u64).sum()
}
