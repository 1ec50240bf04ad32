//! Disks that do not answer, threads that end, settings at the limit of their range: each is reported, and nothing
//! waits for ever.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy_burrow::prelude::*;
use bevy_burrow::store::{SimulatedDisk, Store, StoreError, StoreOptions, StoreWarning};
use bevy_burrow::terrain::Meshing;
use glam::Vec3;

use crate::gated::{Gate, GatedDisk, Gatekeeper};
use crate::play::{ground, open, options, state, terrain};

fn dig(number: u32) -> Brush {
    let (x, z) = (5.0 + (number * 37 % 60) as f32, 5.0 + (number * 91 % 60) as f32);
    Brush::dig(Shape::sphere(Vec3::new(x, 8.0, z), 3.0))
}

struct Game {
    disk: SimulatedDisk,
    gate: Gatekeeper,
    terrain: Terrain,
    store: Store,
    digs: u32,
}

impl Game {
    fn new(options: StoreOptions) -> Self {
        let (disk, gate) = (SimulatedDisk::new(), Gatekeeper::default());
        let mut terrain = terrain(&ground(2));
        let store = Store::create_in(Arc::new(GatedDisk::new(&disk, &gate)), &mut terrain, options);
        Self { disk, gate, terrain, store: store.expect("a new world"), digs: 0 }
    }

    fn dig(&mut self) {
        self.digs += 1;
        self.terrain.apply([dig(self.digs)]);
        self.store.follow(&mut self.terrain).expect("the thread runs");
    }

