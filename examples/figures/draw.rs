//! The figures: a dug world from above, in section, and at its seam.

use std::collections::{BTreeMap, BTreeSet};

use bevy_burrow::lattice::{Column, LatticeBox, ONE, SNAP};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::{MeshKey, World};
use glam::{IVec3, Vec2, Vec3};

use crate::canvas::Canvas;

const BROWN: &str = "#8a5a2b";
const BLUE: &str = "#2f6db5";
const ORANGE: &str = "#e08a1e";
const GREY: &str = "#b9b4aa";
const DARK: &str = "#333333";

/// Cells along a chunk's side.
const CHUNK: u32 = 16;

/// Every figure with its file name.
pub fn all() -> Vec<(&'static str, String)> {
    let hills = dug(14.0, &[dig(21.0, 26.0, 5.0), dig(30.0, 22.0, 4.0)]);
    let tunnel = dug(10.0, &[tunnel()]);
    let cliff = dug(34.0, &[dig(24.0, 24.0, 6.0)]);
    vec![
        ("plan.svg", plan(hills.world())),
        ("ring.svg", ring(hills.world())),
        ("section.svg", section(tunnel.world())),
        ("steep.svg", steep(cliff.world())),
    ]
}

fn ground(amplitude: f64) -> Ground {
    let noise = NoiseHeights { amplitude, scale: 24.0, octaves: 2, seed: 5, ..NoiseHeights::default() };
    Ground::from_noise(48, 48, &noise).expect("valid noise")
}

/// Hills of a height with some brushes applied; brushes are given relative to the height of the ground.
fn dug(amplitude: f64, brushes: &[Brush]) -> Terrain {
    let settings = TerrainSettings { chunk_size: CHUNK, ..TerrainSettings::default() };
    let mut terrain = Terrain::new(ground(amplitude), &settings).expect("valid settings");
    let on_ground = |brush: &Brush| {
        let middle = match &brush.shape {
            Shape::Sphere(sphere) => sphere.center,
            _ => Vec3::new(24.0, 0.0, 24.0),
        };
        let height = terrain.world().height(middle.x.into(), middle.z.into()).unwrap_or_default() as f32;
        brush.transformed(glam::Quat::IDENTITY, Vec3::Y * height, 1.0)
    };
    let brushes: Vec<Brush> = brushes.iter().map(on_ground).collect();
    terrain.apply(brushes);
    terrain
}

fn dig(x: f32, z: f32, radius: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 0.0, z), radius))
}

fn tunnel() -> Brush {
    Brush::dig(Shape::capsule(Vec3::new(5.0, -6.4, 24.0), Vec3::new(34.0, -8.0, 24.0), 3.4))
}

/// Triangles of one kind of mesh, in voxels of the world.
fn triangles(world: &World, are_chunks: bool) -> Vec<[Vec3; 3]> {
    let of = |drawn: MeshKey, mesh: &SurfaceMesh| -> Vec<[Vec3; 3]> {
        let origin = world.origin(drawn).as_vec3();
        let place = |position: IVec3| origin + position.as_vec3() / SNAP as f32;
        mesh.triangles().map(|triangle| triangle.map(|vertex| place(vertex.position))).collect()
    };
    let mut drawn: Vec<(MeshKey, SurfaceMesh)> =
        world.drawn().filter(|(drawn, _)| matches!(drawn, MeshKey::Chunk(_)) == are_chunks).collect();
    drawn.sort_by_key(|&(drawn, _)| drawn);
    drawn.iter().flat_map(|(drawn, mesh)| of(*drawn, mesh)).collect()
}

fn above(at: Vec3) -> Vec2 {
    Vec2::new(at.x, at.z)
}

fn mask(world: &World) -> BTreeSet<Column> {
    world.mask().iter().collect()
}

