//! History memory: within its budget, and as many bytes as reported.

use allocation_counter::measure;
use bevy_burrow::lattice::BrickPos;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use bevy_burrow::volume::Brick;
use fastrand::Rng;
use glam::Vec3;

use crate::scripts::{any_brush, terrain};
use crate::state::State;
use crate::worlds::{random_ground, world_count};

#[test]
fn history_takes_the_reported_bytes_and_stays_within_its_budget() {
    let mut full = 0;
    for index in 0..world_count(40) {
        let mut rng = Rng::with_seed(4200 + index);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let mut terrain = terrain(&mut rng, ground, chunk_size, index / 4);
        let budget = [0, 100, 5_000, 60_000, 400_000, 64 << 20][rng.usize(0..6)];
        terrain.set_undo_budget(budget);
        let ground = terrain.snapshot();
        let mut most = 0;
        for _ in 0..40 {
            match rng.u32(0..6) {
                0 => terrain.submit(Order::Undo),
                1 => terrain.submit(Order::Redo),
                _ => terrain.submit(any_brush(&mut rng, ground.ground(), chunk_size)),
            }
            while let Some(transaction) = terrain.begin() {
                let commit = transaction.run();
                terrain.commit(commit).expect("no other commit");
                let history = terrain.history();
                assert!(history.bytes <= budget, "world {index}: {history:?} with a budget of {budget}");
                most = most.max(history.undos);
            }
        }
        assert!(budget > 0 || most == 0);
        full += u64::from(budget > 0 && terrain.history().undos < most);
        let history = terrain.history();
        assert_eq!(terrain.memory().undo, history.bytes);
        // No other reference to the world remains, so everything that history frees is really freed.
        drop(ground);
        let freed = measure(|| terrain.set_undo_budget(0));
        assert_eq!(-freed.bytes_current, history.bytes as i64, "world {index}: {history:?}");
        assert_eq!(terrain.history(), Default::default());
        assert!(terrain.undo().outcome == Err(Rejection::NothingToUndo));
    }
    assert!(full > 3, "old steps were dropped in {full} worlds only");
}

/// The number of edited bricks with uniform samples.
fn uniform_bricks(world: &World) -> usize {
    let is_uniform = |brick: &Brick, pos: BrickPos| {
        let of = |point| (brick.sample(point), brick.material(point));
        let first = of(pos.origin());
        first.0.distance().is_some() && pos.samples().points().all(|point| of(point) == first)
    };
    world.bricks().filter(|&(pos, brick)| is_uniform(brick, pos)).count()
}

#[test]
fn undoing_a_large_hole_and_its_filling_takes_the_reported_memory() {
    let ground = Ground::from_fn(72, 70, |x, z| 40.0 + f64::from(x * 5 % 7 + z * 3 % 5) * 0.3);
    let mut terrain =
        Terrain::new(ground.expect("finite heights"), &TerrainSettings::default()).expect("valid settings");
    let ball = Shape::sphere(Vec3::new(36.0, 20.0, 35.0), 28.0);
    let mut states = vec![State::of(terrain.world())];
    for brush in [Brush::dig(ball), Brush::add(ball, MaterialId(3)), Brush::paint(ball, MaterialId(4))] {
        terrain.apply([brush]);
        states.push(State::of(terrain.world()));
        let alike = uniform_bricks(terrain.world());
        assert!(alike > 20, "{alike} bricks are uniform");
    }
    let check = |terrain: &Terrain, state: usize, what: &str| {
        states[state].check(terrain.world(), what);
        assert_eq!(terrain.memory().undo, terrain.history().bytes, "{what}");
    };
    for state in (0..3).rev() {
        assert!(terrain.undo().outcome.is_ok());
        check(&terrain, state, &format!("back to {state}"));
    }
    for state in 1..3 {
        assert!(terrain.redo().outcome.is_ok());
        check(&terrain, state, &format!("forth to {state}"));
    }
    let (history, before) = (terrain.history(), terrain.world().memory());
    assert_eq!((history.undos, history.redos), (2, 1));
    let freed = measure(|| terrain.set_undo_budget(0));
    assert_eq!(-freed.bytes_current, history.bytes as i64, "{history:?}");
    assert_eq!(terrain.world().memory(), before);
}