    /// Digs until something is reported.
    fn dig_until_told(&mut self) -> Vec<StoreWarning> {
        let start = Instant::now();
        loop {
            self.dig();
            let told = self.store.take_warnings();
            if !told.is_empty() || start.elapsed() > Duration::from_secs(60) {
                return told;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn check_saved(self) {
        let Self { disk, terrain, store, .. } = self;
        drop(store);
        let (_, opened) = open(&disk, &ground(2)).expect("it can be opened");
        assert_eq!(state(&opened.terrain), state(&terrain));
    }
}

#[test]
fn a_disk_that_does_not_answer_is_reported_and_catches_up() {
    let mut game = Game::new(options(u64::MAX));
    game.gate.set(Gate::Shut);
    assert_eq!(game.dig_until_told(), [StoreWarning::Hanging]);
    let durable = game.store.durable();
    assert!(durable < game.store.revision());
    assert!(matches!(game.store.flush_within(Duration::from_millis(20)), Err(StoreError::TimedOut)));
    game.gate.set(Gate::Open);
    game.store.flush().expect("the disk answers");
    assert_eq!(game.store.durable(), game.terrain.world().revision());
    assert_eq!(game.store.take_warnings(), [StoreWarning::SavedAgain]);
    game.check_saved();
}

#[test]
fn what_waits_for_a_disk_that_does_not_answer_is_bounded_and_nothing_is_lost() {
    let mut game = Game::new(StoreOptions { waiting_bytes: 0, ..options(u64::MAX) });
    game.gate.set(Gate::Shut);
    // More than the limit on waiting data: an incompressible value with each commit.
    let (mut rng, mut refused) = (fastrand::Rng::with_seed(1), 0);
    for number in 0..12u8 {
        let value: Vec<u8> = (0..200 << 10).map(|_| rng.u8(..)).collect();
        game.store.put(number.to_string(), value);
        let before = game.store.point();
        game.dig();
        refused += u32::from(game.store.point() == before);
    }
    assert!(refused > 3, "{refused}");
    let records = game.terrain.take_log();
    assert!(matches!(game.store.append(records), Err(StoreError::Gap { .. } | StoreError::Full)));
    game.gate.set(Gate::Open);
    game.store.flush().expect("the disk answers");
    // The whole terrain is saved with the next commit.
    game.dig();
    game.store.flush().expect("the disk answers");
    assert_eq!(game.store.durable(), game.terrain.world().revision());
    assert!((0..12).all(|number| game.store.get(&number.to_string()).is_some()));
    let disk = game.disk.clone();
    game.check_saved();
    let (store, _) = open(&disk, &ground(2)).expect("it can be opened");
    assert!((0..12).all(|number| store.get(&number.to_string()).is_some_and(|data| data.len() == 200 << 10)));
}

#[test]
fn dropping_a_store_waits_no_longer_than_it_may_and_the_world_stays_locked() {
    let close_timeout = Duration::from_millis(50);
    let mut game = Game::new(StoreOptions { close_timeout, ..options(u64::MAX) });
    game.gate.set(Gate::Shut);
    game.dig();
    let Game { disk, gate, terrain, store, .. } = game;
    drop(store);
    assert!(matches!(open(&disk, &ground(2)), Err(StoreError::Locked(_))), "its thread may still write");
    gate.set(Gate::Open);
    let start = Instant::now();
    let opened = loop {
        match open(&disk, &ground(2)) {
            Err(StoreError::Locked(_)) if start.elapsed() < Duration::from_secs(60) => {
                std::thread::sleep(Duration::from_millis(1));
            }
            other => break other.expect("it can be opened"),
        }
    };
    assert_eq!(state(&opened.1.terrain), state(&terrain), "it was written all the same");
}

#[test]
fn who_closes_a_store_without_waiting_learns_what_was_saved() {
    for (gate, is_saved) in [(Gate::Open, true), (Gate::Panics, false)] {
        let mut game = Game::new(options(u64::MAX));
        game.dig();
        game.store.flush().expect("the disk works");
        game.gate.set(Gate::Shut);
        game.dig();
        let closing = game.store.close();
        assert!(closing.outcome().is_none());
        assert!(matches!(closing.wait(Duration::ZERO), Err(StoreError::TimedOut)));
        game.gate.set(gate);
        let outcome = closing.wait(Duration::from_secs(60));
        match is_saved {
            true => assert_eq!(outcome.expect("the disk answers"), 2),
            false => assert!(matches!(outcome, Err(StoreError::NotSaved(_))), "{outcome:?}"),
        }
        // In any case it can be opened again.
        game.gate.set(Gate::Open);
        let (_, opened) = open(&game.disk, &ground(2)).expect("it is closed");
        assert!(opened.terrain.world().revision() > u64::from(is_saved));
    }
}

#[test]
fn a_thread_that_panics_is_reported_and_lets_the_world_go() {
    let mut game = Game::new(options(u64::MAX));
    game.dig();
    game.store.flush().expect("the disk works");
    game.gate.set(Gate::Panics);
    game.dig();
    assert!(matches!(game.store.flush(), Err(StoreError::Ended)));
    // It may be reported a moment after its channel is gone.
    let start = Instant::now();
    let mut told = game.store.take_warnings();
    while told.is_empty() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(1));
        told = game.store.take_warnings();
    }
    assert_eq!(told, [StoreWarning::Ended("the driver panics".into())]);
    game.terrain.apply([dig(3)]);
    assert!(matches!(game.store.follow(&mut game.terrain), Err(StoreError::Ended)));
    game.gate.set(Gate::Open);
    let (_, opened) = open(&game.disk, &ground(2)).expect("nobody holds it any more");
    assert!(opened.terrain.world().revision() >= 1);
    // What is in memory can be saved elsewhere.
    let elsewhere = SimulatedDisk::new();
    let store = Store::create_in(Arc::new(elsewhere.clone()), &mut game.terrain, options(9));
    drop(store.expect("a new world"));
    let (_, opened) = open(&elsewhere, &ground(2)).expect("it was saved");
    assert_eq!(state(&opened.terrain), state(&game.terrain));
}

#[test]
fn no_setting_ends_the_thread() {
    let durations = [Duration::ZERO, Duration::from_secs(365 * 86_400), Duration::MAX];
    for loss_window in durations {
        for checkpoint_after in durations {
            for (bytes, commits) in [(0, 0), (usize::MAX, u64::MAX)] {
                let options = StoreOptions {
                    loss_window,
                    checkpoint_after,
                    checkpoint_commits: commits,
                    log_bytes: commits,
                    waiting_bytes: bytes,
                    frame_bytes: bytes,
                    close_timeout: checkpoint_after.max(Duration::from_secs(60)),
                    ..StoreOptions::default()
                };
                let mut game = Game::new(options);
                game.terrain.set_meshing(Meshing::Never);
                for _ in 0..3 {
                    game.store.put("turn", game.digs.to_le_bytes());
                    game.dig();
                    let revision = game.terrain.world().revision();
                    assert_eq!(game.store.flush().expect("the thread runs"), revision);
                }
                game.check_saved();
            }
        }
    }
}
