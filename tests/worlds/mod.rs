//! Random worlds and edits for the tests: steep, flat, at integer heights, and cut from real elevation data.
#![allow(dead_code)] // each test file uses its own part of this

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use bevy_burrow::brush::CustomShape;
use bevy_burrow::brush::shapes::Cuboid;
use bevy_burrow::ground::{
    Bedding, GreyImage, Ground, ImageLimits, ImageScale, Interval, MaterialControl, MaterialRule, Strata,
    Stratum, StratumBounds,
};
use bevy_burrow::lattice::{BrickPos, ChunkPos, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{Patch, World, WorldParts};
use bevy_burrow::volume::FieldId;
use fastrand::Rng;
use glam::{IVec3, Quat, Vec2, Vec3};

/// The chunk sizes among which tests alternate.
pub const CHUNK_SIZES: [u32; 4] = [8, 25, 32, 100];

/// The number of random worlds to test: `BURROW_WORLDS`, or the default.
pub fn world_count(default: u64) -> u64 {
    std::env::var("BURROW_WORLDS").ok().and_then(|count| count.parse().ok()).unwrap_or(default)
}

/// The elevation model that the crate ships.
pub fn real_image() -> GreyImage {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/jacksboro_fault.png");
    let bytes = std::fs::read(path).expect("the shipped elevation model can be read");
    GreyImage::decode_png(&bytes, &ImageLimits::default()).expect("the shipped elevation model is a grey PNG")
}

/// The real landscape as in the digger example, at least 1024 x 1024 voxels.
pub fn real_ground() -> Ground {
    let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
    Ground::from_image(&real_image(), &scale).expect("the real landscape is valid")
}

/// A cutout at (x, z), one voxel per sample, much steeper than in reality.
pub fn steep_real_ground(width: u32, depth: u32, x: i32, z: i32, relief: f64) -> Ground {
    let image = real_image();
    let grey = |i: i32, k: i32| {
        let at = |v: i32, end: u32| v.rem_euclid(end as i32) as u32;
        f64::from(image.grey(at(i, image.width()), at(k, image.height()))) / 65535.0
    };
    Ground::from_fn(width, depth, |i, k| grey(x + i, z + k) * relief).expect("finite heights")
}

/// A random ground, from flat to steep, and the chunk size of its world. In every third one, materials vary by column;
/// every fifth one has strata.
pub fn random_ground(rng: &mut Rng, index: u64) -> (Ground, u32) {
    let chunk_size = CHUNK_SIZES[(index % 4) as usize];
    // Sizes that are not multiples of the chunk size: the last chunks are cut at the rim.
    let side = |rng: &mut Rng| match chunk_size {
        8 => rng.u32(12..=26),
        25 | 32 => rng.u32(chunk_size..=chunk_size + 36),
        _ => rng.u32(104..=116),
    };
    let (width, depth) = (side(rng), side(rng));
    (random_ground_of_size(rng, index, width, depth), chunk_size)
}

/// Random ground with `width` cells along x and `depth` along z.
pub fn random_ground_of_size(rng: &mut Rng, index: u64, width: u32, depth: u32) -> Ground {
    let ground = random_ground_without_strata(rng, index, width, depth);
    if index % 5 != 4 {
        return ground;
    }
    let (low, high) = ground.height_range();
    // From numbers of its own, so that the rest of the world is the same as without strata.
    let strata =
        random_strata(&mut Rng::with_seed(index), [low as f32 / 256.0 - 30.0, high as f32 / 256.0 + 3.0]);
    ground.with_strata(&strata).expect("valid strata")
}

/// Strata of all shapes with all kinds of conditions, between these heights.
pub fn random_strata(rng: &mut Rng, [low, high]: [f32; 2]) -> Strata {
    let between = |rng: &mut Rng, low: f32, high: f32| low + rng.f32() * (high - low);
    let span = |rng: &mut Rng, low: f32, high: f32| {
        let mut ends = [(); 2].map(|()| between(rng, low, high));
        ends.sort_by(f32::total_cmp);
        let [from, to] = ends.map(|end| (rng.u8(..3) > 0).then_some(end));
        Interval { from, to }
    };
    let scale = |rng: &mut Rng| 8 << rng.u32(..4);
    let stratum = |rng: &mut Rng, material: MaterialId| {
        let (width, share) = (scale(rng), between(rng, 0.02, 0.2));
        let (from, thickness) = (between(rng, low, high), between(rng, 0.5, 6.0));
        let of_shape = match rng.u8(..5) {
            0 => Stratum::fill(material),
            1 => Stratum::bed(material, from, thickness),
            2 => Stratum::beds(material, from, thickness, thickness + between(rng, 0.0, 20.0)),
            3 => Stratum::vein(material, width, share),
            _ => Stratum::pocket(material, width, share),
        };
        let bounds = match rng.u8(..6) {
            0 => {
                let min = IVec3::new(rng.i32(-9..30), between(rng, low, high) as i32, rng.i32(-9..30));
                StratumBounds::Box(LatticeBox { min, max: min + IVec3::splat(rng.i32(0..40)) })
            }
            1 => {
                let samples = (0..12).map(|_| rng.u16(..)).collect();
                StratumBounds::Image(Arc::new(GreyImage::from_samples(4, 3, samples).expect("an image")))
            }
            _ => StratumBounds::World,
        };
        Stratum {
            depth: span(rng, -3.0, 30.0),
            height: if rng.bool() { span(rng, low, high) } else { Interval::ALL },
            slope: if rng.u8(..3) == 0 { span(rng, 0.0, 1.5) } else { Interval::ALL },
            rough: if rng.bool() { between(rng, 0.0, 5.0) } else { 0.0 },
            rough_scale: scale(rng),
            bounds,
            ..of_shape
        }
    };
    let dip = Vec2::new(between(rng, -0.5, 0.5), between(rng, -0.5, 0.5));
    let bedding = Bedding { dip, fold: between(rng, 0.0, 9.0), scale: scale(rng) };
    let count = rng.u8(1..9);
    let strata = (0..count).map(|number| stratum(rng, MaterialId(number + 10))).collect();
    Strata { seed: rng.u32(..), bedding, strata }
}

fn random_ground_without_strata(rng: &mut Rng, index: u64, width: u32, depth: u32) -> Ground {
    let ground = random_heights(rng, width, depth);
    if !index.is_multiple_of(3) {
        return ground;
    }
    let (low, high) = ground.height_range();
    let share = |part: f64| (f64::from(low) + f64::from(high - low) * part) / 256.0;
    let rule = |overlay, from, to, fade| MaterialRule {
        overlay: MaterialId(overlay),
        height: (share(from), share(to)),
        height_fade: fade,
        ..Default::default()
    };
    let rules = vec![rule(1, 0.7, 1.0, 2.0), rule(2, 0.3, 0.5, 5.0), rule(3, 0.0, 0.1, 30.0)];
    let control = MaterialControl::Rules { base: MaterialId(index as u8 % 5), rules };
    ground.with_materials(&control).expect("valid rules")
}

fn random_heights(rng: &mut Rng, width: u32, depth: u32) -> Ground {
    if rng.u32(0..5) == 0 {
        let relief = [60.0, 300.0, 1500.0][rng.usize(0..3)];
        return steep_real_ground(width, depth, rng.i32(0..400), rng.i32(0..340), relief);
    }
    let noise = [0.0, 0.5, 3.0, 12.0, 30.0][rng.usize(0..5)];
    let slope_x = [-2.0, -0.3, 0.0, 1.0][rng.usize(0..4)];
    let slope_z = [-2.0, -0.3, 0.0, 1.0][rng.usize(0..4)];
    let rounding = [0.0, 0.25, 1.0, 4.0][rng.usize(0..4)];
    let bumps: Vec<f64> = (0..=width * (depth + 2) + depth).map(|_| rng.f64() * noise).collect();
    let height = |x: i32, z: i32| {
        let h = bumps[(z as u32 * (width + 1) + x as u32) as usize]
            + slope_x * f64::from(x)
            + slope_z * f64::from(z);
        if rounding == 0.0 { h } else { (h / rounding).round() * rounding }
    };
    Ground::from_fn(width, depth, height).expect("finite heights")
}

/// The centre of a brush below the ground (dig) or above it (add), which cuts into the surface or leaves a gap to it.
fn random_center(rng: &mut Rng, ground: &Ground, dig: bool, radius: f32) -> Vec3 {
    let x = rng.f32() * (ground.width() + 4) as f32 - 2.0;
    let z = rng.f32() * (ground.depth() + 4) as f32 - 2.0;
    let gap = [-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 5.0, 40.0][rng.usize(0..10)];
    let column = bevy_burrow::lattice::Column::new(x.round() as i32, z.round() as i32);
    let height = ground.height(column) as f32 / 256.0;
    let away = radius + gap;
    let y = height + if dig { -away } else { away };
    let place = Vec3::new(x, y, z);
    if rng.bool() { place.round() } else { place }
}

/// The result of a dig or an add on a sample by definition. Other operations keep densities or depend on more samples.
pub fn reference_density(operation: &Operation, before: i32, outside: i32) -> i32 {
    // A shape counts as at most four voxels deep.
    let outside = outside.max(-1024);
    match operation {
        Operation::Dig => before.max(-outside),
        Operation::Add { .. } => before.min(outside),
        _ => before,
    }
}

/// A random brush of any shape and operation, at lattice points or between them.
pub fn random_brush(rng: &mut Rng, ground: &Ground) -> Brush {
    let radius = [2.0, 3.0, 3.7, 5.0][rng.usize(0..4)];
    let dig = rng.bool();
    let center = random_center(rng, ground, dig, radius);
    let direction =
        Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5).try_normalize().unwrap_or(Vec3::Y);
    let shape = match rng.u32(0..8) {
        0 => {
            let half = Vec3::new(radius, radius * 0.6, radius * 1.3);
            Shape::Cuboid(Cuboid { center, half, rotation: random_rotation(rng) })
        }
        1 => Shape::cylinder(center, direction * radius * 3.0, radius),
        2 => Shape::cone(center, direction * radius * 3.0, radius),
        3 => Shape::capsule(center, random_center(rng, ground, dig, radius), radius),
        _ => Shape::sphere(center, radius),
    };
    let material = MaterialId(rng.u8(0..8));
    let brush = match (rng.u32(0..8), dig) {
        (0, _) => Brush::paint(shape, material),
        (_, true) => Brush::dig(shape),
        (_, false) => Brush::add(shape, material),
    };
    match rng.u32(0..6) {
        0 => brush.with_roughness(random_roughness(rng, 2.0)),
        _ => brush,
    }
}

