//! Files are damaged in every way: bits flip, files end early, records are swapped, and older ones reappear.
//! `BURROW_DAMAGES` is how often, and `BURROW_SEED` the number of the first damage, so that several processes can share
//! the work.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::sync::{Arc, Mutex};

use bevy_burrow::lattice::RegionPos;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{DiskImage, Files, SimulatedDisk, Store, StoreOptions, StoreWarning};
use fastrand::Rng;
use glam::Vec3;
use redb::{Builder, ReadableDatabase, ReadableTable, StorageBackend, TableDefinition};

use crate::play::{State, count, options, save, state};

const DATABASE: &str = "regions.redb";

/// A world of several regions at some time.
struct Saved {
    image: DiskImage,
    /// The image at an earlier time.
    earlier: DiskImage,
    ground: Arc<Ground>,
    states: BTreeMap<u64, Vec<State>>,
    terrain: Terrain,
}

/// Digs a world; with or without a log from its beginning, with or without commits after the last checkpoint.
fn saved(is_whole: bool, has_tail: bool) -> Saved {
    let mut rng = Rng::with_seed(4);
    let height = |x: i32, z: i32| 30.0 + f64::from((x * 7 + z * 3) % 11);
    let ground = Arc::new(Ground::from_fn(220, 220, height).expect("valid heights"));
    let mut terrain = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid");
    let disk = SimulatedDisk::new();
    let log_bytes = if is_whole { u64::MAX } else { 0 };
    let options = StoreOptions { log_bytes, ..options(25) };
    let store = Store::create_in(Arc::new(disk.clone()), &mut terrain, options);
    let mut store = store.expect("a new world");
    let mut states = BTreeMap::from([(0, vec![state(&terrain)])]);
    let mut earlier = disk.image();
    for commit in 0..110 {
        let center = Vec3::new(rng.f32() * 220.0, 20.0 + rng.f32() * 20.0, rng.f32() * 220.0);
        let brush = Brush::dig(Shape::sphere(center, 3.0 + rng.f32() * 6.0));
        terrain.apply([if rng.u8(..4) == 0 {
            brush.with_roughness(Roughness::new(1.0, 4.0, 7))
        } else {
            brush
        }]);
        let revision = terrain.world().revision();
        states.entry(revision).or_default().push(state(&terrain));
        save(&mut store, &mut terrain).expect("the thread runs");
        match commit {
            60 => {
                store.checkpoint().expect("the disk works");
                earlier = disk.image();
            }
            85 if has_tail => drop(store.checkpoint().expect("the disk works")),
            _ => drop(store.flush().expect("the disk works")),
        }
    }
    if !has_tail {
        store.checkpoint().expect("the disk works");
    }
    let image = disk.image();
    Saved { image, earlier, ground, states, terrain }
}

/// Damages a file, by flipped bits only if `only_flips`; returns a description.
fn damage(disk: &SimulatedDisk, earlier: &DiskImage, rng: &mut Rng, only_flips: bool) -> String {
    let paths: Vec<String> =
        disk.paths().into_iter().filter(|path| !path.starts_with("quarantine")).collect();
    let path = rng.choice(&paths).expect("there are files").clone();
    let seed = rng.u64(..);
    let kind = if only_flips { 0 } else { rng.u32(0..7) };
    let mut what = format!("{path}: kind {kind}");
    let mut own = Rng::with_seed(seed);
    match kind {
        0 | 1 => disk.damage(&path, |bytes| {
            let flips = if only_flips { 1 } else { own.usize(1..4) };
            for _ in 0..flips.min(bytes.len()) {
                let at = own.usize(..bytes.len());
                bytes[at] ^= 1 << own.u32(0..8);
                what += &format!(", bit in byte {at}");
            }
        }),
        2 => disk.damage(&path, |bytes| {
            let length = own.usize(..=bytes.len());
            bytes.truncate(length);
            what += &format!(", cut to {length}");
        }),
        3 => disk.damage(&path, |bytes| {
            let from = own.usize(..=bytes.len());
            let to = (from + own.usize(1..5000)).min(bytes.len());
            bytes[from..to].fill(0);
            what += &format!(", zeros from {from} to {to}");
        }),
        4 => Files::remove(disk, &path).expect("it is there"),
        5 => {
            let old = Files::read(&earlier.lose_process(), &path);
            disk.damage(&path, |bytes| {
                if let Ok(old) = old {
                    *bytes = old;
                }
            });
        }
        _ => disk.damage(&path, |bytes| bytes.extend((0..own.usize(1..600)).map(|_| own.u8(..)))),
    }
    what
}

