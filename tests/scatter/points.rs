//! Plants are a function of seed, species and ground.

use std::collections::HashSet;

use bevy_burrow::lattice::{Column, ONE};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{Clearance, Clusters, Plant, Scatter, ScatterError, ScatterRules, Species, Stem};
use fastrand::Rng;
use glam::IVec2;
use proptest::prelude::*;

use crate::worlds::random_ground_of_size;
use crate::{all_plants, random_rules, scatter, tolerance};

fn distance(a: &Plant, b: &Plant) -> f64 {
    let apart = IVec2::new(a.x - b.x, a.z - b.z).as_dvec2();
    apart.length() / f64::from(ONE)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn an_area_has_the_same_plants_whole_and_in_parts(seed: u64, cut_x in 1..40i32, cut_z in 1..40i32) {
        let rng = &mut Rng::with_seed(seed);
        let ground = random_ground_of_size(rng, seed % 60, 41, 37);
        let scatter = scatter(&random_rules(rng));
        let whole = all_plants(&scatter, &ground);
        let mut parts = Vec::new();
        // In another order, and beyond the rim.
        let starts: Vec<i32> = (-cut_x..=41).step_by(cut_x as usize).collect();
        for x in starts.into_iter().rev() {
            for z in (-cut_z..=37).step_by(cut_z as usize) {
                let (low, high) = (Column::new(x, z), Column::new(x + cut_x - 1, z + cut_z - 1));
                parts.extend(scatter.plants(&ground, low, high, |_| true));
            }
        }
        parts.sort_by_key(|plant| plant.id);
        prop_assert_eq!(&parts, &whole);
        // One species alone.
        let only = scatter.plants(&ground, Column::new(0, 0), Column::new(41, 37), |species| species == 0);
        let own: Vec<Plant> = whole.iter().copied().filter(|plant| plant.id.species == 0).collect();
        prop_assert_eq!(only, own);
    }

    #[test]
    fn plants_keep_the_rules_of_their_species(seed: u64) {
        let rng = &mut Rng::with_seed(seed);
        let ground = random_ground_of_size(rng, seed % 60, 33, 30);
        let rules = random_rules(rng);
        let plants = all_plants(&scatter(&rules), &ground);
        // Lengths are rounded to 1/256 voxel.
        let least = 1.0 / 256.0;
        for (index, plant) in plants.iter().enumerate() {
            let species = &rules.species[usize::from(plant.id.species)];
            let size = f32::from(plant.size) / 256.0;
            prop_assert!((species.size.0 - 0.01..=species.size.1 + 0.01).contains(&size));
            let cell = plant.cell();
            prop_assert!((0..33).contains(&cell.x) && (0..30).contains(&cell.z));
            for other in &plants[index + 1..] {
                let apart = distance(plant, other);
                let wanted = if other.id.species == plant.id.species { species.distance } else { species.room };
                prop_assert!(apart + 2.0 * least >= f64::from(wanted), "{} of {}", apart, wanted);
            }
            if !species.materials.is_empty() {
                let at = |v: i32| (v + ONE / 2).div_euclid(ONE);
                let column = Column::new(at(plant.x), at(plant.z));
                let height = ground.height(column);
                let top = height.div_euclid(ONE) - i32::from(height.rem_euclid(ONE) == 0);
                prop_assert!(species.materials.contains(&ground.material(column.at(top))));
            }
        }
    }

    #[test]
    fn plants_stand_on_the_ground_that_is_drawn(seed: u64) {
        let rng = &mut Rng::with_seed(seed);
        let ground = random_ground_of_size(rng, seed % 60, 24, 24);
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
        let plants = all_plants(&scatter(&random_rules(rng)), terrain.world().ground());
        for plant in plants.iter().step_by(1 + plants.len() / 200) {
            let at = plant.position();
            let height = terrain.world().height(at.x, at.z).expect("inside");
            prop_assert!((height - at.y).abs() < tolerance(plant), "{} at {}", height, at);
        }
    }
}

#[test]
fn other_species_and_seeds() {
    let ground = Ground::flat(64, 64, 10.0).unwrap();
    let named = |name: &str| Species { spacing: 1.3, density: 0.7, ..Species::named(name) };
    let rules =
        |seed, names: &[&str]| ScatterRules { seed, species: names.iter().map(|name| named(name)).collect() };
    let places = |rules: &ScatterRules, species: u8| -> HashSet<(i32, i32)> {
        let plants = all_plants(&scatter(rules), &ground).into_iter();
        plants.filter(|plant| plant.id.species == species).map(|plant| (plant.x, plant.z)).collect()
    };
    let oaks = places(&rules(1, &["oak"]), 0);
    assert!(oaks.len() > 1000);
    // Elsewhere in the list, among others, they grow at the same places.
    assert_eq!(places(&rules(1, &["fir", "oak"]), 1), oaks);
    assert!(places(&rules(2, &["oak"]), 0).intersection(&oaks).count() < 20);
    assert!(places(&rules(1, &["fir"]), 0).intersection(&oaks).count() < 20);
}