/// Bumps up to this high; half of them tied to a point that is not the origin.
pub fn random_roughness(rng: &mut Rng, most: f32) -> Roughness {
    let roughness = Roughness::new(rng.f32() * most, 1.0 + rng.f32() * 6.0, rng.u32(..));
    let away = Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 4000.0;
    match rng.u32(0..4) {
        0 | 1 => roughness,
        2 => roughness.with_origin(away.round()),
        _ => roughness.with_origin(away),
    }
}

/// A random sculpting brush, mostly near the surface.
pub fn random_sculpting_brush(rng: &mut Rng, ground: &Ground) -> Brush {
    let like = random_brush(rng, ground);
    let (x, z) = (rng.i32(-1..=ground.width() + 1), rng.i32(-1..=ground.depth() + 1));
    let height = ground.height(bevy_burrow::lattice::Column::new(x, z)) as f32 / 256.0;
    let jitter = Vec3::new(rng.f32() - 0.5, rng.f32() * 6.0 - 3.0, rng.f32() - 0.5);
    let place = Vec3::new(x as f32, height, z as f32) + if rng.bool() { jitter } else { Vec3::ZERO };
    let radius = [1.5, 3.0, 4.3, 6.0][rng.usize(0..4)];
    let shape = match rng.u32(0..5) {
        0 => like.shape,
        1 => Shape::cuboid(place, Vec3::new(radius, radius * 1.5, radius)),
        2 => Shape::cylinder(place - Vec3::Y * radius, Vec3::Y * 2.0 * radius, radius),
        _ => Shape::sphere(place, radius),
    };
    sculpting_brush(rng, shape, place)
}

