//! Where agents can walk.

#[cfg(feature = "landmass")]
mod bevy_app;
mod laws;
mod ledges;
mod polygons;
mod recast;
mod reference;
mod speed;
#[path = "../worlds/mod.rs"]
mod worlds;

use bevy_burrow::ground::{Ground, MaterialId};
use bevy_burrow::navigation::{NavTilePos, WalkSettings, WalkableCell, WalkableTile, Walker};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{DVec3, Vec3};

/// The number of random worlds: `BURROW_PATH_WORLDS`, or the default.
fn world_count(default: u64) -> u64 {
    std::env::var("BURROW_PATH_WORLDS").ok().and_then(|count| count.parse().ok()).unwrap_or(default)
}

fn walker(settings: &WalkSettings) -> Walker {
    Walker::new(settings).expect("valid settings")
}

/// The walkable cells of a world, in order.
fn all_cells(world: &World, walker: &Walker) -> Vec<WalkableCell> {
    let tiles = NavTilePos::all(world).map(|pos| WalkableTile::new(world, pos, walker));
    let mut cells: Vec<WalkableCell> = tiles.flat_map(|tile| tile.cells().collect::<Vec<_>>()).collect();
    cells.sort_unstable();
    cells
}

/// Agents of many kinds: small and large, those that climb and those that need even ground.
fn random_settings(rng: &mut Rng) -> WalkSettings {
    WalkSettings {
        radius: [0.0, 0.3, 0.5, 0.7, 0.9, 1.2, 2.0, 3.1][rng.usize(0..8)],
        height: [0.4, 1.0, 1.8, 2.5, 6.0][rng.usize(0..5)],
        step: [0.0, 0.3, 0.6, 1.5][rng.usize(0..4)],
        slope: [0.2, 0.7, 1.0, 2.0][rng.usize(0..4)],
        precision: [0.05, 0.25, 0.5, 2.0][rng.usize(0..4)],
        ..WalkSettings::default()
    }
}

/// A hilly world of a few tiles with tunnels, pits, platforms and bridges; in some, loose ground falls, rules protect parts of
/// it, and steps are undone.
fn random_dug_world(rng: &mut Rng, index: u64) -> Terrain {
    let (width, depth) = (rng.u32(20..100), rng.u32(20..70));
    let ground = match index % 3 {
        0 => Ground::flat(width, depth, 20.0 + rng.f64() * 3.0).expect("a valid ground"),
        _ => worlds::random_ground_of_size(rng, index, width, depth),
    };
    let chunk_size = [8, 16, 32][rng.usize(0..3)];
    let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
    let rules = worlds::random_rules(rng, &ground);
    let mut terrain = Terrain::new(ground, &settings).expect("a valid terrain");
    if index % 4 == 1 {
        terrain.set_rules(rules).expect("valid rules");
    }
    if index % 4 > 1 {
        terrain.set_loose(Some(LooseSettings { largest: 4000, crumbs: 20, debris: 4000 }));
    }
    for _ in 0..rng.usize(1..25) {
        match rng.u8(0..12) {
            0 => drop(terrain.undo()),
            1 => drop(terrain.redo()),
            _ => {
                let brush = random_works(rng, terrain.world());
                terrain.apply([brush]);
            }
        }
    }
    terrain
}

/// A brush near the surface: a tunnel, a pit, a wall, a bridge or a step.
fn random_works(rng: &mut Rng, world: &World) -> Brush {
    let ground = world.ground();
    let place = |rng: &mut Rng| {
        let (x, z) = (rng.f32() * ground.width() as f32, rng.f32() * ground.depth() as f32);
        let y = world.height(f64::from(x), f64::from(z)).unwrap_or_default() as f32;
        Vec3::new(x, y, z)
    };
    let (at, to) = (place(rng), place(rng));
    let to = at + (to - at).clamp_length_max(25.0);
    let radius = 1.5 + 3.0 * rng.f32();
    let raised = Vec3::Y * (rng.f32() - 0.5) * 6.0;
    let half = Vec3::new(1.0 + 6.0 * rng.f32(), 0.5 + 2.0 * rng.f32(), 1.0 + 6.0 * rng.f32());
    match rng.u8(0..9) {
        0 | 1 => Brush::dig(Shape::capsule(at + raised, to + raised, radius)),
        2 => Brush::dig(Shape::sphere(at, radius)),
        3 => Brush::add(Shape::cuboid(at + raised, half), MaterialId(1)),
        4 => Brush::dig(Shape::cuboid(at + raised, half)),
        5 => Brush::add(Shape::capsule(at + raised, to + raised, radius), MaterialId(2)),
        _ => worlds::any_random_brush(rng, ground),
    }
}

/// The height of a cell's ground at a place in it, between its corners.
fn height_in(cell: &WalkableCell, x: f64, z: f64) -> f64 {
    let [a, b, c, d] = cell.heights.map(|height| f64::from(height) / 256.0);
    let (x, z) = (x - f64::from(cell.cell.x), z - f64::from(cell.cell.z));
    (a * (1.0 - x) + d * x) * (1.0 - z) + (b * (1.0 - x) + c * x) * z
}

#[test]
fn a_tunnel_has_a_floor_below_the_one_above() {
    let ground = Ground::flat(64, 64, 30.0).expect("a valid ground");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("a valid terrain");
    let walker = walker(&WalkSettings { radius: 0.4, height: 2.0, ..WalkSettings::default() });
    let before = all_cells(terrain.world(), &walker);
    assert_eq!(before.len(), 62 * 62);
    let tunnel = Shape::capsule(Vec3::new(10.0, 15.0, 32.0), Vec3::new(54.0, 15.0, 32.0), 4.0);
    terrain.apply([Brush::dig(tunnel)]);
    let cells = all_cells(terrain.world(), &walker);
    let (above, below): (Vec<_>, Vec<_>) = cells.into_iter().partition(|cell| cell.heights[0] > 20 * 256);
    assert_eq!(above, before);
    assert!((100..400).contains(&below.len()), "{}", below.len());
    for cell in &below {
        let at =
            DVec3::new(f64::from(cell.cell.x), f64::from(cell.heights[0]) / 256.0, f64::from(cell.cell.z));
        assert!(
            terrain.world().is_solid(at - 0.1 * DVec3::Y) && !terrain.world().is_solid(at + 0.1 * DVec3::Y)
        );
    }
    terrain.undo();
    assert_eq!(all_cells(terrain.world(), &walker), before);
}

#[test]
fn tall_and_wide_agents_do_not_fit_into_a_low_and_narrow_tunnel() {
    let ground = Ground::flat(64, 32, 30.0).expect("a valid ground");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("a valid terrain");
    let tunnel = Shape::cuboid(Vec3::new(32.0, 12.0, 16.0), Vec3::new(20.0, 2.0, 2.0));
    terrain.apply([Brush::dig(tunnel)]);
    let count = |radius, height| {
        let walker = walker(&WalkSettings { radius, height, ..WalkSettings::default() });
        all_cells(terrain.world(), &walker).iter().filter(|cell| cell.heights[0] < 20 * 256).count()
    };
    assert!(count(0.5, 3.0) >= 38, "{}", count(0.5, 3.0));
    assert_eq!([count(0.5, 5.0), count(3.0, 3.0)], [0, 0]);
}
