//! Tools report what opening a world would do, and inspecting changes nothing.

use std::sync::Arc;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{
    DiskFault, Files, SimulatedDisk, Store, StoreError, StoreOptions, StoreWarning, check_in, inspect_in,
    replay,
};
use fastrand::Rng;
use glam::Vec3;

use crate::opening::Place;
use crate::play::{act, ground, open, options, samples, save, state, terrain};

const DATABASE: &str = "regions.redb";

fn contents(disk: &SimulatedDisk) -> Vec<(String, Vec<u8>)> {
    let read = |path: String| (path.clone(), Files::read(disk, &path).expect("it is there"));
    disk.paths().into_iter().map(read).collect()
}

fn play(store: &mut Store, world: &mut Terrain, rng: &mut Rng, commits: u64) {
    let end = world.world().revision() + commits;
    while world.world().revision() < end {
        act(world, rng);
        save(store, world).expect("the thread runs");
    }
}

#[test]
fn looking_at_a_world_changes_nothing() {
    let ground = ground(2);
    let (disk, mut world, mut rng) = (SimulatedDisk::new(), terrain(&ground), Rng::with_seed(1));
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, options(7)).expect("a new world");
    play(&mut store, &mut world, &mut rng, 20);
    store.flush().expect("the disk works");
    // A database of a process that was killed is repaired when it is opened.
    for disk in [disk.image().lose_process(), disk.image().lose_power(|| false)] {
        for damage in [None, Some(DATABASE)] {
            let disk = disk.image().lose_process();
            if let Some(path) = damage {
                disk.damage(path, |bytes| bytes[0] ^= 1);
            }
            let before = (contents(&disk), disk.operations());
            let info = inspect_in(&disk).expect("it can be read");
            let check = check_in(&disk, Arc::clone(&ground), None).expect("it can be read");
            assert_eq!((contents(&disk), disk.operations()), before);
            assert_eq!(state(&check.terrain), state(&world));
            assert_eq!((info.revision, check.replays), (world.world().revision(), Some(true)));
            assert_eq!(info.damage.is_empty(), damage.is_none(), "{:?}", info.damage);
            assert_eq!(check.warnings.is_empty(), damage.is_none(), "{:?}", check.warnings);
        }
    }
}

#[test]
fn a_world_is_whole_after_a_disk_was_full() {
    let ground = ground(2);
    for begin in 0..40 {
        let (disk, mut world, mut rng) = (SimulatedDisk::new(), terrain(&ground), Rng::with_seed(1));
        let created = Store::create_in(Arc::new(disk.clone()), &mut world, options(7));
        let mut store = Some(created.expect("a new world"));
        let mut go_on = |commits: u64, is_fine: bool| {
            let store = store.as_mut().expect("it is open");
            play(store, &mut world, &mut rng, commits);
            assert!(store.flush().is_ok() || !is_fine);
        };
        go_on(5, true);
        disk.fail_at(disk.operations() + begin, DiskFault::Full);
        go_on(10, false);
        disk.set_fault(DiskFault::None);
        go_on(5, true);
        for is_closed in [false, true] {
            let killed = disk.image().lose_process();
            // The part of a write that fitted before the disk was full.
            for path in killed.paths().into_iter().filter(|path| path.starts_with("journal")) {
                let torn = [&[200, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0][..], b"\xB5BRW", &[1; 40]].concat();
                killed.damage(&path, |bytes| bytes.extend(torn));
            }
            let disk = if is_closed { &disk } else { &killed };
            if is_closed {
                drop(store.take());
            }
            let check = check_in(disk, Arc::clone(&ground), None).expect("it can be read");
            assert_eq!((check.warnings, state(&check.terrain)), (vec![], state(&world)), "from {begin}");
            let info = inspect_in(disk).expect("it can be read");
            assert_eq!(info.damage, Vec::<String>::new(), "from {begin}");
            let (_, opened) = open(&disk.image().lose_process(), &ground).expect("it is whole");
            assert_eq!(opened.warnings, [], "from {begin}");
        }
    }
}

