//! Edits of random worlds.

mod run;

use std::sync::Arc;

use fastrand::Rng;
use glam::{IVec3, Vec3};

use super::super::layout::EditResult;
use super::{Device, seeds, worlds};
use crate::brush::{Brush, DEPTH, Edit, Roughness, Shape};
use crate::edits::{EditDelta, PreparedEdits};
use crate::ground::{ColumnMaterial, Ground, MaterialControl, MaterialId};
use crate::lattice::{BrickPos, ChunkGrid, Column, LatticeBox};
use crate::terrain::{Terrain, TerrainSettings};
use crate::volume::{Brick, Bricks, SampleView};
use run::{EditRoom, EditRun};

/// Edits of all kinds: random ones, larger ones that leave uniform bricks, and ones that restore the look of the
/// ground.
fn random_edits(rng: &mut Rng, ground: &Ground, chunk_size: u32) -> Vec<Edit> {
    let sculpts = rng.bool();
    let mut brushes = Vec::new();
    for _ in 0..rng.usize(1..6) {
        let mut brush = match rng.u32(0..6) {
            0 => worlds::random_brush_at_a_face(rng, ground, chunk_size),
            1 | 2 if sculpts => worlds::random_sculpting_brush(rng, ground),
            3 => worlds::random_gpu_brush(rng, ground),
            _ => worlds::random_brush(rng, ground),
        };
        match rng.u32(0..8) {
            0 => {
                let center = worlds::random_brush(rng, ground).shape;
                let at = Edit::quantize(&Brush::dig(center))
                    .map_or(IVec3::ZERO, |edit| edit.reach().min)
                    .as_vec3();
                brush.shape = Shape::cuboid(at, Vec3::new(17.0, 13.0, 15.0));
            }
            1 => {
                brush = Brush { operation: Brush::paint(brush.shape, MaterialId::GROUND).operation, ..brush }
            }
            2 => brush = Brush { operation: Brush::add(brush.shape, MaterialId::GROUND).operation, ..brush },
            3 => {
                let roughness = Roughness::new(rng.f32() * 8.0, 1.0 + rng.f32() * 30.0, rng.u32(..));
                brush = brush.with_roughness(roughness);
            }
            4 => {
                // Deeper than stored densities reach.
                let column = Column::new(rng.i32(0..ground.width()), rng.i32(0..ground.depth()));
                let y = ground.height(column) as f32 / 256.0 - 90.0 - rng.f32() * 80.0;
                let shape = Shape::sphere(Vec3::new(column.x as f32, y, column.z as f32), 4.0);
                brush = Brush::paint(shape, MaterialId(rng.u8(..)));
            }
            _ => {}
        }
        brush.power = rng.u8(..) | rng.u8(..);
        brushes.push(brush);
        if rng.u32(0..4) == 0 {
            brushes.extend(brushes.last().cloned());
        }
    }
    brushes.iter().filter_map(|brush| Edit::quantize(brush).ok()).collect()
}

/// The delta of the CPU. Brick by brick, as no entry of a kernel spans two bricks.
fn ledger_of(work: &PreparedEdits) -> EditDelta {
    let mut all = EditDelta::default();
    work.run_each_brick(|mut delta| {
        all.bricks.append(&mut delta.bricks);
        all.parts.append(&mut delta.parts);
        all.counts.append(&mut delta.counts);
        all.hash = all.hash.wrapping_add(delta.hash);
    });
    all
}

