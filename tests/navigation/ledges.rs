//! Links over ledges are exactly those of the definition.

use bevy_burrow::lattice::{Column, LatticeBox};
use bevy_burrow::navigation::{LedgeLink, NavTilePos, WalkSettings, WalkableTile};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::reference::{Leap, leaps};
use crate::{random_dug_world, random_settings, random_works, walker, world_count};

const FINE: i32 = 4096;

fn random_leaper(rng: &mut Rng) -> WalkSettings {
    WalkSettings {
        jump_down: [0.0, 2.0, 5.5, 30.0][rng.usize(0..4)],
        climb_up: [0.0, 1.5, 4.0][rng.usize(0..3)],
        leap: [0.0, 1.0, 3.5][rng.usize(0..3)],
        ..random_settings(rng)
    }
}

/// The links of a tile, from the world's origin.
fn links(world: &World, pos: NavTilePos, settings: &WalkSettings) -> Vec<LedgeLink> {
    let origin = pos.origin().at(0) * FINE;
    let moved = |link: LedgeLink| {
        let [top, bottom] = [link.top, link.bottom].map(|edge| edge.map(|end| end + origin));
        LedgeLink { top, bottom, ..link }
    };
    WalkableTile::new(world, pos, &walker(settings)).ledges().into_iter().map(moved).collect()
}

/// The leaps of single cells that a link stands for.
fn leaps_of(link: &LedgeLink) -> Vec<Leap> {
    let at = |point: IVec3| Column::of(point / FINE);
    let (from, to, landing) = (at(link.top[0]), at(link.top[1]), at(link.bottom[0]));
    let (dx, dz) = (link.way.x, link.way.z);
    let count = (to.x - from.x) + (to.z - from.z);
    assert!(count > 0, "{link:?}");
    // The edge lies ahead of the upper cell, and behind the lower one.
    let apart = (landing.x - from.x) * dx + (landing.z - from.z) * dz;
    let back = if dx + dz > 0 { (-dx, -dz) } else { (0, 0) };
    (0..count)
        .map(|step| {
            let (along_x, along_z) = if dx != 0 { (0, step) } else { (step, 0) };
            let cell = from.offset(back.0 + along_x, back.1 + along_z);
            (cell, (dx, dz), apart + 1, link.is_jump, link.is_climb)
        })
        .collect()
}

#[test]
fn links_over_ledges_are_exactly_those_of_the_definition() {
    let (mut jumps, mut climbs, mut all) = (0, 0, 0);
    for index in 0..world_count(120) {
        let mut rng = Rng::with_seed(3000 + index);
        let terrain = random_dug_world(&mut rng, index);
        let (world, settings) = (terrain.world(), random_leaper(&mut rng));
        let links: Vec<LedgeLink> =
            NavTilePos::all(world).flat_map(|pos| links(world, pos, &settings)).collect();
        let mut found: Vec<Leap> = links.iter().flat_map(leaps_of).collect();
        found.sort_unstable();
        let expected = if settings.jump_down.max(settings.climb_up) > 0.0 {
            leaps(world, &settings)
        } else {
            Vec::new()
        };
        let missing = expected.iter().find(|leap| found.binary_search(leap).is_err());
        let wrong = found.iter().find(|leap| expected.binary_search(leap).is_err());
        assert_eq!((missing, wrong), (None, None), "world {index}, {settings:?}");
        assert_eq!(found, expected, "world {index}, {settings:?}");
        for link in &links {
            let drop = link.drop();
            assert!(drop > 0.0, "world {index}: {link:?}");
            jumps += usize::from(link.is_jump);
            climbs += usize::from(link.is_climb);
        }
        all += found.len();
    }
    assert!(
        jumps > 200 && climbs > 50 && all > jumps.max(climbs),
        "{jumps} jumps, {climbs} climbs, {all} leaps"
    );
}

