//! Disks with sectors that can't be read: the remaining files suffice, and a missing disk is not treated as damage.

use std::io;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use bevy_burrow::prelude::*;
use bevy_burrow::store::{
    DiskFault, Files, Lock, OpenFile, Opening, SimulatedDisk, Store, StoreError, StoreOptions, StoreWarning,
    check_in,
};
use glam::Vec3;

use crate::play::{State, ball, options, save, state, terrain};

const DATABASE: &str = "regions.redb";
const FIRST_SEGMENT: &str = "journal/00000001.log";

/// A disk on which some bytes of a file can't be read.
#[derive(Clone, Debug)]
struct BadDisk {
    disk: SimulatedDisk,
    path: String,
    bad: Range<u64>,
    /// The disk fails permanently once the bad bytes are read.
    goes: bool,
    is_gone: Arc<AtomicBool>,
    /// How many further syncs of the database fail, and how often a new database was begun.
    failing_syncs: Arc<AtomicU64>,
    new_databases: Arc<AtomicU64>,
}

#[derive(Debug)]
struct BadFile {
    file: Box<dyn OpenFile>,
    of: BadDisk,
    is_bad: bool,
    is_database: bool,
}

impl BadDisk {
    fn new(disk: &SimulatedDisk, path: &str, bad: Range<u64>, goes: bool) -> Arc<Self> {
        let (disk, path) = (disk.clone(), path.to_owned());
        let (is_gone, failing_syncs, new_databases) = Default::default();
        Arc::new(Self { disk, path, bad, goes, is_gone, failing_syncs, new_databases })
    }

    fn check(&self, is_bad: bool) -> io::Result<()> {
        if is_bad && self.goes {
            self.is_gone.store(true, Ordering::SeqCst);
        }
        // EIO.
        let error = || io::Error::from_raw_os_error(5);
        if is_bad || self.is_gone.load(Ordering::SeqCst) { Err(error()) } else { Ok(()) }
    }
}

impl OpenFile for BadFile {
    fn length(&self) -> io::Result<u64> {
        self.of.check(false)?;
        self.file.length()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let bad = &self.of.bad;
        self.of.check(self.is_bad && offset < bad.end && offset + out.len() as u64 > bad.start)?;
        self.file.read_at(offset, out)
    }

    fn write_at(&self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.of.check(false)?;
        self.file.write_at(offset, bytes)
    }

    fn set_length(&self, length: u64) -> io::Result<()> {
        self.of.check(false)?;
        self.file.set_length(length)
    }

    fn sync(&self) -> io::Result<()> {
        self.of.check(false)?;
        let one_less = |left: u64| left.checked_sub(1);
        let left = &self.of.failing_syncs;
        if self.is_database && left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, one_less).is_ok() {
            return Err(io::Error::from_raw_os_error(5));
        }
        self.file.sync()
    }
}

impl Files for BadDisk {
    fn name(&self) -> String {
        self.disk.name()
    }

    fn open(&self, path: &str, opening: Opening) -> io::Result<Box<dyn OpenFile>> {
        self.check(false)?;
        let (file, of) = (Files::open(&self.disk, path, opening)?, self.clone());
        if path == "regions.new" && opening == Opening::New {
            self.new_databases.fetch_add(1, Ordering::SeqCst);
        }
        let is_bad = path == self.path && opening == Opening::Existing;
        Ok(Box::new(BadFile { file, of, is_bad, is_database: path == DATABASE }))
    }

    fn read(&self, path: &str) -> io::Result<Vec<u8>> {
        self.check(path == self.path)?;
        Files::read(&self.disk, path)
    }

    fn exists(&self, path: &str) -> io::Result<bool> {
        self.check(false)?;
        self.disk.exists(path)
    }

    fn list(&self, folder: &str) -> io::Result<Vec<String>> {
        self.check(false)?;
        self.disk.list(folder)
    }

    fn create_folder(&self, folder: &str) -> io::Result<()> {
        self.check(false)?;
        self.disk.create_folder(folder)
    }

