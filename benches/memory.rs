//! Memory for plants and for paths on a square kilometre: `cargo bench --features examples --bench memory`; without Bevy and
//! without landmass `cargo bench --no-default-features --features navigation,scatter --bench memory`.
//!
//! Prints the memory that stays allocated, on 1024 x 1024 voxels of a metre: plants as those of the bench `plants`, one tuft of
//! grass for every 0.64 square metres and trees 7.5 m apart; polygons for an agent of 0.4 x 1.8 m on a plain, on hills, and on
//! hills with 3,200 pits and tunnels; and, with landmass, its own meshes made from these polygons. In a game, both are loaded
//! near to cameras and sources only.

use std::sync::Arc;

use allocation_counter::measure;
use bevy_burrow::navigation::{NavPolygons, NavTilePos, WalkSettings, WalkableTile, Walker};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{Clearance, PatchPos, PlantPatches, Scatter, ScatterRules, Species};
use fastrand::Rng;
use glam::Vec3;

/// Cells along each side of the world.
const SIDE: u32 = 1024;

/// The bytes that are still allocated after some work, for a square kilometre.
fn bytes<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let mut result = None;
    let info = measure(|| result = Some(work()));
    let share = f64::from(SIDE).powi(2) / 1e6;
    (result.expect("it was run"), info.bytes_current as f64 / share)
}

fn print(what: &str, count: usize, unit: &str, bytes: f64) {
    let each = bytes * f64::from(SIDE).powi(2) / 1e6 / count.max(1) as f64;
    println!("| {what} | {count} {unit} | {:.2} MB | {each:.0} bytes |", bytes / 1e6);
}

fn hills() -> Ground {
    let noise = NoiseHeights { seed: 5, amplitude: 14.0, scale: 60.0, base: 20.0, ..NoiseHeights::default() };
    Ground::from_noise(SIDE, SIDE, &noise).expect("valid parameters")
}

/// A terrain with pits and tunnels.
fn terrain(ground: Ground, works: usize) -> Terrain {
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let mut rng = Rng::with_seed(1);
    for work in 0..works {
        let [x, z] = [0, 1].map(|_| rng.f32() * SIDE as f32);
        let y = terrain.world().height(x.into(), z.into()).unwrap_or_default() as f32;
        let at = Vec3::new(x, y, z);
        let shape = match work % 2 {
            0 => Shape::sphere(at, 3.5),
            _ => Shape::capsule(at - Vec3::Y, at + Vec3::new(20.0, -4.0, 0.0), 3.0),
        };
        terrain.apply([Brush::dig(shape)]);
    }
    terrain
}

fn plants() {
    let tree = Species {
        spacing: 7.5,
        density: 0.9,
        distance: 4.0,
        clearance: Clearance { radius: 1.2, height: 7.0 },
        ..Species::named("tree")
    };
    let grass = Species { spacing: 0.8, ..Species::named("grass") };
    let rules = ScatterRules { seed: 1, species: vec![tree, grass] };
    let scatter = Arc::new(Scatter::new(&rules).expect("valid rules"));
    let terrain = terrain(hills(), 0);
    for (species, name) in [(0, "trees"), (1, "tufts of grass")] {
        let (patches, bytes) = bytes(|| {
            let mut patches = PlantPatches::new(Arc::clone(&scatter));
            let last = (SIDE as i32 - 1) / scatter.patch_size(species);
            for (x, z) in (0..=last).flat_map(|z| (0..=last).map(move |x| (x, z))) {
                let pos = PatchPos { species, x, z };
                let plants = scatter.patch(terrain.world().ground(), pos);
                patches.insert(terrain.world(), pos, plants);
            }
            patches
        });
        print(name, patches.iter().map(|(_, patch)| patch.plants().len()).sum(), "plants", bytes);
    }
}

fn paths(name: &str, ground: Ground, works: usize) {
    let terrain = terrain(ground, works);
    let agent = WalkSettings {
        radius: 0.4,
        height: 1.8,
        step: 0.4,
        slope: 1.0,
        precision: 0.3,
        ..Default::default()
    };
    let walker = Walker::new(&agent).expect("valid settings");
    let world = terrain.world();
    let tiles: Vec<NavTilePos> = NavTilePos::all(world).collect();
    let (made, bytes) = bytes(|| -> Vec<NavPolygons> {
        tiles.iter().map(|&pos| WalkableTile::new(world, pos, &walker).polygons()).collect()
    });
    let count = made.iter().map(NavPolygons::len).sum();
    print(&format!("paths, {name}"), count, "polygons", bytes);
    #[cfg(feature = "landmass")]
    landmass(name, &made, count);
}

/// What landmass keeps for its meshes.
#[cfg(feature = "landmass")]
fn landmass(name: &str, made: &[NavPolygons], count: usize) {
    use bevy_burrow::paths::bevy_landmass::prelude::*;
    let (_meshes, bytes) = bytes(|| -> Vec<ValidNavigationMesh3d> {
        let meshes = made.iter().filter(|polygons| !polygons.is_empty()).map(|polygons| {
            let mesh = NavigationMesh3d {
                vertices: polygons.vertices().iter().map(|vertex| vertex.as_vec3() / 4096.0).collect(),
                polygons: polygons
                    .iter()
                    .map(|own| own.iter().rev().map(|&vertex| vertex as usize).collect())
                    .collect(),
                polygon_type_indices: vec![0; polygons.len()],
                height_mesh: None,
            };
            mesh.validate().expect("convex polygons")
        });
        meshes.collect()
    });
    print(&format!("landmass, {name}"), count, "polygons", bytes);
}

fn main() {
    println!("| a square kilometre | count on 1024 x 1024 voxels | memory | each |");
    println!("| --- | --- | --- | --- |");
    plants();
    paths("a plain", Ground::flat(SIDE, SIDE, 20.0).expect("valid parameters"), 0);
    paths("hills", hills(), 0);
    paths("dug hills", hills(), 3200);
}