#[test]
fn density_clusters_and_distance_give_the_shares_that_they_say() {
    let ground = Ground::flat(256, 256, 10.0).unwrap();
    let count = |species: Species| {
        all_plants(&scatter(&ScatterRules { seed: 3, species: vec![species] }), &ground).len() as f64
            / 65536.0
    };
    let near =
        |share: f64, expected: f64| assert!((share - expected).abs() < 0.03, "{share} is not {expected}");
    near(count(Species::named("a")), 1.0);
    near(count(Species { density: 0.3, ..Species::named("a") }), 0.3);
    near(count(Species { spacing: 2.0, ..Species::named("a") }), 0.25);
    // Groups overlap, so they cover a little less.
    let clusters = |size| Some(Clusters { size, cover: 0.3 });
    let covered = count(Species { clusters: clusters(16.0), ..Species::named("a") });
    assert!((0.2..0.31).contains(&covered), "{covered}");
    let apart = count(Species { distance: 1.0, ..Species::named("a") });
    assert!((0.2..0.5).contains(&apart), "{apart}");
}

/// A golden hash: plants are the same on every machine and in every version. If this fails on purpose, plants of all games
/// change.
#[test]
fn plants_are_the_same_in_every_version() {
    let mut hash = 0u64;
    for seed in 0..20 {
        let rng = &mut Rng::with_seed(seed);
        let ground = random_ground_of_size(rng, seed, 40, 40);
        for plant in all_plants(&scatter(&random_rules(rng)), &ground) {
            let Plant { id, x, z, y, rise, size, turn, variant, .. } = plant;
            let words = [i64::from(id.species), id.x.into(), id.z.into(), x.into(), z.into(), y];
            let more = [rise[0].into(), rise[1].into(), size.into(), turn.into(), variant.into()];
            for word in words.into_iter().chain(more) {
                hash = (hash.rotate_left(5) ^ word.cast_unsigned()).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            }
        }
    }
    assert_eq!(hash, GOLDEN, "{hash:#018x}");
}

const GOLDEN: u64 = 0x73b3_b3c0_05e8_b166;

#[test]
fn rules_are_read_from_files() {
    let rules = random_rules(&mut Rng::with_seed(4));
    let text = serde_json::to_string(&rules).expect("finite numbers");
    assert_eq!(serde_json::from_str::<ScatterRules>(&text).expect("as written"), rules);
    let short = r#"{ "species": [{ "name": "oak", "spacing": 6, "clearance": { "radius": 1 } }] }"#;
    let rules: ScatterRules = serde_json::from_str(short).expect("the rest has defaults");
    let clearance = Clearance { radius: 1.0, height: 0.0 };
    assert_eq!(rules.species, [Species { spacing: 6.0, clearance, ..Species::named("oak") }]);
    assert!(serde_json::from_str::<ScatterRules>(r#"{ "specis": [] }"#).is_err());
}

#[test]
fn bad_rules_say_what_is_wrong() {
    let error =
        |species: Vec<Species>| Scatter::new(&ScatterRules { seed: 0, species }).expect_err("bad rules");
    let oak = || Species::named("oak");
    let stem = |radius, height| Some(Stem { radius, height });
    let clusters = |size, cover| Some(Clusters { size, cover });
    for (bad, field) in [
        (Species { spacing: 0.0, ..oak() }, "spacing"),
        (Species { spacing: f32::NAN, ..oak() }, "spacing"),
        (Species { spacing: f32::INFINITY, ..oak() }, "spacing"),
        (Species { density: 1.5, ..oak() }, "density"),
        (Species { distance: 4.5, ..oak() }, "distance"),
        (Species { room: -1.0, ..oak() }, "room"),
        (Species { size: (2.0, 1.0), ..oak() }, "size"),
        (Species { size: (0.0, 1.0), ..oak() }, "size"),
        (Species { height: (f32::NEG_INFINITY, 0.0), ..oak() }, "height"),
        (Species { slope: (0.5, 0.1), ..oak() }, "slope"),
        (Species { clusters: clusters(0.0, 0.5), ..oak() }, "clusters.size"),
        (Species { clusters: clusters(9.0, 2.0), ..oak() }, "clusters.cover"),
        (Species { clearance: Clearance { radius: 17.0, height: 0.0 }, ..oak() }, "clearance.radius"),
        (Species { clearance: Clearance { radius: 1.0, height: 1e9 }, ..oak() }, "clearance.height"),
        (Species { stem: stem(0.0, 1.0), ..oak() }, "stem.radius"),
        (Species { stem: stem(1.0, f32::NAN), ..oak() }, "stem.height"),
    ] {
        let wrong = error(vec![bad]);
        assert!(matches!(&wrong, ScatterError::Parameter { what, .. } if *what == field), "{field}: {wrong}");
        assert!(wrong.to_string().contains("`oak`"), "{wrong}");
    }
    assert_eq!(error(vec![oak(), oak()]), ScatterError::SameName("oak".into()));
    let many = (0..256).map(|index| Species::named(index.to_string())).collect();
    assert_eq!(error(many), ScatterError::TooMany(256));
}
