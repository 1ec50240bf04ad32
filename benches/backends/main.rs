//! CPU against CUDA: `cargo bench --no-default-features --features cuda --bench backends [-- SECTION...]`.
//!
//! Runs equal transactions on the shipped landscape, on each backend in turn. The CPU uses all of its threads unless
//! stated otherwise. Times run from the edits to the commit, with vertices in host memory.

#[path = "../edits/landscape.rs"]
#[allow(dead_code, reason = "the benchmark `edits` uses all of it")]
mod landscape;
mod level;
#[path = "../edits/statistics.rs"]
#[allow(dead_code, reason = "the benchmark `edits` uses all of it")]
mod statistics;

use std::collections::VecDeque;
use std::time::Duration;

use bevy_burrow::backend::{Backend, Choice, Engine, EngineFigures, EngineState, Stage};
use bevy_burrow::prelude::{Brush, Shape};
use bevy_burrow::terrain::{Commit, Stages, Terrain, Transaction};
use glam::Vec3;

use landscape::{dig, landscape, threads};
use level::Level;
use statistics::Sample;

const SECTIONS: [(&str, fn(&Engines)); 8] = [
    ("moving", |_| moving()),
    ("craters", |engines| bulk(engines, false)),
    ("rough-craters", |engines| bulk(engines, true)),
    ("field", one_field),
    ("brush", |engines| brush(engines, dig)),
    ("sweep", |engines| sweep(engines, dig)),
    ("stroke", |engines| brush(engines, smooth)),
    ("stroke-sweep", |engines| sweep(engines, smooth)),
];

/// A spherical brush that smooths.
fn smooth(center: Vec3, radius: f32) -> Brush {
    Brush::smooth(Shape::sphere(center, radius), 1.0)
}

/// One engine of each kind.
struct Engines {
    cpu: Engine,
    cuda: Engine,
    auto: Engine,
}

/// Which engine.
#[derive(Clone, Copy, PartialEq, Eq)]
enum EngineKind {
    Cpu,
    Cuda,
    Auto,
}

impl EngineKind {
    const ALL: [Self; 3] = [Self::Cpu, Self::Cuda, Self::Auto];

    const fn name(self) -> &'static str {
        ["CPU", "CUDA", "Auto"][self as usize]
    }
}

impl Engines {
    /// Runs one transaction on an engine.
    ///
    /// # Panics
    /// Panics if the GPU left any stage to the CPU, whose time would then count as the GPU's.
    fn run(&self, transaction: Transaction, who: EngineKind, times: &mut Times) -> Commit {
        let engine = [&self.cpu, &self.cuda, &self.auto][who as usize];
        let commit = transaction.run_on(engine);
        let choices = engine.figures().choices;
        assert!(
            who == EngineKind::Cpu || matches!(engine.state(), EngineState::Cuda(_)),
            "{:?}",
            engine.state()
        );
        let is_there = |choice: &Choice| choice.is_cuda || choice.amount == 0;
        assert!(
            who != EngineKind::Cuda || choices.iter().all(is_there),
            "the CPU ran stages of the GPU: {choices:?}"
        );
        times.push(&commit.stages, &choices);
        commit
    }

    /// Plays brushes in one transaction on a terrain that only this engine edits, so that a GPU keeps its copy up to
    /// date; returns the time in seconds.
    fn play(
        &self,
        terrain: &mut Terrain,
        brushes: impl IntoIterator<Item = Brush>,
        who: EngineKind,
        times: &mut Times,
    ) -> f64 {
        terrain.submit_all(brushes);
        let commit = self.run(terrain.begin().expect("queued brushes"), who, times);
        let took = commit.stages.whole.as_secs_f64();
        terrain.commit(commit).expect("no other commit");
        took
    }
}

fn assert_same(terrains: &[Terrain; 3]) {
    let hashes = terrains.each_ref().map(|terrain| terrain.world().hash());
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "the same world");
}

