//! Transactions on one, two and all threads, in turns: one of 64 dirty chunks, and batches of small digs. For
//! comparison, the machine's own scaling: independent transactions at the same time, each on a thread and a terrain
//! of its own.

use std::sync::Barrier;

use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::Stages;
use glam::Vec3;
use rayon::ThreadPool;

use crate::landscape::{dig, ground, landscape, submit, threads};
use crate::stages::run;
use crate::statistics::{Sample, header, row};

pub fn section() {
    let all = std::thread::available_parallelism().map_or(2, std::num::NonZero::get);
    let mut counts = vec![1, 2, all];
    counts.dedup();
    let pools: Vec<_> = counts.iter().map(|&count| (count, threads(count))).collect();
    many_chunks(&pools);
    for &count in &counts[1..] {
        println!("  {count:>3} at once, a thread each: {:.2} times as many as one", at_once(count));
    }
    batches(&pools);
}

/// The order of a round: each case takes one turn, and every round begins with another one.
fn turns(round: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |at| (at + round) % count)
}

fn many_chunks(pools: &[(usize, ThreadPool)]) {
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
        let mut runs = vec![Stages::default(); pools.len()];
        turns(round, pools.len()).for_each(|at| runs[at] = pools[at].1.install(third));
        for (i, run) in runs.iter().enumerate() {
            times[i].push(run.whole.as_secs_f64());
            ratios[i].push(runs[0].whole.as_secs_f64() / run.whole.as_secs_f64());
            for (stage, time) in stages[i].iter_mut().zip([run.edit, run.meshing, run.assembly, run.ring]) {
                stage.push(time.as_secs_f64());
            }
        }
    }
    for (i, (count, _)) in pools.iter().enumerate() {
        let (time, ratio) = (times[i].median() * 1e6, ratios[i].median());
        let [edit, meshing, assembly, ring] = stages[i].each_ref().map(|stage| stage.median() * 1e6);
        println!(
            "  64 chunks, {count:>3} threads {time:>9.0} us, {ratio:.2} times as fast as one (edit {edit:.0}, \
             meshing {meshing:.0}, assembly {assembly:.0}, ring {ring:.0})"
        );
    }
}

/// How many times more transactions per second several independent threads do than one: medians of pairs of
/// transactions that begin at the same moment.
fn at_once(count: usize) -> f64 {
    let pools: Vec<_> = (0..count).map(|_| threads(1)).collect();
    let busy = |pools: &[ThreadPool], round: usize| {
        let start = Barrier::new(pools.len());
        let third = || {
            transaction(round);
            transaction(round);
            let mut terrain = ready(round);
            start.wait();
            run(&mut terrain)
        };
        std::thread::scope(|scope| {
            let threads: Vec<_> = pools.iter().map(|pool| scope.spawn(|| pool.install(third))).collect();
            let times = threads.into_iter().map(|thread| thread.join().expect("no transaction panics"));
            times.fold(0.0, f64::max)
        })
    };
    let ratio = |round: usize| {
        let mut times = [0.0; 2];
        turns(round, 2).for_each(|at| times[at] = busy(&pools[..[1, count][at]], round));
        count as f64 * times[0] / times[1]
    };
    (0..40).map(ratio).collect::<Sample>().median()
}

/// Small digs all over the landscape, by their number in a transaction.
fn batches(pools: &[(usize, ThreadPool)]) {
    header("radius 4 all over, by brushes in a transaction", "an edit");
    for count in [10, 100, 1000] {
        let mut times = vec![Sample::default(); pools.len()];
        for round in 0..20 {
            for at in turns(round, pools.len()) {
                let took = pools[at].1.install(|| {
                    let mut terrain = landscape(32);
                    submit(&mut terrain, count, round, true);
                    run(&mut terrain)
                });
                times[at].push(took / count as f64);
            }
        }
        for ((threads, _), times) in pools.iter().zip(&times) {
            row(&format!("{count} on {threads} threads"), times);
        }
    }
}

/// A terrain with queued digs in each of 8x8 chunks.
fn ready(round: usize) -> Terrain {
    let (mut terrain, round) = (landscape(32), round as i32);
    terrain.submit_all((0..64).map(|i| {
        let (x, z) = (round % 20 * 32 + i % 8 * 32 + 16, round % 17 * 32 + i / 8 * 32 + 16);
        let height = ground().height(Column::new(x, z)) as f32 / 256.0;
        dig(Vec3::new(x as f32, height, z as f32), 7.0)
    }));
    terrain
}

fn transaction(round: usize) -> Stages {
    let commit = ready(round).begin().expect("queued brushes").run();
    assert!(commit.meshes.chunks.len() >= 64);
    commit.stages
}