/// A random sculpting brush around a place.
pub fn sculpting_brush(rng: &mut Rng, shape: Shape, place: Vec3) -> Brush {
    let by = [0.25, 1.0, 2.5, 9.0][rng.usize(0..4)];
    let up = Vec3::new(rng.f32() - 0.5, rng.f32() - 0.2, rng.f32() - 0.5);
    let brush = match rng.u32(0..10) {
        0 | 1 => Brush::smooth(shape, 0.2 + 0.8 * rng.f32()),
        2 => Brush::sharpen(shape, 1.0),
        3 => Brush::flatten(shape, place + rng.f32(), if up.length() < 0.1 { Vec3::X } else { up }),
        4 => Brush::level(shape, (place.y + 3.0 * rng.f32() - 1.5).clamp(-32_768.0, 32_768.0)),
        5 => Brush::raise(shape, by),
        6 => Brush::lower(shape, by),
        7 => Brush::terrace(shape, by.max(1.0)),
        _ => {
            let (width, height) = (rng.u32(2..7), rng.u32(2..7));
            let samples = (0..width * height).map(|_| rng.u16(..)).collect();
            let image = GreyImage::from_samples(width, height, samples).expect("as many samples as it has");
            let size = glam::Vec2::new(1.0 + 9.0 * rng.f32(), 1.0 + 9.0 * rng.f32());
            let stamp = bevy_burrow::brush::Stamp::new(image, place, size, 8.0 * (rng.f32() - 0.5));
            Brush::stamp(shape, if rng.bool() { stamp.onto(up) } else { stamp })
        }
    };
    let brush = match rng.u32(0..4) {
        0 => brush.with_falloff([0.0, 0.5, 2.0, 64.0][rng.usize(0..4)]),
        _ => brush,
    };
    match rng.u32(0..4) {
        0 => brush.with_material(MaterialId(rng.u8(0..6))),
        1 => brush.with_strength(rng.f32()),
        2 => brush.with_roughness(random_roughness(rng, 1.0)),
        _ => brush,
    }
}

