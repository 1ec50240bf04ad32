//! Images and prefabs that edits name are in files of their own: written once, before the first commit that names them,
//! and kept as long as the log does.

use std::sync::Arc;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{Files, SimulatedDisk, Store, StoreOptions, StoreWarning, inspect_in};
use fastrand::Rng;
use glam::Vec3;

use crate::play::{ball, block, brush_with_content, ground, open, options, save, state, terrain};

fn create(disk: &SimulatedDisk, terrain: &mut Terrain, options: StoreOptions) -> Store {
    Store::create_in(Arc::new(disk.clone()), terrain, options).expect("a new world")
}

fn length(disk: &SimulatedDisk, path: &str) -> usize {
    disk.read(path).expect("it is there").len()
}

fn contents(disk: &SimulatedDisk) -> Vec<String> {
    disk.paths().into_iter().filter(|path| path.ends_with(".content")).collect()
}

/// Bytes of all segments.
fn log_bytes(disk: &SimulatedDisk) -> usize {
    disk.paths().iter().filter(|path| path.ends_with(".log")).map(|path| length(disk, path)).sum()
}

/// A paste within a grid of 64 samples a side.
fn paste(prefab: &Arc<Prefab>, grid: &ShapeGrid, number: usize) -> Brush {
    let at = Vec3::new(12.0 + (number * 7 % 40) as f32, 14.0, 12.0 + (number * 11 % 40) as f32);
    let within = GridShape::new(grid.clone(), at).with_scale(0.25);
    let operation = Operation::Paste { paste: Paste::new(Arc::clone(prefab), at) };
    Brush { operation, ..Brush::dig(within) }.with_tag(number as u64)
}

#[test]
fn an_edit_takes_the_bytes_of_names_in_place_of_its_content() {
    let (grid, prefab) = (ball(64), Arc::new(block(1)));
    let paste = |number| paste(&prefab, &grid, number);
    let dig = |number| Brush { operation: Operation::Dig, ..paste(number) };
    let cases: [(&str, &dyn Fn(usize) -> Brush, usize, usize, f64); 4] = [
        ("a dig of a grid", &dig, 1, 1, 130.0),
        ("digs of a grid", &dig, 1, 100, 30.0),
        ("a paste within a grid", &paste, 2, 1, 164.0),
        ("pastes within a grid", &paste, 2, 100, 45.0),
    ];
    for (what, brush, named, in_a_frame, most) in cases {
        let (disk, ground) = (SimulatedDisk::new(), ground(3));
        let mut terrain = terrain(&ground);
        let mut store = create(&disk, &mut terrain, options(1000));
        store.flush().expect("the disk works");
        terrain.apply([brush(0)]);
        store.follow(&mut terrain).expect("the thread runs");
        store.flush().expect("the disk works");
        let (files, before) = (contents(&disk), log_bytes(&disk));
        assert_eq!(files.len(), named);
        assert!(files.iter().map(|path| length(&disk, path)).sum::<usize>() > 10_000);
        for number in 1..=100 {
            let outcome = terrain.apply_one(brush(number)).outcome;
            assert!(outcome.is_ok(), "{outcome:?}");
            if number % in_a_frame == 0 {
                store.follow(&mut terrain).expect("the thread runs");
                store.flush().expect("the disk works");
            }
        }
        let bytes = (log_bytes(&disk) - before) as f64 / 100.0;
        println!("{what}, {in_a_frame} in a frame: {bytes:.1} bytes each");
        assert!(bytes < most, "{what}, {in_a_frame} in a frame: {bytes} bytes each");
        assert_eq!(contents(&disk), files, "nothing was written twice");
        let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("it can be opened");
        assert_eq!((state(&opened.terrain), opened.warnings), (state(&terrain), vec![]));
        assert_eq!(opened.replayed, 101);
        drop(store);
    }
}

