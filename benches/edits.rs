//! What one edit costs: `cargo bench --no-default-features --bench edits`.
//!
//! Radius-4 spheres on the real landscape, one transaction each, on one thread: dug all over fresh ground, and again
//! beside what is dug already. Then the index list of a touched tile. Medians and 99th percentiles of many.

use std::time::{Duration, Instant};

use bevy_burrow::ground::{GreyImage, Ground, ImageLimits, ImageScale};
use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::tile;
use glam::Vec3;

/// A percentile of durations, in microseconds.
fn percentile(sorted: &[Duration], share: f64) -> f64 {
    let at = ((sorted.len() - 1) as f64 * share).round() as usize;
    sorted[at].as_secs_f64() * 1e6
}

fn report(what: &str, mut durations: Vec<Duration>) {
    durations.sort_unstable();
    let [median, high, most] = [0.5, 0.99, 1.0].map(|share| percentile(&durations, share));
    println!(
        "{what:<58} median {median:9.1} us   p99 {high:9.1} us   max {most:9.1} us   n {}",
        durations.len()
    );
}

fn main() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/jacksboro_fault.png");
    let bytes = std::fs::read(path).expect("the shipped elevation model can be read");
    let image = GreyImage::decode_png(&bytes, &ImageLimits::default()).expect("a grey PNG");
    let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    pool.install(|| {
        for chunk_size in [25, 32, 100] {
            let ground = Ground::from_image(&image, &scale).expect("valid ground");
            let settings = TerrainSettings { chunk_size, ..Default::default() };
            let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
            println!("chunk size {chunk_size}");
            for (name, offset) in [("first dig, transaction", 0.0), ("beside it, transaction", 3.0)] {
                let (mut transactions, mut commits, mut receipts) = (Vec::new(), Vec::new(), Vec::new());
                for i in 0..400 {
                    let (x, z) = (40 + i * 389 % 1100, 40 + i * 211 % 940);
                    let height = terrain.world().ground().height(Column::new(x, z)) as f32 / 256.0;
                    let center = Vec3::new(x as f32 + offset, height, z as f32 + offset);
                    terrain.submit(&Brush::dig(Shape::sphere(center, 4.0)));
                    let start = Instant::now();
                    let commit = terrain.begin().expect("a brush waits").run();
                    transactions.push(start.elapsed());
                    let start = Instant::now();
                    receipts.extend(terrain.commit(commit).expect("nothing else commits"));
                    commits.push(start.elapsed());
                }
                let dug: u64 =
                    receipts.iter().flat_map(|r| &r.outcome).map(|applied| applied.removed.total()).sum();
                report(name, transactions);
                report("  commit to the model", commits);
                println!("  {:.0} voxels removed per dig", dug as f64 / receipts.len() as f64);
            }
            let mut lists = Vec::new();
            for cell in terrain.world().mask().iter().step_by(37) {
                let view = terrain.world().view();
                let touched = terrain.world().grid().tile_of_cell(cell);
                let rings = tile::Rings::new(&view, touched, &tile::borders(&view, touched));
                let start = Instant::now();
                let indices = tile::indices(view.grid, touched, &tile::borders(&view, touched), &rings);
                lists.push(start.elapsed());
                assert!(!indices.is_empty());
            }
            report("index list of a touched tile", lists);
            println!("  {:?}", terrain.world().memory());
        }
    });
}
