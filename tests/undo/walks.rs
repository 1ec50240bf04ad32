//! Random walks through history.

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::volume::{MaterialCounts, SampleView};
use fastrand::Rng;

use crate::scripts::{EditStatistics, any_brush, terrain};
use crate::state::{DisplayedMeshes, State};
use crate::worlds::{random_ground, world_count};

#[test]
fn walks_through_history_restore_the_earlier_states() {
    let (mut moved, mut statistics) = (0, EditStatistics::default());
    for index in 0..world_count(60) {
        let mut rng = Rng::with_seed(4100 + index);
        let (ground, usual) = random_ground(&mut rng, index);
        let chunk_size = if index % 2 == 0 { usual } else { rng.u32(8..=128) };
        let mut terrain = terrain(&mut rng, ground, chunk_size, index / 4);
        let mut displayed = DisplayedMeshes::of(terrain.world());
        // The states before each transaction, and the states that were undone.
        let (mut past, mut future): (Vec<State>, Vec<State>) = Default::default();
        for turn in 0..rng.usize(6..24) {
            let what = format!("world {index}, chunks of {chunk_size}, turn {turn}");
            let now = State::of(terrain.world());
            match rng.u32(0..5) {
                0 | 1 if !past.is_empty() => {
                    terrain.submit(Order::Undo);
                    displayed.play(&mut terrain);
                    future.push(now);
                    let expected = past.pop().expect("there is a past");
                    expected.check(terrain.world(), &what);
                    moved += 1;
                }
                2 if !future.is_empty() => {
                    terrain.submit(Order::Redo);
                    displayed.play(&mut terrain);
                    past.push(now);
                    let expected = future.pop().expect("there is a future");
                    expected.check(terrain.world(), &what);
                    moved += 1;
                }
                _ => {
                    let (count, ground) = (rng.usize(1..4), terrain.snapshot());
                    let brush = |_| any_brush(&mut rng, ground.ground(), chunk_size);
                    let brushes: Vec<Brush> = (0..count).map(brush).collect();
                    terrain.submit_all(&brushes);
                    let undos = terrain.history().undos;
                    let receipts = displayed.play(&mut terrain);
                    brushes
                        .iter()
                        .zip(&receipts)
                        .for_each(|(brush, receipt)| statistics.record(brush, receipt));
                    if terrain.history().undos > undos {
                        past.push(now);
                        future.clear();
                    }
                }
            }
            displayed.check(terrain.world(), &what);
            let history = terrain.history();
            assert_eq!((history.undos, history.redos), (past.len(), future.len()), "{what}");
        }
        assert!(terrain.world().check_seams().is_flawless(), "world {index}");
    }
    assert!(moved > 100, "only {moved} steps");
    statistics.check(1);
}

#[test]
fn receipts_of_steps_count_what_changed() {
    for index in 0..world_count(40) {
        let mut rng = Rng::with_seed(4300 + index);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let mut terrain = terrain(&mut rng, ground, chunk_size, index / 4);
        for _ in 0..6 {
            let ground = terrain.snapshot();
            terrain.apply([any_brush(&mut rng, ground.ground(), chunk_size)]);
        }
        let around: Vec<LatticeBox> = terrain.world().bricks().map(|(pos, _)| pos.samples()).collect();
        while terrain.history().undos > 0 {
            let before = terrain.snapshot();
            let restored = terrain.undo().outcome.expect("there is a step");
            let now = terrain.world();
            let (mut removed, mut added, mut painted, mut bounds) = (0, 0, 0, None);
            for point in around.iter().flat_map(|brick| brick.points()) {
                let (old, new) = (before.samples(), now.samples());
                let (was, is) = (old.is_solid(point), new.is_solid(point));
                removed += u64::from(was && !is);
                added += u64::from(is && !was);
                painted += u64::from(was && is && old.material(point) != new.material(point));
                let of = |view: SampleView| {
                    (view.is_edited(point), view.distance(point), view.stored_material(point))
                };
                if of(old) != of(new) {
                    LatticeBox::include(&mut bounds, LatticeBox::point(point));
                }
            }
            assert_eq!(restored.bounds, bounds, "world {index}");
            let totals = [&restored.removed, &restored.added, &restored.painted].map(MaterialCounts::total);
            assert_eq!(totals, [removed, added, painted], "world {index}");
        }
    }
}