/// A lower and a raise by the same amount, with a brush of any shape near the surface.
pub fn random_lower_and_raise(rng: &mut Rng, ground: &Ground) -> (Brush, Brush) {
    let (x, z) = (rng.i32(0..=ground.width()), rng.i32(0..=ground.depth()));
    let height = ground.height(bevy_burrow::lattice::Column::new(x, z)) as f32 / 256.0;
    let jitter = Vec3::new(rng.f32() - 0.5, rng.f32() * 16.0 - 8.0, rng.f32() - 0.5);
    let at = Vec3::new(x as f32, height, z as f32) + if rng.bool() { jitter } else { Vec3::ZERO };
    let r = [1.5, 3.0, 4.3, 6.0, 7.7][rng.usize(0..5)];
    let shape = match rng.u32(0..7) {
        0 => Shape::cuboid(at, Vec3::new(r, r * 1.5, r)),
        1 => Shape::cylinder(at - Vec3::Y * r, Vec3::Y * 2.0 * r, r),
        2 => Shape::cone(at - Vec3::Y * 2.0, Vec3::new(1.0, 9.0, -2.0), r),
        3 => Shape::capsule(at, at + Vec3::new(2.0, -5.0, 3.0), r.min(5.0)),
        _ => Shape::sphere(at, r),
    };
    // Games mostly use whole amounts on level ground.
    let amount = match rng.u32(0..4) {
        0 => 64.0,
        1 => rng.u32(1..=64) as f32,
        2 => rng.f32() * 4.0,
        _ => rng.f32() * 64.0,
    };
    let brush = Brush::lower(shape, amount).with_falloff([0.0, 0.5, 2.0, 4.0, 64.0][rng.usize(0..5)]);
    let brush = if rng.u32(0..4) == 0 { brush.with_strength(rng.f32()) } else { brush };
    let lower = match rng.u32(0..5) {
        0 => brush.with_roughness(Roughness::new(rng.f32() * 2.0, 1.0 + rng.f32() * 6.0, rng.u32(..))),
        _ => brush,
    };
    let raise = Brush { operation: Operation::Raise { amount }, ..lower.clone() };
    (lower, raise)
}

