//! One transaction of 64 dirty chunks on one, two and all threads, in turns.

use std::time::Instant;

use bevy_burrow::lattice::Column;
use glam::Vec3;

use crate::landscape::{dig, ground, landscape, threads};
use crate::statistics::Sample;

pub fn section() {
    let all = std::thread::available_parallelism().map_or(2, std::num::NonZero::get);
    let mut counts = vec![1, 2, all];
    counts.dedup();
    let pools: Vec<_> = counts.iter().map(|&count| threads(count)).collect();
    let mut times = vec![Sample::default(); pools.len()];
    let mut ratios = vec![Sample::default(); pools.len()];
    for round in 0..60 {
        let seconds: Vec<f64> = pools.iter().map(|pool| pool.install(|| transaction(round))).collect();
        for (i, &time) in seconds.iter().enumerate() {
            times[i].push(time);
            ratios[i].push(seconds[0] / time);
        }
    }
    for ((count, time), ratio) in counts.iter().zip(&times).zip(&ratios) {
        let (time, ratio) = (time.median() * 1e6, ratio.median());
        println!("  64 chunks, {count:>3} threads {time:>10.1} us, {ratio:.2} times as fast as one thread");
    }
}

/// Seconds for a transaction that digs in each of 8x8 chunks.
fn transaction(round: i32) -> f64 {
    let mut terrain = landscape(32);
    for i in 0..64 {
        let (x, z) = (round % 20 * 32 + i % 8 * 32 + 16, round % 17 * 32 + i / 8 * 32 + 16);
        let height = ground().height(Column::new(x, z)) as f32 / 256.0;
        terrain.submit(&dig(Vec3::new(x as f32, height, z as f32), 7.0));
    }
    let transaction = terrain.begin().expect("brushes wait");
    let start = Instant::now();
    let commit = transaction.run();
    let seconds = start.elapsed().as_secs_f64();
    assert!(commit.meshes.chunks.len() >= 64);
    seconds
}
