//! The plugin's figures as Bevy's diagnostics.

use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::prelude::*;

use super::{BurrowFigures, BurrowSystems, Times};
use crate::terrain::Terrain;

/// How long a transaction took in its task, in milliseconds: one measurement for each.
pub const TRANSACTION: DiagnosticPath = DiagnosticPath::const_new("burrow/transaction");

/// How long a commit took on the main thread, in milliseconds: one measurement for each.
pub const COMMIT: DiagnosticPath = DiagnosticPath::const_new("burrow/commit");

/// What the plugin took on the main thread, in milliseconds: one measurement for each frame.
pub const MAIN_THREAD: DiagnosticPath = DiagnosticPath::const_new("burrow/main_thread");

/// Brushes that wait in the queues of all terrains: one measurement for each frame.
pub const WAITING: DiagnosticPath = DiagnosticPath::const_new("burrow/waiting");

/// Meshes that were swapped: one measurement for each frame.
pub const SWAPS: DiagnosticPath = DiagnosticPath::const_new("burrow/swaps");

pub(super) fn add(app: &mut App) {
    for path in [TRANSACTION, COMMIT, MAIN_THREAD] {
        app.register_diagnostic(Diagnostic::new(path).with_suffix(" ms"));
    }
    for path in [WAITING, SWAPS] {
        app.register_diagnostic(Diagnostic::new(path));
    }
    app.add_systems(Update, measure.after(BurrowSystems::Propagate));
}

/// Measures what happened since the last frame.
fn measure(
    figures: Res<BurrowFigures>,
    terrains: Query<&Terrain>,
    mut diagnostics: Diagnostics,
    mut last: Local<(u64, u64)>,
) {
    let (commits, swaps) = (figures.commits.saturating_sub(last.0), figures.swaps.saturating_sub(last.1));
    *last = (figures.commits, figures.swaps);
    let mut latest = |path: DiagnosticPath, times: &Times| {
        for time in times.iter().skip(times.len().saturating_sub(commits as usize)) {
            diagnostics.add_measurement(&path, || time.as_secs_f64() * 1e3);
        }
    };
    latest(TRANSACTION, &figures.transactions);
    latest(COMMIT, &figures.commit_times);
    diagnostics.add_measurement(&MAIN_THREAD, || figures.main_thread.as_secs_f64() * 1e3);
    diagnostics.add_measurement(&WAITING, || terrains.iter().map(Terrain::queued).sum::<usize>() as f64);
    diagnostics.add_measurement(&SWAPS, || swaps as f64);
}