/// A random brush of any kind: every shape, every operation. New ones belong here, and all tests of laws get them.
pub fn any_random_brush(rng: &mut Rng, ground: &Ground) -> Brush {
    let like = random_simple_brush(rng, ground);
    let dig = rng.bool();
    let (at, radius) = (random_center(rng, ground, dig, 2.0), 1.5 + rng.f32() * 4.0);
    let material = MaterialId(rng.u8(0..8));
    let shape: Option<CustomShape> = match rng.u32(0..12) {
        0 => Some(CustomShape::Path(random_path(rng, at))),
        1 => {
            Some(CustomShape::Corridor(Corridor::new(random_path(rng, at), rng.f32() * 6.0, rng.f32() * 6.0)))
        }
        2 => Some(CustomShape::Grid(random_grid(rng, at))),
        _ => None,
    };
    // Stamps within grids are refused, and other operations take any shape.
    let is_stamp = matches!(like.operation, Operation::Stamp { .. });
    let brush = match shape {
        Some(shape) if !(is_stamp && matches!(shape, CustomShape::Grid(_))) => with_shape(like, shape),
        _ if rng.u32(0..12) == 0 => {
            let ends = [at, at, at, at].map(|at| at + random_direction(rng) * 9.0);
            Brush { shape: Shape::curve(ends, [radius, radius * 0.5]), ..like }
        }
        _ => like,
    };
    match rng.u32(0..16) {
        0 => Brush { operation: Operation::Reset, ..brush },
        1 | 2 => rounded(rng, brush, dig, material),
        3 => {
            let road = Corridor::new(random_path(rng, at), 1.0 + rng.f32() * 6.0, rng.f32() * 6.0);
            Brush { power: brush.power, ..Brush::road(road, rng.f32() * 3.0) }
        }
        4 => {
            let paste = random_paste(rng, at);
            match rng.bool() {
                true => Brush { power: brush.power, ..Brush::paste(paste) },
                // A part of it, perhaps none.
                false => Brush { operation: Operation::Paste { paste }, ..brush },
            }
        }
        _ => brush,
    }
}

fn with_shape(brush: Brush, shape: CustomShape) -> Brush {
    let own = Brush::dig(shape);
    Brush { shape: own.shape, custom: own.custom, ..brush }
}

/// A fill or a carve with the shape of a brush.
fn rounded(rng: &mut Rng, brush: Brush, dig: bool, material: MaterialId) -> Brush {
    let rounding = [0.0, 0.7, 2.0, 4.5, 9.0][rng.usize(0..5)];
    let operation = if dig { Operation::Carve } else { Operation::Fill };
    let brush = Brush { operation, ..brush }.with_falloff(rounding);
    match rng.u32(0..3) {
        0 => brush,
        1 => brush.with_material(material),
        _ => brush.with_strength(rng.f32()),
    }
}

fn random_direction(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5)
}

