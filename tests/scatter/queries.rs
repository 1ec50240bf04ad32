//! Queries equal a search through all plants.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bevy_burrow::ground::{ColumnGrid, HeightSource};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{Plant, Scatter, ScatterRules, Species};
use fastrand::Rng;
use glam::{DVec2, DVec3};

use crate::worlds::{any_random_brush, random_ground_of_size};
use crate::{all_plants, random_rules, scatter};

/// A dug world, its scatter, and the plants that stand.
fn world(seed: u64) -> (Terrain, ScatterRules, Scatter, Vec<Plant>) {
    let rng = &mut Rng::with_seed(seed);
    let ground = random_ground_of_size(rng, seed, 70, 60);
    let rules = random_rules(rng);
    let scatter = scatter(&rules);
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    for _ in 0..6 {
        let brush = any_random_brush(rng, terrain.world().ground());
        terrain.apply([brush]);
    }
    let mut plants = all_plants(&scatter, terrain.world().ground());
    plants.retain(|plant| scatter.stands(terrain.world(), plant));
    (terrain, rules, scatter, plants)
}

fn random_place(rng: &mut Rng, terrain: &Terrain) -> DVec3 {
    let (x, z) = (rng.f64() * 90.0 - 10.0, rng.f64() * 80.0 - 10.0);
    let inside = (x.clamp(0.0, 70.0), z.clamp(0.0, 60.0));
    let height = terrain.world().height(inside.0, inside.1).expect("inside");
    DVec3::new(x, height + rng.f64() * 12.0 - 4.0, z)
}

#[test]
fn the_nearest_plant_and_those_in_a_box() {
    for seed in 0..12 {
        let (terrain, _, scatter, plants) = world(seed);
        let rng = &mut Rng::with_seed(seed);
        for _ in 0..20 {
            let (place, most) = (random_place(rng, &terrain), rng.f64() * 40.0);
            let apart = |plant: &Plant| plant.position().distance(place);
            let nearest = plants.iter().copied().filter(|plant| apart(plant) <= most);
            let nearest = nearest.min_by(|a, b| apart(a).total_cmp(&apart(b)).then(a.id.cmp(&b.id)));
            assert_eq!(scatter.nearest(terrain.world(), place, most, |_| true), nearest);
            let (low, high) = (place - DVec3::splat(most / 4.0), place + DVec3::splat(most / 4.0));
            let is_inside = |plant: &&Plant| {
                let at = plant.position();
                at.cmpge(low).all() && at.cmple(high).all()
            };
            let inside: Vec<Plant> = plants.iter().filter(is_inside).copied().collect();
            assert_eq!(scatter.in_box(terrain.world(), low, high, |_| true), inside);
        }
        let far = DVec3::new(1e7, 0.0, -1e7);
        let any = scatter.nearest(terrain.world(), far, f64::INFINITY, |_| true);
        assert_eq!(any.is_some(), !plants.is_empty());
    }
}

/// Ground that counts how many heights are asked for.
struct Counted(Arc<AtomicU64>);

impl HeightSource for Counted {
    fn id(&self) -> u64 {
        5
    }

    fn bounds(&self) -> (i32, i32) {
        (0, 0)
    }

    fn fill_heights(&self, _: ColumnGrid, heights: &mut [i32]) {
        self.0.fetch_add(heights.len() as u64, Ordering::Relaxed);
        heights.fill(0);
    }
}

#[test]
fn the_search_for_a_plant_is_bounded_where_there_is_none() {
    let count = Arc::new(AtomicU64::new(0));
    let ground = Ground::from_source(200_000, 200_000, Counted(Arc::clone(&count))).expect("a size");
    let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    // They grow on hills only.
    let (_, rules, _, _) = world(1);
    let species = rules.species.iter().map(|own| Species { height: (50.0, 90.0), ..own.clone() }).collect();
    let scatter = Scatter::new(&ScatterRules { species, ..rules }).expect("valid");
    let before = count.load(Ordering::Relaxed);
    let place = DVec3::new(1e5, 0.0, 1e5);
    assert_eq!(scatter.nearest(terrain.world(), place, f64::INFINITY, |_| true), None);
    let asked = count.load(Ordering::Relaxed) - before;
    assert!(asked < 1 << 25, "{asked} heights");
}

#[test]
fn the_first_stem_along_a_ray() {
    let mut met = 0;
    for seed in 0..12 {
        let (terrain, rules, scatter, plants) = world(seed);
        let rng = &mut Rng::with_seed(seed);
        for _ in 0..60 {
            let (from, to) = (random_place(rng, &terrain), random_place(rng, &terrain));
            let vertical = rng.u8(0..5) == 0;
            let direction = if vertical { DVec3::NEG_Y } else { to - from };
            let hit = scatter.raycast(terrain.world(), from, direction, 200.0, |_| true);
            // No stem is met before, in small steps along the ray.
            let along = direction.normalize();
            let end = hit.map_or(200.0, |hit| hit.distance);
            let inside = |plant: &Plant, at: DVec3, more: f64| {
                let Some(stem) = rules.species[usize::from(plant.id.species)].stem else { return false };
                let size = f64::from(plant.size) / 256.0;
                let local = at - plant.position();
                DVec2::new(local.x, local.z).length() <= f64::from(stem.radius) * size + more
                    && (-more..=f64::from(stem.height) * size + more).contains(&local.y)
            };
            for step in 0..((end - 0.02) / 0.25).max(0.0) as i32 {
                let at = from + along * f64::from(step) * 0.25;
                assert!(!plants.iter().any(|plant| inside(plant, at, -0.01)), "one before {end} at {at}");
            }
            if let Some(hit) = hit {
                met += 1;
                assert!(plants.contains(&hit.plant));
                assert!(inside(&hit.plant, from + along * hit.distance, 0.02));
            }
        }
    }
    assert!(met > 50, "{met}");
}

#[test]
fn bad_questions_have_no_answer() {
    let (terrain, _, scatter, _) = world(1);
    let world = terrain.world();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let place = DVec3::new(10.0, bad, 10.0);
        assert_eq!(scatter.nearest(world, place, 10.0, |_| true), None);
        assert_eq!(scatter.raycast(world, place, DVec3::X, 10.0, |_| true), None);
        assert_eq!(scatter.raycast(world, DVec3::ZERO, DVec3::new(bad, bad, bad), 10.0, |_| true), None);
    }
    assert_eq!(scatter.nearest(world, DVec3::ZERO, f64::NAN, |_| true), None);
    assert_eq!(scatter.raycast(world, DVec3::ZERO, DVec3::X, f64::NAN, |_| true), None);
    assert_eq!(scatter.raycast(world, DVec3::ZERO, DVec3::ZERO, 10.0, |_| true), None);
    // From far away, at once.
    let far = DVec3::new(-1e12, 30.0, 30.0);
    scatter.raycast(world, far, DVec3::X, f64::INFINITY, |_| true);
    assert!(scatter.in_box(world, DVec3::splat(5.0), DVec3::splat(-5.0), |_| true).is_empty());
}
