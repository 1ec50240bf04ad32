//! Anything reported as durable survives, whatever the store was given in between: other terrains, other grounds, gaps,
//! data alone. `BURROW_DURABLE` is the number of random stories.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{DiskFault, SavePoint, SimulatedDisk, Store, StoreError, StoreOptions, WorldSize};
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;
use glam::Vec3;

use crate::play::{State, TURN, act, count, open, options, state};

fn flat(side: u32, height: f64) -> Arc<Ground> {
    Arc::new(Ground::flat(side, side, height).expect("valid heights"))
}

fn terrain_of(ground: &Arc<Ground>, chunk_size: u32, voxel_size: f32) -> Terrain {
    let settings = TerrainSettings { chunk_size, voxel_size };
    let mut terrain = Terrain::new(Arc::clone(ground), &settings).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    terrain
}

fn terrain(ground: &Arc<Ground>) -> Terrain {
    terrain_of(ground, 32, 1.0)
}

fn dig(number: u32) -> Brush {
    let (x, z) = (10.0 + (number * 37 % 100) as f32, 10.0 + (number * 91 % 100) as f32);
    Brush::dig(Shape::sphere(Vec3::new(x, 8.0, z), 4.0))
}

/// Options with which nothing is written until it is requested.
fn lazy() -> StoreOptions {
    let loss_window = Duration::MAX;
    StoreOptions { loss_window, checkpoint_after: Duration::MAX, ..options(u64::MAX) }
}

#[test]
fn of_another_terrain_only_what_was_written_is_durable() {
    let (disk, ground) = (SimulatedDisk::new(), flat(128, 8.0));
    let mut first = terrain(&ground);
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut first, lazy()).expect("a new world");
    for number in 0..5 {
        first.apply([dig(number)]);
        store.follow(&mut first).expect("the thread runs");
    }
    store.flush().expect("the disk works");
    let point = store.point();
    assert_eq!((store.durable(), store.is_durable(point)), (5, true));

    let mut second = terrain(&ground);
    second.apply([dig(7), dig(8)]);
    store.follow(&mut second).expect("it has the same size");
    assert_ne!(store.durable_point().map(SavePoint::revision), Some(5), "that was another terrain");
    store.checkpoint().expect("the disk works");
    assert_eq!((store.durable(), store.revision()), (1, 1));
    second.apply([dig(9)]);
    store.follow(&mut second).expect("the thread runs");
    assert_eq!((store.durable(), store.is_durable(store.point())), (1, false), "the second was not written");
    let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("a saved world");
    assert_eq!(opened.terrain.world().revision(), 1);
    store.flush().expect("the disk works");
    assert_eq!((store.durable(), store.is_durable(point)), (2, true), "durable commits stay durable");
    let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("a saved world");
    assert_eq!((opened.replayed, state(&opened.terrain)), (1, state(&second)), "it was saved whole once");
}

#[test]
fn a_terrain_that_happens_to_be_at_the_next_revision_is_another_one() {
    let (disk, ground) = (SimulatedDisk::new(), flat(128, 8.0));
    let mut first = terrain(&ground);
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut first, lazy()).expect("a new world");
    let mut second = terrain(&ground);
    second.keep_log(Some(1 << 20));
    second.apply([dig(3)]);
    store.follow(&mut second).expect("it has the same size");
    first.apply([dig(1)]);
    first.apply([dig(2)]);
    store.follow(&mut first).expect("it has the same size");
    store.flush().expect("the disk works");
    let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("a saved world");
    assert_eq!(state(&opened.terrain), state(&first));
}

#[test]
fn data_alone_is_durable_once_it_is_written() {
    let (disk, ground) = (SimulatedDisk::new(), flat(128, 8.0));
    let mut terrain = terrain(&ground);
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut terrain, lazy()).expect("a new world");
    store.put("coal", *b"7");
    store.follow(&mut terrain).expect("the thread runs");
    let point = store.point();
    assert!(!store.is_durable(point), "the revision is, but not the data");
    store.flush().expect("the disk works");
    assert!(store.is_durable(point));
    let (store, _) = open(&disk.image().lose_power(|| false), &ground).expect("a saved world");
    assert_eq!(store.get("coal"), Some(&b"7"[..]));
}

