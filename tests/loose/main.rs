//! Loose pieces: exactly the pieces that a dig cuts off are found, and they are removed in the same edit.

mod budget;
mod history;
mod pieces;
#[path = "../worlds/mod.rs"]
mod worlds;

use std::collections::{BTreeMap, BTreeSet};

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{IVec3, Vec3};
use worlds::{
    any_random_brush, random_brush, random_brush_at_a_face, random_ground, random_rules,
    random_sculpting_brush, world_count,
};

const STEPS: [IVec3; 6] = [IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z];

type Point = [i32; 3];

/// The samples of a piece, sorted.
type Piece = BTreeSet<Point>;

/// All loose pieces of a world by a flood fill sample by sample: the components that do not reach the bottom, which
/// lies below all edits and the whole surface.
fn by_brute_force(world: &World) -> Vec<Piece> {
    let samples = world.samples();
    let (low, high) = world.ground().height_range();
    let edited = world.bricks().map(|(pos, _)| pos.samples());
    let rows =
        LatticeBox { min: IVec3::Y * (low.div_euclid(256) - 1), max: IVec3::Y * (high.div_euclid(256) + 1) };
    let around = edited.fold(rows, |all, brick| all.union(brick)).grown(1);
    let (width, depth) = (world.grid().width(), world.grid().depth());
    let all = LatticeBox { min: IVec3::new(0, around.min.y, 0), max: IVec3::new(width, around.max.y, depth) };
    let size = all.size();
    let index = |p: IVec3| {
        let at = p - all.min;
        ((at.y * size.z + at.z) * size.x + at.x) as usize
    };
    let mut solid: Vec<bool> = all.points().map(|point| samples.is_solid(point)).collect();
    let mut pieces = Vec::new();
    // First the component connected to the bottom, then the others.
    for start in all.points() {
        if !solid[index(start)] {
            continue;
        }
        let (mut open, mut piece) = (vec![start], Piece::new());
        solid[index(start)] = false;
        while let Some(point) = open.pop() {
            piece.insert(point.to_array());
            for near in STEPS.map(|step| point + step) {
                if all.contains(near) && std::mem::take(&mut solid[index(near)]) {
                    open.push(near);
                }
            }
        }
        if piece.iter().all(|point| point[1] > all.min.y) {
            pieces.push(piece);
        }
    }
    pieces
}

fn samples_of(piece: &LoosePiece) -> Piece {
    let along = |x: u32, start: IVec3| (start + IVec3::X * x as i32).to_array();
    piece.runs.iter().flat_map(|run| (0..run.len).map(move |x| along(x, run.start))).collect()
}

/// Checks the figures that a piece reports about itself.
fn check_piece(world: &World, piece: &LoosePiece, what: &str) {
    let samples = samples_of(piece);
    assert_eq!(piece.voxels, samples.len() as u64, "{what}");
    assert_eq!(piece.runs.iter().map(|run| u64::from(run.len)).sum::<u64>(), piece.voxels, "{what}");
    let points = || samples.iter().map(|&point| IVec3::from_array(point));
    let bounds = points().map(LatticeBox::point).reduce(LatticeBox::union);
    assert_eq!(Some(piece.bounds), bounds, "{what}");
    let mut counts: BTreeMap<MaterialId, u64> = BTreeMap::new();
    points().for_each(|point| *counts.entry(world.samples().material(point)).or_default() += 1);
    assert_eq!(piece.materials.iter().collect::<BTreeMap<_, _>>(), counts, "{what}");
}

/// Edits that leave many loose pieces: rough digs, thin walls, cut balls in the air, and anything else on top of these.
fn crumbling_brush(rng: &mut Rng, ground: &Ground, chunk_size: u32) -> Brush {
    let brush = match rng.u32(0..12) {
        0 => random_brush_at_a_face(rng, ground, chunk_size),
        9.. => any_random_brush(rng, ground),
        1 => {
            // A horizontal cut through hills and everything above them.
            let (low, high) = ground.height_range();
            let y = (low as f32 + (high - low) as f32 * rng.f32()) / 256.0 + rng.f32() * 6.0;
            let middle = Vec3::new(ground.width() as f32, 2.0 * y, ground.depth() as f32) / 2.0;
            let half = Vec3::new(middle.x.min(40.0) + 1.0, 1.1, middle.z.min(40.0) + 1.0);
            let slab = Shape::cuboid(middle, half);
            if rng.bool() { Brush::dig(slab) } else { Brush::level(slab, y - 2.0).with_falloff(0.0) }
        }
        2 => random_sculpting_brush(rng, ground),
        3 => {
            let shape = random_brush(rng, ground).shape;
            Brush { shape, ..random_sculpting_brush(rng, ground) }
        }
        _ => random_brush(rng, ground),
    };
    if rng.u32(0..3) > 0 {
        return brush;
    }
    brush.with_roughness(Roughness::new(rng.f32() * 4.0, 1.0 + rng.f32() * 3.0, rng.u32(..)))
}

fn small_world(rng: &mut Rng, index: u64) -> (Ground, u32) {
    if index.is_multiple_of(8) {
        return random_ground(rng, index);
    }
    let (width, depth) = (rng.u32(6..30), rng.u32(6..30));
    let steep = [0.0, 0.4, 2.0][rng.usize(0..3)];
    let rough = rng.f64() * 4.0;
    let seed = rng.u64(..);
    let height = |x: i32, z: i32| {
        let noise = Rng::with_seed(seed ^ (x as u64) << 20 ^ z as u64).f64();
        12.0 + steep * f64::from(x) + rough * noise
    };
    (Ground::from_fn(width, depth, height).expect("finite heights"), [8, 9, 17, 32, 128][rng.usize(0..5)])
}

fn terrain(ground: Ground, chunk_size: u32) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings")
}

fn everything(world: &World) -> LatticeBox {
    world.grid().edit_bounds().intersection(LatticeBox::point(IVec3::ZERO).grown(4000)).expect("not empty")
}

/// A table: a pillar of 3 x 3 voxels that carries a slab.
fn table() -> Terrain {
    let mut terrain = terrain(Ground::flat(64, 64, 8.0).expect("flat ground"), 16);
    let at = |y: f32| Vec3::new(32.0, y, 32.0);
    let pillar = Shape::cuboid(at(14.0), Vec3::new(1.2, 8.0, 1.2));
    let slab = Shape::cuboid(at(22.0), Vec3::new(8.2, 2.2, 8.2));
    terrain.apply([Brush::add(pillar, MaterialId(2)), Brush::add(slab, MaterialId(3))]);
    terrain
}

fn saw() -> Brush {
    Brush::dig(Shape::cuboid(Vec3::new(32.0, 14.0, 32.0), Vec3::new(4.0, 1.2, 4.0)))
}