/// The whole world from above: cells, tiles, mask, ring and fields.
fn plan(world: &World) -> String {
    let side = world.grid().width() as f32;
    let mut canvas = Canvas::new(Vec2::ZERO, Vec2::splat(side), 13.0);
    for cell in mask(world) {
        let low = Vec2::new(cell.x as f32, cell.z as f32);
        let corners = [low, low + Vec2::X, low + Vec2::ONE, low + Vec2::Y];
        canvas.polygon(&corners, "#b8d2f0", "#8fb4de");
    }
    for tile in world.grid().tiles() {
        for triangle in world.ring_triangles(tile) {
            canvas.polygon(&triangle.map(above), "#f6d7a8", ORANGE);
        }
    }
    for line in 0..=side as i32 {
        let (at, is_border) = (line as f32, line % CHUNK as i32 == 0);
        let (color, width) = if is_border { (DARK, 2.2) } else { (GREY, 0.5) };
        canvas.line(&[Vec2::new(at, 0.0), Vec2::new(at, side)], color, width);
        canvas.line(&[Vec2::new(0.0, at), Vec2::new(side, at)], color, width);
    }
    let mut fields: Vec<LatticeBox> =
        world.fields().flat_map(|(_, fields)| fields.iter().map(|field| field.bounds)).collect();
    fields.sort_by_key(|field| field.min.to_array());
    for field in fields {
        canvas.frame(above(field.min.as_vec3()), above(field.max.as_vec3()), "#b3261e");
    }
    for (x, text) in [(0.5, "tile"), (16.5, "tile"), (32.5, "tile")] {
        canvas.label(Vec2::new(x, 47.0), text, DARK);
    }
    canvas.finish()
}

/// A part of the seam from above.
fn ring(world: &World) -> String {
    let (min, max) = (Vec2::new(12.0, 19.0), Vec2::new(27.0, 33.0));
    let mut canvas = Canvas::new(min, max, 44.0);
    let is_inside = |triangle: &[Vec3; 3]| {
        triangle.iter().all(|&corner| above(corner).cmpge(min).all() && above(corner).cmple(max).all())
    };
    let rings: Vec<[Vec3; 3]> =
        world.grid().tiles().flat_map(|tile| world.ring_triangles(tile).collect::<Vec<_>>()).collect();
    let key = |triangle: &[Vec3; 3]| triangle.map(|corner| corner.to_array().map(f32::to_bits));
    let is_ring: BTreeSet<_> = rings.iter().map(key).collect();
    let (tiles, chunks) = (triangles(world, false), triangles(world, true));
    for triangle in tiles.iter().filter(|triangle| is_inside(triangle)) {
        let (fill, border) =
            if is_ring.contains(&key(triangle)) { ("#f6d7a8", ORANGE) } else { ("#e6d6c3", BROWN) };
        canvas.polygon(&triangle.map(above), fill, border);
    }
    // From below, so that walls are hidden by what lies over them.
    let mut sorted: Vec<&[Vec3; 3]> = chunks.iter().filter(|triangle| is_inside(triangle)).collect();
    sorted.sort_by(|a, b| a[0].y.total_cmp(&b[0].y));
    for triangle in sorted {
        canvas.polygon(&triangle.map(above), "#c9ddf4", BLUE);
    }
    let corners = |triangles: &[[Vec3; 3]]| -> BTreeSet<[i64; 3]> {
        let exact =
            |corner: &Vec3| corner.to_array().map(|at| (f64::from(at) * f64::from(SNAP)).round() as i64);
        triangles.iter().flatten().map(exact).collect()
    };
    for [x, _, z] in corners(&tiles).intersection(&corners(&chunks)) {
        let at = Vec2::new(*x as f32, *z as f32) / SNAP as f32;
        if at.cmpge(min).all() && at.cmple(max).all() {
            canvas.dot(at, 3.2, "white", DARK);
        }
    }
    canvas.finish()
}