fn main() {
    // Cargo passes `--bench`.
    let wanted: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect();
    if let Some(unknown) = wanted.iter().find(|name| !SECTIONS.iter().any(|(known, _)| known == name)) {
        eprintln!("no section {unknown}; there are {:?}", SECTIONS.map(|(name, _)| name));
        std::process::exit(2);
    }
    let open = |backend| {
        let engine = Engine::new(backend);
        engine.wait(Duration::from_secs(30));
        engine
    };
    let engines = Engines { cpu: open(Backend::Cpu), cuda: open(Backend::Cuda), auto: open(Backend::Auto) };
    match engines.cuda.state() {
        EngineState::Cuda(name) => println!(
            "{name}, {} threads; opened and compared in {:.0} and {:.0} ms",
            rayon::current_num_threads(),
            engines.cuda.figures().opening.as_secs_f64() * 1e3,
            engines.auto.figures().opening.as_secs_f64() * 1e3,
        ),
        state => return println!("no GPU: {state:?}"),
    }
    for (name, run) in SECTIONS {
        if wanted.is_empty() || wanted.iter().any(|wanted| wanted == name) {
            println!("\n{name}");
            run(&engines);
        }
    }
}

/// Times of many transactions on one engine.
#[derive(Default)]
struct Times {
    whole: Sample,
    edit: Sample,
    meshing: Sample,
    assembly: Sample,
    ring: Sample,
    /// The parts of edits and of meshing that a backend does.
    backend: [Sample; 2],
    /// On the GPU only: edits and meshing, and their kernels.
    device: [Sample; 2],
    kernel: [Sample; 2],
}

impl Times {
    fn push(&mut self, stages: &Stages, choices: &VecDeque<Choice>) {
        let parts = [
            (&mut self.whole, stages.whole),
            (&mut self.edit, stages.edit),
            (&mut self.meshing, stages.meshing),
            (&mut self.assembly, stages.assembly),
            (&mut self.ring, stages.ring),
        ];
        parts.into_iter().for_each(|(sample, time)| sample.push(time.as_secs_f64()));
        for (at, stage) in [Stage::Edit, Stage::Mesh].into_iter().enumerate() {
            let Some(choice) = choices.iter().rev().find(|choice| choice.stage == stage) else { continue };
            self.backend[at].push(choice.took.as_secs_f64());
            if !choice.device.is_zero() {
                self.device[at].push(choice.device.as_secs_f64());
                self.kernel[at].push(choice.kernel.as_secs_f64());
            }
        }
    }

    fn print(&self, what: &str) {
        let [edits, meshing] = &self.backend;
        let stages = [edits, meshing, &self.edit, &self.meshing, &self.assembly, &self.ring];
        let stages: String = stages.iter().map(|stage| format!("{:>9.0}", stage.median() * 1e6)).collect();
        let device: String = self
            .device
            .iter()
            .zip(&self.kernel)
            .filter(|(device, _)| device.len() > 0)
            .map(|(device, kernel)| format!("{:>9.0} ({:.0})", device.median() * 1e6, kernel.median() * 1e6))
            .collect();
        let whole = &self.whole;
        println!(
            "  {what:<28}{:>9.0}{:>9.0}{stages} {device}",
            whole.median() * 1e6,
            whole.percentile(0.99) * 1e6
        );
    }
}

/// Prints the header for the lines of [`Times::print`].
fn header(what: &str) {
    // The parts of edit and meshing that a backend does come first. Surfaces that arrive while chunks are assembled
    // count as assembly, and as backend time too while they are waited for.
    let names = ["whole", "p99", "edits", "blocks", "edit", "meshing", "assembly", "ring"];
    let names = names.map(|name| format!("{name:>9}")).concat();
    println!("  {what:<28}{names}   edits and blocks on the GPU (kernels); us, medians but for p99");
}