fn open_damaged(disk: &SimulatedDisk, ground: &Arc<Ground>) -> (Store, bevy_burrow::store::Opened) {
    let opened = Store::open_in(Arc::new(disk.clone()), Arc::clone(ground), options(25));
    opened.unwrap_or_else(|why| panic!("{why}"))
}

#[test]
fn with_a_whole_log_everything_is_rebuilt() {
    let damages = count("BURROW_DAMAGES", 300);
    let (first, mut rebuilt, mut cut) = (count("BURROW_SEED", 0), 0, 0);
    for has_tail in [false, true] {
        let world = saved(true, has_tail);
        let latest = world.terrain.world().revision();
        for number in first..first + damages / 2 {
            let mut rng = Rng::with_seed(number * 2 + u64::from(has_tail));
            let disk = world.image.lose_process();
            let what = damage(&disk, &world.earlier, &mut rng, false);
            let (store, opened) = open_damaged(&disk, &world.ground);
            let revision = opened.terrain.world().revision();
            let now = state(&opened.terrain);
            assert!(world.states[&revision].contains(&now), "{what}: {:?}", opened.warnings);
            let lost = opened.warnings.iter().any(|own| matches!(own, StoreWarning::RegionLost { .. }));
            assert!(!lost, "{what}: {:?}", opened.warnings);
            rebuilt +=
                u32::from(opened.warnings.iter().any(|own| matches!(own, StoreWarning::Rebuilt { .. })));
            if revision < latest {
                cut += 1;
                // Only a log that is shorter by whole frames can't be distinguished from one that never was longer.
                let is_told = !opened.warnings.is_empty();
                let is_shorter = ["cut to", "kind 4", "kind 5"].iter().any(|kind| what.contains(kind));
                assert!(what.starts_with("journal"), "{what}: {revision} of {latest}");
                assert!(is_told || is_shorter, "{what}: {revision} of {latest}");
            }
            drop(store);
            // It is intact from then on.
            let (_, again) = open_damaged(&disk, &world.ground);
            assert!(again.warnings.is_empty(), "{what}: {:?}", again.warnings);
            assert_eq!(state(&again.terrain), now, "{what}");
        }
    }
    println!("{damages} damages: {rebuilt} worlds rebuilt, {cut} logs cut");
}

/// The edited samples of each region.
fn regions(terrain: &Terrain) -> BTreeMap<RegionPos, u64> {
    let world = terrain.world();
    world.regions().map(|at| (at, world.region_hash(at))).collect()
}

fn lost_regions(opened: &bevy_burrow::store::Opened) -> BTreeSet<RegionPos> {
    let lost = opened.warnings.iter().filter_map(|own| match own {
        StoreWarning::RegionLost { region, .. } => {
            let parts: Vec<i32> = region.split(' ').map(|part| part.parse().expect("a number")).collect();
            Some(RegionPos(glam::IVec3::from_slice(&parts)))
        }
        _ => None,
    });
    lost.collect()
}

fn check_losses(world: &Saved, disk: &SimulatedDisk, what: &str) -> usize {
    let (store, opened) = open_damaged(disk, &world.ground);
    let lost = lost_regions(&opened);
    assert!(lost.len() <= 1, "{what}: {:?}", opened.warnings);
    let mut expected = regions(&world.terrain);
    expected.retain(|at, _| !lost.contains(at));
    assert!(regions(&opened.terrain) == expected, "{what}: {:?}", opened.warnings);
    let (hash, number) = (opened.terrain.world().hash(), lost.len());
    drop(store);
    let (_, again) = open_damaged(disk, &world.ground);
    assert_eq!(again.terrain.world().hash(), hash, "{what}");
    assert!(again.warnings.is_empty(), "{what}: {:?}", again.warnings);
    number
}

