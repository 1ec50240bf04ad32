//! Plants go with their ground and return with it, whatever happened in between.
//!
//! ```text
//! BURROW_PLANT_STEPS=10000 cargo test --release --no-default-features --features scatter --test scatter -- laws
//! ```

use std::collections::HashSet;

use bevy_burrow::lattice::{Column, LatticeBox, ONE};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{Clearance, PatchPos, Plant, PlantPatches, Scatter, ScatterRules, Species};
use bevy_burrow::surface::mask::cell_sheet;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::Vec3;

use crate::worlds::{any_random_brush, random_ground_of_size};
use crate::{all_plants, random_rules, scatter};

/// The number of random steps: `BURROW_PLANT_STEPS`, or the default.
fn steps(default: u64) -> u64 {
    std::env::var("BURROW_PLANT_STEPS").ok().and_then(|count| count.parse().ok()).unwrap_or(default)
}

/// Whether a plant has a reason not to stand, found sample by sample.
fn is_disturbed(world: &World, rules: &ScatterRules, plant: &Plant) -> bool {
    let (ground, samples, cell) = (world.ground(), world.samples(), plant.cell());
    let sheet = cell_sheet(ground, cell);
    let corners = cell.corners();
    let is_edited = |at: Column| (sheet.start..=sheet.end).any(|y| samples.is_edited(at.at(y)));
    if corners.into_iter().any(is_edited) {
        return true;
    }
    let Clearance { radius, height } = rules.species[usize::from(plant.id.species)].clearance;
    let scaled = |length: f32| (length * 256.0).round() as i64 * i64::from(plant.size) / 256;
    let (radius, height) = (scaled(radius), scaled(height));
    let top = ((plant.y.div_euclid(256) + height).div_euclid(256)) as i32;
    let reach = radius as i32 / ONE + 1;
    let around = (-reach..=reach + 1).flat_map(|x| (-reach..=reach + 1).map(move |z| cell.offset(x, z)));
    let is_own = |at: &Column| {
        let apart = |own: i32, at: i32| i64::from(own - at * ONE).pow(2);
        corners.contains(at) || apart(plant.x, at.x) + apart(plant.z, at.z) <= radius * radius
    };
    around.filter(is_own).any(|at| {
        let height = ground.height(at);
        let surface = height.div_euclid(ONE) - i32::from(height.rem_euclid(ONE) == 0);
        // The samples of an unedited world: what lies beyond the rim has no edits.
        !samples.is_solid(at.at(surface)) || (surface + 1..=top).any(|y| samples.is_solid(at.at(y)))
    })
}

/// Checks each plant of a world against its samples and its surface; returns those that stand.
fn check(world: &World, scatter: &Scatter, rules: &ScatterRules, plants: &[Plant]) -> Vec<Plant> {
    let mut standing = Vec::new();
    for plant in plants {
        let stands = scatter.stands(world, plant);
        assert_eq!(stands, !is_disturbed(world, rules, plant), "{plant:?}");
        let is_felled = scatter.is_felled(world, plant);
        assert!(!is_felled || !stands && has_its_ground(world, plant), "{plant:?}");
        if stands {
            let at = plant.position();
            let spans = world.spans(at.x, at.z);
            let is_on_it = spans.iter().any(|span| {
                (span.floor - at.y).abs() < crate::tolerance(plant)
                    && span.ceiling.is_none_or(|ceiling| ceiling > at.y)
            });
            assert!(is_on_it, "{plant:?} stands in the air or in the ground: {spans:?}");
            standing.push(*plant);
        }
    }
    standing
}

/// Whether the samples over the four columns around a plant's foot have the densities and the materials of the ground.
fn has_its_ground(world: &World, plant: &Plant) -> bool {
    let (ground, samples, cell) = (world.ground(), world.samples(), plant.cell());
    let sheet = cell_sheet(ground, cell);
    let mut points =
        cell.corners().into_iter().flat_map(|at| (sheet.start..=sheet.end).map(move |y| at.at(y)));
    // Stored densities end at 128 voxels.
    let stored = |distance: i32| distance.clamp(-i32::from(i16::MAX), i32::from(i16::MAX));
    points.all(|at| {
        stored(samples.distance(at)) == stored(ground.distance(at))
            && samples.material(at) == ground.material(at)
    })
}

