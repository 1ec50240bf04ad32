//! Fixed workloads whose instructions are counted: `tools/instructions.sh` runs each of them under callgrind, which
//! counts only what happens inside [`counted_workload`], and compares the counts with `benches/instructions.txt`.
//!
//! Unlike times, counts do not depend on other load, so small regressions show. One thread, fixed inputs, no clocks.
//!
//! `cargo bench --no-default-features --bench instructions -- NAME` runs one workload; without a name it lists them.

use std::hint::black_box;
use std::process::ExitCode;

use bevy_burrow::dense::{DenseGrid, DenseMesh, DenseMesher, Density, Normals};
use bevy_burrow::ground::MaterialId;
use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use glam::{Quat, Vec3};

#[allow(dead_code, reason = "the benchmark `meshers` uses all of it")]
#[path = "meshers/fields.rs"]
mod fields;

use fields::{Border, Field};

/// The counted part. Callgrind finds it by this name, so it must not be inlined.
#[inline(never)]
fn counted_workload(work: &mut dyn FnMut()) {
    work();
    black_box(());
}

/// A name, and what to do.
type Workload = (&'static str, fn());

const WORKLOADS: [Workload; 19] = [
    ("dense-caves", || dense(Field::Caves)),
    ("dense-chunk-i16", dense_chunk),
    ("dense-empty", || dense(Field::Empty)),
    ("dense-sphere", || dense(Field::Sphere)),
    ("dense-terrain", || dense(Field::Terrain)),
    ("dig-radius-4-dug", || dig(Digging::Dug)),
    ("dig-radius-4-fresh", || dig(Digging::Fresh)),
    ("light-radius-4-dug", || dig_lit(Digging::Dug)),
    ("light-radius-4-fresh", || dig_lit(Digging::Fresh)),
    ("dig-radius-4-deep", || dig(Digging::Deep)),
    ("dig-radius-4-mine", || dig(Digging::Mine)),
    ("dig-radius-4-mine-deep", || dig(Digging::DeepMine)),
    ("dig-radius-4-tunnel", || dig(Digging::Tunnel)),
    ("dig-radius-4-wall", || dig(Digging::Wall)),
    ("light-radius-4-tunnel", || dig_lit(Digging::Tunnel)),
    ("light-radius-4-wall", || dig_lit(Digging::Wall)),
    ("dig-radius-16", dig_wide),
    ("paint", paint),
    ("thousand-edits", thousand_edits),
];

fn main() -> ExitCode {
    // Everything runs on this thread: work on other threads would not be counted, and its order would vary.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    pool.expect("no pool was made before");
    // Cargo passes `--bench`.
    let Some(name) = std::env::args().skip(1).find(|word| word != "--bench") else {
        for (name, _) in WORKLOADS {
            println!("{name}");
        }
        return ExitCode::SUCCESS;
    };
    let Some((_, workload)) = WORKLOADS.iter().find(|(known, _)| *known == name) else {
        eprintln!("instructions: no workload '{name}'");
        return ExitCode::FAILURE;
    };
    workload();
    ExitCode::SUCCESS
}

/// One grid of 64^3 floats, with normals. Tables and buffers are created before counting begins.
fn dense(field: Field) {
    let grid = field.grid(64, Border::Cut);
    mesh_counted(|| DenseGrid::new(&grid.samples, grid.sides()).expect("a cube of samples"));
}

/// One chunk of 32^3 cells in i16, with an apron.
fn dense_chunk() {
    let grid = Field::Terrain.chunk(1, 35);
    mesh_counted(|| DenseGrid::with_apron(&grid.fixed, grid.sides()).expect("a cube of samples"));
}

fn mesh_counted<'a, S: Density + 'a>(grid: impl Fn() -> DenseGrid<'a, S>) {
    let (mut mesher, mut mesh) = (DenseMesher::new(), DenseMesh::default());
    mesher.mesh(grid(), Normals::Gradient, &mut mesh);
    counted_workload(&mut || mesher.mesh(grid(), Normals::Gradient, &mut mesh));
    black_box(&mesh);
}

fn hills() -> NoiseHeights {
    NoiseHeights { seed: 5, scale: 90.0, amplitude: 20.0, ..NoiseHeights::default() }
}

/// Hills of 256^2 columns in chunks of 32.
fn terrain() -> Terrain {
    let ground = Ground::from_noise(256, 256, &hills()).expect("valid noise");
    Terrain::new(ground, &TerrainSettings::default()).expect("valid settings")
}

/// The surface above place `number`; places lie all over the hills, apart from each other.
fn place(terrain: &Terrain, number: i32) -> Vec3 {
    let (x, z) = (24 + number * 89 % 208, 24 + number * 55 % 208);
    let height = terrain.world().ground().height(Column::new(x, z)) as f32 / 256.0;
    Vec3::new(x as f32, height, z as f32)
}

/// One transaction per brush, as when a player digs.
fn one_by_one(terrain: &mut Terrain, brushes: &[Brush]) {
    for brush in brushes {
        terrain.submit(brush);
        let commit = terrain.begin().expect("a queued brush").run();
        black_box(terrain.commit(commit).expect("no other commit"));
    }
}

fn spheres(terrain: &Terrain, radius: f32, offset: f32, count: i32) -> Vec<Brush> {
    let sphere =
        |number| Brush::dig(Shape::sphere(place(terrain, number) + Vec3::new(offset, 0.0, offset), radius));
    (0..count).map(sphere).collect()
}

/// The state of the ground where the spheres of radius 4 dig.
enum Digging {
    /// Untouched ground.
    Fresh,
    /// Next to earlier spheres, half a radius away.
    Dug,
    /// Untouched ground, 20 voxels below the surface.
    Deep,
    /// Untouched ground with strata.
    Mine,
    /// Untouched ground with strata, 20 voxels below the surface, where the ores are.
    DeepMine,
    /// The end of a tunnel that leads from the foot of a cliff into it.
    Tunnel,
    /// Places half way up a cliff, apart from each other.
    Wall,
}

/// A cliff of 24 voxels at x = 100, over a plain.
fn cliff() -> Terrain {
    let height = |x: i32, _| 20.0 + 24.0 * ((f64::from(x) - 100.0) / 6.0).clamp(0.0, 1.0);
    let ground = Ground::from_fn(256, 256, height).expect("valid heights");
    Terrain::new(ground, &TerrainSettings::default()).expect("valid settings")
}

/// The digs of a tunnel or a wall.
fn cliff_brushes(ground: &Digging) -> Vec<Brush> {
    let center = |number: i32| match ground {
        Digging::Tunnel => Vec3::new((103 + number * 3) as f32, 24.0, 128.0),
        _ => Vec3::new(103.0, 32.0, (20 + number * 55 % 216) as f32),
    };
    (0..24).map(|number| Brush::dig(Shape::sphere(center(number), 4.0))).collect()
}

fn dig(ground: Digging) {
    let mut terrain = if matches!(ground, Digging::Tunnel | Digging::Wall) { cliff() } else { terrain() };
    if matches!(ground, Digging::Mine | Digging::DeepMine) {
        let hills =
            Ground::from_noise(256, 256, &hills()).and_then(|ground| ground.with_strata(&Strata::mine()));
        terrain =
            Terrain::new(hills.expect("valid strata"), &TerrainSettings::default()).expect("valid settings");
    }
    // The first edit of all initialises tables.
    let warm_up = Brush::dig(Shape::sphere(Vec3::new(8.0, 0.0, 8.0), 4.0));
    terrain.apply([warm_up]);
    let (first, second) = (spheres(&terrain, 4.0, 0.0, 24), spheres(&terrain, 4.0, 3.0, 24));
    match ground {
        Digging::Fresh | Digging::Mine => counted_workload(&mut || one_by_one(&mut terrain, &first)),
        Digging::Deep | Digging::DeepMine => {
            let deeper = |brush: &Brush| brush.transformed(Quat::IDENTITY, Vec3::NEG_Y * 20.0, 1.0);
            let deep: Vec<_> = first.iter().map(deeper).collect();
            counted_workload(&mut || one_by_one(&mut terrain, &deep));
        }
        Digging::Dug => {
            one_by_one(&mut terrain, &first);
            counted_workload(&mut || one_by_one(&mut terrain, &second));
        }
        Digging::Tunnel | Digging::Wall => {
            let brushes = cliff_brushes(&ground);
            counted_workload(&mut || one_by_one(&mut terrain, &brushes));
        }
    }
}

/// The light of digs, which are not counted themselves.
fn dig_lit(ground: Digging) {
    let is_cliff = matches!(ground, Digging::Tunnel | Digging::Wall);
    let mut terrain = if is_cliff { cliff() } else { terrain() };
    terrain.apply([Brush::dig(Shape::sphere(Vec3::new(8.0, 0.0, 8.0), 4.0))]);
    let (first, second) = (spheres(&terrain, 4.0, 0.0, 24), spheres(&terrain, 4.0, 3.0, 24));
    let brushes = match ground {
        Digging::Dug => {
            one_by_one(&mut terrain, &first);
            second
        }
        Digging::Tunnel | Digging::Wall => cliff_brushes(&ground),
        _ => first,
    };
    for brush in &brushes {
        terrain.submit(brush);
        let commit = terrain.begin().expect("a queued brush").run();
        let before = terrain.snapshot();
        counted_workload(&mut || {
            black_box(commit.light(before.clone()));
        });
        drop(before);
        black_box(terrain.commit(commit).expect("no other commit"));
    }
}

/// Spheres that reach into several chunks.
fn dig_wide() {
    let mut terrain = terrain();
    let wide = spheres(&terrain, 16.0, 0.0, 4);
    counted_workload(&mut || one_by_one(&mut terrain, &wide));
}

/// Paint over dug and untouched ground.
fn paint() {
    let mut terrain = terrain();
    let dug = spheres(&terrain, 4.0, 0.0, 12);
    terrain.apply(&dug);
    let stroke = |number| Brush::paint(Shape::sphere(place(&terrain, number), 5.0), MaterialId(3));
    let strokes: Vec<Brush> = (0..24).map(stroke).collect();
    counted_workload(&mut || one_by_one(&mut terrain, &strokes));
}

/// A thousand edits of all kinds in one transaction, as when a saved game is played back.
fn thousand_edits() {
    let mut terrain = terrain();
    let mut random = fastrand::Rng::with_seed(11);
    let brush = |number: i32| {
        let center = place(&terrain, number) + Vec3::Y * (random.f32() * 12.0 - 9.0);
        let size = 1.5 + random.f32() * 3.0;
        let shape = match number % 3 {
            0 => Shape::sphere(center, size),
            1 => Shape::cylinder(center, Vec3::Y * 2.0 * size, size),
            _ => Shape::capsule(center, center + Vec3::X * size, size),
        };
        match number % 5 {
            0 => Brush::add(shape, MaterialId(2)),
            1 => Brush::dig(shape).with_roughness(Roughness::new(1.0, 4.0, number as u32)),
            _ => Brush::dig(shape),
        }
    };
    let brushes: Vec<Brush> = (0..1000).map(brush).collect();
    counted_workload(&mut || {
        black_box(terrain.apply(&brushes));
    });
}
