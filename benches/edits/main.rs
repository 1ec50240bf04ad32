//! What edits cost: `cargo bench --no-default-features --bench edits [-- SECTION...]`.
//!
//! Everything on the landscape that ships with the crate, a transaction at a time, on one thread unless said otherwise.
//! Each section prints medians and 99th percentiles; what is compared runs in turns, and its ratio is the median of
//! pairs.

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
use landscape::{Places, dig, landscape, one_thread};
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

fn main() {
    // Cargo itself passes `--bench`.
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

/// One brush a transaction, by its radius, on ground that nobody touched and beside what is dug already.
fn by_radius() {
    stages::header("brush");
    for radius in [2.0, 4.0, 8.0, 16.0] {
        one_thread(|| {
            let mut terrain = landscape(32);
            for (ground, offset) in [("fresh", 0.0), ("dug", 3.0)] {
                let places = Places::new(200);
                let digs =
                    places.iter().map(|at| Brush::dig(Shape::sphere(at + Vec3::splat(offset), radius)));
                stages::row(&format!("radius {radius}, {ground} ground"), &stages::play(&mut terrain, digs));
            }
        });
    }
}

/// The same brushes, by chunk size.
fn by_chunk_size() {
    stages::header("radius 4, dug ground");
    for chunk_size in [8, 25, 32, 50, 75, 100, 128] {
        one_thread(|| {
            let mut terrain = landscape(chunk_size);
            for offset in [0.0, 3.0] {
                let places = Places::new(300);
                let digs = places.iter().map(|at| Brush::dig(Shape::sphere(at + Vec3::splat(offset), 4.0)));
                let played = stages::play(&mut terrain, digs);
                if offset > 0.0 {
                    stages::row(&format!("chunk size {chunk_size}"), &played);
                }
            }
        });
    }
}

/// Many brushes in one transaction: all over the landscape, and all in one place.
fn by_batch() {
    header("radius 4, by brushes in a transaction", "an edit");
    for (kind, spread) in [("all over", true), ("in one place", false)] {
        for count in [1, 10, 100, 1000] {
            one_thread(|| {
                let mut each = Sample::default();
                for round in 0..(2000 / count).clamp(3, 40) {
                    let mut terrain = landscape(32);
                    let places = Places::new(count).offset(round);
                    let center = Places::new(1).offset(round).iter().next().unwrap_or_default();
                    for (i, place) in (0..).zip(places.iter()) {
                        let near =
                            Vec3::new((i * 7 % 13) as f32, (i * 5 % 7) as f32, (i * 3 % 11) as f32) * 0.3;
                        terrain.submit(&dig(if spread { place } else { center + near }, 4.0));
                    }
                    let start = Instant::now();
                    let commit = terrain.begin().map(|transaction| transaction.run());
                    each.push(start.elapsed().as_secs_f64() / count as f64);
                    assert!(commit.is_some_and(|commit| !commit.meshes.chunks.is_empty()));
                }
                row(&format!("{count} {kind}"), &each);
            });
        }
    }
}

/// Hiding the heightmap: the list of indices of a tile, by its size.
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
