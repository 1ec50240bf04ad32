//! Frames while a terrain loads, by the number of background threads: `cargo bench --bench threads`.
//!
//! A game of 60 frames a second works for a third of each frame on the main thread and for a third on all of Bevy's
//! threads, while a terrain of 2048 x 2048 voxels loads with meshes. Prints how long the load takes, and how long
//! frames take until then, for each number of background threads up to the number of cores.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::tasks::{ComputeTaskPool, TaskPool};
use bevy_burrow::plugin::ThreadSettings;
use bevy_burrow::prelude::*;

/// The time of a frame.
const FRAME: Duration = Duration::from_micros(16_667);

/// Rounds of work that take a third of a frame on this machine when nothing else runs.
#[derive(Resource, Clone, Copy)]
struct Third(u64);

fn work(rounds: u64) -> u64 {
    (0..rounds).fold(1, |sum, round| std::hint::black_box(sum ^ round).wrapping_mul(0x9E37_79B9_7F4A_7C15))
}

/// Finds out how much work that is.
fn calibrate() -> Third {
    let rounds = 20_000_000;
    let start = Instant::now();
    std::hint::black_box(work(rounds));
    let of_round = start.elapsed().as_secs_f64() / rounds as f64;
    Third((FRAME.as_secs_f64() / 3.0 / of_round) as u64)
}

/// The work of a game in a frame.
fn play(third: Res<Third>) {
    let rounds = third.0;
    std::hint::black_box(work(rounds));
    let pool = ComputeTaskPool::get_or_init(TaskPool::default);
    let tasks = pool.thread_num().max(1);
    pool.scope(|scope| {
        for _ in 0..tasks {
            scope.spawn(async move {
                std::hint::black_box(work(rounds / tasks as u64));
            });
        }
    });
}

#[derive(Resource, Default)]
struct IsReady(bool);

/// The load's time, and the frames' until then.
fn load(background: usize, third: Third) -> (Duration, Vec<Duration>) {
    let mut app = App::new();
    app.insert_resource(ThreadSettings { background, ..default() })
        .insert_resource(third)
        .add_plugins((MinimalPlugins, BurrowPlugins))
        .init_resource::<Assets<Mesh>>()
        .init_resource::<IsReady>()
        .add_observer(|_: On<TerrainReady>, mut ready: ResMut<IsReady>| ready.0 = true)
        .add_systems(Update, play);
    app.finish();
    app.cleanup();
    (0..30).for_each(|_| app.update());
    let noise = NoiseHeights { seed: 9, octaves: 6, scale: 200.0, amplitude: 60.0, ..default() };
    let ground = Ground::from_noise(2048, 2048, &noise).expect("valid ground");
    app.world_mut().spawn(Terrain::new(ground, &TerrainSettings::default()).expect("valid settings"));
    let (start, mut frames) = (Instant::now(), Vec::new());
    while !app.world().resource::<IsReady>().0 {
        let frame = Instant::now();
        app.update();
        frames.push(frame.elapsed());
        std::thread::sleep(FRAME.saturating_sub(frame.elapsed()));
    }
    (start.elapsed(), frames)
}

fn main() {
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
    let third = calibrate();
    println!("{cores} cores; the default is {} background threads", ThreadSettings::default().background);
    println!("| background threads | load, s | frames, median ms | p95 | longest | over 16.7 ms |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for background in 1..=cores {
        let (took, mut frames) = load(background, third);
        frames.sort_unstable();
        let ms = |frame: &Duration| frame.as_secs_f64() * 1e3;
        let at = |share: f64| ms(&frames[((frames.len() - 1) as f64 * share) as usize]);
        let late = frames.iter().filter(|frame| **frame > FRAME).count();
        println!(
            "| {background} | {:.2} | {:.1} | {:.1} | {:.1} | {late} of {} |",
            took.as_secs_f64(),
            at(0.5),
            at(0.95),
            at(1.0),
            frames.len()
        );
    }
}