#[test]
fn a_terrain_of_another_size_is_refused_before_anything_is_written() {
    let ground = flat(128, 8.0);
    let sizes = [
        (flat(256, 8.0), 32, 1.0, "256 x 256 cells, chunks of 32 and voxels of 1 m"),
        (flat(64, 8.0), 32, 1.0, "64 x 64 cells, chunks of 32 and voxels of 1 m"),
        (ground.clone(), 64, 1.0, "128 x 128 cells, chunks of 64 and voxels of 1 m"),
        (ground.clone(), 32, 0.5, "128 x 128 cells, chunks of 32 and voxels of 0.5 m"),
    ];
    for (other, chunk_size, voxel_size, named) in sizes {
        let disk = SimulatedDisk::new();
        let mut first = terrain(&ground);
        let mut store = Store::create_in(Arc::new(disk.clone()), &mut first, lazy()).expect("a new world");
        first.apply([dig(1)]);
        store.follow(&mut first).expect("the thread runs");
        store.flush().expect("the disk works");
        let before = disk.operations();
        let mut second = terrain_of(&other, chunk_size, voxel_size);
        second.apply([dig(2)]);
        for refused in [store.append_whole(&second), store.follow(&mut second)] {
            let why = refused.expect_err("it has another size");
            let StoreError::OtherSize { saved, given } = &why else { panic!("{why}") };
            assert_eq!((*saved, *given), (WorldSize::of(&first), WorldSize::of(&second)));
            assert!(why.to_string().contains(named) && why.to_string().contains("128 x 128"), "{why}");
        }
        store.flush().expect("the disk works");
        assert_eq!(disk.operations(), before, "nothing was written");
        // The first one continues.
        first.apply([dig(3)]);
        store.follow(&mut first).expect("the thread runs");
        drop(store);
        let (_, opened) = open(&disk, &ground).expect("a saved world");
        assert_eq!(state(&opened.terrain), state(&first));
        assert!(opened.is_log_whole && opened.warnings.is_empty(), "{:?}", opened.warnings);
    }
}

/// Rules that make rock unbreakable.
fn rules() -> DiggingRules {
    DiggingRules::default().with_unbreakable(MaterialId(0))
}

/// Changes without a revision of their own.
fn quiet_change(terrain: &mut Terrain, which: u32) {
    match which {
        0 => terrain.set_rules(rules()).expect("valid rules"),
        1 => terrain.set_loose(Some(LooseSettings::default())),
        _ => {
            terrain.set_loose(Some(LooseSettings::default()));
            terrain.set_loose(None);
        }
    }
}

#[test]
fn lost_records_of_rules_alone_are_noticed() {
    for which in 0..3 {
        // After the loss there is nothing, a dig that obeys the lost record, or a dig and the earlier settings.
        for after in 0..3 {
            let (disk, ground) = (SimulatedDisk::new(), flat(128, 8.0));
            let mut terrain = terrain(&ground);
            let mut store =
                Store::create_in(Arc::new(disk.clone()), &mut terrain, lazy()).expect("a new world");
            terrain.apply([dig(1)]);
            store.follow(&mut terrain).expect("the thread runs");
            quiet_change(&mut terrain, which);
            drop(terrain.take_log());
            if after > 0 {
                terrain.apply([dig(2)]);
            }
            if after > 1 {
                terrain.set_rules(DiggingRules::default()).expect("valid rules");
                terrain.set_loose(None);
            }
            store.follow(&mut terrain).expect("the thread runs");
            terrain.apply([dig(3)]);
            store.follow(&mut terrain).expect("the thread runs");
            store.flush().expect("the disk works");
            let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("a saved world");
            assert_eq!(state(&opened.terrain), state(&terrain), "{which} {after}");
            assert!(opened.warnings.is_empty(), "{which} {after}: {:?}", opened.warnings);
        }
    }
}

#[test]
fn a_record_of_rules_alone_that_is_not_given_leaves_a_gap() {
    let (disk, ground) = (SimulatedDisk::new(), flat(128, 8.0));
    let mut terrain = terrain(&ground);
    let mut store = Store::create_in(Arc::new(disk), &mut terrain, lazy()).expect("a new world");
    terrain.set_rules(rules()).expect("valid rules");
    assert_eq!(terrain.take_log().len(), 1);
    terrain.apply([dig(1)]);
    let records = terrain.take_log();
    assert_eq!(records.len(), 1);
    assert!(matches!(store.append(records), Err(StoreError::Gap { at: 0, found: 1 })));
    store.append_whole(&terrain).expect("the thread runs");
    terrain.apply([dig(2)]);
    store.append(terrain.take_log()).expect("they follow");
}

#[test]
fn edits_that_wait_while_the_whole_world_is_saved_obey_their_own_rules_when_they_are_replayed() {
    for is_new in [true, false] {
        let (disk, ground) = (SimulatedDisk::new(), flat(128, 8.0));
        let mut terrain = terrain(&ground);
        let create = |terrain: &mut Terrain| Store::create_in(Arc::new(disk.clone()), terrain, lazy());
        let mut store = (!is_new).then(|| create(&mut terrain).expect("a new world"));
        terrain.keep_log(Some(1 << 30));
        terrain.apply([dig(1)]);
        drop(terrain.take_log());
        // This one may still dig.
        terrain.submit(dig(2));
        terrain.set_rules(rules()).expect("valid rules");
        let store = match &mut store {
            Some(store) => {
                store.follow(&mut terrain).expect("the thread runs");
                store
            }
            none => none.insert(create(&mut terrain).expect("a new world")),
        };
        terrain.apply([dig(3)]);
        store.follow(&mut terrain).expect("the thread runs");
        store.flush().expect("the disk works");
        let (_, opened) = open(&disk.image().lose_power(|| false), &ground).expect("a saved world");
        assert_eq!(state(&opened.terrain), state(&terrain), "{is_new}");
        assert!(opened.warnings.is_empty(), "{is_new}: {:?}", opened.warnings);
    }
}