/// The order of the engines in a round. Later engines find warmer caches, depending on the engine before. In six
/// rounds, each engine follows each other engine equally often.
fn turns(round: usize) -> [usize; 3] {
    let [a, b, c] = [0, 1, 2].map(|turn| (turn + round) % 3);
    if (round / 3).is_multiple_of(2) { [a, b, c] } else { [c, b, a] }
}

/// 512 fields of 32x32x32, all of them dirty: created, and then dug all over again.
fn bulk(engines: &Engines, are_rough: bool) {
    let level = Level::new();
    let [mut cpu, mut cuda] = [(); 2].map(|()| [Times::default(), Times::default()]);
    let mut ratios = [Sample::default(), Sample::default()];
    let mut vertices = 0;
    for round in 0..12 {
        let mut hashes = Vec::new();
        let mut wholes = [[0.0; 2]; 2];
        let mut contenders = [(EngineKind::Cpu, &mut cpu), (EngineKind::Cuda, &mut cuda)];
        contenders.rotate_left(round % 2);
        for (who, times) in contenders {
            let mut terrain = level.terrain();
            for (pass, times) in times.iter_mut().enumerate() {
                terrain.submit_all(level.brushes(pass, are_rough));
                let mut discarded = Times::default();
                let transaction = terrain.begin().expect("queued brushes");
                let commit = engines.run(transaction, who, if round < 2 { &mut discarded } else { times });
                wholes[who as usize][pass] = commit.stages.whole.as_secs_f64();
                vertices = commit.meshes.chunks.iter().map(|(_, chunk)| chunk.mesh().vertices.len()).sum();
                terrain.commit(commit).expect("no other commit");
            }
            hashes.push(terrain.world().hash());
        }
        assert_eq!(hashes[0], hashes[1], "the same world");
        if round >= 2 {
            ratios
                .iter_mut()
                .enumerate()
                .for_each(|(pass, ratio)| ratio.push(wholes[0][pass] / wholes[1][pass]));
        }
    }
    header("512 fields");
    for (pass, what) in ["first dig", "dug again"].into_iter().enumerate() {
        cpu[pass].print(&format!("{what}, CPU"));
        cuda[pass].print(&format!("{what}, CUDA"));
        println!("  {what}: CUDA {:.2} times as fast (median of pairs)", ratios[pass].median());
    }
    println!("  {vertices} vertices");
}

/// Large transactions on a new engine: the first one opens the GPU, the next ones measure which backend is faster.
fn moving() {
    let start = std::time::Instant::now();
    let engine = Engine::new(Backend::Auto);
    println!("  a new engine: {:.1?}, {:?}", start.elapsed(), engine.state());
    let level = Level::new();
    for number in 0..10 {
        let mut terrain = level.terrain();
        terrain.submit_all(level.brushes(0, false));
        let before = engine.figures();
        let commit = terrain.begin().expect("queued brushes").run_on(&engine);
        let figures = engine.figures();
        println!(
            "  {:>2}: {:>6.1} ms, {} of {} stages on the GPU; {:?}, {} MiB there, {} MiB pinned",
            number + 1,
            commit.stages.whole.as_secs_f64() * 1e3,
            figures.cuda - before.cuda,
            figures.cuda + figures.cpu - before.cuda - before.cpu,
            engine.state(),
            figures.device_memory >> 20,
            figures.pinned_memory >> 20,
        );
        if number == 1 {
            engine.wait(Duration::from_secs(30));
            println!("  opened and compared in {:.0} ms", engine.figures().opening.as_secs_f64() * 1e3);
        }
    }
}

