//! The cost of colliders: building them in tasks, by kind of shape, and updating them on the main thread.
//! `cargo bench --features avian --bench colliders`.
//!
//! For tiles and chunks of hills with tunnels, it compares the crate's own shape, a parry triangle mesh with fixed
//! internal edges, one without, and, for unedited tiles, a height field. Then it digs, in the crate's shapes, which are
//! rebuilt, and in parry's voxels, which are edited in place. Last, it measures the systems that update colliders on
//! 4096 tiles, and commits with and without a snapshot of the world held.

use std::hint::black_box;
use std::time::{Duration, Instant};

use avian3d::parry::math::{IVector, Vector};
use avian3d::parry::query::{Ray, RayCast};
use avian3d::parry::shape::{HeightField, HeightFieldFlags, TriMesh, TriMeshFlags, Voxels};
use avian3d::parry::utils::Array2;
use avian3d::prelude::{LinearVelocity, PhysicsPlugins};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::lattice::{ChunkPos, Column, TilePos};
use bevy_burrow::physics::{
    ColliderSource, GroundShape, PhysicsFigures, TerrainPhysicsPlugin, TerrainPhysicsSystems,
};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use fastrand::Rng;

/// Rounds, of which the fastest counts.
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
            row(what, "mesh, edges fixed", &meshes, |mesh| Some(tri_mesh(mesh, flags)?.heap_memory_size()));
            row(what, "mesh", &meshes, |mesh| {
                Some(tri_mesh(mesh, TriMeshFlags::empty())?.heap_memory_size())
            });
            if what == "tile" {
                row(what, "height field", &meshes, |mesh| Some(height_field(mesh, chunk_size as usize)));
            }
        }
        println!();
    }
    digs()?;
    println!();
    upkeep()?;
    println!();
    commits()
}

/// Cells of a chunk, and columns along a side of the world, in which colliders are dug.
const CHUNK: i32 = 32;
const SIDE: i32 = 256;

/// The shapes of a tile and of the chunks over it, each with its lowest point.
fn shapes_over(terrain: &Terrain, tile: TilePos) -> Vec<(Vec3, GroundShape)> {
    let world = terrain.world();
    let origin = |y: i32| IVec3::new(tile.x, y, tile.z).as_vec3() * CHUNK as f32;
    let of = |origin, mesh| Some((origin, GroundShape::new(&mesh, 1.0)?));
    let chunks = world.drawn_chunks().filter(|chunk| chunk.tile() == tile);
    let chunks = chunks.filter_map(|chunk: ChunkPos| of(origin(chunk.y), world.chunk_mesh(chunk)));
    of(origin(0), world.tile_mesh(tile)).into_iter().chain(chunks).collect()
}

