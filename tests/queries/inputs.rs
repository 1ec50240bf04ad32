//! Random worlds and positions for the query tests.

use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{DVec3, IVec3, Vec3};

use crate::triangles::Triangles;
use crate::worlds::{random_brush, random_world, real_ground, world_count};

/// The worlds that are queried.
pub fn dug_worlds() -> impl Iterator<Item = (String, Terrain)> {
    (0..world_count(24)).map(|index| {
        let mut rng = Rng::with_seed(31_000 + index);
        (format!("world {index}"), random_world(&mut rng, index))
    })
}

/// A corner of the real landscape with a hillside full of tunnels; materials depend on height and slope.
pub fn dug_landscape() -> Terrain {
    let whole = real_ground();
    let height = |x: i32, z: i32| f64::from(whole.height(Column::new(400 + x, 300 + z))) / 256.0;
    let ground = Ground::from_fn(160, 144, height).expect("finite heights");
    let (low, high) = ground.height_range();
    let middle = f64::from(low + high) / 512.0;
    let rules = vec![
        MaterialRule { overlay: MaterialId(11), slope: (0.5, f64::INFINITY), ..Default::default() },
        MaterialRule { overlay: MaterialId(12), height: (middle, f64::INFINITY), ..Default::default() },
    ];
    let ground =
        ground.with_materials(&MaterialControl::Rules { base: MaterialId(10), rules }).expect("valid rules");
    let mut rng = Rng::with_seed(5);
    let mut brushes = Vec::new();
    for _ in 0..25 {
        brushes.push(random_brush(&mut rng, &ground));
        let column = Column::new(rng.i32(0..=160), rng.i32(0..=144));
        let from = Vec3::new(column.x as f32, ground.height(column) as f32 / 256.0 + 1.0, column.z as f32);
        let to = from + Vec3::new(rng.f32() * 60.0 - 30.0, -rng.f32() * 12.0, rng.f32() * 60.0 - 30.0);
        brushes.push(Brush::dig(Shape::capsule(from, to, 3.0)));
        brushes.push(Brush::dig(Shape::sphere(to, 6.0)).with_roughness(Roughness::new(
            1.5,
            4.0,
            rng.u32(..),
        )));
    }
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.apply(&brushes);
    terrain
}

/// Level ground with hills, a tunnel and a bridge.
pub fn small_terrain() -> Terrain {
    let height = |x: i32, z: i32| 10.0 + f64::from((x * 5 + z * 3) % 7) / 2.0;
    let ground = Ground::from_fn(40, 30, height).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.apply([
        Brush::dig(Shape::capsule(Vec3::new(5.0, 5.0, 15.0), Vec3::new(35.0, 5.0, 15.0), 2.5)),
        Brush::add(
            Shape::capsule(Vec3::new(5.0, 20.0, 5.0), Vec3::new(35.0, 20.0, 25.0), 2.0),
            MaterialId(4),
        ),
    ]);
    terrain
}

/// A random direction, normalised or not.
pub fn random_direction(rng: &mut Rng) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let component = |rng: &mut Rng| rng.f64() * 2.0 - 1.0;
    match rng.u32(0..8) {
        0 | 1 => axes[rng.usize(0..6)],
        2 => axes[rng.usize(0..6)] + axes[rng.usize(0..6)] * 0.5,
        3 => DVec3::new(component(rng), 0.0, component(rng)),
        4 => DVec3::new(component(rng), -3.0, component(rng)) * 100.0,
        5 => IVec3::new(rng.i32(-2..=2), rng.i32(-2..=2), rng.i32(-2..=2)).as_dvec3(),
        _ => DVec3::new(component(rng), component(rng), component(rng)),
    }
    .try_normalize()
    .map_or(DVec3::NEG_Y, |unit| unit * (1.0 + rng.f64()))
}

/// A lattice point near the surface of a world.
pub fn point_near_surface(rng: &mut Rng, world: &World) -> IVec3 {
    let column = Column::new(rng.i32(0..=world.grid().width()), rng.i32(0..=world.grid().depth()));
    column.at(world.ground().height(column) / 256 + rng.i32(-8..=6))
}

/// A random vertical line: anywhere, on lattice lines and points, on the rim, through vertices and edges.
pub fn random_column(rng: &mut Rng, world: &World, triangles: &Triangles) -> (f64, f64) {
    let (width, depth) = (world.grid().width(), world.grid().depth());
    let free = (rng.f64() * f64::from(width), rng.f64() * f64::from(depth));
    let lattice = (f64::from(rng.i32(0..=width)), f64::from(rng.i32(0..=depth)));
    match rng.u32(0..8) {
        0 | 1 => free,
        2 => lattice,
        3 => (lattice.0, free.1),
        4 => ([0.0, f64::from(width)][rng.usize(0..2)], [free.1, lattice.1][rng.usize(0..2)]),
        5 => ([free.0, lattice.0, 0.0][rng.usize(0..3)], [0.0, f64::from(depth)][rng.usize(0..2)]),
        _ => {
            // Through dug ground: triangles of tiles come first in the list.
            let count = triangles.triangles.len();
            let [a, b, c] = triangles.triangles[rng.usize(triangles.tiles.min(count - 1)..count)];
            let place = [a, (a + b) / 2.0, a.lerp(b, rng.f64()), (a + b + c) / 3.0][rng.usize(0..4)];
            (place.x, place.z)
        }
    }
}
