//! Malicious files, and files of a newer version: reading them takes little memory, overflows nothing, and does not
//! change them.

use std::sync::Arc;

use allocation_counter::measure;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{Files, Opening, SimulatedDisk, Store, StoreError, inspect_in};
use fastrand::Rng;

use crate::play::{State, act, ground, open, options, save, state, terrain};

const DATABASE: &str = "regions.redb";

/// A world that was closed, all of which is in the database and in the log.
fn world(ground: &Arc<Ground>) -> (SimulatedDisk, State) {
    let (disk, mut world, mut rng) = (SimulatedDisk::new(), terrain(ground), Rng::with_seed(6));
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, options(9)).expect("a new world");
    for _ in 0..20 {
        act(&mut world, &mut rng);
        save(&mut store, &mut world).expect("the thread runs");
    }
    drop(store);
    (disk, state(&world))
}

/// The memory that opening takes, and how it ends.
fn opening(disk: &SimulatedDisk, ground: &Arc<Ground>) -> (u64, Result<State, StoreError>) {
    let mut opened = None;
    let taken = measure(|| opened = Some(open(disk, ground).map(|(_, own)| state(&own.terrain)))).bytes_max;
    (taken, opened.expect("it was opened"))
}

fn number(mut value: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value > 127 {
        bytes.push(value as u8 | 128);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// A sequence of records, each of which claims to reach to the end; with `in_key`, their keys do too.
fn nested(length: usize, in_key: bool, prefix: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    while bytes.len() + 96 < length {
        let at = bytes.len();
        bytes.extend_from_slice(prefix);
        bytes.extend_from_slice(b"\xB5BRW");
        bytes.extend_from_slice(&[1, 3, 0]);
        bytes.extend_from_slice(&[7; 16]);
        if in_key {
            bytes.extend(number(length - at - 96));
        } else {
            bytes.extend_from_slice(&[0, 0]);
            bytes.extend(number(length - at - 96));
        }
    }
    bytes.resize(length, 0);
    bytes
}

#[test]
fn small_files_take_little_memory_whatever_they_say() {
    let ground = ground(2);
    for length in [256 << 10, 1 << 20] {
        for in_key in [false, true] {
            for path in [DATABASE, "quarantine/regions.redb.1", "regions.new", "journal/00000077.log"] {
                let (disk, expected) = world(&ground);
                let prefix =
                    if path.starts_with('j') { &[255, 255, 15, 0, 1, 0, 0, 0, 0, 0, 0, 0][..] } else { &[] };
                let bytes = nested(length, in_key, prefix);
                if path == DATABASE || path.starts_with('j') {
                    drop(Files::open(&disk, path, Opening::New));
                } else {
                    // It is read only if there is no database.
                    disk.remove(DATABASE).expect("it is there");
                    drop(Files::open(&disk, path, Opening::New).expect("a new file"));
                }
                disk.damage(path, |own| *own = bytes);
                let (taken, now) = opening(&disk, &ground);
                assert!(taken < 48 << 20, "{path}: {} MiB", taken >> 20);
                assert_eq!(now.expect("the rest is whole"), expected, "{path}");
            }
        }
    }
}

#[test]
fn a_database_of_a_newer_format_is_refused_and_left_alone() {
    let ground = ground(2);
    for (format, is_newer) in [(4, true), (9, true), (255, true), (0, false)] {
        let (disk, expected) = world(&ground);
        disk.damage(DATABASE, |bytes| [64, 192].into_iter().for_each(|slot| bytes[slot] = format));
        let before: Vec<_> = disk
            .paths()
            .into_iter()
            .map(|path| (Files::read(&disk, &path), path))
            .map(|(own, path)| (own.expect("it is there"), path))
            .collect();
        match open(&disk, &ground) {
            Err(why) => {
                assert!(
                    is_newer && matches!(why, StoreError::NewerDatabase { known: 3, .. }),
                    "{format}: {why}"
                );
                let after: Vec<_> = disk
                    .paths()
                    .into_iter()
                    .map(|path| (Files::read(&disk, &path), path))
                    .map(|(own, path)| (own.expect("it is there"), path))
                    .collect();
                assert!(before == after);
                assert!(matches!(inspect_in(&disk), Err(StoreError::NewerDatabase { .. })));
            }
            Ok((_, opened)) => assert!(!is_newer && state(&opened.terrain) == expected, "{format}"),
        }
    }
    // One slot of it is damage.
    let (disk, expected) = world(&ground);
    disk.damage(DATABASE, |bytes| bytes[64] = 4);
    assert_eq!(state(&open(&disk, &ground).expect("it is whole").1.terrain), expected);
}