/// Digs balls of radius 4 out of colliders. The crate's own shapes have the triangles of the ground's meshes, and are
/// rebuilt for the parts that a dig touches; parry's `Voxels`, which has no slopes, is edited voxel by voxel. Then
/// casts rays downwards.
fn digs() -> Result<(), Box<dyn std::error::Error>> {
    let noise = NoiseHeights { seed: 11, scale: 60.0, amplitude: 20.0, base: 4.0, ..Default::default() };
    let ground = Ground::from_noise(SIDE as u32, SIDE as u32, &noise)?;
    let height = |x: i32, z: i32| ground.height(Column::new(x, z)) / 256;
    let columns = (0..SIDE).flat_map(|x| (0..SIDE).map(move |z| (x, z)));
    let solid: Vec<IVector> =
        columns.flat_map(|(x, z)| (-24..height(x, z)).map(move |y| IVector::new(x, y, z))).collect();
    let start = Instant::now();
    let mut voxels = Voxels::new(Vector::splat(1.0), &solid);
    println!("{} voxels are made in {:.0?}", solid.len(), start.elapsed());
    let mut rng = Rng::with_seed(9);
    let places: Vec<Vec3> = (0..200)
        .map(|number| {
            let (x, z) = (20 + number * 37 % 216, 20 + number * 53 % 216);
            Vec3::new(x as f32, height(x, z) as f32 - 6.0 * rng.f32(), z as f32)
        })
        .collect();
    let mut terrain = Terrain::new(ground, &TerrainSettings { chunk_size: CHUNK as u32, voxel_size: 1.0 })?;
    let [mut edits, mut built, mut taken] = [const { Vec::new() }; 3];
    for &place in &places {
        terrain.submit(Brush::dig(Shape::sphere(place, 4.0)));
        let transaction = terrain.begin().ok_or("nothing to do")?;
        let start = Instant::now();
        let commit = transaction.run();
        edits.push(start.elapsed());
        terrain.commit(commit)?;
        let [low, high] = [-5.0, 5.0].map(|reach| ((place + reach) / CHUNK as f32).floor().as_ivec3());
        let world = terrain.world();
        let mut meshes = Vec::new();
        for (x, z) in (low.x..=high.x).flat_map(|x| (low.z..=high.z).map(move |z| (x, z))) {
            meshes.push(world.tile_mesh(TilePos { x, z }));
            meshes.extend((low.y..=high.y).map(|y| world.chunk_mesh(ChunkPos { x, y, z })));
        }
        let start = Instant::now();
        black_box(meshes.iter().filter_map(|mesh| GroundShape::new(mesh, 1.0)).count());
        built.push(start.elapsed());
        let start = Instant::now();
        let reach = || -5..=5;
        for offset in
            reach().flat_map(|x| reach().flat_map(move |y| reach().map(move |z| IVec3::new(x, y, z))))
        {
            let at = place.floor().as_ivec3() + offset;
            if (at.as_vec3() + 0.5).distance(place) <= 4.0 {
                voxels.set_voxel(IVector::from_array(at.to_array()), false);
            }
        }
        taken.push(start.elapsed());
    }
    let tiles = |x: i32| (0..SIDE / CHUNK).map(move |z| TilePos { x, z });
    let shapes: Vec<_> =
        (0..SIDE / CHUNK).flat_map(tiles).map(|tile| (tile, shapes_over(&terrain, tile))).collect();
    let rays: Vec<Vec3> =
        (0..4000).map(|_| Vec3::new(rng.f32() * 250.0 + 3.0, 90.0, rng.f32() * 250.0 + 3.0)).collect();
    let down = |from: Vec3| Ray::new(Vector::from_array(from.to_array()), Vector::new(0.0, -1.0, 0.0));
    let start = Instant::now();
    for &from in &rays {
        let tile = TilePos { x: from.x as i32 / CHUNK, z: from.z as i32 / CHUNK };
        let over = shapes.iter().find(|(other, _)| *other == tile);
        let hits = over.into_iter().flat_map(|(_, shapes)| shapes);
        black_box(
            hits.filter_map(|(low, shape)| shape.cast_local_ray(&down(from - *low), 200.0, true)).count(),
        );
    }
    let ours = start.elapsed();
    let start = Instant::now();
    for &from in &rays {
        black_box(voxels.cast_local_ray(&down(from), 200.0, true));
    }
    let theirs = start.elapsed();
    let ray = |all: Duration| all.as_secs_f64() * 1e9 / rays.len() as f64;
    for list in [&mut edits, &mut built, &mut taken] {
        list.sort_unstable();
    }
    let bytes: usize = shapes.iter().flat_map(|(_, shapes)| shapes).map(|(_, shape)| shape.bytes()).sum();
    println!(
        "| {} digs of radius 4, chunks of {CHUNK} | edit of the ground with meshes, median µs | collider, median µs | p99 µs | a ray, ns | bytes |",
        places.len()
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    let row = |what, edit: String, times: &[Duration], ns: f64, bytes: usize| {
        println!(
            "| {what} | {edit} | {:.1} | {:.1} | {ns:.0} | {bytes} |",
            micros(times, 0.5),
            micros(times, 0.99)
        );
    };
    row("own shapes of the touched parts", format!("{:.1}", micros(&edits, 0.5)), &built, ray(ours), bytes);
    row("parry's `Voxels`", "-".into(), &taken, ray(theirs), voxels.total_memory_size());
    Ok(())
}

/// When the systems of a frame began, and how long they took.
#[derive(Resource, Default)]
struct Clock(Option<Instant>, Vec<Duration>);

/// Number of measured frames.
const FRAMES: usize = 256;

/// The systems in `Update` that maintain colliders, and the plugin's systems between them.
fn upkeep() -> Result<(), Box<dyn std::error::Error>> {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PhysicsPlugins::default(), BurrowPlugins, TerrainPhysicsPlugin))
        .init_resource::<Clock>()
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(1.0 / 64.0)))
        .add_systems(
            Update,
            (
                (|mut clock: ResMut<Clock>| clock.0 = Some(Instant::now()))
                    .before(TerrainPhysicsSystems::Near),
                (|mut clock: ResMut<Clock>| {
                    let spent = clock.0.map(|start| start.elapsed());
                    clock.1.extend(spent);
                })
                .after(TerrainPhysicsSystems::Upkeep),
            ),
        );
    app.finish();
    app.cleanup();
    let ground = Ground::flat(1024, 1024, 8.0)?;
    app.world_mut().spawn(Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 })?);
    let walk = Vec3::X * 5.0;
    for number in 0..100 {
        let place = Vec3::new(60.3 + 90.0 * (number % 10) as f32, 9.0, 60.0 + 90.0 * (number / 10) as f32);
        let source =
            (Transform::from_translation(place), ColliderSource { radius: 32.0 }, LinearVelocity(walk));
        app.world_mut().spawn(source);
    }
    println!(
        "4096 tiles, 100 sources; the systems of {FRAMES} frames\n| | mean µs | median µs | p99 µs |\n| --- | --- | --- | --- |"
    );
    let settle = |app: &mut App| {
        for _ in 0..100_000 {
            app.update();
            std::thread::sleep(Duration::from_micros(200));
            let figures = app.world().resource::<PhysicsFigures>().clone();
            let is_busy =
                app.world_mut().query::<&Terrain>().iter(app.world()).any(|t| t.is_busy() || t.queued() > 0);
            if figures.colliders > 0 && figures.missing == 0 && !is_busy {
                break;
            }
        }
    };
    for (what, walks, digs) in [
        ("nothing happens", false, false),
        ("a brush in each fourth frame", false, true),
        ("the sources walk", true, false),
        ("the sources walk, a brush in each fourth frame", true, true),
    ] {
        settle(&mut app);
        app.world_mut().resource_mut::<Clock>().1.clear();
        for frame in 0..FRAMES {
            if walks {
                let world = app.world_mut();
                let mut sources = world.query_filtered::<&mut Transform, With<ColliderSource>>();
                sources.iter_mut(world).for_each(|mut place| place.translation += walk / 64.0);
            }
            if digs && frame % 4 == 0 {
                let place = Vec3::new(100.0 + 3.0 * frame as f32, 8.0, 150.0 + (frame % 7) as f32 * 100.0);
                app.world_mut().write_message(Brush::dig(Shape::sphere(place, 3.0)));
            }
            app.update();
        }
        let mut spent = std::mem::take(&mut app.world_mut().resource_mut::<Clock>().1);
        spent.sort_unstable();
        let mean = spent.iter().sum::<Duration>().as_secs_f64() * 1e6 / spent.len().max(1) as f64;
        println!("| {what} | {mean:.1} | {:.1} | {:.1} |", micros(&spent, 0.5), micros(&spent, 0.99));
    }
    Ok(())
}

