//! The cost of edits: `cargo bench --no-default-features --bench edits [-- SECTION...]`.
//!
//! Everything runs on the shipped landscape, one transaction at a time, on one thread unless stated otherwise. Each
//! section prints medians and 99th percentiles. Compared cases run in turns, and their ratio is the median of pairs.

mod beside_peer;
mod landscape;
mod loose;
mod stages;
mod statistics;
mod threads;

use std::time::Instant;

use bevy_burrow::prelude::*;
use bevy_burrow::surface::tile::{self, Rings};
use glam::Vec3;
use landscape::{Places, dig, landscape, one_thread, submit};
use stages::{Played, run};
use statistics::{Sample, header, row};

const SECTIONS: [(&str, fn()); 7] = [
    ("radius", by_radius),
    ("chunk-size", by_chunk_size),
    ("batch", by_batch),
    ("peer", beside_peer::section),
    ("threads", threads::section),
    ("tiles", index_lists),
    ("loose", loose::section),
];

/// Frees a large block of memory, like programs that have loaded an image. From then on glibc keeps what a
/// transaction frees; before, it sometimes returns that memory to the system, and the next transaction has to request
/// it again.
fn warm_allocator() {
    drop(std::hint::black_box(vec![0_u8; 24 << 20]));
}

fn main() {
    warm_allocator();
    // Cargo passes `--bench`.
    let wanted: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect();
    if let Some(unknown) = wanted.iter().find(|name| !SECTIONS.iter().any(|(known, _)| known == name)) {
        eprintln!("no section {unknown}; there are {:?}", SECTIONS.map(|(name, _)| name));
        std::process::exit(2);
    }
    for (name, run) in SECTIONS {
        if wanted.is_empty() || wanted.iter().any(|wanted| wanted == name) {
            println!("\n{name}");
            run();
        }
    }
}

/// One brush per transaction, by its radius, on fresh ground and on dug ground.
fn by_radius() {
    stages::header("brush");
    one_thread(|| {
        let mut terrains = [2.0, 4.0, 8.0, 16.0].map(|radius| (radius, landscape(32)));
        for (ground, offset) in [("fresh", 0.0), ("dug", 3.0)] {
            for (radius, played) in in_turns(&mut terrains, Places::new(200), offset, |&radius| radius) {
                stages::row(&format!("radius {radius}, {ground} ground"), &played);
            }
        }
    });
}

/// Equal brushes, by chunk size.
fn by_chunk_size() {
    stages::header("radius 4, dug ground");
    one_thread(|| {
        let mut terrains = [8, 25, 32, 50, 75, 100, 128].map(|size| (size, landscape(size)));
        in_turns(&mut terrains, Places::new(300), 0.0, |_| 4.0);
        for (chunk_size, played) in in_turns(&mut terrains, Places::new(300), 3.0, |_| 4.0) {
            stages::row(&format!("chunk size {chunk_size}"), &played);
        }
    });
}

/// Digs at each place in all terrains in turns, beginning with another terrain each time.
fn in_turns<T: Copy>(
    terrains: &mut [(T, Terrain)],
    places: Places,
    offset: f32,
    radius: impl Fn(&T) -> f32,
) -> Vec<(T, Played)> {
    let mut played: Vec<_> = terrains.iter().map(|&(which, _)| (which, Played::default())).collect();
    for (turn, place) in places.iter().enumerate() {
        for at in 0..terrains.len() {
            let at = (at + turn) % terrains.len();
            let (which, terrain) = &mut terrains[at];
            played[at].1.play(terrain, &dig(place + Vec3::splat(offset), radius(which)));
        }
    }
    played
}

/// Many brushes in one transaction: spread over the landscape, and all in one place.
fn by_batch() {
    header("radius 4, by brushes in a transaction", "an edit");
    let kinds = [("all over", true), ("in one place", false)];
    let cases = kinds.into_iter().flat_map(|kind| [1, 10, 100, 1000].map(|count| (kind, count)));
    let mut all: Vec<_> = cases.map(|case| (case, Sample::default())).collect();
    one_thread(|| {
        for round in 0..30 {
            for turn in 0..all.len() {
                let at = (turn + round) % all.len();
                let (((_, is_spread), count), each) = &mut all[at];
                let twice = [0, 1].map(|_| {
                    let mut terrain = landscape(32);
                    submit(&mut terrain, *count, round, *is_spread);
                    run(&mut terrain)
                });
                // The first run warms the caches, which another case has used.
                each.push(twice[1] / *count as f64);
            }
        }
    });
    for (((kind, _), count), each) in &all {
        row(&format!("{count} {kind}"), each);
    }
}

/// Rebuilding the index list of a tile that hides the dug cells, by tile size.
fn index_lists() {
    header("a tile's index list", "a list");
    for chunk_size in [25, 32, 50, 75, 100, 128] {
        let mut terrain = landscape(chunk_size);
        terrain.apply(Places::new(400).iter().map(|at| dig(at, 4.0)));
        let (world, mut lists, mut rings) = (terrain.world(), Sample::default(), Sample::default());
        let view = world.view();
        for cell in world.mask().iter().step_by(61) {
            let touched = world.grid().tile_of_cell(cell);
            let start = Instant::now();
            let borders = tile::borders(&view, touched);
            let all = Rings::new(&view, touched, &borders);
            rings.push(start.elapsed().as_secs_f64());
            let start = Instant::now();
            let indices = tile::indices(world.grid(), touched, &borders, &all);
            lists.push(start.elapsed().as_secs_f64());
            assert!(!indices.is_empty());
        }
        row(&format!("chunk size {chunk_size}, list"), &lists);
        row(&format!("chunk size {chunk_size}, all rings from nothing"), &rings);
    }
}
