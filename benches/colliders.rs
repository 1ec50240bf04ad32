//! What a collider costs in the task, and which kind: `cargo bench --features avian --bench colliders`.
//!
//! For tiles and chunks of hills with tunnels: the crate's own shape, a triangle mesh of parry's that mends its inner
//! edges, one that does not, and, for tiles that nobody dug, a height field.

use std::hint::black_box;
use std::time::{Duration, Instant};

use avian3d::parry::math::Vector;
use avian3d::parry::shape::{HeightField, HeightFieldFlags, TriMesh, TriMeshFlags};
use avian3d::parry::utils::Array2;
use bevy_burrow::physics::GroundShape;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use glam::Vec3;

/// Rounds of which the fastest counts.
const ROUNDS: u32 = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for chunk_size in [16, 32] {
        let noise = NoiseHeights { seed: 11, scale: 60.0, amplitude: 20.0, base: 4.0, ..Default::default() };
        let ground = Ground::from_noise(256, 256, &noise)?;
        let mut terrain = Terrain::new(ground, &TerrainSettings { chunk_size, voxel_size: 1.0 })?;
        let pristine = meshes(&terrain, true);
        terrain.apply((0..8).map(|number| {
            let at = 16.0 + 30.0 * number as f32;
            Brush::dig(Shape::capsule(Vec3::new(8.0, 2.0, at), Vec3::new(248.0, 5.0, at), 3.5))
        }));
        println!("chunks of {chunk_size} cells; fastest of {ROUNDS} rounds, mean over all parts");
        println!("| what | kind | triangles | µs | bytes |\n| --- | --- | --- | --- | --- |");
        for (what, meshes) in [
            ("tile", pristine),
            ("tile with rings", meshes(&terrain, true)),
            ("chunk", meshes(&terrain, false)),
        ] {
            let flags = TriMeshFlags::FIX_INTERNAL_EDGES;
            row(what, "own shape", &meshes, |mesh| GroundShape::new(mesh, 1.0).map(|shape| shape.bytes()));
            row(what, "mesh, edges mended", &meshes, |mesh| Some(tri_mesh(mesh, flags)?.heap_memory_size()));
            row(what, "mesh", &meshes, |mesh| {
                Some(tri_mesh(mesh, TriMeshFlags::empty())?.heap_memory_size())
            });
            if what == "tile" {
                row(what, "height field", &meshes, |mesh| Some(height_field(mesh, chunk_size as usize)));
            }
        }
        println!();
    }
    Ok(())
}

fn meshes(terrain: &Terrain, tiles: bool) -> Vec<SurfaceMesh> {
    let world = terrain.world();
    if tiles {
        return world.grid().tiles().map(|tile| world.tile_mesh(tile)).collect();
    }
    world.drawn_chunks().map(|chunk| world.chunk_mesh(chunk)).collect()
}

fn row(what: &str, kind: &str, meshes: &[SurfaceMesh], build: impl Fn(&SurfaceMesh) -> Option<usize>) {
    let count = meshes.len() as u32;
    let (mut fastest, mut bytes) = (Duration::MAX, 0);
    for _ in 0..ROUNDS {
        let start = Instant::now();
        bytes = meshes.iter().filter_map(|mesh| black_box(build(mesh))).sum::<usize>();
        fastest = fastest.min(start.elapsed());
    }
    let triangles: usize = meshes.iter().map(|mesh| mesh.indices.len() / 3).sum();
    let mean = |all: usize| all as u32 / count.max(1);
    let time = fastest.as_secs_f64() * 1e6 / f64::from(count.max(1));
    println!("| {what} | {kind} | {} | {time:.1} | {} |", mean(triangles), mean(bytes));
}

fn tri_mesh(mesh: &SurfaceMesh, flags: TriMeshFlags) -> Option<TriMesh> {
    let vertices = mesh.vertices.iter().map(|vertex| Vector::from_array(vertex.position_f32())).collect();
    let triangles = mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    TriMesh::with_flags(vertices, triangles, flags).ok()
}

fn height_field(mesh: &SurfaceMesh, cells: usize) -> usize {
    let heights = mesh.vertices.iter().take((cells + 1) * (cells + 1)).map(|vertex| vertex.position_f32()[1]);
    let mut field = Array2::repeat(cells + 1, cells + 1, 0.0);
    for (number, height) in heights.enumerate() {
        field[(number / (cells + 1), number % (cells + 1))] = height;
    }
    let scale = Vector::new(cells as f32, 1.0, cells as f32);
    let field = HeightField::with_flags(field, scale, HeightFieldFlags::FIX_INTERNAL_EDGES);
    size_of_val(field.heights().data()) + size_of_val(field.cells_statuses().data())
}
