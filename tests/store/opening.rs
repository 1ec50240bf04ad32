//! Creating and opening worlds, and the errors where that is impossible.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Barrier};

use bevy_burrow::prelude::*;
use bevy_burrow::store::{
    BaseChanged, Files, Progress, SimulatedDisk, Store, StoreError, StoreOptions, StoreWarning,
};
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;
use glam::{UVec3, Vec3};

use crate::play::{act, ground, open, options, save, state, terrain};

/// A folder that is removed at the end.
pub struct Place(pub PathBuf);

impl Place {
    pub fn new(name: &str) -> Self {
        let place = std::env::temp_dir().join(format!("bevy_burrow_{name}_{}", std::process::id()));
        drop(std::fs::remove_dir_all(&place));
        Self(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.0));
    }
}

#[test]
fn a_world_is_created_once_and_opened_by_one() {
    let place = Place::new("once");
    let ground = ground(1);
    let missing = Store::open(&place.0, Arc::clone(&ground), options(9)).expect_err("there is none");
    assert!(matches!(missing, StoreError::Missing(_)), "{missing}");
    let mut first = terrain(&ground);
    let store = Store::create(&place.0, &mut first, options(9)).expect("a new world");
    let locked = Store::open(&place.0, Arc::clone(&ground), options(9)).expect_err("it is open");
    assert!(matches!(locked, StoreError::Locked(_)), "{locked}");
    let locked = Store::create(&place.0, &mut terrain(&ground), options(9)).expect_err("it is open");
    assert!(matches!(locked, StoreError::Locked(_)), "{locked}");
    drop(store);
    let exists = Store::create(&place.0, &mut terrain(&ground), options(9)).expect_err("it exists");
    assert!(matches!(exists, StoreError::Exists(_)), "{exists}");
    let (_, opened) = Store::open(&place.0, ground, options(9)).expect("it can be opened");
    assert_eq!(state(&opened.terrain), state(&first));
    assert!(opened.warnings.is_empty() && opened.replayed == 0 && opened.is_log_whole);
}

#[test]
fn a_terrain_that_was_dug_before_is_saved_with_rules_and_all() {
    for is_dug in [false, true] {
        let (disk, ground) = (SimulatedDisk::new(), ground(3));
        let (mut first, mut rng) = (terrain(&ground), Rng::with_seed(2));
        first.set_rules(DiggingRules::default().with_unbreakable(MaterialId(3))).expect("valid");
        first.set_loose(Some(LooseSettings::default()));
        if is_dug {
            (0..30).for_each(|_| act(&mut first, &mut rng));
        }
        let mut store =
            Store::create_in(Arc::new(disk.clone()), &mut first, options(9)).expect("a new world");
        let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("it can be opened");
        assert_eq!(state(&opened.terrain), state(&first));
        assert_eq!(opened.is_log_whole, !is_dug);
        (0..30).for_each(|_| act(&mut first, &mut rng));
        save(&mut store, &mut first).expect("the thread runs");
        drop(store);
        let (_, opened) = open(&disk, &ground).expect("it can be opened");
        assert_eq!(state(&opened.terrain), state(&first));
    }
}

#[test]
fn records_that_are_missing_are_noticed() {
    let (disk, ground) = (SimulatedDisk::new(), ground(3));
    let (mut first, mut rng) = (terrain(&ground), Rng::with_seed(2));
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut first, options(9)).expect("a new world");
    while first.world().revision() < 9 {
        act(&mut first, &mut rng);
    }
    let mut records = first.take_log();
    records.drain(..3);
    assert!(matches!(store.append(records), Err(StoreError::Gap { at: 0, .. })));
    first.apply([Brush::dig(Shape::sphere(Vec3::splat(20.0), 3.0))]);
    save(&mut store, &mut first).expect("the thread runs");
    store.flush().expect("the disk works");
    let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("it can be opened");
    assert_eq!(state(&opened.terrain), state(&first));
    assert!(!opened.is_log_whole);
}

#[test]
fn undo_goes_on_after_a_checkpoint_and_is_gone_after_a_restart() {
    let (disk, ground) = (SimulatedDisk::new(), ground(3));
    let mut first = terrain(&ground);
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut first, options(2)).expect("a new world");
    for x in 0..9 {
        first.apply([Brush::dig(Shape::sphere(Vec3::new(8.0 * x as f32, 4.0, 30.0), 9.0))]);
        save(&mut store, &mut first).expect("the thread runs");
    }
    store.checkpoint().expect("the disk works");
    (0..9).for_each(|_| drop(first.undo()));
    save(&mut store, &mut first).expect("the thread runs");
    assert_eq!(first.world().bricks().count(), 0);
    drop(store);
    let (_, opened) = open(&disk, &ground).expect("it can be opened");
    assert_eq!(state(&opened.terrain), state(&first));
    assert_eq!(opened.terrain.history(), History::default());
}

