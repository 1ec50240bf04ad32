//! Large transactions, on the CPU and on a CUDA GPU: ground from noise, a meteor shower, a landscape cut into terraces
//! and smoothed as a whole, hundreds of strokes that sculpt it, and a world of thousands of edits replayed as when it
//! is loaded.
//!
//! `cargo run --release --no-default-features --features cuda --example bulk [-- --help]`

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy_burrow::backend::{Backend, Engine, EngineState};
use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{Commit, WorkLimits};
use clap::Parser;
use fastrand::Rng;
use glam::{Quat, Vec2, Vec3};

/// Times large transactions on the CPU and on a CUDA GPU.
#[derive(Parser)]
struct Arguments {
    /// Cells along a side of the landscape.
    #[arg(long, default_value_t = 1024, value_parser = clap::value_parser!(u32).range(256..=8192))]
    side: u32,
    /// How often each transaction is timed; medians are printed.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=100))]
    repeats: u16,
    /// Cells along a side of the ground that is made of noise.
    #[arg(long, default_value_t = 4096, value_parser = clap::value_parser!(u32).range(1..=16_384))]
    ground_side: u32,
}

/// Something large to do to a landscape.
struct Scene {
    name: &'static str,
    /// Earlier edits.
    before: fn(&Ground, &mut Rng) -> Vec<Brush>,
    brushes: fn(&Ground, &mut Rng) -> Vec<Brush>,
}

const SCENES: [Scene; 5] = [
    Scene { name: "meteor shower", before: nothing, brushes: meteors },
    Scene { name: "terraces", before: nothing, brushes: terraces },
    Scene { name: "replay of 3,000 edits", before: nothing, brushes: replay },
    Scene { name: "smooth the whole terrain", before: terraces, brushes: smooth },
    Scene { name: "800 strokes that sculpt", before: replay, brushes: strokes },
];

/// An unedited landscape.
fn nothing(_: &Ground, _: &mut Rng) -> Vec<Brush> {
    Vec::new()
}

/// A place on the ground.
fn place(ground: &Ground, rng: &mut Rng) -> Vec3 {
    let (x, z) = (rng.i32(16..ground.width() - 16), rng.i32(16..ground.depth() - 16));
    Vec3::new(x as f32, ground.height(Column::new(x, z)) as f32 / 256.0, z as f32)
}

/// Craters of all sizes, the rims rough.
fn meteors(ground: &Ground, rng: &mut Rng) -> Vec<Brush> {
    let crater = |i: u32| {
        let radius = 5.0 + 12.0 * rng.f32() * rng.f32();
        let center = place(ground, rng) + Vec3::Y * radius * 0.3;
        Brush::dig(Shape::sphere(center, radius)).with_roughness(Roughness::new(1.5, 5.0, i))
    };
    (0..600).map(crater).collect()
}

/// Steps cut into the whole landscape, a few voxels each.
fn terraces(ground: &Ground, _: &mut Rng) -> Vec<Brush> {
    let step = 64;
    let places = (0..ground.depth() / step).flat_map(|z| (0..ground.width() / step).map(move |x| (x, z)));
    let cut = |(x, z): (i32, i32)| {
        let (x, z) = (x * step + step / 2, z * step + step / 2);
        let height = ground.height(Column::new(x, z)) as f32 / 256.0;
        let floor = (height / 8.0).floor() * 8.0;
        let half = Vec3::new(step as f32 * 0.5, 12.0, step as f32 * 0.5);
        Brush::dig(Shape::cuboid(Vec3::new(x as f32, floor + 12.0, z as f32), half))
    };
    places.map(cut).collect()
}

/// All of the ground smoothed in overlapping squares. Those of one colour, of four, lie apart, so that they need not
/// wait for each other.
fn smooth(ground: &Ground, _: &mut Rng) -> Vec<Brush> {
    let (step, overlap) = (64, 4);
    let square = |x: i32, z: i32| {
        let (x, z) = (x * step, z * step);
        let columns =
            (0..=step).step_by(4).flat_map(|dz| (0..=step).step_by(4).map(move |dx| (x + dx, z + dz)));
        let heights = columns.map(|(x, z)| ground.height(Column::new(x, z)) as f32 / 256.0);
        let (low, high) =
            heights.fold((f32::MAX, f32::MIN), |(low, high), height| (low.min(height), high.max(height)));
        let side = step as f32 * 0.5;
        let center = Vec3::new(x as f32 + side, (low + high) * 0.5, z as f32 + side);
        let half = Vec3::new(side + overlap as f32, (high - low) * 0.5 + 10.0, side + overlap as f32);
        Brush::smooth(Shape::cuboid(center, half), 1.0)
    };
    let colours = [(0, 0), (1, 0), (0, 1), (1, 1)];
    let of_colour = |(x0, z0): (i32, i32)| {
        let rows = (z0..ground.depth() / step).step_by(2);
        rows.flat_map(move |z| (x0..ground.width() / step).step_by(2).map(move |x| square(x, z)))
    };
    colours.into_iter().flat_map(of_colour).collect()
}