    fn remove(&self, path: &str) -> io::Result<()> {
        self.check(false)?;
        self.disk.remove(path)
    }

    fn rename(&self, from: &str, to: &str) -> io::Result<()> {
        self.check(false)?;
        self.disk.rename(from, to)
    }

    fn sync_folder(&self, folder: &str) -> io::Result<()> {
        self.check(false)?;
        self.disk.sync_folder(folder)
    }

    fn lock(&self, path: &str) -> io::Result<Option<Box<dyn Lock>>> {
        self.disk.lock(path)
    }
}

fn ground() -> Arc<Ground> {
    Arc::new(Ground::flat(220, 220, 30.0).expect("valid heights"))
}

/// A world with six commits, of which the log holds all or only the last, closed or killed.
fn played(is_whole: bool, is_closed: bool) -> (SimulatedDisk, State) {
    let (disk, mut world) = (SimulatedDisk::new(), terrain(&ground()));
    let log_bytes = if is_whole { u64::MAX } else { 0 };
    let options = StoreOptions { log_bytes, ..options(u64::MAX) };
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, options).expect("a new world");
    for number in 0..6 {
        let at = Vec3::new(20.0 + 33.0 * number as f32, 30.0, 20.0 + 31.0 * number as f32);
        world.apply([Brush::dig(Shape::sphere(at, 6.0))]);
        save(&mut store, &mut world).expect("the thread runs");
        if number < 5 { store.checkpoint() } else { store.flush() }.expect("the disk works");
    }
    let killed = disk.image().lose_process();
    drop(store);
    (if is_closed { disk } else { killed }, state(&world))
}

/// A world with an edit with content in its tail, after edits without; killed, or closed with a whole log. Also the path
/// of the content.
fn played_with_content(is_closed: bool) -> (SimulatedDisk, State, String) {
    let (disk, mut world) = (SimulatedDisk::new(), terrain(&ground()));
    let store = Store::create_in(Arc::new(disk.clone()), &mut world, options(u64::MAX));
    let mut store = store.expect("a new world");
    for number in 0..6 {
        let at = Vec3::new(20.0 + 33.0 * number as f32, 30.0, 20.0 + 31.0 * number as f32);
        let grid = || GridShape::new(ball(20), at).with_scale(0.5);
        world.apply([if number == 3 { Brush::dig(grid()) } else { Brush::dig(Shape::sphere(at, 6.0)) }]);
        save(&mut store, &mut world).expect("the thread runs");
        store.flush().expect("the disk works");
    }
    let killed = disk.image().lose_process();
    drop(store);
    let disk = if is_closed { disk } else { killed };
    let path = disk.paths().into_iter().find(|path| path.ends_with(".content"));
    (disk, state(&world), path.expect("it has content"))
}

/// All files but the lock.
fn files(disk: &SimulatedDisk) -> Vec<(String, Vec<u8>)> {
    let paths = disk.paths().into_iter().filter(|path| path != "lock");
    paths.map(|path| (path.clone(), Files::read(disk, &path).expect("it is there"))).collect()
}

/// The copies in quarantine of a file of the journal.
fn copies(disk: &SimulatedDisk, path: &str) -> Vec<Vec<u8>> {
    let name = path.rsplit('/').next().expect("a name");
    let own = disk.paths().into_iter().filter(|path| path.starts_with(&format!("quarantine/{name}.")));
    own.map(|path| Files::read(disk, &path).expect("it is there")).collect()
}

/// The sectors of a file.
fn sectors(disk: &SimulatedDisk, path: &str) -> Vec<Range<u64>> {
    let length = Files::read(disk, path).expect("it is there").len() as u64;
    (0..length).step_by(512).map(|start| start..(start + 512).min(length)).collect()
}

fn open(files: Arc<BadDisk>, salvage: bool) -> Result<(State, Vec<StoreWarning>), StoreError> {
    let options = StoreOptions { salvage, ..options(u64::MAX) };
    Store::open_in(files, ground(), options).map(|(_, own)| (state(&own.terrain), own.warnings))
}

