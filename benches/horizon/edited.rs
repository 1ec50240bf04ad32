//! Time to mesh a node at each level of detail: without edits, with a few, and with craters everywhere.

use std::time::Instant;

use bevy_burrow::lattice::Column;
use bevy_burrow::lod::{Cut, Node};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use glam::Vec3;

/// Microseconds to mesh a node, the least of several means, and its triangles.
fn time(world: &World, cut: &Cut, node: Node) -> (f64, usize) {
    let mean = || {
        let start = Instant::now();
        (0..50).for_each(|_| drop(std::hint::black_box(world.node_mesh(cut, node))));
        start.elapsed().as_secs_f64() * 1e6 / 50.0
    };
    let least = (0..8).map(|_| mean()).fold(f64::INFINITY, f64::min);
    (least, world.node_mesh(cut, node).indices.len() / 3)
}

/// Prints microseconds and triangles of a mesh for nodes of levels 0 to 3.
pub fn nodes() {
    println!();
    let noise = NoiseHeights { seed: 3, scale: 200.0, amplitude: 60.0, ..Default::default() };
    let ground = Ground::from_noise(1024, 1024, &noise).expect("valid hills");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    // A node of level 1 between finer and coarser ones.
    let one = Node { level: 1, x: 5, z: 4 };
    let split = Node { level: 1, x: 4, z: 4 };
    let cut = Cut::new(terrain.world().lod_grid(3), |node| node.covers(split));
    let nodes =
        [Node { level: 0, x: 9, z: 8 }, one, Node { level: 2, x: 3, z: 2 }, Node { level: 3, x: 3, z: 3 }];
    let times = |terrain: &Terrain, what: &str| {
        for node in nodes {
            assert!(cut.contains(node), "{node:?}");
            let (micros, triangles) = time(terrain.world(), &cut, node);
            println!("{what}, level {}: {micros:.1} us, {triangles} triangles", node.level);
        }
    };
    times(&terrain, "no edits");
    let ball = |terrain: &Terrain, x: i32, z: i32, radius: f32, down: f32| {
        let height = terrain.world().ground().height(Column::new(x, z)) as f32 / 256.0;
        Brush::dig(Shape::sphere(Vec3::new(x as f32, height - down, z as f32), radius))
    };
    // Within nodes, over the border between levels 0 and 1, and a cave.
    let places = [
        (350, 280, 8.0, 0.0),
        (320, 300, 6.0, 0.0),
        (420, 310, 8.0, 0.0),
        (900, 880, 20.0, 0.0),
        (345, 300, 6.0, 40.0),
    ];
    let brushes = places.map(|(x, z, radius, down)| ball(&terrain, x, z, radius, down));
    terrain.apply(brushes);
    times(&terrain, "some edits");
    let many: Vec<Brush> =
        (0..1600).map(|at| ball(&terrain, 12 + at % 40 * 25, 12 + at / 40 * 25, 9.0, 0.0)).collect();
    terrain.apply(many);
    times(&terrain, "craters everywhere");
}
