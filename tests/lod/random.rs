//! Random worlds, random cuts of them, and edits at the faces and corners of their nodes.

use bevy_burrow::lattice::{Column, TilePos};
use bevy_burrow::lod::{Cut, Node};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::Vec3;

use crate::worlds::{any_random_brush, random_ground_of_size, random_rules};

/// Runs a check on each of some random worlds, on all threads.
pub fn for_worlds(count: u64, check: impl Fn(u64, &Terrain, &Cut) + Sync) {
    let threads = std::thread::available_parallelism().map_or(2, |n| n.get() as u64);
    std::thread::scope(|scope| {
        for thread in 0..threads {
            let check = &check;
            scope.spawn(move || {
                for index in (thread..count).step_by(threads as usize) {
                    let (terrain, cut) = random_world(index);
                    check(index, &terrain, &cut);
                }
            });
        }
    });
}

/// A random world of several tiles, edited anywhere and where nodes meet, and a cut of it.
pub fn random_world(index: u64) -> (Terrain, Cut) {
    let mut rng = Rng::with_seed(index ^ 0x1e_7e15);
    // Seldom multiples of a stride. Five levels take more than 16 tiles.
    let (chunk_size, sides) = [(8, 30..=150), (25, 30..=140), (32, 40..=150)][rng.usize(0..3)].clone();
    let [width, depth] = [(); 2].map(|()| rng.u32(sides.clone()));
    let ground = random_ground_of_size(&mut rng, index, width, depth);
    let mut terrain =
        Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings");
    let grid = terrain.world().lod_grid(5);
    let cut = Cut::random(grid, rng.u64(..), rng.u64(10..85));
    if index % 7 == 6 {
        let rules = random_rules(&mut rng, terrain.world().ground());
        terrain.set_rules(rules).expect("valid rules");
    }
    if index % 5 == 2 {
        terrain.set_loose(Some(LooseSettings { largest: 4000, crumbs: 20, debris: 4000 }));
    }
    for _ in 0..rng.u32(1..4) {
        let brushes = random_brushes(&mut rng, &terrain, &cut);
        terrain.apply(brushes);
    }
    (terrain, cut)
}

/// Edits of all kinds, anywhere, over faces and corners of nodes, and at the rim.
pub fn random_brushes(rng: &mut Rng, terrain: &Terrain, cut: &Cut) -> Vec<Brush> {
    let ground = terrain.world().ground();
    let count = rng.u32(0..5);
    let mut brushes: Vec<Brush> = (0..count).map(|_| any_random_brush(rng, ground)).collect();
    for _ in 0..rng.u32(0..6) {
        brushes.push(seam_brush(rng, ground, cut));
    }
    brushes
}

/// A brush over a corner of a random node, or over a face of it; some over the rim.
fn seam_brush(rng: &mut Rng, ground: &Ground, cut: &Cut) -> Brush {
    let nodes = sorted(cut.nodes());
    let (low, high) = cut.grid().columns(nodes[rng.usize(0..nodes.len())]);
    let (mut x, mut z) = ([low.x, high.x][rng.usize(0..2)], [low.z, high.z][rng.usize(0..2)]);
    match rng.u32(0..5) {
        0 | 1 => x = rng.i32(0..=ground.width()),
        2 => z = rng.i32(0..=ground.depth()),
        _ => {}
    }
    if rng.u32(0..4) == 0 {
        x = ground.width();
    }
    let above = [-6.0, -2.0, -0.3, 0.0, 1.5, 4.0][rng.usize(0..6)];
    let y = ground.height(Column::new(x, z)) as f32 / 256.0 + above;
    let radius = [1.2, 2.0, 3.7, 6.0, 9.0][rng.usize(0..5)];
    let shape = Shape::sphere(Vec3::new(x as f32, y, z as f32), radius);
    match rng.u32(0..5) {
        0 | 1 => Brush::dig(shape),
        2 => Brush::paint(shape, MaterialId(6)),
        3 => Brush::smooth(shape, 1.0),
        _ => Brush::add(shape, MaterialId(5)),
    }
}

/// Nodes in order.
pub fn sorted(nodes: impl Iterator<Item = Node>) -> Vec<Node> {
    let mut nodes: Vec<Node> = nodes.collect();
    nodes.sort_unstable();
    nodes
}

/// The cut with one more node split, an edited one if there is one, and that node; `None` if none can be split.
pub fn split_once(rng: &mut Rng, terrain: &Terrain, cut: &Cut) -> Option<(Cut, Node)> {
    let mut nodes = sorted(cut.nodes().filter(|node| node.level > 0));
    rng.shuffle(&mut nodes);
    nodes.sort_by_key(|&node| !terrain.world().has_edits(cut.grid(), node));
    nodes.into_iter().find_map(|node| {
        let finer = Cut::new(cut.grid(), |other| cut.is_split(other) || other == node);
        let before = cut.nodes().filter(|&other| !finer.contains(other)).count();
        (before == 1).then_some((finer, node))
    })
}

/// The level of the nodes around a column: -x -z, +x -z, -x +z, +x +z.
pub fn levels_around(cut: &Cut, x: i32, z: i32) -> [Option<u8>; 4] {
    let grid = cut.grid().chunks();
    [(-1, -1), (0, -1), (-1, 0), (0, 0)].map(|(dx, dz)| {
        let cell = Column::new(x + dx, z + dz);
        let tile: Option<TilePos> = grid.has_cell(cell).then(|| grid.tile_of_cell(cell));
        tile.and_then(|tile| cut.node_at(tile)).map(|node| node.level)
    })
}