#[test]
fn the_log_of_another_branch_is_not_taken_for_that_of_the_world() {
    let ground = ground(2);
    let dig = |store: &mut Store, world: &mut Terrain, seed: u64| {
        let mut rng = Rng::with_seed(seed);
        for _ in 0..8 {
            let at = Vec3::new(rng.f32() * 70.0, 5.0, rng.f32() * 70.0);
            world.apply([Brush::dig(Shape::sphere(at, 6.0))]);
            save(store, world).expect("the thread runs");
        }
    };
    let (disk, mut world) = (SimulatedDisk::new(), terrain(&ground));
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, options(99)).expect("a new world");
    dig(&mut store, &mut world, 1);
    drop(store);
    // A backup that was then edited differently.
    let branches = [2, 3].map(|seed| {
        let branch = disk.image().lose_process();
        let (mut store, opened) = open(&branch, &ground).expect("it is whole");
        let mut world = opened.terrain;
        dig(&mut store, &mut world, seed);
        drop(store);
        (branch, world)
    });
    let [(mixed, expected), (other, _)] = branches;
    for path in mixed.paths().into_iter().filter(|path| path.starts_with("journal")) {
        mixed.remove(&path).expect("it is there");
    }
    for (path, bytes) in contents(&other).into_iter().filter(|(path, _)| path.starts_with("journal")) {
        let file = Files::open(&mixed, &path, bevy_burrow::store::Opening::New).expect("a new file");
        file.write_at(0, &bytes).expect("the disk works");
    }
    let check = check_in(&mixed, Arc::clone(&ground), None).expect("it can be read");
    assert_ne!(check.replays, Some(true));
    assert!(check.warnings.iter().any(|own| own.contains("another branch")), "{:?}", check.warnings);
    assert!(!inspect_in(&mixed).expect("it can be read").is_log_whole);
    let (_, opened) = open(&mixed, &ground).expect("its regions are whole");
    assert_eq!((opened.is_log_whole, state(&opened.terrain)), (false, state(&expected)));
}

#[test]
fn a_copy_is_named_where_there_is_one() {
    let ground = ground(2);
    for is_whole in [true, false] {
        let (disk, mut world, mut rng) = (SimulatedDisk::new(), terrain(&ground), Rng::with_seed(1));
        let log_bytes = if is_whole { u64::MAX } else { 0 };
        let settings = StoreOptions { log_bytes, ..options(4) };
        let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, settings).expect("a new world");
        play(&mut store, &mut world, &mut rng, 20);
        store.checkpoint().expect("the disk works");
        drop(store);
        for damage in ["nothing", "removed", "emptied", "damaged", "cut", "full"] {
            let disk = disk.image().lose_process();
            match damage {
                "removed" => disk.remove(DATABASE).expect("it is there"),
                "emptied" => disk.damage(DATABASE, Vec::clear),
                "damaged" | "full" => disk.damage(DATABASE, |bytes| bytes[0] ^= 1),
                "cut" => disk.damage(DATABASE, |bytes| bytes.truncate(bytes.len() / 2)),
                _ => {}
            }
            if damage == "full" {
                disk.set_fault(DiskFault::Full);
            }
            let opened = open(&disk, &ground);
            let (store, opened) = opened.unwrap_or_else(|why| panic!("{damage}: {why}"));
            let mut copies = 0;
            for warning in &opened.warnings {
                let text = warning.to_string();
                if let StoreWarning::Rebuilt { quarantine, .. }
                | StoreWarning::RegionLost { quarantine, .. } = warning
                {
                    assert_eq!(text.contains("a copy is in"), !quarantine.is_empty(), "{text}");
                    let exists = quarantine.is_empty() || disk.paths().contains(quarantine);
                    assert!(exists, "{damage}: {text}: {:?}", disk.paths());
                    copies += usize::from(!quarantine.is_empty());
                }
            }
            let has_copy = !["nothing", "removed", "emptied"].contains(&damage);
            assert_eq!(copies > 0, has_copy, "{damage}: {:?}", opened.warnings);
            drop((store, opened));
        }
    }
}

