//! Figures as Bevy's diagnostics.

use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore};
use bevy_burrow::plugin::diagnostics::{COMMIT, MAIN_THREAD, SWAPS, TRANSACTION, WAITING};

use crate::stage::{Stage, level, random_brushes};

/// All that was measured of something.
fn measured(stage: &Stage, path: &DiagnosticPath) -> Vec<f64> {
    let store = stage.app.world().resource::<DiagnosticsStore>();
    store.get(path).expect("registered").values().copied().collect()
}

#[test]
fn every_transaction_and_frame_is_measured() {
    let mut stage = Stage::drawing();
    stage.show(level(1.0));
    for brush in random_brushes(50, 12) {
        stage.send(brush);
        stage.settle();
    }
    stage.frame();
    let commits = stage.figures().commits as usize;
    assert!(commits > 3, "{commits} commits");
    for path in [TRANSACTION, COMMIT] {
        let all = measured(&stage, &path);
        assert_eq!(all.len(), commits, "{path}");
        assert!(all.iter().all(|&ms| ms > 0.0), "{path}: {all:?}");
    }
    assert!(measured(&stage, &MAIN_THREAD).iter().any(|&ms| ms > 0.0));
    assert!(measured(&stage, &WAITING).ends_with(&[0.0]));
    assert!(measured(&stage, &SWAPS).iter().any(|&swaps| swaps > 0.0));
}
