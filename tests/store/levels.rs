//! A world on a level stores only its differences from the level, and neither level nor edits are lost.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::format::Level;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{
    BaseChanged, BaseLevel, Files, SimulatedDisk, Store, StoreError, StoreOptions, StoreWarning, WorldFile,
    check_in, inspect_in,
};
use bevy_burrow::terrain::{Meshing, Patch};
use fastrand::Rng;
use glam::Vec3;

use crate::play::{act, check_opened, count, ground, options, save, state, terrain};

/// A sculpted level.
pub fn level(ground: &Arc<Ground>, seed: u64, acts: u32) -> BaseLevel {
    let (mut sculpted, mut rng) = (terrain(ground), Rng::with_seed(seed));
    (0..acts).for_each(|_| act(&mut sculpted, &mut rng));
    BaseLevel::new(Level::of(&sculpted), format!("levels/{seed}"))
}

pub fn on(level: &BaseLevel, options: StoreOptions) -> StoreOptions {
    StoreOptions { level: Some(level.clone()), ..options }
}

/// A new world on a level.
pub fn begin(
    disk: &SimulatedDisk,
    level: &BaseLevel,
    ground: &Arc<Ground>,
    options: StoreOptions,
) -> (Store, Terrain) {
    let mut world = level.level().terrain(Arc::clone(ground)).expect("its own ground");
    world.set_meshing(Meshing::Never);
    let store =
        Store::create_in(Arc::new(disk.clone()), &mut world, on(level, options)).expect("a new world");
    (store, world)
}

/// Makes a brick of the level pristine again, together with all fields of its world.
pub fn restore_brick(world: &mut Terrain, rng: &mut Rng) {
    let mut places: Vec<_> = world.world().bricks().map(|(pos, _)| pos).collect();
    places.sort_unstable();
    if let Some(pos) = rng.choice(places) {
        let change = Patch { bricks: vec![(pos, None)], ..Patch::default() };
        world.apply_one(Order::parts(change, None)).outcome.expect("a brick of its own");
    }
}

#[test]
fn a_world_on_a_level_comes_back_whatever_happens() {
    for seed in 0..count("BURROW_WORLDS", 10) {
        let (ground, mut rng) = (ground(seed), Rng::with_seed(seed));
        let level = level(&ground, seed, if seed == 3 { 0 } else { 25 });
        let disk = SimulatedDisk::new();
        let (mut store, mut world) = begin(&disk, &level, &ground, options(rng.u64(3..20)));
        let open = |disk: &SimulatedDisk| {
            Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), on(&level, options(16)))
        };
        let (mut states, mut acknowledged) = (BTreeMap::from([(0, vec![state(&world)])]), 0);
        for _ in 0..40 {
            match rng.u32(0..4) {
                0 => restore_brick(&mut world, &mut rng),
                _ => act(&mut world, &mut rng),
            }
            let revision = world.world().revision();
            states.entry(revision).or_default().push(state(&world));
            save(&mut store, &mut world).expect("the thread runs");
            if rng.u32(0..4) == 0 {
                acknowledged = store.flush().expect("the disk works");
            }
            for image in [disk.image().lose_power(|| rng.bool()), disk.image().lose_process()] {
                let opened = open(&image).expect("it can be opened");
                check_opened(&opened, &states, acknowledged, revision);
            }
        }
        drop(store);
        let check = check_in(&disk, Arc::clone(&ground), Some(&level)).expect("it can be read");
        assert_eq!((check.warnings, check.replays), (vec![], Some(true)), "seed {seed}");
        // Without its regions, replaying the log on the level gives the same world.
        let damaged = disk.image().lose_process();
        damaged.remove("regions.redb").expect("it is there");
        let (_, opened) = open(&damaged).expect("it can be rebuilt");
        assert_eq!(state(&opened.terrain), state(&world), "seed {seed}");
        let (_, opened) = open(&disk).expect("it can be opened");
        assert!(opened.warnings.is_empty() && opened.is_log_whole && opened.replayed == 0);
        assert_eq!(state(&opened.terrain), state(&world));
        // A file to share needs no level.
        let bytes =
            WorldFile::to_bytes(&opened.terrain, Default::default(), &BTreeMap::new()).expect("it is small");
        let shared = WorldFile::from_bytes(&bytes, Arc::clone(&ground)).expect("its own bytes");
        assert_eq!(state(&shared.terrain), state(&world));
    }
}