fn micros(sorted: &[Duration], share: f64) -> f64 {
    let at = (sorted.len().saturating_sub(1) as f64 * share) as usize;
    sorted.get(at).map_or(0.0, |duration| duration.as_secs_f64() * 1e6)
}

/// The effect of a held snapshot on a commit.
fn commits() -> Result<(), Box<dyn std::error::Error>> {
    println!("| bricks | a snapshot is held | commit, median µs | p99 µs |\n| --- | --- | --- | --- |");
    for side in [40.0, 200.0] {
        let mut terrain = Terrain::new(Ground::flat(512, 512, 40.0)?, &TerrainSettings::default())?;
        let (middle, half) = (Vec3::new(256.0, 30.0, 256.0), Vec3::new(side, 16.0, side));
        terrain.apply([Brush::dig(Shape::cuboid(middle, half))]);
        for is_held in [false, true] {
            let mut spent = Vec::new();
            for number in 0..100 {
                let place = Vec3::new(60.0 + 4.0 * number as f32, 40.0, 20.0 + 400.0 * f32::from(is_held));
                terrain.submit(Brush::dig(Shape::sphere(place, 3.0)));
                let commit = terrain.begin().ok_or("nothing to do")?.run();
                let snapshot = is_held.then(|| terrain.snapshot());
                let start = Instant::now();
                terrain.commit(commit)?;
                spent.push(start.elapsed());
                drop(snapshot);
            }
            spent.sort_unstable();
            let bricks = terrain.world().bricks().count();
            println!("| {bricks} | {is_held} | {:.1} | {:.1} |", micros(&spent, 0.5), micros(&spent, 0.99));
        }
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
    let triangles = mesh.indices.triangles().collect();
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