/// One random step of a game.
fn step(rng: &mut Rng, terrain: &mut Terrain, standing: &[Plant]) {
    match rng.u8(0..14) {
        0 | 1 => drop(terrain.undo()),
        2 => drop(terrain.redo()),
        12 => {
            let rules = crate::worlds::random_rules(rng, terrain.world().ground());
            let rules = if rng.bool() { rules } else { DiggingRules::default() };
            terrain.set_rules(rules).expect("valid rules");
        }
        13 => {
            let loose = LooseSettings { largest: 4000, crumbs: 20, debris: rng.u32(..4000) };
            terrain.set_loose(rng.bool().then_some(loose));
        }
        3 | 4 if !standing.is_empty() => drop(terrain.apply([rng.choice(standing).expect("some").removal()])),
        5 => {
            let place = any_random_brush(rng, terrain.world().ground()).shape;
            drop(terrain.apply([Brush::reset(place)]));
        }
        _ => {
            let brushes: Vec<Brush> =
                (0..rng.u8(1..4)).map(|_| any_random_brush(rng, terrain.world().ground())).collect();
            drop(terrain.apply(brushes));
        }
    }
}

#[test]
fn no_plant_in_the_air_or_in_the_ground_and_none_missing() {
    let (all, mut gone, mut back) = (steps(80), 0, 0);
    for world in 0..all.div_ceil(40) {
        let rng = &mut Rng::with_seed(world);
        let ground = std::sync::Arc::new(random_ground_of_size(rng, world, 48, 40));
        let rules = random_rules(rng);
        let scatter = scatter(&rules);
        let plants = all_plants(&scatter, &ground);
        let sampled: Vec<Plant> = plants.iter().copied().step_by(1 + plants.len() / 400).collect();
        let made = |chunk_size| {
            let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
            let mut terrain = Terrain::new(ground.clone(), &settings).expect("valid");
            terrain.keep_log(Some(1 << 30));
            terrain
        };
        let (mut terrain, mut other) = (made(16), made(16));
        let mut standing = check(terrain.world(), &scatter, &rules, &sampled);
        assert_eq!(standing, sampled, "all stand on undug ground");
        for turn in 0..40 {
            step(rng, &mut terrain, &standing);
            for record in terrain.take_log() {
                other.replay(&record).expect("it follows");
            }
            let now = check(terrain.world(), &scatter, &rules, &sampled);
            let (before, after): (HashSet<Plant>, HashSet<Plant>) =
                (standing.into_iter().collect(), now.iter().copied().collect());
            gone += before.difference(&after).count();
            back += after.difference(&before).count();
            standing = now;
            // Another machine.
            let there: Vec<Plant> =
                sampled.iter().copied().filter(|plant| scatter.stands(other.world(), plant)).collect();
            assert_eq!(there, standing);
            if turn % 10 == 9 {
                let settings = TerrainSettings { chunk_size: 32, ..TerrainSettings::default() };
                let restored =
                    Terrain::restore(ground.clone(), &settings, terrain.parts()).expect("its own parts");
                let there: Vec<Plant> =
                    sampled.iter().copied().filter(|plant| scatter.stands(restored.world(), plant)).collect();
                assert_eq!(there, standing, "after a reload");
            }
        }
        // Plants never depend on edits.
        assert_eq!(all_plants(&scatter, terrain.world().ground()), plants);
        while terrain.undo().outcome.is_ok() {}
    }
    assert!(gone > 100 && back > 20, "{gone} went and {back} returned");
}

/// Plants on rough ground, without rules about it.
fn meadow() -> (Terrain, Scatter, Vec<Plant>) {
    let ground =
        Ground::from_fn(64, 64, |x, z| 20.0 + f64::from(x * 7 % 13) * 0.1 + f64::from(z * 5 % 11) * 0.1);
    let tree = Species {
        spacing: 5.0,
        distance: 4.0,
        clearance: Clearance { radius: 1.5, height: 8.0 },
        ..Species::named("tree")
    };
    let grass = Species { spacing: 0.5, ..Species::named("grass") };
    let scatter = scatter(&ScatterRules { seed: 5, species: vec![tree, grass] });
    let terrain = Terrain::new(ground.expect("finite"), &TerrainSettings::default()).expect("valid");
    let plants = all_plants(&scatter, terrain.world().ground());
    (terrain, scatter, plants)
}

/// The plants that do not stand.
fn gone(terrain: &Terrain, scatter: &Scatter, plants: &[Plant]) -> Vec<Plant> {
    plants.iter().copied().filter(|plant| !scatter.stands(terrain.world(), plant)).collect()
}

