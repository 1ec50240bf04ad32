//! Coarse cells are split along the diagonal that fits the ground, so ridges are lines and not rows of teeth.

use bevy_burrow::lattice::{Column, SNAP};
use bevy_burrow::lod::Cut;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;

use crate::check::draw;

/// How far the middles of two lines lie from the ground, in 1/256 voxel: of the one along which a cell is split, and of
/// the other one. Of all coarse cells with sides of one length each that have no finer neighbours.
fn misses(world: &World, cut: &Cut) -> Vec<[i64; 2]> {
    let height = |column: Column| i64::from(world.ground().height(column));
    let mut misses = Vec::new();
    for (node, mesh) in draw(world, cut) {
        let (low, stride) = (cut.grid().columns(node).0, node.stride());
        for triangle in mesh.triangles() {
            let places = triangle.map(|vertex| vertex.position.div_euclid(glam::IVec3::splat(SNAP)));
            let columns = places.map(|place| low.offset(place.x, place.z));
            let [mut xs, mut zs] = [columns.map(|column| column.x), columns.map(|column| column.z)];
            xs.sort_unstable();
            zs.sort_unstable();
            if node.level == 0 || xs[2] - xs[0] != stride || zs[2] - zs[0] != stride {
                continue;
            }
            let corners = |x: [i32; 2]| [Column::new(x[0], zs[0]), Column::new(x[1], zs[2])];
            let lines = [corners([xs[0], xs[2]]), corners([xs[2], xs[0]])];
            let middle = height(Column::new(xs[0] + stride / 2, zs[0] + stride / 2));
            let miss = lines.map(|[from, to]| (height(from) + height(to) - 2 * middle).abs());
            let is_split = |line: &[Column; 2]| line.iter().all(|end| columns.contains(end));
            misses.push(if is_split(&lines[0]) { miss } else { [miss[1], miss[0]] });
        }
    }
    misses
}

fn terrain(ground: Ground) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size: 8, ..Default::default() }).expect("valid settings")
}

#[test]
fn each_cell_is_split_along_the_line_that_is_nearer_to_the_ground() {
    let noise = NoiseHeights { seed: 3, scale: 30.0, amplitude: 12.0, ..Default::default() };
    let hills = terrain(Ground::from_noise(160, 160, &noise).expect("valid hills"));
    for level in 1..=3 {
        let cut = Cut::coarsest(hills.world().lod_grid(level));
        let misses = misses(hills.world(), &cut);
        assert!(misses.iter().all(|[split, other]| split <= other), "level {level}");
        let [split, other] = [0, 1].map(|at| misses.iter().map(|miss| miss[at]).sum::<i64>());
        println!("level {level}: {split} in all, along the other lines {other}, {} halves", misses.len());
        assert!(misses.len() > 100 && split * 5 < other * 4, "level {level}: {split} of {other}");
    }
}

/// On a ridge or in a valley that runs over columns, whichever way, nothing is cut off or filled.
#[test]
fn ridges_along_both_diagonals_are_drawn_as_they_are() {
    let shapes: [fn(f64, f64) -> f64; 4] = [
        |x, z| 40.0 - (x - z).abs(),
        |x, z| 40.0 - (x + z - 64.0).abs(),
        |x, z| 10.0 + (x - z).abs(),
        |x, z| 10.0 + (x + z - 64.0).abs(),
    ];
    for (number, shape) in shapes.into_iter().enumerate() {
        let ground = Ground::from_fn(64, 64, |x, z| shape(f64::from(x), f64::from(z)));
        let terrain = terrain(ground.expect("valid heights"));
        for level in 1..=3 {
            let misses = misses(terrain.world(), &Cut::coarsest(terrain.world().lod_grid(level)));
            assert!(misses.iter().all(|miss| miss[0] == 0), "ridge {number}, level {level}");
            assert!(misses.iter().any(|miss| miss[1] > 0), "ridge {number}, level {level} is level ground");
        }
    }
}
