//! Files are replaced during a fault: at each operation on the disk, the power or the process is lost, or the disk
//! becomes full or breaks. A world that was damaged before can be opened afterwards, regardless of the moment.
//! `BURROW_MATRIX` is how many operations are tried for each case, spread over all of them, and `BURROW_COMMITS` the
//! commits of a world. `BURROW_SHARE=3/16` tries the fourth of sixteen equal shares, for as many processes.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use bevy_burrow::prelude::*;
use bevy_burrow::store::{
    BaseChanged, DiskFault, DiskImage, Files, Opening, SimulatedDisk, Store, StoreError, StoreOptions,
    StoreWarning, inspect_in,
};
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;

use crate::play::{State, act, count, ground, options, save, state, terrain};

const DATABASE: &str = "regions.redb";

/// The earlier damage of a world.
#[derive(Clone, Copy, Debug)]
enum Before {
    Undamaged,
    DamagedDatabase,
    DamagedLog,
    /// The database is in quarantine only: a version that moved it there too early was killed.
    MovedDatabase,
}

/// An edited world, and its state at each revision.
struct Played {
    disk: SimulatedDisk,
    ground: Arc<Ground>,
    states: BTreeMap<u64, Vec<State>>,
    latest: u64,
}

/// Edits a world whose log is complete or not, and kills the process.
fn played(before: Before, is_whole: bool) -> Played {
    let (ground, mut rng) = (ground(9), Rng::with_seed(9));
    let disk = SimulatedDisk::new();
    let mut world = terrain(&ground);
    let log_bytes = if is_whole { u64::MAX } else { 0 };
    let settings = StoreOptions { log_bytes, ..options(u64::MAX) };
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut world, settings).expect("a new world");
    let mut states = BTreeMap::from([(0, vec![state(&world)])]);
    let commits = count("BURROW_COMMITS", 30);
    while world.world().revision() < commits {
        act(&mut world, &mut rng);
        states.entry(world.world().revision()).or_default().push(state(&world));
        save(&mut store, &mut world).expect("the thread runs");
        match rng.u32(0..8) {
            0 => store.checkpoint(),
            _ => store.flush(),
        }
        .expect("the disk works");
    }
    store.checkpoint().expect("the disk works");
    let disk = disk.image().lose_process();
    match before {
        Before::Undamaged => {}
        Before::DamagedDatabase => disk.damage(DATABASE, |bytes| bytes[0] ^= 1),
        Before::DamagedLog => {
            let segments = disk.list("journal").expect("a folder");
            let first = segments.first().expect("there was a commit");
            disk.damage(&format!("journal/{first}"), |bytes| {
                let middle = bytes.len() / 2;
                bytes[middle] ^= 1;
            });
        }
        Before::MovedDatabase => {
            disk.rename(DATABASE, &format!("quarantine/{DATABASE}.1")).expect("it is there");
        }
    }
    Played { disk, ground, states, latest: commits }
}

/// The operation on a world.
#[derive(Clone, Copy, Debug)]
enum Doing {
    Playing,
    Compacting,
    /// The world is opened over another ground; only then do the old states no longer apply.
    Replacing,
}

/// The known states of a world during an operation.
struct Known {
    states: Mutex<BTreeMap<u64, Vec<State>>>,
    acknowledged: AtomicU64,
    latest: AtomicU64,
}

impl Known {
    fn of(played: &Played) -> Self {
        Self {
            states: Mutex::new(played.states.clone()),
            acknowledged: AtomicU64::new(played.latest),
            latest: AtomicU64::new(played.latest),
        }
    }

    fn enter(&self, terrain: &Terrain) {
        let revision = terrain.world().revision();
        self.states.lock().expect("no panic").entry(revision).or_default().push(state(terrain));
        self.latest.store(revision, Ordering::SeqCst);
    }
}

/// Another ground of the same size.
fn other_ground(ground: &Ground) -> Arc<Ground> {
    let height = |x: i32, z: i32| f64::from((x * 5 + z * 3) % 17) / 2.0;
    let other = Ground::from_fn(ground.width() as u32, ground.depth() as u32, height);
    Arc::new(other.expect("valid heights"))
}

