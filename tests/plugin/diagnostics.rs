//! The plugin's figures are in Bevy's `DiagnosticsStore`.

use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore};
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level};

fn values(stage: &Stage, path: &DiagnosticPath) -> Vec<f64> {
    let store = stage.app.world().resource::<DiagnosticsStore>();
    store.get(path).expect("registered").values().copied().collect()
}

#[test]
fn commits_and_frames_are_measured() {
    let mut stage = Stage::drawing();
    stage.show(level(1.0));
    assert!(values(&stage, &BurrowFigures::COMMIT).is_empty(), "nothing was committed yet");
    assert_eq!(values(&stage, &BurrowFigures::WAITING).last(), Some(&0.0));
    for commits in 1..=2 {
        stage.send(dig(24.0 * commits as f32, 8.0, 24.0, 4.0));
        stage.settle();
        stage.frame();
        let [transactions, edits, meshes, swaps] =
            [BurrowFigures::TRANSACTION, BurrowFigures::EDIT, BurrowFigures::MESH, BurrowFigures::COMMIT]
                .map(|path| values(&stage, &path));
        assert_eq!([&transactions, &edits, &meshes, &swaps].map(Vec::len), [commits; 4]);
        assert!(swaps.iter().all(|&time| time > 0.0));
        for (total, (edit, mesh)) in transactions.iter().zip(edits.iter().zip(&meshes)) {
            assert!(*edit > 0.0 && *mesh > 0.0 && edit + mesh <= total * 1.001, "{edit} + {mesh} of {total}");
        }
        let last = stage.figures().last_transaction.as_secs_f64() * 1e3;
        assert_eq!(transactions.last(), Some(&last));
        assert!(values(&stage, &BurrowFigures::TRIANGLES).iter().all(|&count| count > 100.0));
    }
    assert!(values(&stage, &BurrowFigures::MAIN_THREAD).iter().any(|&time| time > 0.0));
}
