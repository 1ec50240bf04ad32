//! A game ships a new version of a level: saves that were created from the old one continue, and keep their edits.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use bevy_burrow::format::Level;
use bevy_burrow::lattice::{BrickPos, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{
    BaseChanged, BaseLevel, DiskImage, SimulatedDisk, Store, StoreError, StoreOptions, StoreWarning,
    check_in, inspect_in,
};
use bevy_burrow::terrain::{Meshing, Patch};
use bevy_burrow::volume::Brick;
use fastrand::Rng;

use crate::damage::{Record, records};
use crate::levels::{begin, level, on, restore_brick};
use crate::play::{act, count, ground, options, save, state};
use crate::worlds::any_random_brush;

type Bricks = BTreeMap<BrickPos, Arc<Brick>>;

fn bricks(change: Patch) -> Bricks {
    change.bricks.into_iter().filter_map(|(pos, brick)| Some((pos, brick?))).collect()
}

fn is_same(one: Option<&Arc<Brick>>, other: Option<&Arc<Brick>>, pos: BrickPos) -> bool {
    let samples = |brick: Option<&Arc<Brick>>| -> Vec<_> {
        brick.map(|brick| brick.edited_samples(pos).collect()).unwrap_or_default()
    };
    samples(one) == samples(other)
}

/// The bricks in which a world differs from its level.
fn own_bricks(world: &Terrain, level: &BaseLevel) -> Patch {
    let (now, below) = (bricks(world.parts().change), bricks(level.level().parts().change));
    let all: BTreeSet<BrickPos> = now.keys().chain(below.keys()).copied().collect();
    let is_own = |pos: &BrickPos| !is_same(now.get(pos), below.get(pos), *pos);
    let own = all.into_iter().filter(is_own).map(|pos| (pos, now.get(&pos).cloned()));
    Patch { bricks: own.collect(), ..Patch::default() }
}

/// The expected world on another level: that level with the world's own bricks on it.
fn by_hand(world: &Terrain, ground: &Arc<Ground>, from: &BaseLevel, to: &BaseLevel) -> Terrain {
    let mut moved = to.level().terrain(Arc::clone(ground)).expect("its own ground");
    moved.set_meshing(Meshing::Never);
    moved.apply_one(Order::parts(own_bricks(world, from), None)).outcome.expect("its own bricks");
    moved
}

/// Another version of a level, or sometimes another level.
fn version(before: &BaseLevel, ground: &Arc<Ground>, seed: u64) -> BaseLevel {
    match seed % 5 {
        3 => level(ground, seed + 1000, 25),
        4 => level(ground, seed + 1000, 0),
        _ => {
            let mut sculpted = before.level().terrain(Arc::clone(ground)).expect("its own ground");
            sculpted.set_meshing(Meshing::Never);
            let mut rng = Rng::with_seed(!seed);
            (0..15).for_each(|_| act(&mut sculpted, &mut rng));
            (0..3).for_each(|_| restore_brick(&mut sculpted, &mut rng));
            BaseLevel::new(Level::of(&sculpted), "levels/new")
        }
    }
}

fn open(
    disk: &SimulatedDisk,
    ground: &Arc<Ground>,
    level: &BaseLevel,
    base_changed: BaseChanged,
) -> Result<(Store, bevy_burrow::store::Opened), StoreError> {
    let options = StoreOptions { base_changed, ..on(level, options(99)) };
    Store::open_in(Arc::new(disk.clone()), Arc::clone(ground), options)
}

/// Fields contain all edited samples of their chunks, and each has a unique name that was assigned.
fn assert_fields(terrain: &Terrain) {
    let (world, change) = (terrain.world(), terrain.parts().change);
    let mut names = BTreeSet::new();
    for field in change.fields.iter().flat_map(|(_, fields)| fields.iter()) {
        assert!(names.insert(field.id) && field.id.0 <= change.next_field, "{field:?}");
    }
    for (pos, brick) in world.bricks() {
        for (point, ..) in brick.edited_samples(pos) {
            let sample = LatticeBox::new(point, point).expect("a point");
            for chunk in world.grid().chunks_of(sample) {
                let fields = world.fields_of(chunk).expect("a chunk with edits has fields");
                assert!(fields.iter().any(|field| field.bounds.encloses(sample)), "{point}");
            }
        }
    }
}

fn was_kept(warnings: &[StoreWarning]) -> bool {
    matches!(warnings, [StoreWarning::BaseChanged { kept: "kept", .. }])
}

/// A world that was edited on a level and closed, or whose process was killed.
fn played(level: &BaseLevel, ground: &Arc<Ground>, seed: u64) -> (SimulatedDisk, Terrain) {
    let (disk, mut rng) = (SimulatedDisk::new(), Rng::with_seed(seed));
    let (mut store, mut world) = begin(&disk, level, ground, options(rng.u64(3..30)));
    for _ in 0..20 {
        match rng.u32(0..6) {
            0 => restore_brick(&mut world, &mut rng),
            _ => act(&mut world, &mut rng),
        }
        save(&mut store, &mut world).expect("the thread runs");
    }
    drop(store);
    (disk, world)
}

#[test]
fn own_bricks_stay_and_all_others_are_those_of_the_new_level() {
    let (mut own, mut others) = (0, 0);
    for seed in 0..count("BURROW_WORLDS", 60) {
        let ground = ground(seed);
        let old = level(&ground, seed, if seed == 7 { 0 } else { 25 });
        let new = version(&old, &ground, seed);
        let (disk, world) = played(&old, &ground, seed);
        let expected = by_hand(&world, &ground, &old, &new);
        own += own_bricks(&world, &old).bricks.len();
        others += usize::from(expected.world().hash() != world.world().hash());
        // Refused, it stays as it is.
        let refused = open(&disk, &ground, &new, BaseChanged::Refuse).expect_err("it is another level");
        assert!(matches!(refused, StoreError::LevelChanged { .. }), "{refused}");
        let missing = Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), options(9));
        assert!(matches!(missing, Err(StoreError::LevelMissing { .. })));
        let (_, same) =
            open(&disk.image().lose_process(), &ground, &old, BaseChanged::Refuse).expect("it is whole");
        assert_eq!((state(&same.terrain), same.warnings), (state(&world), vec![]), "seed {seed}");

        let (mut store, opened) = open(&disk, &ground, &new, BaseChanged::Keep).expect("it can be moved");
        assert!(was_kept(&opened.warnings) && !opened.is_log_whole, "seed {seed}: {:?}", opened.warnings);
        let mut moved = opened.terrain;
        assert_eq!(moved.world().hash(), expected.world().hash(), "seed {seed}");
        assert_eq!(moved.world().revision(), world.world().revision());
        assert_eq!((moved.rules(), moved.loose()), (world.rules(), world.loose()));
        assert_fields(&moved);
        if seed < 8 {
            assert!(moved.world().check_seams().is_flawless(), "seed {seed}");
        }
        // It continues as a world on the new level; the old level is now a different one.
        moved.set_meshing(Meshing::Never);
        let mut rng = Rng::with_seed(seed);
        (0..8).for_each(|_| act(&mut moved, &mut rng));
        save(&mut store, &mut moved).expect("the thread runs");
        store.flush().expect("the disk works");
        let killed = disk.image().lose_process();
        drop(store);
        for disk in [&killed, &disk] {
            let (_, again) = open(&disk.image().lose_process(), &ground, &new, BaseChanged::Refuse)
                .expect("it is its level");
            assert_eq!((state(&again.terrain), again.warnings), (state(&moved), vec![]), "seed {seed}");
        }
        // No record of the old state is left.
        let is_region = |(key, _): &&Record| key.len() == 13 && key[0] == b'r';
        let stored = records(&disk).1.iter().filter(is_region).count();
        assert_eq!(stored, inspect_in(&disk).expect("it can be read").regions, "seed {seed}");
        let check = check_in(&disk, Arc::clone(&ground), Some(&new)).expect("it can be read");
        assert_eq!((check.warnings, check.replays), (vec![], None), "seed {seed}");
        let back = by_hand(&moved, &ground, &new, &old);
        let (_, opened) = open(&disk, &ground, &old, BaseChanged::Keep).expect("it can be moved back");
        assert!(was_kept(&opened.warnings));
        assert_eq!(opened.terrain.world().hash(), back.world().hash(), "seed {seed}");
        assert_fields(&opened.terrain);
    }
    assert!(own > 100 && others > 10, "{own} bricks of {others} worlds");
}