/// The sectors of a file that hold anything but zeros.
fn used(disk: &SimulatedDisk, path: &str) -> Vec<Range<u64>> {
    let bytes = Files::read(disk, path).expect("it is there");
    let is_used =
        |range: &Range<u64>| bytes[range.start as usize..range.end as usize].iter().any(|&own| own > 0);
    sectors(disk, path).into_iter().filter(is_used).collect()
}

#[test]
fn a_bad_sector_of_the_database_costs_nothing_while_the_log_is_whole() {
    for is_closed in [true, false] {
        let (disk, expected) = played(true, is_closed);
        for bad in used(&disk, DATABASE) {
            let disk = disk.image().lose_process();
            let (now, _) = open(BadDisk::new(&disk, DATABASE, bad.clone(), false), false)
                .unwrap_or_else(|why| panic!("{bad:?}: {why}"));
            assert_eq!(now, expected, "{bad:?}");
            // The new file has no bad sector, and the unreadable file is kept.
            let check = check_in(&disk, ground(), None).expect("it is whole");
            assert_eq!((state(&check.terrain), check.warnings), (expected.clone(), vec![]), "{bad:?}");
        }
    }
}

#[test]
fn a_bad_sector_of_the_log_costs_nothing_while_the_database_holds_all() {
    for is_whole in [true, false] {
        let (disk, expected) = played(is_whole, true);
        for segment in disk.list("journal").expect("a folder") {
            let path = format!("journal/{segment}");
            for bad in sectors(&disk, &path) {
                let disk = disk.image().lose_process();
                let (now, _) = open(BadDisk::new(&disk, &path, bad.clone(), false), false)
                    .unwrap_or_else(|why| panic!("{path} {bad:?}: {why}"));
                assert_eq!(now, expected, "{path} {bad:?}");
            }
        }
    }
}

#[test]
fn without_a_log_a_bad_sector_costs_the_region_in_it_only_and_is_reported() {
    let (disk, expected) = played(false, true);
    let opened = Store::open_in(Arc::new(disk.clone()), ground(), options(9));
    // Else there are older copies of most records in the file.
    opened.expect("it is whole").0.compact().expect("the disk works");
    let mut lost = 0;
    for bad in used(&disk, DATABASE) {
        let disk = disk.image().lose_process();
        let (now, warnings) = open(BadDisk::new(&disk, DATABASE, bad.clone(), false), false)
            .unwrap_or_else(|why| panic!("{bad:?}: {why}"));
        let regions = warnings.iter().filter(|own| matches!(own, StoreWarning::RegionLost { .. })).count();
        assert_eq!(now == expected, regions == 0, "{bad:?}: {warnings:?}");
        lost += regions;
    }
    assert!(lost > 0);
}

#[test]
fn a_disk_that_is_gone_is_no_damage() {
    for (is_whole, is_closed) in [(true, true), (true, false), (false, true), (false, false)] {
        let (disk, expected) = played(is_whole, is_closed);
        let segments = disk.list("journal").expect("a folder");
        let journal = segments.iter().map(|segment| format!("journal/{segment}"));
        for path in journal.chain([DATABASE.to_owned()]) {
            let disk = disk.image().lose_process();
            let before = disk.paths();
            let bad = sectors(&disk, &path)[0].clone();
            match open(BadDisk::new(&disk, &path, bad, true), false) {
                Err(why) => assert!(matches!(why, StoreError::Files { .. }), "{path}: {why}"),
                // It had been read before, and is in memory.
                Ok((now, _)) => assert_eq!(now, expected, "{path}"),
            }
            assert_eq!(disk.paths(), before, "nothing was changed");
            // The disk works again.
            let opened = Store::open_in(Arc::new(disk), ground(), options(9)).expect("it is whole");
            assert_eq!((state(&opened.1.terrain), opened.1.warnings), (expected.clone(), vec![]));
        }
    }
}

