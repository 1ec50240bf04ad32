//! What grows with the edits of a world: `cargo bench --no-default-features --features store --bench growth`; with the
//! frames of an app, `cargo bench --features examples --bench growth`.
//!
//! Worlds with 10,000, 100,000 and 1,000,000 edited bricks, at the same density. Each is made and measured in a process
//! of its own, so that memory is that of one world: digs of radius 4, one after the other in tunnels, alone and with
//! levels of detail; bytes; saving and opening. The last line has the slopes of logarithms between the smallest and the
//! largest world: 0 for what does not grow, 1 for what grows in proportion. Then 100,000 digs in one landscape, with
//! meshes and without.
//!
//! ```text
//! growth [BRICKS...]       these worlds only
//! growth digs [COUNT]      the digs only
//! ```

#[cfg(feature = "plugin")]
mod app;

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy_burrow::ground::{GreyImage, ImageLimits, ImageScale};
use bevy_burrow::lattice::Column;
use bevy_burrow::lod::{Cut, LodSettings, View, Viewpoint};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{Store, StoreOptions};
use bevy_burrow::terrain::{ChooseCut, KnownNodes, Meshing};
use fastrand::Rng;
use glam::Vec3;

/// Edited bricks of the worlds.
const SIZES: [usize; 3] = [10_000, 100_000, 1_000_000];

/// Tunnels that are measured, and digs in each.
const TUNNELS: usize = 16;
const DIGS: usize = 40;

/// Bytes of a mebibyte.
const MIB: f64 = (1 << 20) as f64;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["world", bricks] => return print_world(bricks.parse().expect("a number of bricks")),
        ["dug", count, meshing] => return print_digs(count.parse().expect("a number of digs"), meshing),
        ["digs", ..] => return digs(args.get(1).map_or("100000", String::as_str)),
        _ => {}
    }
    let given: Vec<usize> = args.iter().filter_map(|arg| arg.parse().ok()).collect();
    let sizes = if given.is_empty() { SIZES.to_vec() } else { given };
    println!("| | {} |", COLUMNS.join(" | "));
    println!("| --- |{}", " --- |".repeat(COLUMNS.len()));
    let rows: Vec<Vec<f64>> = sizes.iter().map(|bricks| child(&["world", &bricks.to_string()])).collect();
    for (bricks, row) in sizes.iter().zip(&rows) {
        println!("| {bricks} bricks | {} |", cells(row, 1));
    }
    if let ([few, .., many], [first, .., last]) = (&sizes[..], &rows[..]) {
        let slope = |(a, b): (&f64, &f64)| (b / a).ln() / (*many as f64 / *few as f64).ln();
        println!("| slope | {} |", cells(&first.iter().zip(last).map(slope).collect::<Vec<_>>(), 2));
    }
    if args.is_empty() {
        digs("100000");
    }
}

fn cells(row: &[f64], digits: usize) -> String {
    row.iter().map(|figure| format!("{figure:.digits$}")).collect::<Vec<_>>().join(" | ")
}

/// The figures that this program prints in a process of its own.
fn child(args: &[&str]) -> Vec<f64> {
    let own = std::env::current_exe().expect("this program has a path");
    let output = Command::new(own).args(args).stderr(Stdio::inherit()).output().expect("it starts");
    assert!(output.status.success(), "{args:?} failed");
    let text = String::from_utf8(output.stdout).expect("it prints text");
    text.split_whitespace().map(|figure| figure.parse().expect("a figure")).collect()
}

const COLUMNS: [&str; if cfg!(feature = "plugin") { 12 } else { 10 }] = [
    "transaction, us",
    "commit, us",
    "p99",
    "levels after it, us",
    "Terrain::memory, MiB",
    "of it meshes",
    "resident",
    "save a dig, ms",
    "checkpoint after 200 digs, ms",
    "open, ms",
    #[cfg(feature = "plugin")]
    "plugin on the main thread, us",
    #[cfg(feature = "plugin")]
    "p99",
];

/// Median and 99th percentile in microseconds.
fn percentiles(mut times: Vec<Duration>) -> [f64; 2] {
    times.sort_unstable();
    [0.5, 0.99].map(|share| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6)
}

