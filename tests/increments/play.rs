//! Random grounds, and random edits played on them.

use std::sync::Arc;

use bevy_burrow::brush::AnyShape;
use bevy_burrow::lattice::{Column, ONE};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{Quat, Vec2, Vec3};

use crate::checked_terrain::CheckedTerrain;
use crate::worlds;

/// A brush of any shape and operation, rough or smooth, with about this radius and position.
pub fn any_brush(rng: &mut Rng, place: Vec3, radius: f32) -> Brush {
    let mut vector = |scale: f32| Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 2.0 * scale;
    let (axis, jitter, turn) = (vector(2.0 * radius), vector(2.0), vector(3.0));
    let axis = if axis.length() < 0.5 { Vec3::Y } else { axis };
    let center = if rng.bool() { place.round() } else { place + jitter };
    let radius = if rng.bool() { radius.ceil() } else { radius };
    let shape = match rng.u32(0..7) {
        0 => Shape::cuboid(center, Vec3::new(radius, radius * 0.5 + 0.25, radius)),
        1 => Shape::turned_cuboid(
            center,
            Vec3::new(radius, radius * 0.4 + 0.25, radius),
            Quat::from_euler(glam::EulerRot::XYZ, turn.x, turn.y, turn.z),
        ),
        2 => Shape::cylinder(center, axis, radius),
        3 => Shape::cone(center, axis, radius),
        4 => Shape::capsule(center, center + axis, radius * 0.7 + 0.25),
        _ => Shape::sphere(center, radius),
    };
    let material = match rng.u32(0..4) {
        0 => MaterialId::GROUND,
        _ => MaterialId(rng.u8(0..4)),
    };
    let by = [0.1, 1.0, 3.5, 20.0][rng.usize(0..4)];
    let brush = match rng.u32(0..18) {
        0..=3 => Brush::paint(shape, material),
        4..=7 => Brush::dig(shape),
        8..=9 => Brush::add(shape, material),
        10 => Brush::smooth(shape, 1.0),
        11 => Brush::sharpen(shape, 0.7),
        12 => Brush::raise(shape, by),
        13 => Brush::lower(shape, by),
        14 => Brush::level(shape, place.y),
        15 => Brush::flatten(shape, center, [Vec3::Y, -Vec3::Y, Vec3::X, -Vec3::Z][rng.usize(0..4)]),
        16 => Brush::stamp(shape, any_stamp(rng, center, radius)),
        _ => Brush::terrace(shape, by.max(1.0)),
    };
    let brush = match rng.u32(0..8) {
        0 => {
            // Shapes and operations that no others are combined with here.
            let (path, grid) = (worlds::random_path(rng, center), worlds::random_grid(rng, center));
            let shape: AnyShape = match rng.u32(0..5) {
                0 => path.into(),
                1 => Corridor::new(path, radius, 2.0).into(),
                2 => grid.into(),
                3 => Shape::curve([center, center + axis, center + jitter, center - axis], [radius, 1.0])
                    .into(),
                _ => shape.into(),
            };
            let rounding = [0.0, 0.6, 1.5, 3.0][rng.usize(0..4)];
            match rng.u32(0..7) {
                0 => Brush::dig(shape),
                1 => Brush::add(shape, material),
                2 => Brush::paint(shape, material),
                // The materials of grids have tests of their own.
                3 => Brush::fill(shape, rounding).with_material(material),
                4 if !matches!(shape, AnyShape::Grid(_)) => Brush::fill(shape, rounding),
                5 => Brush::carve(shape, rounding),
                _ => Brush::reset(shape),
            }
        }
        _ => brush,
    };
    let rounds = matches!(brush.operation, Operation::Fill | Operation::Carve);
    let brush = match rng.u32(0..3) {
        0 if rounds => brush.with_material(material),
        0 if brush.operation.is_sculpting() => brush.with_falloff(rng.f32() * 3.0).with_material(material),
        1 => brush.with_strength(rng.f32()),
        _ => brush,
    };
    match rng.u32(0..4) {
        0 => brush.with_roughness(Roughness::new(rng.f32() * 8.0, 1.0 + rng.f32() * 9.0, rng.u32(..))),
        _ => brush,
    }
}

/// An unrotated stamp of about this radius.
fn any_stamp(rng: &mut Rng, center: Vec3, radius: f32) -> Stamp {
    let (width, height) = (rng.u32(2..6), rng.u32(2..6));
    let samples = (0..width * height).map(|_| rng.u16(..)).collect();
    let image = GreyImage::from_samples(width, height, samples).expect("as many samples as it has");
    let mut side = || 0.5 + 2.5 * radius * rng.f32();
    Stamp::new(image, center, Vec2::new(side(), side()), 8.0 * (rng.f32() - 0.5))
}