#[test]
fn a_whole_log_is_replayed_on_the_new_level() {
    for seed in 0..count("BURROW_WORLDS", 12) {
        let (ground, mut rng) = (ground(seed), Rng::with_seed(seed));
        let old = level(&ground, seed, 25);
        let new = version(&old, &ground, seed);
        let disk = SimulatedDisk::new();
        let (mut store, mut world) = begin(&disk, &old, &ground, options(7));
        let brushes: Vec<Brush> = (0..20).map(|_| any_random_brush(&mut rng, &ground)).collect();
        for brush in &brushes {
            world.apply([brush.clone()]);
            save(&mut store, &mut world).expect("the thread runs");
        }
        drop(store);
        let mut expected = new.level().terrain(Arc::clone(&ground)).expect("its own ground");
        expected.set_meshing(Meshing::Never);
        expected.set_rules(world.rules().cloned().unwrap_or_default()).expect("valid rules");
        expected.set_loose(world.loose().copied());
        brushes.iter().for_each(|brush| drop(expected.apply([brush.clone()])));
        let (store, opened) = open(&disk, &ground, &new, BaseChanged::Replay).expect("it can be moved");
        assert!(matches!(opened.warnings[..], [StoreWarning::BaseChanged { kept: "replayed", .. }]));
        assert_eq!(opened.terrain.world().hash(), expected.world().hash(), "seed {seed}");
        assert_eq!(opened.terrain.world().revision(), world.world().revision());
        assert_fields(&opened.terrain);
        drop(store);
        let (_, again) = open(&disk, &ground, &new, BaseChanged::Refuse).expect("it is its level");
        assert_eq!((state(&again.terrain), again.warnings), (state(&opened.terrain), vec![]));
    }
}