/// The state that the store was given at a point.
struct Past {
    point: SavePoint,
    state: State,
    ground: Arc<Ground>,
    turn: Option<u64>,
}

/// A game that changes everything that may be changed.
struct Story {
    rng: Rng,
    disk: SimulatedDisk,
    grounds: [Arc<Ground>; 2],
    ground: usize,
    terrain: Terrain,
    store: Option<Store>,
    turn: u64,
    past: Vec<Past>,
}

impl Story {
    fn new(seed: u64) -> Self {
        let (rng, disk, grounds) =
            (Rng::with_seed(seed), SimulatedDisk::new(), [flat(96, 8.0), flat(96, 11.0)]);
        let mut terrain = terrain(&grounds[0]);
        let store = Store::create_in(Arc::new(disk.clone()), &mut terrain, lazy()).expect("a new world");
        let mut story =
            Self { rng, disk, grounds, ground: 0, terrain, store: Some(store), turn: 0, past: Vec::new() };
        story.remember();
        story
    }

    fn store(&mut self) -> &mut Store {
        self.store.as_mut().expect("it is open")
    }

    fn remember(&mut self) {
        let point = self.store().point();
        let (state, ground) = (state(&self.terrain), Arc::clone(&self.grounds[self.ground]));
        let turn = (self.turn > 0).then_some(self.turn);
        self.past.push(Past { point, state, ground, turn });
    }

    fn act(&mut self) -> String {
        let what = self.rng.u32(0..16);
        match what {
            0 => {
                // Another terrain, sometimes one that was already dug.
                self.terrain = terrain(&self.grounds[self.ground]);
                for _ in 0..self.rng.u32(0..3) {
                    act(&mut self.terrain, &mut self.rng);
                }
            }
            1 => {
                self.ground = 1 - self.ground;
                let ground = Arc::clone(&self.grounds[self.ground]);
                self.terrain.apply_one(Order::Ground(ground)).outcome.expect("it has the same size");
            }
            // Records are lost.
            2 => {
                act(&mut self.terrain, &mut self.rng);
                drop(self.terrain.take_log());
            }
            3 => {
                self.turn += 1;
                let turn = self.turn;
                self.store().put(TURN, turn.to_le_bytes());
            }
            4 | 5 => drop(self.store().flush()),
            6 => drop(self.store().checkpoint()),
            7 => drop(self.store().request_checkpoint()),
            8 => {
                let fault = [DiskFault::Full, DiskFault::None][self.rng.usize(0..2)];
                self.disk.set_fault(fault);
            }
            9 => {
                self.disk.set_fault(DiskFault::None);
                self.store = None;
                let ground = Arc::clone(&self.grounds[self.ground]);
                let opened = Store::open_in(Arc::new(self.disk.clone()), ground, lazy());
                let (store, opened) = opened.expect("it was closed well");
                assert_eq!(state(&opened.terrain), state(&self.terrain), "{:?}", opened.warnings);
                // Points are those of one store.
                (self.store, self.terrain) = (Some(store), opened.terrain);
                self.past.clear();
                self.remember();
            }
            _ => act(&mut self.terrain, &mut self.rng),
        }
        let Self { store, terrain, .. } = self;
        store.as_mut().expect("it is open").follow(terrain).expect("the thread runs");
        self.remember();
        format!("{what}")
    }

    /// Loses the power, and compares the saved world with the reports.
    fn check(&mut self, story: &str) {
        let durable = self.store().durable_point();
        let reported = self.past.iter().filter(|past| self.store.as_ref().unwrap().is_durable(past.point));
        let first = reported.map(|past| past.point).max();
        assert!(durable.is_none() || durable <= first.max(durable), "{story}");
        let image = self.disk.image().lose_power(|| false);
        image.set_fault(DiskFault::None);
        let candidates = self.past.iter().filter(|past| first.is_none_or(|first| past.point >= first));
        let mut seen = Vec::new();
        for past in candidates {
            let copy = image.image().lose_process();
            let Ok((store, opened)) = open(&copy, &past.ground) else { continue };
            let turn = store.get(TURN).map(|turn| u64::from_le_bytes(turn.try_into().expect("8 bytes")));
            let found = state(&opened.terrain);
            if found == past.state && turn == past.turn {
                return;
            }
            let differs = [
                found.hash != past.state.hash,
                found.fields != past.state.fields,
                found.next_field != past.state.next_field,
                found.rules != past.state.rules,
                found.loose != past.state.loose,
                turn != past.turn,
            ];
            seen.push((past.point, differs, opened.warnings));
        }
        panic!("{story}: {first:?} is durable, but the saved world is not one of the later ones: {seen:?}");
    }
}

#[test]
fn whatever_is_given_what_is_reported_as_durable_survives() {
    for seed in 0..count("BURROW_DURABLE", 12) {
        let mut story = Story::new(seed);
        let mut told = format!("seed {seed}:");
        for step in 0..40 {
            told = format!("{told} {}", story.act());
            if step % 5 == 4 {
                story.check(&told);
            }
        }
    }
}