/// Strokes of an editor: every operation that sculpts, anywhere, in any order.
fn strokes(ground: &Ground, rng: &mut Rng) -> Vec<Brush> {
    let bumps = (0..64).map(|i| 2700 * (i % 8 * (7 - i % 8) + i / 8 * (7 - i / 8))).collect();
    let image = Arc::new(GreyImage::from_samples(8, 8, bumps).expect("as many samples as it has"));
    let stroke = |i: u32| {
        let (at, radius) = (place(ground, rng), 6.0 + 10.0 * rng.f32());
        let shape = Shape::sphere(at, radius);
        match i % 8 {
            0 | 1 => Brush::smooth(shape, 1.0),
            2 => Brush::raise(shape, 3.0),
            3 => Brush::lower(shape, 2.0),
            4 => Brush::level(shape, at.y),
            5 => Brush::flatten(shape, at, Vec3::new(rng.f32() - 0.5, 1.0, rng.f32() - 0.5)),
            6 => Brush::stamp(shape, Stamp::new(Arc::clone(&image), at, Vec2::splat(radius), 4.0)),
            _ => Brush::terrace(shape, 3.0),
        }
    };
    (0..800).map(stroke).collect()
}

/// Typical edits of players: holes, tunnels, walls, heaps.
fn replay(ground: &Ground, rng: &mut Rng) -> Vec<Brush> {
    let edit = |i: u32| {
        let (at, radius) = (place(ground, rng), 2.0 + 4.0 * rng.f32());
        let along = Quat::from_rotation_y(rng.f32() * 6.3) * Vec3::new(20.0, -6.0, 0.0);
        match i % 5 {
            0 => Brush::dig(Shape::capsule(at, at + along, radius * 0.7)),
            1 => Brush::add(Shape::cuboid(at, Vec3::new(8.0, 4.0, 1.5)), MaterialId(3)),
            2 => Brush::add(Shape::cone(at - Vec3::Y, Vec3::Y * radius, radius), MaterialId(2)),
            _ => Brush::dig(Shape::sphere(at, radius)),
        }
    };
    (0..3000).map(edit).collect()
}

/// The middle one of some times.
fn median(mut times: Vec<Duration>) -> f64 {
    times.sort_unstable();
    times[times.len() / 2].as_secs_f64() * 1e3
}

/// Times the making of ground from noise on some engine.
fn time_ground(side: u32, repeats: u16, engine: &Engine) -> (f64, Ground) {
    let noise = NoiseHeights { seed: 7, ..NoiseHeights::default() };
    let make = || engine.ground_from_noise(side, side, &noise).expect("valid noise");
    let mut ground = make();
    let time = |_| {
        let start = Instant::now();
        ground = make();
        start.elapsed()
    };
    (median((0..repeats).map(time).collect()), ground)
}

/// Times the making of ground on all engines.
fn compare_ground(side: u32, repeats: u16, engines: &[(Backend, Engine); 3]) {
    let [(cpu, expected), (cuda, found), (auto, other)] =
        engines.each_ref().map(|(_, engine)| time_ground(side, repeats, engine));
    assert!(expected == found && expected == other, "all make the same ground");
    println!(
        "Ground of {side} x {side} cells from noise: {cpu:.1} ms with Cpu, {cuda:.1} ms with Cuda, {auto:.1} ms with Auto; \
         hash {:016x} of all",
        found.hash()
    );
}

/// The result of one engine for a scene, and its time.
struct Outcome {
    commit: Commit,
    hash: u64,
    /// Numbers of stages that ran on the GPU, and of those with work that did not.
    on_gpu: u64,
    left: usize,
    /// Expected times on CPU and GPU, in milliseconds, summed over all choices.
    expected: [f64; 2],
}

/// Runs the waiting edits, which stay queued. No other handle to the world may exist, or it would be copied.
fn run(terrain: &mut Terrain, engine: &Engine) -> Outcome {
    let before = engine.figures();
    let commit = terrain.begin().expect("brushes wait").run_on(engine);
    terrain.abandon();
    let figures = engine.figures();
    let on_gpu = figures.cuda - before.cuda;
    let fresh = (figures.cuda + figures.cpu - before.cuda - before.cpu) as usize;
    let choices = || figures.choices.iter().rev().take(fresh);
    let left = choices().filter(|choice| !choice.is_cuda && choice.amount > 0).count();
    let estimates = choices().filter_map(|choice| choice.estimate);
    let expected = estimates.fold([0.0; 2], |[cpu, cuda], estimate| {
        [cpu + estimate.cpu.as_secs_f64() * 1e3, cuda + estimate.cuda.as_secs_f64() * 1e3]
    });
    let hash = commit.sample_hash();
    Outcome { commit, hash, on_gpu, left, expected }
}