/// A vertical section along x through the tunnel.
fn section(world: &World) -> String {
    const Z: i32 = 24;
    let samples = world.samples();
    let heights: Vec<f32> =
        (0..=48).map(|x| world.ground().height(Column::new(x, Z)) as f32 / ONE as f32).collect();
    let low = heights.iter().copied().fold(f32::MAX, f32::min).min(-13.0).floor() - 1.0;
    let high = heights.iter().copied().fold(f32::MIN, f32::max).ceil() + 2.0;
    let mut canvas = Canvas::new(Vec2::new(0.0, low), Vec2::new(40.0, high), 17.0);
    for y in low as i32..=high as i32 {
        for x in 0..=40 {
            let point = IVec3::new(x, y, Z);
            let (at, is_solid) = (Vec2::new(x as f32, y as f32), samples.distance(point) < 0);
            match (samples.is_edited(point), is_solid) {
                (true, true) => canvas.dot(at, 3.4, BLUE, BLUE),
                (true, false) => canvas.dot(at, 3.4, "white", BLUE),
                (false, true) => canvas.dot(at, 1.1, BROWN, BROWN),
                (false, false) => canvas.dot(at, 0.7, GREY, GREY),
            }
        }
    }
    for (are_chunks, color) in [(false, BROWN), (true, BLUE)] {
        for triangle in triangles(world, are_chunks) {
            // Slightly off the lattice plane, so that no triangle lies within it.
            if let Some(cut) = slice(triangle, Z as f32 + 0.01) {
                canvas.line(&cut, color, 2.4);
            }
        }
    }
    canvas.finish()
}

/// Where a triangle crosses the plane of a z, as (x, y).
fn slice(triangle: [Vec3; 3], z: f32) -> Option<[Vec2; 2]> {
    let [a, b, c] = triangle;
    let crossings = [(a, b), (b, c), (c, a)].into_iter().filter_map(|(from, to)| {
        let share = (z - from.z) / (to.z - from.z);
        ((from.z < z) != (to.z < z)).then(|| from.lerp(to, share).truncate())
    });
    let crossings: Vec<Vec2> = crossings.collect();
    crossings.try_into().ok()
}

/// The steepest side between a cell of the mask and a neighbour, in the plane of that side.
fn steep(world: &World) -> String {
    let mask = mask(world);
    let height = |x: i32, z: i32| world.ground().height(Column::new(x, z)) as f32 / ONE as f32;
    let sides = mask.iter().filter(|cell| !mask.contains(&cell.offset(-1, 0)));
    let rise = |cell: &Column| (height(cell.x, cell.z) - height(cell.x, cell.z + 1)).abs();
    let side =
        sides.max_by(|a, b| rise(a).total_cmp(&rise(b)).then(b.cmp(a))).copied().unwrap_or(Column::new(0, 0));
    let [left, right] = [0, 1].map(|step| height(side.x, side.z + step));
    let (low, high) = (left.min(right).floor() - 1.0, left.max(right).ceil() + 1.0);
    let mut canvas = Canvas::new(Vec2::new(-0.4, low), Vec2::new(6.2, high), 62.0);
    for y in low as i32..=high as i32 {
        canvas.line(&[Vec2::new(0.0, y as f32), Vec2::new(1.0, y as f32)], GREY, 1.0);
    }
    for step in 0..=1 {
        let at = step as f32;
        canvas.line(&[Vec2::new(at, low), Vec2::new(at, high)], GREY, 1.0);
        for y in low as i32..=high as i32 {
            let is_solid = world.samples().distance(IVec3::new(side.x, y, side.z + step)) < 0;
            let fill = if is_solid { BROWN } else { "white" };
            canvas.dot(Vec2::new(at, y as f32), 4.0, fill, BROWN);
        }
    }
    // Vertices in the plane of the side, by height.
    let mut found: BTreeMap<i64, Vec2> = BTreeMap::new();
    for corner in triangles(world, true).into_iter().flatten() {
        let across = corner.z - side.z as f32;
        if corner.x == side.x as f32 && (0.0..=1.0).contains(&across) && (low..=high).contains(&corner.y) {
            found.insert((f64::from(corner.y) * f64::from(SNAP)) as i64, Vec2::new(across, corner.y));
        }
    }
    let border: Vec<Vec2> = found.into_values().collect();
    canvas.line(&border, BLUE, 3.0);
    for &vertex in &border {
        canvas.dot(vertex, 5.0, BLUE, "white");
    }
    let middle = (low + high) / 2.0;
    let labels = [
        (high - 1.2, "hollow: a sample of air", BROWN),
        (middle + 0.5, "line: the border that both sides draw", BLUE),
        (middle, "one vertex for each lattice edge", BLUE),
        (middle - 0.5, "that the surface crosses", BLUE),
        (low + 1.2, "filled: a solid sample", BROWN),
    ];
    for (y, text, color) in labels {
        canvas.label(Vec2::new(1.3, y), text, color);
    }
    canvas.finish()
}