/// Resident memory of the process in bytes, where the system reports it.
fn resident() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or_default();
    line.trim().trim_end_matches(" kB").parse().unwrap_or(0.0) * 1024.0
}

/// A place in the ground, at most `depth` voxels deep.
fn place(ground: &Ground, rng: &mut Rng, depth: f32) -> Vec3 {
    let [x, z] = [ground.width(), ground.depth()].map(|width| rng.f32() * (width - 32) as f32 + 16.0);
    let height = ground.height(Column::new(x as i32, z as i32)) as f32 / 256.0;
    Vec3::new(x, height - rng.f32() * depth, z)
}

/// A ground as wide as needed for four edited bricks below each 8 x 8 columns.
fn hills(bricks: usize) -> Arc<Ground> {
    let side = (((bricks as f64).sqrt() * 4.0) as u32 / 32 * 32).max(128);
    let noise = NoiseHeights { seed: 5, octaves: 5, scale: 200.0, amplitude: 60.0, ..Default::default() };
    Arc::new(Ground::from_noise(side, side, &noise).expect("a valid size"))
}

/// A terrain with at least this many edited bricks.
fn edited(ground: &Arc<Ground>, bricks: usize, rng: &mut Rng) -> Terrain {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    while terrain.world().bricks().count() < bricks {
        for _ in 0..bricks.div_ceil(4000).max(4) {
            let brush = |_| Brush::dig(Shape::sphere(place(ground, rng, 60.0), 5.0));
            let brushes: Vec<Brush> = (0..50).map(brush).collect();
            terrain.apply(brushes);
        }
    }
    terrain
}

/// Tunnels: lists of places that follow each other.
fn tunnels(ground: &Ground, rng: &mut Rng) -> Vec<Vec<Vec3>> {
    let tunnel = |_| {
        let start = place(ground, rng, 20.0);
        (0..DIGS).map(|at| start + Vec3::new(at as f32 * 2.0, at as f32 * -0.5, at as f32 * 0.7)).collect()
    };
    (0..TUNNELS).map(tunnel).collect()
}

/// Prints the figures of a world.
fn print_world(bricks: usize) {
    let mut rng = Rng::with_seed(7);
    let ground = hills(bricks);
    let mut terrain = edited(&ground, bricks, &mut rng);
    // As left by the edits, before anything else is there.
    let (memory, resident) = (terrain.memory(), resident());
    let (mut transactions, mut commits) = (Vec::new(), Vec::new());
    for tunnel in tunnels(&ground, &mut rng) {
        for (number, at) in tunnel.into_iter().enumerate() {
            let (transaction, commit) = dig(&mut terrain, at);
            if number > 0 {
                transactions.push(transaction);
                commits.push(commit);
            }
        }
    }
    let ([transaction, _], [commit, p99]) = (percentiles(transactions), percentiles(commits));
    let mut row = vec![transaction, commit, p99, levels(&mut terrain, &ground, &mut rng)];
    row.extend([memory.total() as f64, memory.meshes as f64, resident].map(|bytes| bytes / MIB));
    row.extend(save_and_open(&mut terrain, &ground, &mut rng));
    #[cfg(feature = "plugin")]
    row.extend(app::main_thread(terrain, &ground, &mut rng));
    println!("{}", row.iter().map(f64::to_string).collect::<Vec<_>>().join(" "));
}

/// Digs once; returns the times of the transaction and of the commit.
fn dig(terrain: &mut Terrain, at: Vec3) -> (Duration, Duration) {
    terrain.submit(Brush::dig(Shape::sphere(at, 4.0)));
    let transaction = terrain.begin().expect("a dig waits");
    let start = Instant::now();
    let commit = transaction.run();
    let ran = start.elapsed();
    let start = Instant::now();
    terrain.commit(commit).expect("the one under way");
    (ran, start.elapsed())
}