/// A path near a place.
pub fn random_path(rng: &mut Rng, at: Vec3) -> BrushPath {
    let points: Vec<(Vec3, f32)> = (0..rng.u32(2..6))
        .map(|_| (at + random_direction(rng) * Vec3::new(24.0, 6.0, 24.0), 1.0 + rng.f32() * 3.0))
        .collect();
    if rng.bool() { BrushPath::spline(points) } else { BrushPath::polyline(points) }
}

/// The grids and prefabs that random brushes have.
pub fn contents() -> &'static (Vec<ShapeGrid>, Vec<Arc<Prefab>>) {
    static CONTENTS: OnceLock<(Vec<ShapeGrid>, Vec<Arc<Prefab>>)> = OnceLock::new();
    CONTENTS.get_or_init(|| ((0..6).map(grid).collect(), (0..6).map(prefab).collect()))
}

/// A ball or a box; half of them have materials.
fn grid(number: i32) -> ShapeGrid {
    let side = 7 + number % 3;
    let distance = |at: IVec3| {
        let from = (at - side / 2).as_vec3();
        let depth = side as f32 / 2.0 - 1.2;
        if number % 2 == 0 { from.length() - depth } else { from.abs().max_element() - depth }
    };
    let grid = ShapeGrid::from_fn(glam::UVec3::splat(side as u32), distance).expect("a valid grid");
    match number {
        0..3 => grid,
        _ => grid.with_materials(|at| MaterialId([0, 3, 255][at.element_sum() as usize / 5 % 3])),
    }
}

/// A copy of some ground with a pit or a heap.
fn prefab(number: i32) -> Arc<Prefab> {
    let mut terrain = Terrain::new(Ground::flat(32, 32, 10.0).expect("valid"), &TerrainSettings::default())
        .expect("valid settings");
    let ball = Shape::sphere(Vec3::new(16.0, 10.0, 16.0), (3 + number / 2) as f32);
    terrain.apply([if number % 2 == 0 { Brush::dig(ball) } else { Brush::add(ball, MaterialId(2)) }]);
    let min = IVec3::new(10, 4, 10);
    let samples = LatticeBox { min, max: min + 8 + number };
    Arc::new(terrain.world().copy(samples, min + 6).expect("in the world"))
}

/// A grid near a place, turned and scaled.
pub fn random_grid(rng: &mut Rng, at: Vec3) -> GridShape {
    let grids = &contents().0;
    let grid = grids[rng.usize(0..grids.len())].clone();
    GridShape::new(grid, at).with_rotation(random_rotation(rng)).with_scale(0.5 + rng.f32())
}

/// A prefab near a place, turned in any way.
fn random_paste(rng: &mut Rng, at: Vec3) -> Paste {
    let prefabs = &contents().1;
    let prefab = Arc::clone(&prefabs[rng.usize(0..prefabs.len())]);
    let paste = Paste { edited_only: rng.bool(), mirror: rng.bool(), ..Paste::new(prefab, at.round()) };
    match rng.u32(0..3) {
        0 => Paste { scale: 0.5 + rng.f32(), at, ..paste.rotated(random_rotation(rng)) },
        1 => paste.turned_about_y(rng.i32(0..4)),
        _ => paste,
    }
}

/// Whether a brush has an image, a grid or a prefab, which messages name.
pub fn has_content(brush: &Brush) -> bool {
    Edit::quantize(brush).is_ok_and(|edit| edit.stamp_image().is_some() || edit.prefab().is_some())
}

/// A random brush of those that GPUs apply.
pub fn random_gpu_brush(rng: &mut Rng, ground: &Ground) -> Brush {
    match rng.u32(0..6) {
        0 => {
            let brush = random_simple_brush(rng, ground);
            let is_stamp = matches!(brush.operation, Operation::Stamp { .. });
            if is_stamp { brush } else { in_grid(rng, ground, brush) }
        }
        1 => random_rounded_brush(rng, ground),
        _ => random_simple_brush(rng, ground),
    }
}