#[test]
fn links_of_tiles_change_only_where_an_edit_affects_them() {
    let settings = WalkSettings { jump_down: 6.0, climb_up: 3.0, leap: 2.0, ..WalkSettings::default() };
    let mut changed = 0;
    for index in 0..world_count(10) {
        let mut rng = Rng::with_seed(4000 + index);
        let mut terrain = random_dug_world(&mut rng, index);
        let all = |world: &World| -> Vec<(NavTilePos, Vec<LedgeLink>)> {
            NavTilePos::all(world).map(|pos| (pos, links(world, pos, &settings))).collect()
        };
        let before = all(terrain.world());
        let brush = random_works(&mut rng, terrain.world());
        let receipt = terrain.apply_one(brush);
        let bounds: Option<LatticeBox> = receipt.outcome.ok().and_then(|applied| applied.bounds);
        let affected: Vec<NavTilePos> = bounds.map_or_else(Vec::new, |samples| {
            NavTilePos::affected(terrain.world(), samples, &walker(&settings)).collect()
        });
        for ((pos, was), (_, is)) in before.iter().zip(all(terrain.world())) {
            assert!(*was == is || affected.contains(pos), "world {index}, {pos:?}");
            changed += usize::from(*was != is);
        }
    }
    assert!(changed > 3, "{changed}");
}

#[test]
fn a_platform_is_left_by_jumps_and_climbed_if_it_is_low() {
    let mut terrain =
        Terrain::new(Ground::flat(64, 64, 10.0).expect("valid"), &TerrainSettings::default()).expect("valid");
    // 4 voxels high, over the border of four tiles.
    terrain.apply([Brush::add(
        Shape::cuboid(
            Vec3::new(NavTilePos::SIZE as f32, 12.0, NavTilePos::SIZE as f32),
            Vec3::new(8.0, 2.0, 8.0),
        ),
        MaterialId(1),
    )]);
    let around = |settings: &WalkSettings| -> Vec<LedgeLink> {
        NavTilePos::all(terrain.world()).flat_map(|pos| links(terrain.world(), pos, settings)).collect()
    };
    let jumper = WalkSettings { radius: 0.4, jump_down: 5.0, ..WalkSettings::default() };
    let found = around(&jumper);
    // Each side is one link in each of two tiles.
    assert_eq!(found.len(), 8, "{found:?}");
    for link in &found {
        assert!(link.is_jump && !link.is_climb && (link.drop() - 4.0).abs() < 0.1, "{link:?}");
        let outwards = (link.bottom[0] - link.top[0]).dot(link.way);
        assert!(outwards > 0 && outwards <= 5 * FINE, "{link:?}");
    }
    let climber = WalkSettings { climb_up: 4.5, ..jumper };
    assert!(around(&climber).iter().all(|link| link.is_jump && link.is_climb));
    assert!(around(&WalkSettings { jump_down: 3.5, ..jumper }).is_empty(), "too high");
    assert!(around(&WalkSettings { jump_down: 0.0, ..jumper }).is_empty());
    // A roof over the ledge, too low to jump below it.
    terrain.apply([Brush::add(
        Shape::cuboid(Vec3::new(42.0, 17.0, 32.0), Vec3::new(3.0, 1.0, 30.0)),
        MaterialId(2),
    )]);
    let found: Vec<LedgeLink> = NavTilePos::all(terrain.world())
        .flat_map(|pos| links(terrain.world(), pos, &WalkSettings { height: 3.0, ..jumper }))
        .collect();
    assert!(
        found.iter().all(|link| link.way != IVec3::X) && found.iter().any(|link| link.way == IVec3::NEG_X)
    );
}

#[test]
fn a_cliff_that_runs_diagonally_is_passed_along_x_and_z() {
    // 4 voxels high, along x + z = 64.
    let cliff = Ground::from_fn(64, 64, |x, z| if x + z < 64 { 14.0 } else { 10.0 }).expect("finite");
    let terrain = Terrain::new(cliff, &TerrainSettings::default()).expect("valid");
    let count = |radius: f32, leap: f32| {
        let settings = WalkSettings { radius, leap, jump_down: 5.0, ..WalkSettings::default() };
        let all = NavTilePos::all(terrain.world());
        let links = all.flat_map(|pos| links(terrain.world(), pos, &settings));
        let leaps: Vec<Leap> = links.flat_map(|link| leaps_of(&link)).collect();
        assert!(leaps.iter().all(|leap| [(1, 0), (0, 1)].contains(&leap.1)), "{leaps:?}");
        leaps.len()
    };
    assert_eq!(count(0.4, 0.0), 0);
    assert!(count(0.4, 1.0) > 80, "{}", count(0.4, 1.0));
    // A wider agent keeps farther from it.
    assert_eq!(count(0.9, 2.0), 0);
    assert!(count(0.9, 3.0) > 80, "{}", count(0.9, 3.0));
}