#[test]
fn a_file_that_can_not_be_read_at_all_is_no_reason_to_lock_anybody_out() {
    // The log contains everything that the database holds.
    let (disk, expected) = played(true, true);
    let all = 0..u64::MAX;
    let (now, _) = open(BadDisk::new(&disk.image().lose_process(), DATABASE, all.clone(), false), false)
        .expect("the log is whole");
    assert_eq!(now, expected);
    // Without it something may be lost, so salvage has to be requested.
    let (disk, expected) = played(false, false);
    for path in disk.paths().into_iter().filter(|path| path != "lock" && path != "unsaved") {
        let bad = || BadDisk::new(&disk.image().lose_process(), &path, all.clone(), false);
        match open(bad(), false) {
            Err(StoreError::Files { .. }) => {}
            Err(why) => panic!("{path}: {why}"),
            Ok((now, _)) => assert_eq!(now, expected, "{path}"),
        }
        let (_, warnings) = open(bad(), true).unwrap_or_else(|why| panic!("{path}: {why}"));
        assert!(path != DATABASE && !path.starts_with(FIRST_SEGMENT) || !warnings.is_empty());
    }
}

#[test]
fn content_that_can_not_be_read_at_the_moment_is_no_damage() {
    let (disk, expected, content) = played_with_content(false);
    let all = 0..u64::MAX;
    for goes in [true, false] {
        let disk = disk.image().lose_process();
        let before = files(&disk);
        let refused = open(BadDisk::new(&disk, &content, all.clone(), goes), false);
        assert!(matches!(refused, Err(StoreError::Files { .. })), "{refused:?}");
        assert_eq!(files(&disk), before, "nothing was changed");
        // It can be read again.
        let (now, warnings) = open(BadDisk::new(&disk, "none", 0..0, false), false).expect("it is whole");
        assert_eq!((now, warnings), (expected.clone(), vec![]));
    }
    // If the rest is asked for, the file is kept as it is.
    let bytes = Files::read(&disk, &content).expect("it is there");
    let (_, warnings) = open(BadDisk::new(&disk, &content, all, false), true).expect("the rest is there");
    assert!(matches!(warnings[..], [StoreWarning::LogRefused { .. }]), "{warnings:?}");
    assert_eq!(copies(&disk, &content), [bytes]);
}

/// While some files can't be read, they may hold regions that others have lost.
#[test]
fn a_region_is_not_given_up_while_a_file_of_the_log_can_not_be_read() {
    let (disk, expected, content) = played_with_content(true);
    Files::remove(&disk, DATABASE).expect("it is there");
    for path in [content, FIRST_SEGMENT.to_owned()] {
        let disk = disk.image().lose_process();
        let before = files(&disk);
        let refused = open(BadDisk::new(&disk, &path, 0..u64::MAX, false), false);
        assert!(matches!(refused, Err(StoreError::Files { .. })), "{path}: {refused:?}");
        assert_eq!(files(&disk), before, "nothing was changed");
        let (now, _) = open(BadDisk::new(&disk, "none", 0..0, false), false).expect("the log is whole");
        assert_eq!(now, expected, "{path}");
    }
}