/// A position in or near the world: often at rims and corners, mostly near the surface.
pub fn any_place(rng: &mut Rng, ground: &Ground) -> Vec3 {
    let along = |rng: &mut Rng, end: i32| match rng.u32(0..6) {
        0 => 0.0,
        1 => end as f32,
        2 => end as f32 + 2.0,
        _ => rng.f32() * end as f32,
    };
    let (x, z) = (along(rng, ground.width()), along(rng, ground.depth()));
    let height = |dx: i32| ground.height(Column::new(x as i32 + dx, z as i32)) as f32 / ONE as f32;
    let (a, b) = (height(0), height(1));
    let y = match rng.u32(0..8) {
        0 => a - 30.0 * rng.f32(),
        1 => a + 20.0 * rng.f32(),
        2 => (a + b) * 0.5,
        _ => a + 4.0 * (rng.f32() - 0.5),
    };
    Vec3::new(x, y.clamp(-32_768.0, 32_768.0), z)
}

pub fn play(checked: &mut CheckedTerrain, rng: &mut Rng, transactions: usize, most: f32, what: &str) {
    let mut held: Vec<(Arc<World>, u64, usize)> = Vec::new();
    for i in 0..transactions {
        let ground = checked.terrain.world();
        let count = if rng.u32(0..4) == 0 { rng.usize(2..6) } else { 1 };
        let brushes: Vec<Brush> = (0..count)
            .map(|tag| {
                let place = any_place(rng, ground.ground());
                let radius = 0.25 + rng.f32() * rng.f32() * most;
                any_brush(rng, place, radius).with_tag(tag as u64)
            })
            .collect();
        if rng.bool() {
            let world = checked.terrain.snapshot();
            let (hash, triangles) = fingerprint(&world);
            held.push((world, hash, triangles));
        }
        checked.apply(&brushes, &format!("{what}, transaction {i}"));
        for (world, hash, triangles) in &held {
            assert_eq!(fingerprint(world), (*hash, *triangles), "{what}: a snapshot changed");
        }
        if rng.bool() {
            held.clear();
        }
    }
}

fn fingerprint(world: &World) -> (u64, usize) {
    let drawn: usize = world.drawn_chunks().map(|chunk| world.chunk_mesh(chunk).indices.len()).sum();
    (world.hash() ^ world.mask().len() as u64, drawn)
}

/// Grounds of every kind, small enough to compare every sample.
pub fn any_ground(rng: &mut Rng, seed: u64) -> (Ground, u32) {
    let chunk_size = [8, 9, 13, 16, 27, 100, 128][rng.usize(0..7)];
    let side = |rng: &mut Rng| match rng.u32(0..6) {
        0 => rng.u32(1..4),
        1 => chunk_size.min(48),
        2 => chunk_size.min(40) + 1,
        _ => rng.u32(8..34),
    };
    let (width, depth) = (side(rng), side(rng));
    let kind = seed % 6;
    let base = [0.0, 10.0, -7.5, 31.996][rng.usize(0..4)];
    let bumps: Vec<f64> = (0..(width + 1) * (depth + 1)).map(|_| rng.f64()).collect();
    let height = |x: i32, z: i32| {
        let bump = bumps[(z as u32 * (width + 1) + x as u32) as usize];
        match kind {
            0 => base,
            1 => base + bump * 3.0,
            2 => base + (bump * 20.0).round(),
            3 => base + 60.0 * bump,
            4 => base + if x > 5 { 40.0 } else { 0.0 },
            _ => base + 0.5 * f64::from(x) - 1.5 * f64::from(z),
        }
    };
    let ground = Ground::from_fn(width, depth, height).expect("finite heights");
    if !rng.bool() {
        return (ground, chunk_size);
    }
    let (low, high) = ground.height_range();
    let share = |part: f64| (f64::from(low) + f64::from(high - low) * part) / 256.0;
    let rule = MaterialRule {
        overlay: MaterialId(1),
        height: (share(0.3), share(0.8)),
        height_fade: 3.0,
        ..Default::default()
    };
    let control = MaterialControl::Rules { base: MaterialId(2), rules: vec![rule] };
    (ground.with_materials(&control).expect("valid rules"), chunk_size)
}
