//! A running world gets another ground below its edits: the holes stay, in memory and on the disk.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::format::WorldId;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{SimulatedDisk, Store, StoreOptions, StoreWarning, WorldFile, inspect_in};
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::{MeshKey, Meshing, PartsError};
use fastrand::Rng;

use crate::gated::{Gate, GatedDisk, Gatekeeper};
use crate::play::{act, check_opened, count, open, options, save, state, terrain};
use crate::worlds::{any_random_brush, random_ground_of_size};

/// Two grounds of one size.
fn grounds(seed: u64) -> [Arc<Ground>; 2] {
    let mut rng = Rng::with_seed(seed);
    let width = 40 + seed as u32 % 60;
    [seed, seed + 1].map(|index| Arc::new(random_ground_of_size(&mut rng, index, width, 70)))
}

fn drawn(terrain: &Terrain) -> BTreeMap<MeshKey, SurfaceMesh> {
    terrain.world().drawn().filter(|(_, mesh)| !mesh.indices.is_empty()).collect()
}

/// The world, written and read again over a ground.
fn read_over(ground: &Arc<Ground>, terrain: &Terrain) -> Terrain {
    let bytes = WorldFile::to_bytes(terrain, WorldId(1), &BTreeMap::new()).expect("it is small");
    let mut read = WorldFile::from_bytes(&bytes, Arc::clone(ground)).expect("its own bytes").terrain;
    read.set_meshing(terrain.meshing());
    read
}

fn assert_same(one: &Terrain, other: &Terrain, seed: u64) {
    assert_eq!(state(one), state(other), "seed {seed}");
    assert!(drawn(one) == drawn(other), "seed {seed}: it is drawn differently");
}

#[test]
fn a_world_on_another_ground_is_as_if_it_was_read_there() {
    for seed in 0..count("BURROW_WORLDS", 8) {
        let ([before, after], mut rng) = (grounds(seed), Rng::with_seed(seed));
        let mut world = terrain(&before);
        world.set_meshing(if seed % 3 == 0 { Meshing::Never } else { Meshing::All });
        (0..12).for_each(|_| act(&mut world, &mut rng));
        let (first, mut expected) = (read_over(&before, &world), read_over(&after, &world));
        let revision = world.world().revision();
        world.keep_log(Some(usize::MAX));
        world.apply_one(Order::Ground(Arc::clone(&after))).outcome.expect("it has the same size");
        assert_same(&world, &expected, seed);
        assert_ne!(world.world().hash(), first.world().hash());
        assert_eq!(world.world().revision(), revision + 1);
        assert_eq!(world.history(), History::default());
        assert!(world.world().check_seams().is_flawless(), "seed {seed}");

        // It continues like any other world, and replaying its log gives the same state.
        let mut follower = read_over(&before, &first);
        for _ in 0..5 {
            let brush = any_random_brush(&mut rng, &after);
            let receipts = [&mut world, &mut expected].map(|own| own.apply([brush.clone()]));
            assert_eq!(receipts[0], receipts[1], "seed {seed}");
        }
        [&mut world, &mut expected].into_iter().for_each(|own| drop(own.undo()));
        assert_same(&world, &expected, seed);
        for record in world.take_log() {
            follower.replay(&record).expect("it follows");
        }
        assert_same(&follower, &world, seed);

        // The old ground restores the old world.
        let mut there = first;
        let hash = there.world().hash();
        let old = drawn(&there);
        there.apply_one(Order::Ground(after)).outcome.expect("it has the same size");
        there.apply_one(Order::Ground(before)).outcome.expect("it has the same size");
        assert!(there.world().hash() == hash && drawn(&there) == old, "seed {seed}");
    }
}

#[test]
fn a_ground_waits_its_turn() {
    let ([before, after], mut rng) = (grounds(3), Rng::with_seed(3));
    let [mut queued, mut at_once] = [(); 2].map(|()| terrain(&before));
    let brushes: Vec<Brush> = (0..8).map(|_| any_random_brush(&mut rng, &after)).collect();
    queued.submit_all(&brushes[..4]);
    queued.submit(Order::Ground(Arc::clone(&after)));
    queued.submit_all(&brushes[4..]);
    assert_eq!(queued.world().ground().hash(), before.hash());
    let mut receipts = Vec::new();
    while let Some(transaction) = queued.begin() {
        receipts.extend(queued.commit(transaction.run()).expect("the one under way"));
    }
    at_once.apply(&brushes[..4]);
    at_once.apply_one(Order::Ground(after)).outcome.expect("it has the same size");
    at_once.apply(&brushes[4..]);
    assert_same(&queued, &at_once, 3);
    let kinds: Vec<OrderKind> = receipts.iter().map(|receipt| receipt.kind).collect();
    assert_eq!(
        kinds,
        [[OrderKind::Edit; 4].as_slice(), &[OrderKind::Ground], &[OrderKind::Edit; 4]].concat()
    );
    assert!(receipts[4].outcome.is_ok());

    // One of another size is refused, and nothing changes.
    let now = queued.world().hash();
    let other = Arc::new(Ground::flat(20, 70, 0.0).expect("valid"));
    let refused = queued.apply_one(Order::Ground(other)).outcome;
    assert!(matches!(refused, Err(Rejection::Parts(PartsError::GroundSize { .. }))), "{refused:?}");
    assert_eq!(
        (queued.world().hash(), queued.world().ground().hash()),
        (now, at_once.world().ground().hash())
    );
}