/// Opens a world and runs the operation, as far as the fault allows.
fn go_on(disk: &SimulatedDisk, played: &Played, known: &Known, doing: Doing) -> Result<(), StoreError> {
    let ground = match doing {
        Doing::Replacing => other_ground(&played.ground),
        Doing::Playing | Doing::Compacting => Arc::clone(&played.ground),
    };
    let (mut store, opened) = Store::open_in(Arc::new(disk.clone()), ground, options(u64::MAX))?;
    let mut world = opened.terrain;
    known.enter(&world);
    world.set_meshing(Meshing::Never);
    let (mut rng, begin) = (Rng::with_seed(1), world.world().revision());
    let acknowledge = |done: Result<u64, StoreError>| {
        if let Ok(revision) = done {
            known.acknowledged.fetch_max(revision, Ordering::SeqCst);
        }
    };
    while world.world().revision() < begin + 6 {
        act(&mut world, &mut rng);
        known.enter(&world);
        save(&mut store, &mut world)?;
        match (rng.u32(0..4), doing) {
            (0, Doing::Compacting) => acknowledge(store.compact()),
            (0 | 1, _) => acknowledge(store.checkpoint()),
            _ => acknowledge(store.flush()),
        }
    }
    if matches!(doing, Doing::Compacting) {
        acknowledge(store.compact());
    }
    Ok(())
}

/// Opens a world twice on a working disk, and checks that it is intact.
fn check(disk: &SimulatedDisk, played: &Played, known: &Known, what: &str) {
    let mut found = None;
    for time in 0..2 {
        let told = inspect_in(disk).unwrap_or_else(|why| panic!("{what}: {why}")).ground;
        let other = other_ground(&played.ground);
        let ground = if told == played.ground.hash() { &played.ground } else { &other };
        let options = StoreOptions { base_changed: BaseChanged::Refuse, ..options(u64::MAX) };
        let opened = Store::open_in(Arc::new(disk.clone()), Arc::clone(ground), options);
        let (_, opened) = opened.unwrap_or_else(|why| panic!("{what}: {why}"));
        let (revision, now) = (opened.terrain.world().revision(), state(&opened.terrain));
        let bounds = known.acknowledged.load(Ordering::SeqCst)..=known.latest.load(Ordering::SeqCst);
        assert!(bounds.contains(&revision), "{what}: {revision}, not in {bounds:?}: {:?}", opened.warnings);
        let was = known.states.lock().expect("no panic").get(&revision).is_some_and(|all| all.contains(&now));
        assert!(was, "{what}: revision {revision} was never like that: {:?}", opened.warnings);
        let is_lost = |own: &StoreWarning| matches!(own, StoreWarning::RegionLost { .. });
        assert!(!opened.warnings.iter().any(is_lost), "{what}: {:?}", opened.warnings);
        if time > 0 {
            assert!(opened.warnings.is_empty(), "{what}: {:?}", opened.warnings);
            assert_eq!(found.as_ref(), Some(&now), "{what}");
        }
        found = Some(now);
    }
}

/// At most `BURROW_MATRIX` items of a list, spread evenly.
fn some<T>(all: Vec<T>) -> Vec<T> {
    let most = usize::try_from(count("BURROW_MATRIX", 8)).unwrap_or(usize::MAX).max(1);
    let step = all.len().div_ceil(most).max(1);
    let spread = all.into_iter().skip(step / 2).step_by(step);
    let (share, shares) = share();
    spread.skip(share).step_by(shares).collect()
}

/// The number of this process's share, and how many shares there are.
fn share() -> (usize, usize) {
    let Ok(text) = std::env::var("BURROW_SHARE") else { return (0, 1) };
    let parts = text.split_once('/').and_then(|(share, of)| Some((share.parse().ok()?, of.parse().ok()?)));
    parts.filter(|&(share, of)| share < of).expect("BURROW_SHARE is like 3/16")
}

fn matrix(before: Before, is_whole: bool) -> usize {
    let mut tried = 0;
    let played = played(before, is_whole);
    for doing in [Doing::Playing, Doing::Compacting, Doing::Replacing] {
        let name = format!("{before:?}, log whole: {is_whole}, {doing:?}");
        // The power or the process is lost.
        let disk = played.disk.image().lose_process();
        let (known, images) = (Arc::new(Known::of(&played)), Arc::new(Mutex::new(Vec::new())));
        let (seen, so_far) = (Arc::clone(&images), Arc::clone(&known));
        disk.watch(Some(move |image: &DiskImage| {
            let acknowledged = so_far.acknowledged.load(Ordering::SeqCst);
            seen.lock().expect("no panic").push((acknowledged, image.clone()));
        }));
        go_on(&disk, &played, &known, doing).expect("the disk works");
        disk.watch(None::<fn(&DiskImage)>);
        check(&disk, &played, &known, &name);
        let images = std::mem::take(&mut *images.lock().expect("no panic"));
        let operations = images.len() as u64;
        for (acknowledged, image) in some(images) {
            known.acknowledged.store(acknowledged, Ordering::SeqCst);
            let mut rng = Rng::with_seed(image.operations());
            let at = image.operations();
            check(&image.lose_process(), &played, &known, &format!("{name}, killed at {at}"));
            check(&image.lose_power(|| false), &played, &known, &format!("{name}, no power at {at}"));
            check(&image.lose_power(|| rng.bool()), &played, &known, &format!("{name}, some power at {at}"));
            tried += 3;
        }
        // The disk fails.
        for at in some((0..operations).collect()) {
            for fault in [DiskFault::Full, DiskFault::Broken] {
                let name = format!("{name}, {fault:?} from operation {at}");
                let (disk, known) = (played.disk.image().lose_process(), Known::of(&played));
                disk.fail_at(disk.operations() + at + 1, fault);
                // Opening may fail too.
                drop(go_on(&disk, &played, &known, doing));
                check(&disk.image().lose_process(), &played, &known, &name);
                check(&disk.image().lose_power(|| false), &played, &known, &name);
                tried += 2;
            }
        }
    }
    tried
}