/// Frames that are kept aside can be read only with their content.
#[test]
fn content_of_a_log_that_is_moved_aside_is_kept_with_it() {
    let (killed, _, content) = played_with_content(false);
    type Damage = fn(&SimulatedDisk, &str);
    let damages: [(&str, Damage); 2] = [
        ("content", |disk, content| disk.damage(content, |bytes| bytes[40] ^= 1)),
        // The first frame is behind the checkpoint at the beginning, all others behind it.
        ("frame", |disk, _| {
            disk.damage(FIRST_SEGMENT, |bytes| {
                let middle = bytes.len() / 2;
                bytes[middle] ^= 1;
            });
        }),
    ];
    for (what, damage) in damages {
        let disk = killed.image().lose_process();
        damage(&disk, &content);
        let [segment, bytes] =
            [FIRST_SEGMENT, &content].map(|path| Files::read(&disk, path).expect("it is there"));
        let opened = Store::open_in(Arc::new(disk.clone()), ground(), options(9)).expect("the rest is there");
        assert_eq!(opened.1.warnings.len(), 1, "{what}: {:?}", opened.1.warnings);
        assert!(opened.1.terrain.world().revision() < 4, "{what}");
        let (mut store, mut world) = (opened.0, opened.1.terrain);
        world.apply([Brush::dig(Shape::sphere(Vec3::splat(40.0), 6.0))]);
        save(&mut store, &mut world).expect("the thread runs");
        store.checkpoint().expect("the disk works");
        drop(store);
        assert!(!disk.exists(&content).expect("the disk works"), "no frame of the log names it");
        assert_eq!(copies(&disk, &content), [bytes], "{what}");
        let tail = copies(&disk, FIRST_SEGMENT);
        assert!(tail.len() == 1 && segment.ends_with(&tail[0]), "{what}");
    }
}

/// The content of such frames is also kept if the disk is full when they should be moved aside.
#[test]
fn content_is_kept_though_the_disk_is_full() {
    let (killed, _, content) = played_with_content(false);
    let bytes = Files::read(&killed, &content).expect("it is there");
    killed.damage(FIRST_SEGMENT, |bytes| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
    });
    let mut opened = 0;
    for begin in 0..120 {
        let disk = killed.image().lose_process();
        disk.fail_at(disk.operations() + begin, DiskFault::Full);
        let files = || Arc::new(disk.clone());
        if let Ok((mut store, own)) = Store::open_in(files(), ground(), options(9)) {
            opened += 1;
            let mut world = own.terrain;
            disk.set_fault(DiskFault::None);
            for number in 0..3 {
                world.apply([Brush::dig(Shape::sphere(Vec3::splat(40.0 + number as f32), 6.0))]);
                save(&mut store, &mut world).expect("the thread runs");
                drop(store.checkpoint());
            }
        }
        disk.set_fault(DiskFault::None);
        drop(Store::open_in(files(), ground(), options(9)).expect("the rest is there"));
        // Frames that could not be moved stay where they are, and so does what they name.
        let is_there = Files::read(&disk, &content).is_ok_and(|own| own == bytes);
        assert!(is_there || copies(&disk, &content).contains(&bytes), "full after {begin} operations");
    }
    assert!(opened > 20, "{opened}");
}

/// Pages that could not be written may look as if they were once they are read again, so the file can't be trusted any
/// more.
#[test]
fn a_database_that_could_not_be_synced_is_written_anew() {
    let disk = SimulatedDisk::new();
    let files = BadDisk::new(&disk, "none", 0..0, false);
    let mut world = terrain(&ground());
    let created = Store::create_in(Arc::clone(&files) as Arc<dyn Files>, &mut world, options(u64::MAX));
    let mut store = created.expect("a new world");
    assert_eq!(files.new_databases.load(Ordering::SeqCst), 1);
    for number in 0..6u64 {
        world.apply([Brush::dig(Shape::sphere(Vec3::splat(30.0 + 9.0 * number as f32), 6.0))]);
        save(&mut store, &mut world).expect("the thread runs");
        if number % 2 == 1 {
            files.failing_syncs.store(1, Ordering::SeqCst);
            assert!(matches!(store.checkpoint(), Err(StoreError::NotSaved(_))));
        }
        store.checkpoint().expect("the disk works");
        let expected = 1 + number.div_ceil(2);
        assert_eq!(files.new_databases.load(Ordering::SeqCst), expected);
    }
    let (_, opened) = Store::open_in(Arc::new(disk.image().lose_power(|| false)), ground(), options(9))
        .expect("it is whole");
    assert_eq!(state(&opened.terrain), state(&world));
    assert!(!disk.paths().iter().any(|path| path.starts_with("quarantine")), "nothing was damaged");
}