/// A random fill or carve of those that GPUs apply.
pub fn random_rounded_brush(rng: &mut Rng, ground: &Ground) -> Brush {
    let brush = random_simple_brush(rng, ground);
    let brush = if rng.u32(0..3) == 0 { in_grid(rng, ground, brush) } else { brush };
    let (dig, material) = (rng.bool(), MaterialId(rng.u8(0..8)));
    let brush = rounded(rng, brush, dig, material);
    match rng.u32(0..10) {
        0 => brush.with_falloff(16.0 * rng.f32()),
        _ => brush,
    }
}

/// The brush with a random grid as its shape.
fn in_grid(rng: &mut Rng, ground: &Ground, brush: Brush) -> Brush {
    let dig = rng.bool();
    let at = random_center(rng, ground, dig, 2.0);
    with_shape(brush, CustomShape::Grid(random_grid(rng, at)))
}

/// A random brush whose shape is not a grid and whose edges are not rounded.
fn random_simple_brush(rng: &mut Rng, ground: &Ground) -> Brush {
    let brush = if rng.bool() { random_brush(rng, ground) } else { random_sculpting_brush(rng, ground) };
    if rng.u32(0..8) > 0 {
        return brush;
    }
    let (radius, axis) = (2.0 + rng.f32() * 5.0, random_rotation(rng) * Vec3::Y);
    let dig = rng.bool();
    let center = random_center(rng, ground, dig, radius / 2.0);
    Brush { shape: Shape::torus(center, axis, radius, radius * (0.2 + 0.8 * rng.f32())), ..brush }
}

/// Rules of every kind, some of which affect the edits.
pub fn random_rules(rng: &mut Rng, ground: &Ground) -> DiggingRules {
    let (low, high) = ground.height_range();
    let mut rules = DiggingRules::default();
    for material in 0..8 {
        match rng.u32(0..6) {
            0 => rules = rules.with_unbreakable(MaterialId(material)),
            1 | 2 => rules = rules.with_hardness(MaterialId(material), rng.u8(..)),
            _ => {}
        }
    }
    if rng.bool() {
        rules = rules.with_bedrock(rng.i32(low / 256 - 5..=high / 256 + 2));
    }
    for _ in 0..rng.u32(0..4) {
        let (x, z) = (rng.i32(0..=ground.width()), rng.i32(0..=ground.depth()));
        let y = ground.height(bevy_burrow::lattice::Column::new(x, z)) / 256 + rng.i32(-3..4);
        let half = glam::IVec3::new(rng.i32(0..6), rng.i32(0..6), rng.i32(0..6));
        let at = glam::IVec3::new(x, y, z);
        let samples = bevy_burrow::lattice::LatticeBox::new(at - half, at + half);
        rules = rules.with_protected(samples.expect("not empty"));
    }
    rules
}

fn random_rotation(rng: &mut Rng) -> Quat {
    let angles = [rng.f32() * 6.3, rng.f32() * 6.3, rng.f32() * 6.3];
    if rng.bool() {
        Quat::IDENTITY
    } else {
        Quat::from_euler(glam::EulerRot::XYZ, angles[0], angles[1], angles[2])
    }
}

/// A brush that lies on chunk faces, edges or corners, or at the world's rim.
pub fn random_brush_at_a_face(rng: &mut Rng, ground: &Ground, chunk_size: u32) -> Brush {
    let size = chunk_size as i32;
    let on = |rng: &mut Rng, end: i32| match rng.u32(0..3) {
        0 => rng.i32(0..=end),
        1 => (rng.i32(0..=end) / size * size).min(end),
        _ => [0, end][rng.usize(0..2)],
    };
    let (x, z) = (on(rng, ground.width()), on(rng, ground.depth()));
    let height = ground.height(bevy_burrow::lattice::Column::new(x, z)) as f32 / 256.0;
    let y = if rng.bool() { (height / chunk_size as f32).round() * chunk_size as f32 } else { height };
    let shape = Shape::sphere(Vec3::new(x as f32, y, z as f32), [1.5, 3.0, 4.5][rng.usize(0..3)]);
    if rng.bool() { Brush::dig(shape) } else { Brush::add(shape, MaterialId(5)) }
}