#[test]
fn only_what_differs_is_stored() {
    let ground = ground(7);
    let level = level(&ground, 7, 120);
    let ball = |x: f32| Brush::add(Shape::sphere(Vec3::new(x, 90.0, 30.0), 2.0), MaterialId(1));
    let stored = |is_on_level: bool, balls: u8| {
        let disk = SimulatedDisk::new();
        let (mut store, mut world) = if is_on_level {
            begin(&disk, &level, &ground, options(99))
        } else {
            let mut world = level.level().terrain(Arc::clone(&ground)).expect("its own ground");
            let store = Store::create_in(Arc::new(disk.clone()), &mut world, options(99));
            (store.expect("a new world"), world)
        };
        world.set_rules(DiggingRules::default()).expect("valid rules");
        world.set_loose(None);
        (0..balls).for_each(|x| drop(world.apply([ball(20.0 + 6.0 * f32::from(x))])));
        save(&mut store, &mut world).expect("the thread runs");
        store.checkpoint().expect("the disk works");
        let before = inspect_in(&disk.image().lose_process()).expect("it can be read");
        (0..balls).for_each(|_| drop(world.undo()));
        save(&mut store, &mut world).expect("the thread runs");
        drop(store);
        let after = inspect_in(&disk).expect("it can be read");
        assert_eq!(before.level.as_ref(), is_on_level.then(|| level.name()));
        (before.region_bytes, after.region_bytes)
    };
    let [none, few, many] = [0, 1, 4].map(|balls| stored(true, balls));
    let (whole, _) = stored(false, 1);
    assert_eq!(none, (0, 0));
    assert!(few.0 > 0 && few.0 < 2_000 && many.0 > few.0 && many.0 < 8_000, "{few:?} {many:?}");
    assert!(whole > 10 * few.0, "{whole} bytes without a level, {few:?} with it");
    assert_eq!((few.1, many.1), (0, 0), "undone edits leave nothing that differs from the level");
}

#[test]
fn a_level_that_is_missing_or_has_changed_is_told_and_loses_nothing() {
    let (ground, mut rng) = (ground(5), Rng::with_seed(5));
    let (level, other) = (level(&ground, 5, 30), level(&ground, 6, 30));
    let disk = SimulatedDisk::new();
    let (mut store, mut world) = begin(&disk, &level, &ground, options(9));
    (0..30).for_each(|_| act(&mut world, &mut rng));
    save(&mut store, &mut world).expect("the thread runs");
    drop(store);
    let open = |level: Option<&BaseLevel>| {
        let base_changed = BaseChanged::Refuse;
        let options = StoreOptions { level: level.cloned(), base_changed, ..options(9) };
        Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), options)
    };
    let missing = open(None).expect_err("it has a level");
    assert!(matches!(&missing, StoreError::LevelMissing { label } if label == "levels/5"), "{missing}");
    let changed = open(Some(&other)).expect_err("it has another level");
    assert!(matches!(&changed, StoreError::LevelChanged { .. }), "{changed}");
    // An equal level under another name is accepted.
    let renamed = BaseLevel::new(level.level().clone(), "elsewhere");
    let (store, opened) = open(Some(&renamed)).expect("it is the same level");
    assert_eq!((state(&opened.terrain), opened.warnings), (state(&world), vec![]));
    drop(store);
    // Worlds that were begun without a level need none, and ignore it.
    let whole = SimulatedDisk::new();
    drop(Store::create_in(Arc::new(whole.clone()), &mut world, options(9)).expect("a new world"));
    let opened = Store::open_in(Arc::new(whole), Arc::clone(&ground), on(&other, options(9)));
    assert_eq!(state(&opened.expect("it needs no level").1.terrain), state(&world));
}

#[test]
fn a_world_on_a_level_keeps_its_edits_on_another_ground() {
    for seed in 0..4 {
        let (before, mut rng) = (ground(seed), Rng::with_seed(seed));
        let height = |x: i32, z: i32| f64::from((x * 3 + z * 5) % 40) / 3.0;
        let after = Ground::from_fn(before.width() as u32, before.depth() as u32, height);
        let after = Arc::new(after.expect("valid heights"));
        let (disk, level) = (SimulatedDisk::new(), level(&before, seed, 20));
        let (mut store, mut world) = begin(&disk, &level, &before, options(9));
        (0..20).for_each(|_| act(&mut world, &mut rng));
        restore_brick(&mut world, &mut rng);
        save(&mut store, &mut world).expect("the thread runs");
        // While it is running, too.
        let image = disk.image();
        world.apply_one(Order::Ground(Arc::clone(&after))).outcome.expect("it has the same size");
        store.checkpoint().expect("the disk works");
        save(&mut store, &mut world).expect("the thread runs");
        drop(store);
        for (disk, is_told) in [(image.lose_process(), true), (disk, false)] {
            let opened = Store::open_in(Arc::new(disk), Arc::clone(&after), on(&level, options(9)));
            let (_, opened) = opened.expect("it can be opened");
            let is_changed = |own: &StoreWarning| matches!(own, StoreWarning::BaseChanged { .. });
            assert_eq!(opened.warnings.iter().any(is_changed), is_told, "{:?}", opened.warnings);
            if !is_told {
                assert_eq!(state(&opened.terrain), state(&world), "seed {seed}");
            }
        }
    }
}