/// A tunnel along a path, a road over it, and a shape of any form.
fn path_edits() -> [Brush; 3] {
    let path = |y: f32, radius: f32| {
        let at = |x: f32| (Vec3::new(x, y + 0.1 * x, 12.0 + 0.7 * x), radius);
        BrushPath::spline([4.0, 17.0, 31.0, 52.0, 66.0].map(at))
    };
    let road = Corridor::new(path(4.0, 2.5), 9.0, 7.0);
    let grid = ShapeGrid::from_fn(UVec3::splat(13), |at| (at - 6).as_vec3().abs().element_sum() - 5.0);
    let shape = GridShape::new(grid.expect("a valid size"), Vec3::new(20.0, -9.0, 60.0)).with_scale(1.7);
    [
        Brush::dig(path(-6.0, 2.0)).with_tag(7),
        Brush::road(road, 3.0).with_material(MaterialId(2)),
        Brush::dig(shape),
    ]
}

#[test]
fn paths_roads_and_grids_are_replayed_from_the_journal_and_read_from_a_checkpoint() {
    // No checkpoint before the restart, or one after each commit.
    for commits in [1000, 1] {
        let (disk, ground) = (SimulatedDisk::new(), ground(3));
        let mut first = terrain(&ground);
        let mut store =
            Store::create_in(Arc::new(disk.clone()), &mut first, options(commits)).expect("a new world");
        for brush in path_edits() {
            let outcome = first.apply_one(brush).outcome.expect("it is valid");
            assert!(outcome.removed.total() + outcome.added.total() > 100, "{outcome:?}");
            save(&mut store, &mut first).expect("the thread runs");
        }
        store.flush().expect("the disk works");
        // Power is lost: closing the store would make a checkpoint.
        let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("it can be opened");
        assert_eq!(state(&opened.terrain), state(&first));
        assert!(opened.replayed > 0 || commits == 1);
    }
}

/// Two grounds that differ over one column of regions, and a world that was dug everywhere on the first.
fn changed_base(disk: &SimulatedDisk, tail: bool) -> ([Arc<Ground>; 2], Terrain) {
    let ground = |raised: f64| {
        let height = |x: i32, z: i32| 20.0 + f64::from((x * 3 + z) % 5) + if x > 140 { raised } else { 0.0 };
        Arc::new(Ground::from_fn(200, 60, height).expect("valid heights"))
    };
    let grounds = [ground(0.0), ground(3.0)];
    let mut first = Terrain::new(Arc::clone(&grounds[0]), &TerrainSettings::default()).expect("valid");
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut first, options(99)).expect("a new world");
    for x in 0..20 {
        first.apply([Brush::dig(Shape::sphere(Vec3::new(10.0 * x as f32, 20.0, 30.0), 4.0))]);
        save(&mut store, &mut first).expect("the thread runs");
    }
    if tail {
        store.flush().expect("the disk works");
        let image = disk.image();
        drop(store);
        let before = image.lose_process();
        for path in before.paths() {
            let bytes = bevy_burrow::store::Files::read(&before, &path).expect("it is there");
            disk.damage(&path, |own| *own = bytes);
        }
    }
    (grounds, first)
}

#[test]
fn a_changed_ground_keeps_the_edits() {
    for tail in [false, true] {
        let disk = SimulatedDisk::new();
        let ([_, other], first) = changed_base(&disk, tail);
        let open = |disk: &SimulatedDisk, base_changed| {
            let options = StoreOptions { base_changed, ..options(99) };
            Store::open_in(Arc::new(disk.clone()), Arc::clone(&other), options)
        };
        let refused = open(&disk, BaseChanged::Refuse).expect_err("it refuses");
        assert!(matches!(refused, StoreError::BaseChanged { .. }), "{refused}");
        // Refusing changes nothing.
        let (store, replayed) = open(&disk.image().lose_process(), BaseChanged::Replay).expect("it replays");
        assert_eq!(replayed.terrain.world().revision(), first.world().revision());
        let mut again = Terrain::new(Arc::clone(&other), &TerrainSettings::default()).expect("valid");
        for x in 0..20 {
            again.apply([Brush::dig(Shape::sphere(Vec3::new(10.0 * x as f32, 20.0, 30.0), 4.0))]);
        }
        assert_eq!(replayed.terrain.world().hash(), again.world().hash());
        drop(store);

        let (store, kept) = open(&disk, BaseChanged::Keep).expect("it keeps");
        let told = |own: &StoreWarning| matches!(own, StoreWarning::BaseChanged { .. });
        assert!(kept.warnings.iter().any(told), "{:?}", kept.warnings);
        assert_eq!(kept.terrain.world().revision(), first.world().revision());
        for (pos, brick) in first.world().bricks().filter(|_| !tail) {
            let now: Vec<_> = kept.terrain.world().bricks().filter(|(own, _)| *own == pos).collect();
            let samples: Vec<_> = brick.edited_samples(pos).collect();
            assert_eq!(now[0].1.edited_samples(pos).collect::<Vec<_>>(), samples);
        }
        let hash = kept.terrain.world().hash();
        drop(store);
        // From now on it is the world of the other ground.
        let (_, same) = open(&disk, BaseChanged::Refuse).expect("the ground is the same now");
        assert_eq!(same.terrain.world().hash(), hash);
        assert!(same.warnings.is_empty(), "{:?}", same.warnings);
    }
}