/// A random, edited world; every fourth one has rules.
pub fn random_world(rng: &mut Rng, index: u64) -> Terrain {
    let (ground, chunk_size) = random_ground(rng, index);
    let mut brushes = Vec::new();
    for _ in 0..rng.u32(2..8) {
        if rng.u32(0..4) == 0 {
            // A row of balls: a tunnel or a dam.
            let first = any_random_brush(rng, &ground);
            let (from, to) = (random_center(rng, &ground, true, 3.0), random_center(rng, &ground, true, 3.0));
            for step in 0..12 {
                let shape = Shape::sphere(from.lerp(to, step as f32 / 11.0), 3.0);
                brushes.push(Brush { shape, ..first.clone() });
            }
        } else if rng.u32(0..4) == 0 {
            brushes.push(random_brush_at_a_face(rng, &ground, chunk_size));
        } else {
            brushes.push(any_random_brush(rng, &ground));
        }
    }
    let mut terrain =
        Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings");
    if index / 4 % 4 == 3 {
        let rules = random_rules(rng, terrain.world().ground());
        terrain.set_rules(rules).expect("valid rules");
        brushes.iter_mut().for_each(|brush| brush.power = rng.u8(..) | rng.u8(..));
    }
    // Some in one transaction, some in transactions of their own.
    let cut = rng.usize(0..=brushes.len());
    terrain.apply(&brushes[..cut]);
    for brush in &brushes[cut..] {
        terrain.apply([brush]);
    }
    terrain
}

/// The change that makes a terrain's world what these parts were saved of.
pub fn change_towards(terrain: &Terrain, parts: &WorldParts) -> Patch {
    let (mut change, now) = (parts.change.clone(), terrain.parts().change);
    let gone = |pos: &BrickPos| parts.change.bricks.binary_search_by_key(pos, |own| own.0).is_err();
    change.bricks.extend(now.bricks.iter().filter(|(pos, _)| gone(pos)).map(|(pos, _)| (*pos, None)));
    change.bricks.sort_by_key(|(pos, _)| *pos);
    let gone = |chunk: &ChunkPos| parts.change.fields.iter().all(|own| own.0 != *chunk);
    let gone = now.fields.iter().filter(|(chunk, _)| gone(chunk));
    change.fields.extend(gone.map(|(chunk, _)| (*chunk, Default::default())));
    change
}

/// Checks that each edited sample lies in one field of its chunk, that each field is the box around some, and that fields
/// do not meet and have names of their own.
pub fn check_fields(world: &World, what: &str) {
    let mut edited: BTreeMap<FieldId, LatticeBox> = BTreeMap::new();
    for (pos, brick) in world.bricks() {
        for (point, ..) in brick.edited_samples(pos) {
            let fields = world.fields_of(world.grid().chunk_of(point));
            let own = fields.and_then(|fields| fields.iter().find(|field| field.bounds.contains(point)));
            let id = own.map(|field| field.id);
            let id = id.unwrap_or_else(|| panic!("{what}: no field holds {point}"));
            let own = LatticeBox::point(point);
            edited.entry(id).and_modify(|all| *all = all.union(own)).or_insert(own);
        }
    }
    let mut count = 0;
    for (chunk, fields) in world.fields() {
        for (number, field) in fields.iter().enumerate() {
            assert_eq!(edited.get(&field.id), Some(&field.bounds), "{what}: {field:?} of {chunk:?}");
            assert!(field.id.0 <= world.next_field(), "{what}: {field:?} has a name to come");
            let mut others = fields.iter().skip(number + 1);
            assert!(
                others.all(|other| !other.bounds.meets(field.bounds)),
                "{what}: fields of {chunk:?} meet"
            );
            count += 1;
        }
    }
    assert_eq!(edited.len(), count, "{what}: two fields have one name");
}