/// Returns `true` if both draw the same meshes.
fn are_same(a: &Commit, b: &Commit) -> bool {
    let (a, b) = (&a.meshes, &b.meshes);
    let mut chunks = a.chunks.iter().zip(&b.chunks);
    let mut tiles = a.tiles.iter().zip(&b.tiles);
    (a.chunks.len(), a.tiles.len()) == (b.chunks.len(), b.tiles.len())
        && chunks.all(|((a, own), (b, other))| a == b && own.mesh() == other.mesh())
        && tiles.all(|((a, own), (b, other))| a == b && own.mesh() == other.mesh())
}

fn main() {
    let arguments = Arguments::parse();
    let noise = NoiseHeights { seed: 7, ..NoiseHeights::default() };
    let ground = Arc::new(Ground::from_noise(arguments.side, arguments.side, &noise).expect("valid noise"));
    let engines = [Backend::Cpu, Backend::Cuda, Backend::Auto].map(|backend| (backend, Engine::new(backend)));
    for (backend, engine) in &engines {
        match engine.wait(Duration::from_secs(30)) {
            EngineState::Cuda(name) => println!("{backend:?}: {name} and the CPU"),
            EngineState::Lost(why) => println!("{backend:?}: the CPU; {why}"),
            _ => println!("{backend:?}: the CPU, {} threads", rayon::current_num_threads()),
        }
    }
    let has_card = matches!(engines[1].1.state(), EngineState::Cuda(_));
    println!();
    for side in [256, 512, 1024, 2048].into_iter().filter(|&side| side < arguments.ground_side) {
        compare_ground(side, arguments.repeats, &engines);
    }
    compare_ground(arguments.ground_side, arguments.repeats, &engines);
    let names = engines.each_ref().map(|(backend, _)| format!("{backend:?}"));
    let [cpu, cuda, auto] = names.each_ref().map(|name| format!("{name:>9}"));
    println!("\n{:<24}{:>9}{:>10}{cpu}{cuda}{auto}   ms, medians", "", "brushes", "vertices");
    for scene in &SCENES {
        let brushes = (scene.brushes)(&ground, &mut Rng::with_seed(1));
        let mut terrain =
            Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings");
        terrain.apply((scene.before)(&ground, &mut Rng::with_seed(2)));
        terrain.set_work_limits(WorkLimits::UNBOUNDED);
        terrain.submit_all(&brushes);
        let mut times = [const { Vec::new() }; 3];
        let (mut hashes, mut vertices, mut on_gpu, mut expected) = (Vec::new(), 0, [0; 3], [0.0; 2]);
        let mut first: Option<Commit> = None;
        // The first round warms memory and threads.
        for round in 0..=arguments.repeats {
            // In turns: a later engine finds caches warm. Every other round runs backwards, so that no engine always
            // follows the same one.
            for turn in 0..engines.len() {
                let turn = if round.is_multiple_of(2) { turn } else { engines.len() - 1 - turn };
                let i = (turn + usize::from(round) / 2) % engines.len();
                let engine = &engines[i].1;
                let outcome = run(&mut terrain, engine);
                hashes.push(outcome.hash);
                on_gpu[i] = outcome.on_gpu;
                // In the end, of Auto.
                expected = if i == 2 { outcome.expected } else { expected };
                let is_card = engines[i].0 == Backend::Cuda && has_card;
                assert!(!is_card || outcome.left == 0, "the CPU ran stages of the GPU: {:?}", engine.state());
                let meshes = outcome.commit.meshes.chunks.iter();
                vertices = meshes.map(|(_, chunk)| chunk.mesh().vertices.len()).sum();
                if round > 0 {
                    times[i].push(outcome.commit.stages.whole);
                    continue;
                }
                match &first {
                    Some(first) => {
                        assert!(are_same(first, &outcome.commit), "all engines make the same meshes")
                    }
                    None => first = Some(outcome.commit),
                }
            }
        }
        let [cpu, cuda, auto] = times.map(|times| format!("{:>9.2}", median(times)));
        println!("{:<24}{:>9}{vertices:>10}{cpu}{cuda}{auto}", scene.name, brushes.len());
        assert!(hashes.windows(2).all(|pair| pair[0] == pair[1]), "all engines make the same world");
        let [cpu, cuda] = expected;
        println!("{:<24}stages on the GPU: {on_gpu:?}; samples {:016x} on all", "", hashes[0]);
        println!("{:<24}Auto expected {cpu:.1} ms of the CPU, {cuda:.1} of the GPU", "");
    }
}