#[test]
fn a_removed_plant_is_gone_alone_until_it_is_undone_or_grows_again() {
    let (mut terrain, scatter, plants) = meadow();
    let trees: Vec<Plant> = plants.iter().copied().filter(|plant| plant.id.species == 0).collect();
    let (before, surface) = (terrain.world().hash(), terrain.world().elevation().expect("small"));
    for tree in &trees {
        let receipts = terrain.apply([tree.removal()]);
        let applied = receipts[0].outcome.as_ref().expect("allowed");
        assert_eq!((applied.removed.total(), applied.added.total()), (0, 0));
        let missing = gone(&terrain, &scatter, &plants);
        assert!(missing.contains(tree));
        assert!(missing.iter().all(|plant| scatter.is_felled(terrain.world(), plant)));
        // What grows within a voxel of the mark goes too, and no other tree.
        for other in missing.iter().filter(|other| *other != tree) {
            let apart = other.position() - tree.position();
            assert!(other.id.species == 1 && apart.x.abs() < 1.6 && apart.z.abs() < 1.6, "{other:?}");
        }
        assert_ne!(terrain.world().hash(), before);
        let now = terrain.world().elevation().expect("small");
        let moved = surface.samples().iter().zip(now.samples()).map(|(a, b)| (a - b).abs());
        assert!(moved.fold(0.0, f32::max) < 1e-3, "the ground looks the same");
        terrain.undo();
        assert!(gone(&terrain, &scatter, &plants).is_empty());
        assert_eq!(terrain.world().hash(), before, "a world without removed plants has the hash that it had");
        terrain.redo();
        assert_eq!(gone(&terrain, &scatter, &plants), missing);
        // Dug away as well, it is no longer felled, and neither is one that was painted or built over.
        let foot = tree.position().as_vec3();
        let others = [
            Brush::dig(Shape::sphere(foot, 2.0)),
            Brush::paint(Shape::sphere(foot, 1.5), MaterialId(7)),
            Brush::add(Shape::sphere(foot, 2.0), MaterialId(7)),
        ];
        for brush in others {
            assert!(scatter.is_felled(terrain.world(), tree));
            terrain.apply([brush]);
            assert!(!scatter.stands(terrain.world(), tree) && !scatter.is_felled(terrain.world(), tree));
            terrain.undo();
        }
        terrain.apply([tree.regrowth()]);
        assert!(!scatter.is_felled(terrain.world(), tree), "it stands");
        assert!(gone(&terrain, &scatter, &plants).is_empty());
    }
}

#[test]
fn plants_go_with_their_clearance() {
    let (mut terrain, scatter, plants) = meadow();
    let middle = |plant: &&Plant| {
        plant.id.species == 0 && (20..40).contains(&plant.cell().x) && (20..40).contains(&plant.cell().z)
    };
    let tree = *plants.iter().find(middle).expect("a tree");
    let at = tree.position().as_vec3();
    let stands = |terrain: &Terrain| scatter.stands(terrain.world(), &tree);
    // A branch of it is built in, a hole next to it, a tunnel under it, a bridge over it.
    let block = |offset: Vec3| Brush::add(Shape::sphere(at + offset, 1.0), MaterialId(3));
    let hole = |offset: Vec3, radius| Brush::dig(Shape::sphere(at + offset, radius));
    for (brush, expected) in [
        (block(Vec3::new(1.0, 5.0, 0.0)), false),
        (block(Vec3::new(4.5, 5.0, 0.0)), true),
        (block(Vec3::new(0.0, 12.0, 0.0)), true),
        (hole(Vec3::new(1.5, 0.0, 0.0), 1.2), false),
        (hole(Vec3::new(6.0, 0.0, 0.0), 1.5), true),
        (hole(Vec3::new(0.0, -8.0, 0.0), 3.0), true),
        (hole(Vec3::new(0.0, -3.0, 0.0), 4.0), false),
        (Brush::paint(Shape::sphere(at, 1.0), MaterialId(3)), false),
    ] {
        terrain.apply([brush.clone()]);
        assert_eq!(stands(&terrain), expected, "{brush:?}");
        terrain.undo();
        assert!(stands(&terrain));
    }
}

#[test]
fn protected_ground_keeps_its_plants() {
    let (mut terrain, scatter, plants) = meadow();
    let tree = plants[0];
    let around = LatticeBox { min: tree.cell().at(0) - 4, max: tree.cell().at(60) + 4 };
    terrain.set_rules(DiggingRules::default().with_protected(around)).expect("valid");
    let hash = terrain.world().hash();
    terrain.apply([tree.removal()]);
    assert!(scatter.stands(terrain.world(), &tree));
    assert_eq!(terrain.world().hash(), hash);
}

