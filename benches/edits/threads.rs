//! One transaction of 64 dirty chunks on one, two and all threads, in turns. Beside it, what the machine itself gives: as
//! many such transactions at once, each on a thread and a terrain of its own.

use std::time::Instant;

use bevy_burrow::lattice::Column;
use bevy_burrow::terrain::Stages;
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
    let mut stages = vec![[(); 4].map(|()| Sample::default()); pools.len()];
    for round in 0..60 {
        let third = || {
            // The first two wake the threads.
            transaction(round);
            transaction(round);
            transaction(round)
        };
        let runs: Vec<Stages> = pools.iter().map(|pool| pool.install(third)).collect();
        for (i, run) in runs.iter().enumerate() {
            times[i].push(run.whole.as_secs_f64());
            ratios[i].push(runs[0].whole.as_secs_f64() / run.whole.as_secs_f64());
            for (stage, time) in stages[i].iter_mut().zip([run.edit, run.meshing, run.assembly, run.ring]) {
                stage.push(time.as_secs_f64());
            }
        }
    }
    for (i, count) in counts.iter().enumerate() {
        let (time, ratio) = (times[i].median() * 1e6, ratios[i].median());
        let [edit, meshing, assembly, ring] = stages[i].each_ref().map(|stage| stage.median() * 1e6);
        println!(
            "  64 chunks, {count:>3} threads {time:>9.0} us, {ratio:.2} times as fast as one (edit {edit:.0}, \
             meshing {meshing:.0}, assembly {assembly:.0}, ring {ring:.0})"
        );
    }
    for &count in &counts[1..] {
        println!("  {count:>3} at once, a thread each: {:.2} times as many as one", at_once(count));
    }
}

/// How many times as many transactions are done in a time, if several threads work for themselves.
fn at_once(count: usize) -> f64 {
    let busy = |threads_at_once: usize| {
        let start = Instant::now();
        std::thread::scope(|scope| {
            for _ in 0..threads_at_once {
                scope.spawn(|| {
                    threads(1).install(|| {
                        (0..20).map(transaction).for_each(|stages| assert!(!stages.whole.is_zero()))
                    })
                });
            }
        });
        start.elapsed().as_secs_f64()
    };
    let ratios: Sample = (0..5).map(|_| count as f64 * busy(1) / busy(count)).collect();
    ratios.median()
}

/// A transaction that digs in each of 8x8 chunks.
fn transaction(round: i32) -> Stages {
    let mut terrain = landscape(32);
    for i in 0..64 {
        let (x, z) = (round % 20 * 32 + i % 8 * 32 + 16, round % 17 * 32 + i / 8 * 32 + 16);
        let height = ground().height(Column::new(x, z)) as f32 / 256.0;
        terrain.submit(&dig(Vec3::new(x as f32, height, z as f32), 7.0));
    }
    let commit = terrain.begin().expect("brushes wait").run();
    assert!(commit.meshes.chunks.len() >= 64);
    commit.stages
}