#[test]
fn without_a_log_a_flip_loses_one_region_at_most() {
    let world = saved(false, false);
    let (damages, mut lost) = (count("BURROW_DAMAGES", 300) / 2, 0);
    let first = count("BURROW_SEED", 0);
    for number in first..first + damages {
        let disk = world.image.lose_process();
        let what = damage(&disk, &world.earlier, &mut Rng::with_seed(number), true);
        lost += check_losses(&world, &disk, &what);
    }
    println!("{damages} flips: {lost} regions lost");
}

/// Bytes of a database, to be changed without its store.
#[derive(Debug, Clone, Default)]
pub struct Bytes(Arc<Mutex<Vec<u8>>>);

impl StorageBackend for Bytes {
    fn len(&self) -> io::Result<u64> {
        Ok(self.0.lock().expect("no panic").len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let from = offset as usize;
        out.copy_from_slice(&self.0.lock().expect("no panic")[from..from + out.len()]);
        Ok(())
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.0.lock().expect("no panic").resize(len as usize, 0);
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        let from = offset as usize;
        self.0.lock().expect("no panic")[from..from + data.len()].copy_from_slice(data);
        Ok(())
    }
}

const RECORDS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("records");

pub type Record = (Vec<u8>, Vec<u8>);

/// Reads the records of a disk's database.
pub fn records(disk: &SimulatedDisk) -> (Bytes, Vec<Record>) {
    let bytes = Bytes::default();
    *bytes.0.lock().expect("no panic") = Files::read(disk, DATABASE).expect("it is there");
    let database = Builder::new().create_with_backend(bytes.clone()).expect("a database");
    let read = database.begin_read().expect("it can be read");
    let table = read.open_table(RECORDS).expect("it has records");
    let record = |entry: Result<(redb::AccessGuard<&[u8]>, redb::AccessGuard<&[u8]>), _>| {
        let (key, value) = entry.expect("it can be read");
        (key.value().to_vec(), value.value().to_vec())
    };
    let all = table.iter().expect("it can be read").map(record).collect();
    drop((table, read, database));
    (bytes, all)
}

/// Changes a record of a disk's database.
pub fn put(disk: &SimulatedDisk, key: &[u8], record: Option<&[u8]>) {
    let (bytes, _) = records(disk);
    let database = Builder::new().create_with_backend(bytes.clone()).expect("a database");
    let write = database.begin_write().expect("it can be written");
    let mut table = write.open_table(RECORDS).expect("it has records");
    match record {
        Some(record) => drop(table.insert(key, record).expect("it can be written")),
        None => drop(table.remove(key).expect("it can be written")),
    }
    drop(table);
    write.commit().expect("it can be written");
    drop(database);
    let bytes = bytes.0.lock().expect("no panic").clone();
    disk.damage(DATABASE, |own| *own = bytes);
}

#[test]
fn swapped_stale_and_missing_records_are_found() {
    for is_whole in [true, false] {
        let world = saved(is_whole, false);
        let (_, all) = records(&world.image.lose_process());
        let (_, old) = records(&world.earlier.lose_process());
        let old: BTreeMap<Vec<u8>, Vec<u8>> = old.into_iter().collect();
        let mut rng = Rng::with_seed(1);
        let (mut rebuilt, mut lost) = (0, 0);
        for (key, record) in &all {
            let other = &rng.choice(&all).expect("there are some").1;
            let mut flipped = record.clone();
            let at = rng.usize(..flipped.len());
            flipped[at] ^= 1 << rng.u32(0..8);
            let changes = [old.get(key).map(Vec::as_slice), Some(other), Some(&flipped[..]), Some(&[]), None];
            for change in changes.into_iter().filter(|change| *change != Some(&record[..])) {
                let disk = world.image.lose_process();
                put(&disk, key, change);
                let what = format!("key {key:?}, {} bytes", change.map_or(0, <[u8]>::len));
                if is_whole {
                    let (_, opened) = open_damaged(&disk, &world.ground);
                    assert_eq!(
                        state(&opened.terrain),
                        state(&world.terrain),
                        "{what}: {:?}",
                        opened.warnings
                    );
                    assert!(lost_regions(&opened).is_empty(), "{what}");
                    rebuilt += opened.warnings.len();
                } else {
                    lost += check_losses(&world, &disk, &what);
                }
            }
        }
        println!("{} records: {rebuilt} rebuilt, {lost} lost", all.len());
    }
}
