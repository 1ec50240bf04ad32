//! Laws of everything that is drawn together: closed, manifold, shaded without a jump.

use std::sync::Mutex;

use crate::check::{Counts, check, draw};
use crate::random::{for_worlds, random_brushes, random_world, split_once};
use crate::worlds::world_count;
use bevy_burrow::ground::Strata;
use bevy_burrow::lod::Cut;
use bevy_burrow::prelude::*;
use fastrand::Rng;

#[test]
fn random_cuts_are_closed_before_and_after_a_split() {
    let total = Mutex::new(Counts::default());
    let failed = Mutex::new(Vec::new());
    for_worlds(world_count(250), |index, terrain, cut| {
        let mut rng = Rng::with_seed(index);
        let other = split_once(&mut rng, terrain, cut).map(|(cut, _)| cut);
        for cut in other.iter().chain([cut]) {
            let counts = check(terrain.world(), cut, &draw(terrain.world(), cut));
            total.lock().expect("no panic").add(&counts);
            if !counts.is_flawless() {
                println!("world {index}: {counts:?}");
                failed.lock().expect("no panic").push(index);
            }
        }
    });
    println!("{:?}", total.lock().expect("no panic"));
    let failed = failed.into_inner().expect("no panic");
    assert!(failed.is_empty(), "worlds {failed:?}");
}

#[test]
fn cliffs_of_many_beds_are_closed_at_every_level() {
    let noise = NoiseHeights { seed: 5, scale: 20.0, amplitude: 60.0, base: 4.0, ..Default::default() };
    let ground = Ground::from_noise(150, 110, &noise).expect("valid hills");
    let beds = ground.with_strata(&Strata::alpine()).expect("valid strata");
    let mut terrain =
        Terrain::new(beds, &TerrainSettings { chunk_size: 8, ..Default::default() }).expect("valid settings");
    let mut rng = Rng::with_seed(4);
    for _ in 0..6 {
        for percent in [15, 40, 70] {
            let cut = Cut::random(terrain.world().lod_grid(4), rng.u64(..), percent);
            let counts = check(terrain.world(), &cut, &draw(terrain.world(), &cut));
            assert!(counts.is_flawless() && counts.coarse > 0, "{counts:?}");
            let brushes = random_brushes(&mut rng, &terrain, &cut);
            terrain.apply(brushes);
        }
    }
}

#[test]
#[ignore = "looks at one world, by its number in BURROW_WORLD"]
fn one_world() {
    let index = std::env::var("BURROW_WORLD").ok().and_then(|at| at.parse().ok()).unwrap_or(0);
    let (terrain, cut) = random_world(index);
    let counts = check(terrain.world(), &cut, &draw(terrain.world(), &cut));
    println!("{counts:?}");
    println!("{:?}", terrain.world().check_seams_in(&cut));
}