#[test]
fn an_imported_world_has_no_log_to_replay() {
    let (place, ground) = (Place::new("imported"), ground(2));
    let (mut world, mut rng) = (terrain(&ground), Rng::with_seed(1));
    (0..12).for_each(|_| act(&mut world, &mut rng));
    drop(Store::create(&place.0, &mut world, options(9)).expect("a new world"));
    let refused = replay(&place.0, Arc::clone(&ground), None).expect_err("it has no log");
    assert!(matches!(refused, StoreError::LogNotWhole), "{refused}");
    let other = replay(&place.0, crate::play::ground(3), None).expect_err("it is another ground");
    assert!(matches!(other, StoreError::BaseChanged { .. }), "{other}");
}

#[test]
fn what_is_only_looked_at_is_not_said_to_be_rebuilt() {
    let ground = ground(2);
    let (disk, mut world, mut rng) = (SimulatedDisk::new(), terrain(&ground), Rng::with_seed(1));
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, options(4)).expect("a new world");
    play(&mut store, &mut world, &mut rng, 20);
    drop(store);
    disk.damage("regions.redb", |bytes| bytes[0] ^= 1);
    for _ in 0..2 {
        let looked = check_in(&disk, Arc::clone(&ground), None).expect("its log is whole");
        assert_eq!(samples(&looked.terrain), samples(&world));
        let [warning] = &looked.warnings[..] else { panic!("{:?}", looked.warnings) };
        assert!(warning.contains("when the world is opened") && !warning.contains("has been"), "{warning}");
    }
    let (_, opened) = open(&disk, &ground).expect("its log is whole");
    assert!(matches!(opened.warnings[..], [StoreWarning::Rebuilt { .. }]), "{:?}", opened.warnings);
}

#[test]
fn a_folder_in_the_place_of_the_copy_of_the_checkpoint_is_moved_aside() {
    let (place, ground) = (Place::new("in-the-way"), ground(2));
    let (mut world, mut rng) = (terrain(&ground), Rng::with_seed(1));
    let mut store = Store::create(&place.0, &mut world, options(4)).expect("a new world");
    play(&mut store, &mut world, &mut rng, 20);
    drop(store);
    let copy = place.0.join("journal/checkpoint");
    std::fs::remove_file(&copy).expect("it is there");
    std::fs::create_dir(&copy).expect("a new folder");
    std::fs::write(copy.join("notes.txt"), b"of somebody").expect("a new file");
    let (mut store, opened) =
        Store::open(&place.0, Arc::clone(&ground), options(4)).expect("all that it needs is there");
    assert_eq!(samples(&opened.terrain), samples(&world));
    store.checkpoint().expect("it can be saved");
    drop(store);
    assert!(copy.is_file());
    assert!(place.0.join("quarantine/checkpoint.1/notes.txt").is_file(), "nothing of anybody's is removed");
}

#[test]
fn whatever_is_left_of_a_world_can_be_opened() {
    let ground = ground(2);
    let (disk, mut world, mut rng) = (SimulatedDisk::new(), terrain(&ground), Rng::with_seed(1));
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, options(4)).expect("a new world");
    play(&mut store, &mut world, &mut rng, 20);
    drop(store);
    for path in disk.paths().into_iter().filter(|path| path.starts_with("journal")) {
        disk.remove(&path).expect("it is there");
    }
    // Both copies of the checkpoint are gone, and all regions are there.
    for key in [b"c", b"d"] {
        crate::damage::put(&disk, key, None);
    }
    let refused = open(&disk, &ground).expect_err("nothing says what it was");
    assert!(refused.to_string().contains("checkpoint"), "{refused}");
    let options = StoreOptions { salvage: true, ..options(9) };
    let opened =
        Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), options).expect("it has regions");
    assert_eq!(opened.1.warnings, [StoreWarning::CheckpointLost]);
    assert_eq!(samples(&opened.1.terrain), samples(&world));
    drop(opened);
    let (_, again) = open(&disk, &ground).expect("it is a world again");
    assert_eq!((again.warnings, samples(&again.terrain)), (vec![], samples(&world)));
}
