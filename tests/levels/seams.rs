//! Laws of everything that is drawn together: closed, manifold, shaded without a jump.

use std::sync::Mutex;

use crate::drawn::{Counts, check, draw};
use crate::random::{for_worlds, random_world, split_once};
use crate::worlds::world_count;
use fastrand::Rng;

#[test]
fn random_cuts_are_closed_before_and_after_a_split() {
    let total = Mutex::new(Counts::default());
    let failed = Mutex::new(Vec::new());
    for_worlds(world_count(200), |index, terrain, cut| {
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
#[ignore = "looks at one world, by its number in BURROW_WORLD"]
fn one_world() {
    let index = std::env::var("BURROW_WORLD").ok().and_then(|at| at.parse().ok()).unwrap_or(0);
    let (terrain, cut) = random_world(index);
    let counts = check(terrain.world(), &cut, &draw(terrain.world(), &cut));
    println!("{counts:?}");
    println!("{:?}", terrain.world().check_seams_in(&cut));
}