/// Applies edits on both sides, first with enough room and then without; returns how many bricks changed.
fn compare_edits(
    device: &mut Device,
    (samples, grid): (SampleView, ChunkGrid),
    edits: &[Edit],
    rng: &mut Rng,
) -> usize {
    let edits: Vec<&Edit> = edits.iter().collect();
    let rules = worlds::random_rules(rng, samples.ground());
    let work = PreparedEdits::new(samples, grid, &edits);
    let work = work.under((rng.u32(0..3) == 0).then_some(&rules));
    let delta = ledger_of(&work);
    let most = EditRoom {
        records: delta.bricks.len(),
        materials: delta.bricks.iter().filter(|drafted| drafted.brick.materials().is_some()).count(),
        parts: delta.parts.len(),
        counts: delta.counts.len(),
    };
    let run = EditRun::new(device, &work, rng, most, FAR);
    assert_eq!(run.counters[2..], [most.parts as u32, most.counts as u32]);
    run.check_bricks(&delta, true);
    run.check_effects(&delta, &work);

    let mut less = |room: usize| if rng.bool() { room } else { rng.usize(0..=room) };
    let room = EditRoom {
        records: less(most.records),
        materials: less(most.materials),
        parts: less(most.parts),
        counts: less(most.counts),
    };
    let short = EditRun::new(device, &work, rng, room, FAR);
    short.check_bricks(&delta, false);
    assert_eq!(short.counters, run.counters, "counters exceed the room");
    // Small windows either suffice, or the kernel reports that they do not.
    let near = EditRun::new(device, &work, rng, most, 1);
    if near.results.iter().all(|result| result.flags & EditResult::TOO_FAR == 0) {
        near.check_bricks(&delta, true);
        near.check_effects(&delta, &work);
    }
    delta.bricks.len()
}

/// Vertical reach of windows that always suffices, in bricks.
const FAR: i32 = 8;

#[test]
fn edits_are_those_of_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    let mut bricks = 0;
    for (seed, mut rng) in seeds(40) {
        let terrain = worlds::random_world(&mut rng, seed);
        let world = terrain.world();
        let edits = random_edits(&mut rng, world.ground(), world.grid().size() as u32);
        bricks += compare_edits(&mut device, (world.samples(), world.grid()), &edits, &mut rng);
    }
    println!("{bricks} edited bricks are the same");
}

#[test]
fn fills_and_carves_are_those_of_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    let mut bricks = 0;
    for (seed, mut rng) in seeds(24) {
        let terrain = worlds::random_world(&mut rng, seed);
        let (world, chunk_size) = (terrain.world(), terrain.world().grid().size() as u32);
        let brush = |rng: &mut Rng| {
            let brush = worlds::random_rounded_brush(rng, world.ground());
            let brush = match rng.u32(0..6) {
                // At the world's rim and on the faces of chunks.
                0 => {
                    let Brush { shape, .. } = worlds::random_brush_at_a_face(rng, world.ground(), chunk_size);
                    Brush { shape, custom: None, ..brush }
                }
                1 => worlds::random_gpu_brush(rng, world.ground()),
                _ => brush,
            };
            Brush { power: rng.u8(..) | rng.u8(..), ..brush }
        };
        let mut brushes: Vec<Brush> = (0..rng.usize(1..5)).map(|_| brush(&mut rng)).collect();
        // In one place with different radii, so that ways of different lengths count.
        if rng.bool() {
            let Brush { shape, custom, .. } = brushes[0].clone();
            brushes.push(Brush { shape, custom, ..worlds::random_rounded_brush(&mut rng, world.ground()) });
        }
        let edits: Vec<Edit> = brushes.iter().filter_map(|brush| Edit::quantize(brush).ok()).collect();
        bricks += compare_edits(&mut device, (world.samples(), world.grid()), &edits, &mut rng);
    }
    println!("{bricks} edited bricks are the same");
    assert!(bricks > worlds::world_count(24) as usize, "{bricks}");
}

#[test]
fn grids_are_those_of_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    let mut bricks = 0;
    for (seed, mut rng) in seeds(24) {
        let ground = worlds::random_ground(&mut rng, seed).0;
        let grid =
            ChunkGrid::new(worlds::CHUNK_SIZES[seed as usize % 4] as i32, ground.width(), ground.depth());
        let brush = |rng: &mut Rng| {
            let (x, z) = (rng.i32(0..=ground.width()), rng.i32(0..=ground.depth()));
            let height = ground.height(Column::new(x, z)) as f32 / 256.0;
            let at = Vec3::new(x as f32 + rng.f32(), height + rng.f32() * 8.0 - 4.0, z as f32);
            let (shape, material) = (worlds::random_grid(rng, at), MaterialId(rng.u8(0..9)));
            let brush = match rng.u32(0..6) {
                0 => Brush::dig(shape),
                1 => Brush::add(shape, material),
                2 => Brush::paint(shape, material),
                3 => Brush::raise(shape, 2.0),
                // With the grid's materials, if it has any.
                _ => Brush::fill(shape, 0.0),
            };
            match rng.u32(0..3) {
                0 => brush.with_roughness(worlds::random_roughness(rng, 2.0)),
                _ => brush,
            }
        };
        let brushes: Vec<Brush> = (0..rng.usize(2..6)).map(|_| brush(&mut rng)).collect();
        let edits: Vec<Edit> = brushes.iter().filter_map(|brush| Edit::quantize(brush).ok()).collect();
        let none = Bricks::default();
        bricks += compare_edits(&mut device, (SampleView::new(&ground, &none), grid), &edits, &mut rng);
    }
    println!("{bricks} edited bricks are the same");
    assert!(bricks > worlds::world_count(24) as usize, "{bricks}");
}