#[test]
fn a_crash_while_a_world_is_moved_loses_nothing() {
    let mut outcomes = [0; 2];
    for seed in 0..count("BURROW_CRASHES", 6) {
        let ground = ground(seed);
        let old = level(&ground, seed, 20);
        let new = version(&old, &ground, seed);
        let (disk, world) = played(&old, &ground, seed);
        let before = disk.image().lose_process();
        let images = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&images);
        disk.watch(Some(move |image: &DiskImage| seen.lock().expect("no panic").push(image.clone())));
        let (store, opened) = open(&disk, &ground, &new, BaseChanged::Keep).expect("it can be moved");
        let moved = opened.terrain;
        drop(store);
        disk.watch(None::<fn(&DiskImage)>);
        let (_, back) = open(&disk, &ground, &old, BaseChanged::Keep).expect("it can be moved back");
        let mut rng = Rng::with_seed(seed);
        let images = images.lock().expect("no panic");
        assert!(images.len() > 5, "only {} operations", images.len());
        for image in &*images {
            for after in [image.lose_power(|| false), image.lose_power(|| rng.bool()), image.lose_process()] {
                let (_, there) = open(&after.image().lose_process(), &ground, &new, BaseChanged::Keep)
                    .expect("it can be opened");
                assert_eq!(state(&there.terrain), state(&moved), "seed {seed}, {image:?}");
                let (_, here) = open(&after, &ground, &old, BaseChanged::Keep).expect("it can be opened");
                // Moved or not, there is nothing in between.
                let is_moved = !here.warnings.is_empty();
                let expected = if is_moved { &back.terrain } else { &world };
                assert_eq!(state(&here.terrain), state(expected), "seed {seed}, {image:?}");
                outcomes[usize::from(is_moved)] += 1;
            }
        }
        let (_, untouched) = open(&before, &ground, &old, BaseChanged::Refuse).expect("it is whole");
        assert_eq!(state(&untouched.terrain), state(&world));
    }
    assert!(outcomes.iter().all(|count| *count > 0), "{outcomes:?}");
}

#[test]
fn commits_behind_the_last_checkpoint_are_made_again() {
    for seed in 0..count("BURROW_WORLDS", 20) {
        let (ground, mut rng) = (ground(seed), Rng::with_seed(seed));
        let old = level(&ground, seed, 25);
        let new = version(&old, &ground, seed);
        let disk = SimulatedDisk::new();
        let (mut store, mut world) = begin(&disk, &old, &ground, options(u64::MAX));
        for _ in 0..10 {
            act(&mut world, &mut rng);
            save(&mut store, &mut world).expect("the thread runs");
        }
        store.checkpoint().expect("the disk works");
        let mut expected = by_hand(&world, &ground, &old, &new);
        expected.set_rules(world.rules().cloned().unwrap_or_default()).expect("valid rules");
        expected.set_loose(world.loose().copied());
        for _ in 0..6 {
            let brush = any_random_brush(&mut rng, &ground);
            [&mut world, &mut expected].into_iter().for_each(|own| drop(own.apply([brush.clone()])));
            if rng.bool() {
                // Bricks that an undo restored keep their content on any level.
                let before = world.parts().change;
                drop(world.undo());
                let (before, after) = (bricks(before), bricks(world.parts().change));
                let all: BTreeSet<BrickPos> = before.keys().chain(after.keys()).copied().collect();
                let is_undone = |pos: &BrickPos| !is_same(before.get(pos), after.get(pos), *pos);
                let undone = all.into_iter().filter(is_undone).map(|pos| (pos, after.get(&pos).cloned()));
                let change = Patch { bricks: undone.collect(), ..Patch::default() };
                expected.apply_one(Order::parts(change, None)).outcome.expect("its own bricks");
            }
            save(&mut store, &mut world).expect("the thread runs");
        }
        store.flush().expect("the disk works");
        let killed = disk.image().lose_process();
        let (_, opened) = open(&killed, &ground, &new, BaseChanged::Keep).expect("it can be moved");
        assert_eq!(opened.terrain.world().hash(), expected.world().hash(), "seed {seed}");
        assert_eq!(opened.terrain.world().revision(), world.world().revision());
        assert!(was_kept(&opened.warnings), "{:?}", opened.warnings);
        assert_fields(&opened.terrain);
    }
}
