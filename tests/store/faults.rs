//! Disks that are full, read-only or broken: play continues, and saving resumes when it can.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{DiskFault, SimulatedDisk, Store, StoreError, StoreOptions, StoreWarning};
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;

use crate::play::{State, act, check_opened, ground, open, options, save, state, terrain};

const FAULTS: [(DiskFault, &str); 3] =
    [(DiskFault::Full, "space"), (DiskFault::ReadOnly, "read-only"), (DiskFault::Broken, "broken")];

struct Player {
    terrain: Terrain,
    store: Option<Store>,
    states: BTreeMap<u64, Vec<State>>,
    rng: Rng,
}

impl Player {
    fn new(disk: &SimulatedDisk, seed: u64, options: StoreOptions) -> Self {
        let mut terrain = terrain(&ground(seed));
        let store = Store::create_in(Arc::new(disk.clone()), &mut terrain, options).expect("a new world");
        let states = BTreeMap::from([(0, vec![state(&terrain)])]);
        Self { terrain, store: Some(store), states, rng: Rng::with_seed(seed) }
    }

    fn store(&mut self) -> &mut Store {
        self.store.as_mut().expect("it is open")
    }

    fn close(&mut self) {
        self.store = None;
    }

    fn play(&mut self, commits: u64) {
        let end = self.terrain.world().revision() + commits;
        while self.terrain.world().revision() < end {
            act(&mut self.terrain, &mut self.rng);
            let revision = self.terrain.world().revision();
            self.states.entry(revision).or_default().push(state(&self.terrain));
            save(self.store.as_mut().expect("it is open"), &mut self.terrain).expect("the thread runs");
        }
    }

    fn check(&self, disk: &SimulatedDisk, seed: u64) -> bool {
        let opened = open(disk, &ground(seed)).expect("it can be opened");
        let revision = self.terrain.world().revision();
        check_opened(&opened, &self.states, revision, revision);
        opened.1.is_log_whole
    }
}

#[test]
fn play_goes_on_while_saving_fails_and_nothing_is_lost() {
    for (fault, message) in FAULTS {
        for begin in (0..80).step_by(3) {
            let disk = SimulatedDisk::new();
            let mut player = Player::new(&disk, 2, options(7));
            player.play(3);
            player.store().flush().expect("the disk works");
            disk.fail_at(disk.operations() + begin, fault);
            player.play(20);
            let refused = player.store().flush();
            let warnings = player.store().take_warnings();
            if let Err(why) = &refused {
                assert!(matches!(why, StoreError::NotSaved(_)) && why.to_string().contains(message), "{why}");
                let is_reported = |own: &StoreWarning| matches!(own, StoreWarning::NotSaved(_));
                assert!(warnings.iter().any(is_reported), "{fault:?} from {begin}: {warnings:?}");
                assert!(warnings.len() < 6, "{warnings:?}");
            }
            // Even if the power is lost now, acknowledged commits are there.
            let durable = player.store().durable();
            let lost = disk.image().lose_power(|| false);
            let opened = open(&lost, &ground(2)).expect("it can be opened");
            check_opened(&opened, &player.states, durable, player.terrain.world().revision());
            drop(opened);

            disk.set_fault(DiskFault::None);
            player.play(2);
            player.store().flush().expect("the disk works again");
            if refused.is_err() {
                assert!(player.store().take_warnings().contains(&StoreWarning::SavedAgain));
            }
            assert!(player.check(&disk.image().lose_power(|| false), 2), "the log is whole");
            // Closing makes a checkpoint.
            player.close();
            assert!(player.check(&disk, 2));
        }
    }
}