/// One field meshed as a whole.
fn one_field(engines: &Engines) {
    header("one field");
    for size in [64, 100] {
        let mut samples = [(); 3].map(|()| Times::default());
        let one = threads(1);
        for round in 0..30 {
            let mut discarded = [(); 3].map(|()| Times::default());
            let kept = if round < 6 { &mut discarded } else { &mut samples };
            let dig_all = |who: EngineKind, times: &mut Times| {
                let mut terrain = level::one_field(size, round);
                drop(engines.run(terrain.begin().expect("a queued brush"), who, times));
            };
            for who in turns(round as usize) {
                match who {
                    0 => one.install(|| dig_all(EngineKind::Cpu, &mut kept[0])),
                    1 => dig_all(EngineKind::Cpu, &mut kept[1]),
                    _ => dig_all(EngineKind::Cuda, &mut kept[2]),
                }
            }
        }
        for (times, who) in samples.iter().zip(["1 thread", "CPU", "CUDA"]) {
            times.print(&format!("{size}^3, {who}"));
        }
    }
}

/// Single brushes of radius 4 on dug ground.
fn brush(engines: &Engines, brush: fn(Vec3, f32) -> Brush) {
    header("radius 4");
    let mut times = [(); 3].map(|()| Times::default());
    let mut terrains = [(); 3].map(|()| landscape(32));
    for (round, at) in landscape::Places::new(600).iter().enumerate() {
        for who in turns(round) {
            let (mut discarded, terrain) = (Times::default(), &mut terrains[who]);
            engines.play(terrain, [dig(at, 4.0)], EngineKind::ALL[who], &mut discarded);
            let kept = if round < 102 { &mut discarded } else { &mut times[who] };
            engines.play(terrain, [brush(at + Vec3::splat(2.0), 4.0)], EngineKind::ALL[who], kept);
        }
    }
    assert_same(&terrains);
    for (who, times) in EngineKind::ALL.into_iter().zip(&times) {
        times.print(who.name());
    }
}

/// Transactions of one block to thousands of blocks, on each backend and with `Auto`.
fn sweep(engines: &Engines, brush: fn(Vec3, f32) -> Brush) {
    println!(
        "  {:<28}{:>9}{:>9}{:>9}   us, medians; Auto over the better one",
        "dirty blocks", "CPU", "CUDA", "Auto"
    );
    let (mut worst, mut good, mut rows) = (0.0f64, 0, 0);
    let stages = |figures: &EngineFigures| figures.cpu + figures.cuda;
    let before = engines.auto.figures();
    for count in [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024] {
        let mut times = [(); 3].map(|()| Times::default());
        let mut ratios = Sample::default();
        let mut blocks = 0;
        let mut terrains = [(); 3].map(|()| landscape(32));
        let places: Vec<Vec3> = landscape::Places::new(4096).iter().collect();
        for round in 0..30 {
            let radius = if count == 1 { 1.0 } else { 3.0 };
            let own = || places.iter().cycle().skip(round * count).take(count);
            let brushes = || own().map(|&place| brush(place + Vec3::splat(round as f32 * 0.1), radius));
            let mut taken = [0.0; 3];
            for who in turns(round) {
                let mut discarded = Times::default();
                let kept = if round < 6 { &mut discarded } else { &mut times[who] };
                taken[who] = engines.play(&mut terrains[who], brushes(), EngineKind::ALL[who], kept);
            }
            blocks = engines.auto.figures().choices.back().map_or(blocks, |choice| choice.amount);
            if round >= 6 {
                ratios.push(taken[2] / taken[0].min(taken[1]));
            }
        }
        assert_same(&terrains);
        let [cpu, cuda, auto] = times.each_ref().map(|times| times.whole.median() * 1e6);
        let ratio = auto / cpu.min(cuda);
        worst = worst.max(ratio);
        (good, rows) = (good + u32::from(ratio <= 1.15), rows + 1);
        println!(
            "  {blocks:<28}{cpu:>9.0}{cuda:>9.0}{auto:>9.0}   {ratio:.2}, median of pairs {:.2}",
            ratios.median()
        );
    }
    let after = engines.auto.figures();
    println!("  worst {worst:.2}; {good} of {rows} rows within 1.15");
    println!(
        "  of the stages, the GPU did {} of {}",
        after.cuda - before.cuda,
        stages(&after) - stages(&before)
    );
}