#[test]
fn what_an_edit_removes_lies_in_the_area_that_it_affects() {
    let rng = &mut Rng::with_seed(9);
    for index in 0..30 {
        let ground = random_ground_of_size(rng, index, 40, 40);
        let scatter = scatter(&random_rules(rng));
        let plants = all_plants(&scatter, &ground);
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
        let brush = any_random_brush(rng, terrain.world().ground());
        let receipts = terrain.apply([brush]);
        let Ok(applied) = &receipts[0].outcome else { continue };
        let missing = gone(&terrain, &scatter, &plants);
        let Some(bounds) = applied.bounds else {
            assert!(missing.is_empty());
            continue;
        };
        let (low, high) = scatter.affected(bounds);
        for plant in missing {
            let cell = plant.cell();
            let is_inside = (low.x..=high.x).contains(&cell.x) && (low.z..=high.z).contains(&cell.z);
            assert!(is_inside, "{plant:?} is not between {low:?} and {high:?}");
        }
    }
}

#[test]
fn patches_that_follow_edits_are_those_made_anew() {
    let rng = &mut Rng::with_seed(5);
    for index in 0..10 {
        let ground = random_ground_of_size(rng, index, 60, 50);
        let scatter = std::sync::Arc::new(scatter(&random_rules(rng)));
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
        let made = |world: &World| {
            let mut patches = PlantPatches::new(scatter.clone());
            for species in 0..scatter.species().len() as u8 {
                for (x, z) in (0..4).flat_map(|x| (0..4).map(move |z| (x, z))) {
                    let pos = PatchPos { species, x, z };
                    patches.insert(world, pos, scatter.patch(world.ground(), pos));
                }
            }
            patches
        };
        let standing = |patches: &PlantPatches| {
            let mut all: Vec<Plant> =
                patches.iter().flat_map(|(_, patch)| patch.standing().copied()).collect();
            all.sort_by_key(|plant| plant.id);
            all
        };
        let mut patches = made(terrain.world());
        for _ in 0..12 {
            let receipt = match rng.u8(0..4) {
                0 => terrain.undo(),
                _ => terrain.apply_one(any_random_brush(rng, terrain.world().ground())),
            };
            let Some(bounds) = receipt.outcome.ok().and_then(|applied| applied.bounds) else { continue };
            let before = standing(&patches);
            let changes = patches.update(terrain.world(), Some(bounds));
            let after = standing(&patches);
            assert_eq!(after, standing(&made(terrain.world())));
            let gone = before.iter().filter(|plant| !after.contains(plant)).count();
            assert_eq!(changes.iter().filter(|change| !change.stands).count(), gone);
        }
    }
}

#[test]
fn a_box_that_is_larger_than_the_world_holds_all_its_plants() {
    let rng = &mut Rng::with_seed(6);
    let ground = random_ground_of_size(rng, 3, 60, 50);
    let scatter = std::sync::Arc::new(scatter(&random_rules(rng)));
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    let mut patches = PlantPatches::new(scatter.clone());
    for species in 0..scatter.species().len() as u8 {
        for (x, z) in (0..4).flat_map(|x| (0..4).map(move |z| (x, z))) {
            let pos = PatchPos { species, x, z };
            patches.insert(terrain.world(), pos, scatter.patch(terrain.world().ground(), pos));
        }
    }
    let all = patches.iter().map(|(_, patch)| patch.standing().count()).sum::<usize>();
    let (low, high) = (Column::new(i32::MIN, i32::MIN), Column::new(i32::MAX, i32::MAX));
    assert_eq!(patches.near_of(low, high, [true; 5]).count(), all);
    let shape = Shape::sphere(
        Vec3::new(30.0, terrain.world().ground().height(Column::new(30, 25)) as f32 / 256.0, 25.0),
        9.0,
    );
    terrain.apply_one(Brush::dig(shape));
    let mut expected = patches.clone();
    let mut expected = expected.update(terrain.world(), None);
    let everything = LatticeBox { min: glam::IVec3::MIN, max: glam::IVec3::MAX };
    let mut changes = patches.update(terrain.world(), Some(everything));
    changes.sort_by_key(|change| change.plant.id);
    expected.sort_by_key(|change| change.plant.id);
    assert!(!changes.is_empty());
    assert_eq!(changes, expected);
}