#[test]
fn edits_at_the_ends_of_the_lattice_are_those_of_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    for (seed, mut rng) in seeds(12) {
        let side = if rng.bool() { 1.0 } else { -1.0 };
        let height = |x: i32, z: i32| side * (32_760.0 - f64::from((x * 7 + z * 5) % 23) * 0.7);
        let ground = Ground::from_fn(30, 27, height).expect("a ground");
        let materials = ColumnMaterial { base: MaterialId(3), overlay: MaterialId(4), blend: 200 };
        let ground = ground
            .with_materials(&MaterialControl::Uniform(materials))
            .unwrap_or_else(|error| panic!("{error}"));
        let settings =
            TerrainSettings { chunk_size: worlds::CHUNK_SIZES[seed as usize % 4], ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("a terrain");
        for _ in 0..3 {
            let world = terrain.world();
            let edits = random_edits(&mut rng, world.ground(), settings.chunk_size);
            compare_edits(&mut device, (world.samples(), world.grid()), &edits, &mut rng);
            terrain.submit_all(&edits);
            terrain.apply(std::iter::empty::<Brush>());
        }
    }
}

/// A brick that no brush would leave behind: arbitrary densities side by side, many of them clamped.
fn noise_brick(rng: &mut Rng) -> Brick {
    // Some are so deep that a clamped sample is nearer the surface than all of its neighbours.
    let deep = [0, 0, 1, -1][rng.usize(0..4)];
    let mut sample = || match rng.u32(0..6) {
        kind if deep != 0 => deep * if kind == 0 { DEPTH as i16 } else { rng.i16(900..1500) },
        0 => DEPTH as i16,
        1 => -DEPTH as i16,
        2 => rng.i16(..),
        3 => [i16::MAX, -i16::MAX][rng.usize(0..2)],
        _ => rng.i16(-300..300),
    };
    let mut brick = Brick::of_edited(&std::array::from_fn(|_| sample()));
    if rng.bool() {
        (0..512).for_each(|index| brick.set_material(index, MaterialId(rng.u8(0..4))));
    }
    brick
}

#[test]
fn noise_is_sculpted_like_on_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    for (seed, mut rng) in seeds(24) {
        let ground = worlds::random_ground(&mut rng, seed).0;
        let grid =
            ChunkGrid::new(worlds::CHUNK_SIZES[seed as usize % 4] as i32, ground.width(), ground.depth());
        let near = LatticeBox::point(IVec3::ONE).grown(1).points();
        let mut bricks = Bricks::default();
        for pos in near.map(BrickPos).filter(|_| rng.u32(0..6) > 0).collect::<Vec<_>>() {
            bricks.insert(pos, Arc::new(noise_brick(&mut rng)));
        }
        let brush = |rng: &mut Rng| {
            let place = Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 16.0 + 4.0;
            let shape = Shape::sphere(place, 2.0 + rng.f32() * 5.0);
            // Ways through noise are as crooked as can be.
            match rng.u32(0..6) {
                0 => Brush::fill(shape, rng.f32() * 16.0),
                1 => Brush::carve(shape, rng.f32() * 16.0),
                _ => worlds::sculpting_brush(rng, shape, place),
            }
        };
        let edits: Vec<Edit> = (0..3).filter_map(|_| Edit::quantize(&brush(&mut rng)).ok()).collect();
        compare_edits(&mut device, (SampleView::new(&ground, &bricks), grid), &edits, &mut rng);
    }
}