#[test]
fn game_data_is_there_by_its_keys() {
    let (disk, ground) = (SimulatedDisk::new(), ground(3));
    let mut first = terrain(&ground);
    first.set_meshing(Meshing::Never);
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut first, options(9)).expect("a new world");
    store.put("inventory", b"three shovels".to_vec());
    store.put("time", [7; 4]);
    store.flush().expect("the disk works");
    store.put("time", [8; 4]);
    store.remove("inventory");
    store.put("weather", []);
    assert_eq!((store.get("inventory"), store.get("time")), (None, Some(&[8; 4][..])));
    let (before, _) = open(&disk.image().lose_power(|| false), &ground).expect("it can be opened");
    assert_eq!(
        (before.get("inventory"), before.get("time")),
        (Some(&b"three shovels"[..]), Some(&[7; 4][..]))
    );
    drop(store);
    let (after, _) = open(&disk, &ground).expect("it can be opened");
    let keys: Vec<&str> = after.game_data().keys().map(String::as_str).collect();
    assert_eq!((keys, after.get("time")), (vec!["time", "weather"], Some(&[8; 4][..])));
}

/// Opens a world and polls its progress meanwhile. Returns the values seen, and whether it was opened.
fn watched(disk: &SimulatedDisk, ground: &Arc<Ground>, base_changed: BaseChanged) -> (Vec<f32>, bool) {
    let progress = Progress::default();
    let options = StoreOptions { base_changed, progress: Some(progress.clone()), ..options(99) };
    let (done, both) = (AtomicBool::new(false), Barrier::new(2));
    std::thread::scope(|scope| {
        let watcher = scope.spawn(|| {
            let mut seen = vec![progress.share()];
            both.wait();
            while !done.load(Ordering::Acquire) {
                seen.push(progress.share());
                std::thread::yield_now();
            }
            seen.push(progress.share());
            seen.dedup();
            seen
        });
        both.wait();
        let opened = Store::open_in(Arc::new(disk.clone()), Arc::clone(ground), options).is_ok();
        done.store(true, Ordering::Release);
        (watcher.join().expect("it only looks"), opened)
    })
}

#[test]
fn how_far_opening_is_never_falls_and_ends_at_one() {
    let disk = SimulatedDisk::new();
    let ([ground, other], _) = changed_base(&disk, true);
    let cut = disk.image().lose_process();
    cut.remove("regions.redb").expect("it is there");
    let of = |disk: &SimulatedDisk| disk.image().lose_process();
    for (what, disk, ground, base_changed) in [
        ("a tail", of(&disk), &ground, BaseChanged::Refuse),
        ("the log alone", cut, &ground, BaseChanged::Refuse),
        ("edits kept", of(&disk), &other, BaseChanged::Keep),
        ("edits replayed", of(&disk), &other, BaseChanged::Replay),
    ] {
        let (seen, is_opened) = watched(&disk, ground, base_changed);
        assert!(is_opened && seen.is_sorted(), "{what}: {seen:?}");
        assert_eq!((seen[0], seen.last()), (0.0, Some(&1.0)), "{what}");
    }
    let (seen, is_opened) = watched(&disk, &other, BaseChanged::Refuse);
    assert!(!is_opened && seen.is_sorted() && seen.last().is_some_and(|share| (0.1..1.0).contains(share)));
    // Creating a world is soon done.
    let progress = Progress::default();
    let options = StoreOptions { progress: Some(progress.clone()), ..options(99) };
    drop(Store::create_in(Arc::new(SimulatedDisk::new()), &mut terrain(&ground), options));
    assert_eq!(progress.share().to_bits(), 1f32.to_bits());
}
