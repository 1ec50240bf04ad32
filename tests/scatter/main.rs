//! Plants and stones: where they are, and when they stand.

#[cfg(feature = "examples")]
mod drawing;
mod laws;
#[cfg(feature = "plugin")]
mod plugin;
mod points;
mod queries;
#[path = "../worlds/mod.rs"]
mod worlds;

use bevy_burrow::ground::{Ground, MaterialId};
use bevy_burrow::lattice::Column;
use bevy_burrow::scatter::{Clearance, Clusters, Plant, Scatter, ScatterRules, Species, Stem};
use fastrand::Rng;

/// A few random species: dense and sparse, in groups, with and without distances and clearance.
fn random_rules(rng: &mut Rng) -> ScatterRules {
    let (seed, count) = (rng.u64(..), rng.usize(1..5));
    let species = (0..count).map(|index| {
        let spacing = [0.25, 0.6, 1.0, 1.7, 3.0, 6.5][rng.usize(0..6)];
        let is_tall = rng.bool();
        Species {
            spacing,
            density: 0.3 + 0.7 * rng.f32(),
            distance: if rng.bool() { rng.f32() * 2.0 * spacing } else { 0.0 },
            room: if rng.bool() { rng.f32() * 3.0 } else { 0.0 },
            size: (0.5, 1.0 + rng.f32()),
            slope: (0.0, if rng.bool() { 0.5 + rng.f32() } else { 128.0 }),
            materials: if rng.u8(0..4) == 0 { vec![MaterialId(1), MaterialId(2)] } else { Vec::new() },
            clusters: rng.bool().then(|| Clusters { size: 4.0 + rng.f32() * 20.0, cover: rng.f32() }),
            clearance: if is_tall {
                Clearance { radius: rng.f32() * 2.5, height: rng.f32() * 12.0 }
            } else {
                Clearance::default()
            },
            stem: is_tall.then(|| Stem { radius: 0.1 + rng.f32(), height: 1.0 + rng.f32() * 8.0 }),
            ..Species::named(format!("species {index}"))
        }
    });
    ScatterRules { seed, species: species.collect() }
}

fn scatter(rules: &ScatterRules) -> Scatter {
    Scatter::new(rules).expect("valid rules")
}

/// All plants of a ground.
fn all_plants(scatter: &Scatter, ground: &Ground) -> Vec<Plant> {
    scatter.plants(ground, Column::new(0, 0), Column::new(ground.width(), ground.depth()), |_| true)
}

/// How far the drawn ground may be from a plant's foot, in voxels: vertices are rounded to 1/4096 voxel, along slopes too.
fn tolerance(plant: &Plant) -> f64 {
    let [x, z] = plant.rise.map(|rise| f64::from(rise.abs()) / 256.0);
    (2.0 + x + z) / 4096.0
}