#[test]
fn content_stays_as_long_as_the_log_names_it() {
    let (disk, ground) = (SimulatedDisk::new(), ground(3));
    let mut terrain = terrain(&ground);
    // Segments of 4 KiB.
    let options = StoreOptions { log_bytes: 64 << 10, ..options(5) };
    let mut store = create(&disk, &mut terrain, options);
    let mut rng = Rng::with_seed(8);
    terrain.apply([paste(&Arc::new(block(1)), &ball(9), 0)]);
    save(&mut store, &mut terrain).expect("the thread runs");
    store.checkpoint().expect("the disk works");
    let first = contents(&disk);
    assert_eq!(first.len(), 2);
    let dig = |rng: &mut Rng| {
        Brush::dig(Shape::sphere(Vec3::new(rng.f32() * 60.0, 10.0, rng.f32() * 60.0), 2.0))
            .with_tag(rng.u64(..))
    };
    // The log is rebuilt from as long as it is whole.
    for _ in 0..20 {
        terrain.apply([dig(&mut rng)]);
        save(&mut store, &mut terrain).expect("the thread runs");
    }
    store.checkpoint().expect("the disk works");
    assert_eq!(contents(&disk), first);
    let rebuilt = disk.image().lose_process();
    rebuilt.remove("regions.redb").expect("it is there");
    let (_, opened) = open(&rebuilt, &ground).expect("the log is whole");
    assert_eq!(state(&opened.terrain), state(&terrain));
    // Then its beginning goes, and the content with it.
    for number in 0..12_000 {
        terrain.apply([dig(&mut rng)]);
        save(&mut store, &mut terrain).expect("the thread runs");
        if contents(&disk).is_empty() {
            break;
        }
        assert!(number < 11_999, "it stays forever: {:?}", disk.paths());
    }
    // It comes again where it is named again.
    terrain.apply([paste(&Arc::new(block(1)), &ball(9), 5)]);
    save(&mut store, &mut terrain).expect("the thread runs");
    store.flush().expect("the disk works");
    assert_eq!(contents(&disk), first);
    let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("it can be opened");
    assert_eq!((state(&opened.terrain), opened.warnings), (state(&terrain), vec![]));
}

#[test]
fn missing_or_damaged_content_loses_nothing_but_the_commits_that_need_it() {
    let ground = ground(3);
    let disk = SimulatedDisk::new();
    let mut terrain = terrain(&ground);
    let mut store = create(&disk, &mut terrain, options(1000));
    let mut rng = Rng::with_seed(4);
    for number in 0..9 {
        let brush = match number {
            6 => brush_with_content(&mut rng),
            _ => Brush::dig(Shape::sphere(Vec3::new(9.0 + 5.0 * number as f32, 20.0, 30.0), 6.0)),
        };
        terrain.apply([brush]);
        save(&mut store, &mut terrain).expect("the thread runs");
        store.flush().expect("the disk works");
    }
    let killed = disk.image().lose_process();
    let path = contents(&killed).pop().expect("it has content");
    for how in ["removed", "damaged", "empty", "whole"] {
        let disk = killed.image().lose_process();
        match how {
            "removed" => disk.remove(&path).expect("it is there"),
            "damaged" => disk.damage(&path, |bytes| bytes[40] ^= 1),
            "empty" => disk.damage(&path, Vec::clear),
            _ => {}
        }
        if how == "whole" {
            let (_, opened) = open(&disk, &ground).expect("it can be opened");
            assert_eq!((state(&opened.terrain), opened.warnings), (state(&terrain), vec![]));
            continue;
        }
        let damage = inspect_in(&disk).expect("it can be inspected").damage;
        assert!(damage.iter().any(|what| what.contains("frame")), "{damage:?}");
        let (store, opened) = open(&disk, &ground).expect("it can be opened");
        assert_eq!(opened.terrain.world().revision(), 6, "{how}");
        let why = match &opened.warnings[..] {
            [StoreWarning::LogRefused { why, .. }] => why,
            other => panic!("{how}: {other:?}"),
        };
        assert!(why.contains("content") && why.contains("missing or damaged"), "{why}");
        // The rest is kept aside, and what follows is saved.
        assert!(disk.paths().iter().any(|path| path.starts_with("quarantine/")));
        let (mut store, mut terrain) = (store, opened.terrain);
        terrain.apply([brush_with_content(&mut Rng::with_seed(4))]);
        save(&mut store, &mut terrain).expect("the thread runs");
        store.flush().expect("the disk works");
        let (_, again) = open(&disk.image().lose_power(|| false), &ground).expect("it can be opened");
        assert_eq!((state(&again.terrain), again.warnings), (state(&terrain), vec![]));
    }
}
