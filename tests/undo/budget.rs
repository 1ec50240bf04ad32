//! What history takes: no more than its budget, and as many bytes as it says.

use allocation_counter::measure;
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::scripts::{any_brush, terrain};
use crate::worlds::{random_ground, world_count};

#[test]
fn history_takes_the_bytes_it_says_and_stays_within_its_budget() {
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
                0 => terrain.submit_undo(),
                1 => terrain.submit_redo(),
                _ => terrain.submit(&any_brush(&mut rng, ground.ground(), chunk_size)),
            }
            while let Some(transaction) = terrain.begin() {
                let commit = transaction.run();
                terrain.commit(commit).expect("nobody else commits");
                let history = terrain.history();
                assert!(history.bytes <= budget, "world {index}: {history:?} with a budget of {budget}");
                most = most.max(history.undos);
            }
        }
        assert!(budget > 0 || most == 0);
        full += u64::from(budget > 0 && terrain.history().undos < most);
        let history = terrain.history();
        assert_eq!(terrain.memory().undo, history.bytes);
        // The world is let go of by whoever looked at it, so what history frees nobody else holds.
        drop(ground);
        let freed = measure(|| terrain.set_undo_budget(0));
        assert_eq!(-freed.bytes_current, history.bytes as i64, "world {index}: {history:?}");
        assert_eq!(terrain.history(), Default::default());
        assert!(terrain.undo().outcome == Err(HistoryRejection::NothingToUndo));
    }
    assert!(full > 3, "old steps fell off in {full} worlds only");
}