#[test]
fn when_too_much_waits_the_world_is_saved_whole() {
    for (fault, _) in FAULTS {
        let disk = SimulatedDisk::new();
        let mut player = Player::new(&disk, 2, StoreOptions { waiting_bytes: 2_000, ..options(7) });
        player.play(5);
        player.store().flush().expect("the disk works");
        disk.set_fault(fault);
        player.play(1);
        player.store().flush().expect_err("the disk does not");
        player.play(100);
        player.store().flush().expect_err("the disk does not");
        let warnings = player.store().take_warnings();
        assert!(warnings.iter().any(|own| matches!(own, StoreWarning::LogGap { .. })), "{warnings:?}");
        disk.set_fault(DiskFault::None);
        player.store().flush().expect("the disk works again");
        assert_eq!(player.store().durable(), player.terrain.world().revision());
        assert!(!player.check(&disk.image().lose_power(|| false), 2), "the log has a gap");
        player.play(9);
        player.store().flush().expect("the disk works");
        assert!(!player.check(&disk.image().lose_power(|| false), 2));
    }
}

#[test]
fn a_commit_that_is_too_much_for_a_frame_is_saved_whole() {
    let data: Vec<u8> = (0..9_000u32).map(|at| ((at * at) >> 3) as u8).collect();
    for frame_bytes in [800, 1 << 20] {
        let is_too_much = frame_bytes < data.len();
        let disk = SimulatedDisk::new();
        let mut player = Player::new(&disk, 2, StoreOptions { frame_bytes, ..options(1_000) });
        player.play(5);
        player.store().flush().expect("the disk works");
        assert_eq!(player.store().take_warnings(), []);
        player.store().put("map", data.clone());
        player.play(1);
        let durable = player.store().flush().expect("the disk works");
        assert_eq!(durable, player.terrain.world().revision());
        let warnings = player.store().take_warnings();
        let is_gap = |own: &StoreWarning| matches!(own, StoreWarning::LogGap { .. });
        assert!(warnings.iter().all(is_gap) && warnings.is_empty() != is_too_much, "{warnings:?}");
        for _ in 0..3 {
            for image in [disk.image().lose_power(|| false), disk.image().lose_process()] {
                assert_eq!(player.check(&image, 2), !is_too_much, "the log is whole without a gap");
                let (store, _) = open(&image, &ground(2)).expect("it can be opened");
                assert_eq!(store.get("map"), Some(&data[..]));
            }
            player.play(6);
            player.store().flush().expect("the disk works");
        }
    }
}

#[test]
fn files_that_are_removed_are_written_again() {
    for removed in ["journal", "regions", "all"] {
        let disk = SimulatedDisk::new();
        let mut player = Player::new(&disk, 2, options(10));
        player.play(25);
        player.store().flush().expect("the disk works");
        for path in disk.paths() {
            if removed == "all" || path.starts_with(removed) {
                bevy_burrow::store::Files::remove(&disk, &path).expect("it is there");
            }
        }
        player.play(4);
        // The first flush may report the fault; then the whole world is saved again.
        drop(player.store().flush());
        player.play(12);
        player.store().checkpoint().expect("the disk works");
        player.play(3);
        player.store().flush().expect("the disk works");
        player.check(&disk.image().lose_power(|| false), 2);
    }
}

#[test]
fn a_read_only_world_can_be_played() {
    let disk = SimulatedDisk::new();
    let mut player = Player::new(&disk, 2, options(10));
    player.play(25);
    player.store().flush().expect("the disk works");
    for image in [disk.image().lose_process(), disk.image().lose_power(|| false)] {
        image.set_fault(DiskFault::ReadOnly);
        let opened = open(&image, &ground(2));
        // The database may have to be repaired, which takes writing.
        let (mut store, mut terrain) = match opened {
            Ok((store, opened)) => (store, opened.terrain),
            Err(why) => {
                assert!(why.to_string().contains("read-only"), "{why}");
                continue;
            }
        };
        assert_eq!(state(&terrain), state(&player.terrain));
        terrain.set_meshing(Meshing::Never);
        let mut rng = Rng::with_seed(1);
        (0..9).for_each(|_| act(&mut terrain, &mut rng));
        save(&mut store, &mut terrain).expect("the thread runs");
        assert!(store.flush().expect_err("it is read-only").to_string().contains("read-only"));
        image.set_fault(DiskFault::None);
        store.flush().expect("the disk works again");
        let saved = open(&image.image().lose_power(|| false), &ground(2)).expect("it can be opened");
        assert_eq!(state(&saved.1.terrain), state(&terrain));
    }
}
