//! Power is lost at every operation on the disk, and once more at every operation of recoveries.
//! `BURROW_COMMITS` is the number of commits.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use bevy_burrow::store::{DiskImage, SimulatedDisk, Store, StoreError};
use fastrand::Rng;

use crate::play::{State, act, check_opened, count, ground, open, options, save, state, terrain};

/// No revision was acknowledged yet, not even 0.
const NOTHING: u64 = u64::MAX;

/// The parts of unsynced data that survive: nothing, all, or a random part.
fn losses(seed: u64) -> [Box<dyn FnMut() -> bool>; 4] {
    let mut rng = Rng::with_seed(seed);
    let mut other = Rng::with_seed(!seed);
    [
        Box::new(|| false),
        Box::new(|| true),
        Box::new(move || rng.bool()),
        Box::new(move || other.u32(0..8) > 0),
    ]
}

#[derive(Default)]
struct Known {
    states: Mutex<BTreeMap<u64, Vec<State>>>,
    acknowledged: AtomicU64,
    latest: AtomicU64,
}

#[test]
fn no_loss_of_power_loses_what_was_acknowledged() {
    let (commits, recoveries) = (count("BURROW_COMMITS", 40), count("BURROW_RECOVERIES", 12));
    let ground = ground(5);
    let known = Arc::new(Known::default());
    known.acknowledged.store(NOTHING, Ordering::SeqCst);
    let disk = SimulatedDisk::new();
    let seconds = Arc::new(AtomicU64::new(0));
    let losses_so_far = Arc::new(AtomicU64::new(0));
    let watch = {
        let (known, ground, seconds) = (known.clone(), ground.clone(), seconds.clone());
        let so_far = losses_so_far.clone();
        move |image: &DiskImage| {
            let (acknowledged, latest) =
                (known.acknowledged.load(Ordering::SeqCst), known.latest.load(Ordering::SeqCst));
            let states = known.states.lock().expect("no panic").clone();
            for mut keep in losses(image.operations()) {
                so_far.fetch_add(1, Ordering::SeqCst);
                let after = image.lose_power(&mut keep);
                // Sometimes the power is lost during recovery too.
                let again = Arc::new(Mutex::new(Vec::new()));
                let is_twice = image.operations() % 7 == 3 && seconds.load(Ordering::SeqCst) < recoveries;
                if is_twice {
                    seconds.fetch_add(1, Ordering::SeqCst);
                    let images = again.clone();
                    after.watch(Some(move |image: &DiskImage| {
                        images.lock().expect("no panic").push(image.clone());
                    }));
                }
                let opened = match open(&after, &ground) {
                    Err(StoreError::Missing(_)) if acknowledged == NOTHING => continue,
                    opened => opened.unwrap_or_else(|why| panic!("after {image:?}: {why}")),
                };
                let least = if acknowledged == NOTHING { 0 } else { acknowledged };
                let revision = check_opened(&opened, &states, least, latest);
                let seen = after.operations();
                drop(opened);
                for second in again.lock().expect("no panic").iter() {
                    // The world after the first recovery is there after the second.
                    let least = if second.operations() >= seen { revision } else { least };
                    for keep in losses(second.operations()) {
                        so_far.fetch_add(1, Ordering::SeqCst);
                        match open(&second.lose_power(keep), &ground) {
                            Err(StoreError::Missing(_)) if acknowledged == NOTHING => {}
                            opened => {
                                let opened =
                                    opened.unwrap_or_else(|why| panic!("{image:?} {second:?}: {why}"));
                                check_opened(&opened, &states, least, latest);
                            }
                        }
                    }
                }
            }
        }
    };
    let mut rng = Rng::with_seed(26);
    let mut terrain = terrain(&ground);
    let enter = |terrain: &bevy_burrow::prelude::Terrain| {
        let mut states = known.states.lock().expect("no panic");
        states.entry(terrain.world().revision()).or_default().push(state(terrain));
        known.latest.store(terrain.world().revision(), Ordering::SeqCst);
    };
    enter(&terrain);
    disk.watch(Some(watch));
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut terrain, options(9)).expect("a new world");
    known.acknowledged.store(0, Ordering::SeqCst);
    while terrain.world().revision() < commits {
        act(&mut terrain, &mut rng);
        enter(&terrain);
        save(&mut store, &mut terrain).expect("the thread runs");
        if rng.u32(0..3) > 0 {
            let durable = store.flush().expect("the disk works");
            assert_eq!(durable, terrain.world().revision());
            known.acknowledged.store(durable, Ordering::SeqCst);
        }
    }
    drop(store);
    println!(
        "{commits} commits, {} operations, {} losses of power, {} recoveries with a second loss",
        disk.operations(),
        losses_so_far.load(Ordering::SeqCst),
        seconds.load(Ordering::SeqCst)
    );
}