#[test]
fn a_saved_world_goes_on_on_its_new_ground() {
    for seed in 0..count("BURROW_WORLDS", 12) {
        let (grounds, mut rng) = (grounds(seed), Rng::with_seed(seed));
        let disk = SimulatedDisk::new();
        let mut world = terrain(&grounds[0]);
        let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, options(rng.u64(3..30)));
        let store = store.as_mut().expect("a new world");
        let mut states = BTreeMap::from([(0, vec![state(&world)])]);
        let mut acknowledged = 0;
        for turn in 0..40 {
            match turn {
                15 => assert!(world.apply_one(Order::Ground(Arc::clone(&grounds[1]))).outcome.is_ok()),
                30 if seed % 2 == 0 => {
                    assert!(world.apply_one(Order::Ground(Arc::clone(&grounds[0]))).outcome.is_ok());
                }
                _ => act(&mut world, &mut rng),
            }
            let revision = world.world().revision();
            states.entry(revision).or_default().push(state(&world));
            save(store, &mut world).expect("the thread runs");
            if rng.u32(0..4) == 0 {
                acknowledged = store.flush().expect("the disk works");
                assert_eq!(acknowledged, revision);
            }
            for image in [disk.image().lose_power(|| rng.bool()), disk.image().lose_process()] {
                let told = inspect_in(&image).expect("it can be read").ground;
                let own = grounds.iter().find(|own| own.hash() == told).expect("one of the two");
                let opened = open(&image, own).expect("it can be opened");
                check_opened(&opened, &states, acknowledged, revision);
            }
        }
        assert_eq!(store.take_warnings(), []);
        assert_eq!(store.checkpoint().expect("the disk works"), world.world().revision());
        // The other ground is one that has changed.
        let now = world.world().ground().hash();
        let other = grounds.iter().find(|own| own.hash() != now).expect("one of the two");
        let (_, opened) = open(&disk.image().lose_process(), other).expect("it can be opened");
        assert!(opened.warnings.iter().any(|own| matches!(own, StoreWarning::BaseChanged { .. })));
        assert_eq!(opened.terrain.world().hash(), read_over(other, &world).world().hash());
    }
}

/// A terrain whose ground is replaced is the same one as before, even if its log has no room for that, or if the store
/// took nothing meanwhile because the disk did not answer.
#[test]
fn a_new_ground_that_was_not_logged_is_saved_too() {
    for hangs in [false, true] {
        let ([before, after], mut rng) = (grounds(5), Rng::with_seed(5));
        let (disk, gate) = (SimulatedDisk::new(), Gatekeeper::default());
        let options = StoreOptions { waiting_bytes: 0, ..options(u64::MAX) };
        let mut world = terrain(&before);
        let files = Arc::new(GatedDisk::new(&disk, &gate));
        let mut store = Store::create_in(files, &mut world, options).expect("a new world");
        let mut dig = |world: &mut Terrain| drop(world.apply([any_random_brush(&mut rng, &after)]));
        dig(&mut world);
        save(&mut store, &mut world).expect("the thread runs");
        store.flush().expect("the disk works");
        let point = store.point();
        if hangs {
            gate.set(Gate::Shut);
            while store.revision() == world.world().revision() {
                store.put("filler", vec![0; 2 << 20]);
                dig(&mut world);
                save(&mut store, &mut world).expect("the thread runs");
            }
        } else {
            world.keep_log(Some(1000));
        }
        world.apply_one(Order::Ground(Arc::clone(&after))).outcome.expect("it has the same size");
        dig(&mut world);
        store.put("filler", Vec::new());
        save(&mut store, &mut world).expect("the thread runs");
        gate.set(Gate::Open);
        drop(store.flush());
        dig(&mut world);
        save(&mut store, &mut world).expect("the thread runs");
        store.flush().expect("the disk works");
        assert!(store.point().is_same_terrain(point), "it counts as another terrain, hangs: {hangs}");
        assert_eq!(store.durable(), world.world().revision());
        let (_, opened) = open(&disk.image().lose_process(), &after).expect("it can be opened");
        assert_eq!((state(&opened.terrain), opened.warnings), (state(&world), vec![]), "hangs: {hangs}");
    }
}
