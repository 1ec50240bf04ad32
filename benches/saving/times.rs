//! How soon a dig is durable, how long the main thread takes for it, and how long a world takes to open after a crash.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{Files, Folder, Progress, SimulatedDisk, Store, StoreOptions};
use bevy_burrow::terrain::Meshing;
use glam::Vec3;

use crate::worlds::real_ground;

fn digger(ground: &Arc<Ground>) -> Terrain {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    terrain
}

/// A dig into the surface at a place.
fn dig_at(ground: &Ground, [x, z]: [f32; 2], radius: f32) -> Brush {
    let height = ground.height(Column::new(x as i32, z as i32)) as f32 / 256.0;
    Brush::dig(Shape::sphere(Vec3::new(x, height, z), radius))
}

/// A dig of a player that walks all over the landscape.
fn dig(ground: &Ground, number: u32) -> Brush {
    let (at, turn) = (f64::from(number) * 1.3, f64::from(number) * 0.013);
    let place = [turn.cos(), turn.sin()].map(|part| (500.0 + (at * 0.31).min(400.0) * part) as f32);
    dig_at(ground, place, 2.5)
}

fn percentile(times: &mut [Duration], percent: usize) -> f64 {
    times.sort();
    times.get((times.len() * percent / 100).min(times.len() - 1)).map_or(0.0, |time| time.as_secs_f64() * 1e3)
}

pub fn print() {
    let ground = Arc::new(real_ground());
    let place = std::env::temp_dir().join(format!("bevy_burrow_times_{}", std::process::id()));
    drop(std::fs::remove_dir_all(&place));

    // How much later than the window a dig is durable, at 20 digs a second.
    let window = Duration::from_millis(200);
    let options = StoreOptions { loss_window: window, ..StoreOptions::default() };
    let mut terrain = digger(&ground);
    let mut store = Store::create(&place, &mut terrain, options.clone()).expect("a new world");
    let (mut late, mut main, mut waiting) = (Vec::new(), Vec::new(), std::collections::VecDeque::new());
    let start = Instant::now();
    for number in 0..400 {
        terrain.apply([dig(&ground, number)]);
        let before = Instant::now();
        store.put("time", number.to_le_bytes());
        store.follow(&mut terrain).expect("the thread runs");
        main.push(before.elapsed());
        waiting.push_back((terrain.world().revision(), before));
        while start.elapsed() < Duration::from_millis(50) * (number + 1) {
            std::thread::sleep(Duration::from_micros(500));
            while waiting.front().is_some_and(|(revision, _)| *revision <= store.durable()) {
                late.extend(waiting.pop_front().map(|(_, since)| since.elapsed().saturating_sub(window)));
            }
        }
    }
    println!(
        "durable after the window: p50 {:.1}, p99 {:.1} ms; main thread: p50 {:.4}, p99 {:.4} ms",
        percentile(&mut late, 50),
        percentile(&mut late, 99),
        percentile(&mut main, 50),
        percentile(&mut main, 99)
    );
    drop(store);
    let files = Folder::new(&place);
    let journal = files.list("journal").expect("it is there");
    let bytes: usize =
        journal.iter().map(|name| files.read(&format!("journal/{name}")).map_or(0, |all| all.len())).sum();
    println!("journal: {:.1} bytes a sphere, heads included", bytes as f64 / 400.0);
    drop(std::fs::remove_dir_all(&place));

    // A world of many chunks with a tail of 5000 edits, after its process was killed.
    let disk = SimulatedDisk::new();
    let options = StoreOptions {
        loss_window: Duration::from_millis(250),
        checkpoint_commits: u64::MAX,
        checkpoint_after: Duration::from_secs(3600),
        ..options
    };
    let mut terrain = digger(&ground);
    let mut store =
        Store::create_in(Arc::new(disk.clone()), &mut terrain, options.clone()).expect("a new world");
    let far = |number: u32| {
        let (chunk, round) = (number % 2025, (number / 2025) as f32);
        dig_at(&ground, [chunk % 45, chunk / 45].map(|part| 12.0 + 22.0 * part as f32 + round * 0.4), 6.0)
    };
    let start = Instant::now();
    for number in 0..2025 * 10 {
        terrain.apply([far(number)]);
        store.follow(&mut terrain).expect("the thread runs");
    }
    let first = start.elapsed();
    store.flush().expect("the disk works");
    let start = Instant::now();
    store.checkpoint().expect("the disk works");
    let checkpoint = start.elapsed();
    let start = Instant::now();
    for number in 0..5000 {
        terrain.apply([dig(&ground, number)]);
        store.follow(&mut terrain).expect("the thread runs");
    }
    let tail = start.elapsed();
    store.flush().expect("the disk works");
    let killed = disk.image().lose_process();
    let chunks = terrain.world().fields().count();
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    println!(
        "{chunks} chunks with fields; digging {:.0} + {:.0} ms, checkpoint {:.0} ms",
        ms(first),
        ms(tail),
        ms(checkpoint)
    );
    // Without a store: the brushes one by one, with meshes.
    let mut by_hand = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings");
    let start = Instant::now();
    (0..2025 * 10).for_each(|number| drop(by_hand.apply([far(number)])));
    (0..5000).for_each(|number| drop(by_hand.apply([dig(&ground, number)])));
    let by_hand = (start.elapsed(), by_hand.world().hash());
    assert_eq!(by_hand.1, terrain.world().hash());
    println!("the same brushes by hand, with meshes: {:.0} ms", ms(by_hand.0));
    let damaged = killed.image().lose_process();
    damaged.remove("regions.redb").expect("it is there");
    let mut times = Vec::new();
    for (disk, what) in [(killed, "opened"), (damaged, "by the log alone")] {
        let progress = Progress::default();
        let options = StoreOptions { progress: Some(progress.clone()), ..options.clone() };
        let start = Instant::now();
        let watcher = std::thread::spawn(move || {
            let mut seen = Vec::new();
            while progress.share() < 1.0 {
                seen.push((start.elapsed(), progress.share()));
                std::thread::sleep(Duration::from_millis(2));
            }
            seen
        });
        let opened = Store::open_in(Arc::new(disk), Arc::clone(&ground), options);
        let (_store, opened) = opened.expect("it opens");
        let took = start.elapsed();
        let seen = watcher.join().expect("it only looks");
        let off = seen.iter().map(|(at, share)| (share - at.as_secs_f32() / took.as_secs_f32()).abs());
        println!("the bar is at most {:.0} % off", 100.0 * off.fold(0.0, f32::max));
        assert!(!opened.terrain.world().is_solid(glam::DVec3::new(500.0, 900.0, 500.0)));
        println!("{what} with {} commits replayed: {:.0} ms to the first query", opened.replayed, ms(took));
        assert_eq!(opened.terrain.world().hash(), terrain.world().hash());
        times.push(took.as_secs_f64());
    }
    println!(
        "opening is {:.1} times as fast as the log alone, and {:.1} times as fast as by hand",
        times[1] / times[0],
        by_hand.0.as_secs_f64() / times[0]
    );
}