#[test]
fn an_undamaged_world_survives_a_fault_at_each_operation() {
    for is_whole in [true, false] {
        println!("{} faults", matrix(Before::Undamaged, is_whole));
    }
}

#[test]
fn a_world_with_a_damaged_database_survives_a_fault_at_each_operation() {
    for is_whole in [true, false] {
        println!("{} faults", matrix(Before::DamagedDatabase, is_whole));
    }
}

#[test]
fn a_world_with_a_damaged_log_survives_a_fault_at_each_operation() {
    for is_whole in [true, false] {
        println!("{} faults", matrix(Before::DamagedLog, is_whole));
    }
}

#[test]
fn a_world_whose_database_is_in_quarantine_survives_a_fault_at_each_operation() {
    for is_whole in [true, false] {
        println!("{} faults", matrix(Before::MovedDatabase, is_whole));
    }
}

/// Imports a world with data during a fault: afterwards all of it is there, or nothing.
#[test]
fn a_world_is_created_with_its_data_or_not_at_all() {
    let ground = ground(4);
    let data: BTreeMap<String, Vec<u8>> = [("map".to_owned(), vec![7; 5000])].into();
    let create = |disk: &SimulatedDisk| {
        let (mut world, mut rng) = (terrain(&ground), Rng::with_seed(4));
        (0..12).for_each(|_| act(&mut world, &mut rng));
        let created =
            Store::create_with_data_in(Arc::new(disk.clone()), &mut world, data.clone(), options(99));
        created.map(|_| state(&world))
    };
    let disk = SimulatedDisk::new();
    let images = Arc::new(Mutex::new(Vec::new()));
    let seen = Arc::clone(&images);
    disk.watch(Some(move |image: &DiskImage| seen.lock().expect("no panic").push(image.clone())));
    let expected = create(&disk).expect("the disk works");
    disk.watch(None::<fn(&DiskImage)>);
    let images = std::mem::take(&mut *images.lock().expect("no panic"));
    let (mut there, mut gone) = (0, 0);
    let mut look = |disk: SimulatedDisk, what: &str| {
        match Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), options(99)) {
            Ok((store, opened)) => {
                assert_eq!((state(&opened.terrain), store.game_data()), (expected.clone(), &data), "{what}");
                there += 1;
            }
            Err(StoreError::Missing(_)) => {
                // It can be created then.
                assert_eq!(create(&disk).unwrap_or_else(|why| panic!("{what}: {why}")), expected);
                gone += 1;
            }
            Err(why) => panic!("{what}: {why}"),
        }
    };
    for image in &images {
        let at = image.operations();
        look(image.lose_process(), &format!("killed at {at}"));
        look(image.lose_power(|| false), &format!("no power at {at}"));
    }
    for at in 1..=images.len() as u64 {
        for fault in [DiskFault::Full, DiskFault::Broken] {
            let disk = SimulatedDisk::new();
            disk.fail_at(at, fault);
            drop(create(&disk));
            look(disk.image().lose_process(), &format!("{fault:?} from {at}"));
        }
    }
    assert!(there > 0 && gone > 0, "{there} {gone}");
}

/// A replacement that was interrupted long ago is not mistaken for the present world.
#[test]
fn what_an_old_replacement_left_is_not_the_world_of_now() {
    let played = played(Before::Undamaged, false);
    let (disk, known) = (played.disk.image().lose_process(), Known::of(&played));
    let old = Files::read(&disk, DATABASE).expect("it is there");
    go_on(&disk, &played, &known, Doing::Playing).expect("the disk works");
    known.acknowledged.store(known.latest.load(Ordering::SeqCst), Ordering::SeqCst);
    let file = Files::open(&disk, "regions.new", Opening::New).expect("a new file");
    file.write_at(0, &old).expect("the disk works");
    disk.damage(DATABASE, |bytes| bytes[0] ^= 1);
    check(&disk, &played, &known, "damaged, next to an old one");
}
