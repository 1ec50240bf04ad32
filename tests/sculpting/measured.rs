//! Test grounds for sculpting, and measurements of their surface.

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{IVec3, Vec3};

/// Tolerance for positions of the surface, in voxels.
pub const CLOSE: f64 = 1.0 / 16.0;

pub fn terrain(ground: Ground) -> Terrain {
    Terrain::new(ground, &TerrainSettings::default()).expect("valid settings")
}

/// Fixed bumps, a few voxels high.
pub fn bumpy(high: f64) -> Ground {
    let mut rng = Rng::with_seed(4);
    let bumps: Vec<f64> = (0..65 * 65).map(|_| rng.f64() * high).collect();
    Ground::from_fn(64, 64, |x, z| 20.0 + bumps[(z * 65 + x) as usize]).expect("finite heights")
}

/// Ground with a cave, a shaft, a heap and a tower.
pub fn dug(ground: Ground) -> Terrain {
    let mut terrain = terrain(ground);
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    terrain.apply([
        Brush::dig(Shape::sphere(at(30.0, 12.0, 30.0), 9.0)),
        Brush::dig(Shape::cylinder(at(40.0, 8.0, 36.0), Vec3::Y * 30.0, 3.0)),
        Brush::add(Shape::sphere(at(22.0, 22.0, 40.0), 6.0), MaterialId(3)),
        Brush::add(Shape::cuboid(at(44.0, 26.0, 24.0), at(2.0, 9.0, 2.0)), MaterialId(4)),
    ]);
    terrain
}

/// Positions of the surface along a line of samples: each sign change, interpolated between its densities.
pub fn crossings(world: &World, from: IVec3, step: IVec3, count: i32) -> Vec<f64> {
    let samples = world.samples();
    let density = |i: i32| f64::from(samples.distance(from + step * i));
    let crossing = |i: i32| {
        let (a, b) = (density(i), density(i + 1));
        ((a < 0.0) != (b < 0.0)).then(|| f64::from(i) + a.abs() / (a.abs() + b.abs()))
    };
    (0..count).filter_map(crossing).collect()
}

/// The heights of the surface in a column between two heights.
pub fn heights(world: &World, x: i32, z: i32, low: i32, high: i32) -> Vec<f64> {
    let found = crossings(world, IVec3::new(x, low, z), IVec3::Y, high - low);
    found.into_iter().map(|along| f64::from(low) + along).collect()
}

pub fn solid(world: &World) -> u64 {
    let all = LatticeBox::new(IVec3::new(0, -10, 0), IVec3::new(64, 60, 64)).expect("not empty");
    world.samples().solid_count(all)
}

/// The number of solid components in a box that do not touch its rim.
pub fn crumbs(world: &World, within: LatticeBox) -> usize {
    let samples = world.samples();
    let mut seen = std::collections::HashSet::new();
    let mut found = 0;
    for start in within.points().filter(|&point| samples.is_solid(point)) {
        if !seen.insert(start) {
            continue;
        }
        let (mut open, mut is_tied) = (vec![start], false);
        while let Some(point) = open.pop() {
            for step in [IVec3::X, IVec3::Y, IVec3::Z].into_iter().flat_map(|axis| [axis, -axis]) {
                let near = point + step;
                is_tied |= !within.contains(near);
                if within.contains(near) && samples.is_solid(near) && seen.insert(near) {
                    open.push(near);
                }
            }
        }
        found += usize::from(!is_tied);
    }
    found
}

/// The mean square of second differences of height, which smoothing reduces.
pub fn roughness(world: &World, from: i32, to: i32) -> f64 {
    let height = |x: i32, z: i32| heights(world, x, z, 0, 60).last().copied().expect("ground everywhere");
    let mut sum = 0.0;
    for (x, z) in (from..=to).flat_map(|x| (from..=to).map(move |z| (x, z))) {
        let around = height(x - 1, z) + height(x + 1, z) + height(x, z - 1) + height(x, z + 1);
        sum += (around - 4.0 * height(x, z)).powi(2);
    }
    sum / f64::from((to - from + 1).pow(2))
}

pub fn assert_closed(terrain: &Terrain) {
    let report = terrain.world().check_seams();
    assert!(report.is_flawless(), "{report}");
}