/// Microseconds, in the median, to choose levels again after a dig, for an eye in the middle of the world.
fn levels(terrain: &mut Terrain, ground: &Ground, rng: &mut Rng) -> f64 {
    let middle = ground.width() as f32 / 2.0;
    let position = Vec3::new(middle, 80.0, middle);
    let eye = Viewpoint { position, velocity: Vec3::ZERO, pixels: 1000.0, view: View::Perspective };
    let (known, choice) = (KnownNodes::default(), LodSettings::default());
    let (drawn, _) = terrain.world().draw_cut(Cut::coarsest(terrain.world().lod_grid(u8::MAX)));
    terrain.set_drawn_cut(Some(Arc::new(drawn)));
    let choose: Arc<ChooseCut> = Arc::new(move |world, cut| known.next_cut(world, cut, &choice, &[eye], 64));
    // The time, and whether anything changed.
    let cut = |terrain: &mut Terrain| {
        let transaction = terrain.begin_cut(Arc::clone(&choose)).expect("none is under way");
        let start = Instant::now();
        let commit = transaction.run();
        let took = start.elapsed();
        let is_changed = !commit.meshes.nodes.is_empty();
        terrain.commit(commit).expect("the one under way");
        (took, is_changed)
    };
    while cut(terrain).1 {}
    let mut times = Vec::new();
    for at in tunnels(ground, rng).into_iter().flat_map(|tunnel| tunnel.into_iter().take(5)) {
        dig(terrain, at);
        let (took, is_changed) = cut(terrain);
        times.extend((!is_changed).then_some(took));
        while cut(terrain).1 {}
    }
    terrain.set_drawn_cut(None);
    percentiles(times)[0]
}

/// Milliseconds until a dig is durable, until a checkpoint after 200 digs is, and until the world is opened again.
fn save_and_open(terrain: &mut Terrain, ground: &Arc<Ground>, rng: &mut Rng) -> [f64; 3] {
    let place = std::env::temp_dir().join(format!("bevy_burrow_growth_{}", std::process::id()));
    let options = StoreOptions {
        loss_window: Duration::ZERO,
        checkpoint_commits: u64::MAX,
        checkpoint_after: Duration::from_secs(3600),
        ..StoreOptions::default()
    };
    let mut store = Store::create(&place, terrain, options.clone()).expect("a new world");
    store.checkpoint().expect("the disk works");
    let mut digs = Vec::new();
    for at in tunnels(ground, rng).into_iter().flatten().take(200) {
        dig(terrain, at);
        let start = Instant::now();
        store.follow(terrain).expect("the thread runs");
        store.flush().expect("the disk works");
        digs.push(start.elapsed());
    }
    let start = Instant::now();
    store.checkpoint().expect("the disk works");
    let checkpoint = start.elapsed();
    drop(store);
    terrain.keep_log(None);
    let start = Instant::now();
    let (_, opened) = Store::open(&place, Arc::clone(ground), options).expect("it opens");
    let open = start.elapsed();
    assert_eq!(opened.terrain.world().hash(), terrain.world().hash());
    std::fs::remove_dir_all(&place).expect("it is there");
    [percentiles(digs)[0] / 1e3, checkpoint.as_secs_f64() * 1e3, open.as_secs_f64() * 1e3]
}

/// Prints what `count` digs leave behind, with meshes and without.
fn digs(count: &str) {
    println!(
        "\n| {count} digs of radius 4 | Terrain::memory, MiB | of it samples | meshes and rings | undo | resident more |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for meshing in ["All", "Never"] {
        println!("| `Meshing::{meshing}` | {} |", cells(&child(&["dug", count, meshing]), 0));
    }
}

/// Prints the memory after digs all over the real landscape.
fn print_digs(count: usize, meshing: &str) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/jacksboro_fault.png");
    let bytes = std::fs::read(path).expect("the shipped elevation model can be read");
    let image = GreyImage::decode_png(&bytes, &ImageLimits::default()).expect("a grey PNG");
    let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
    let ground = Arc::new(Ground::from_image(&image, &scale).expect("valid ground"));
    drop((bytes, image));
    let mut terrain = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings");
    if meshing == "Never" {
        terrain.set_meshing(Meshing::Never);
    }
    let before = resident();
    let mut rng = Rng::with_seed(11);
    for _ in 0..count {
        terrain.apply([Brush::dig(Shape::sphere(place(&ground, &mut rng, 8.0), 4.0))]);
    }
    let (memory, resident) = (terrain.memory(), resident() - before);
    let row = [memory.total() - memory.ground, memory.samples, memory.meshes + memory.parts, memory.undo];
    let row: Vec<String> = row.iter().map(|&bytes| (bytes as f64 / MIB).to_string()).collect();
    println!("{} {}", row.join(" "), resident / MIB);
}
