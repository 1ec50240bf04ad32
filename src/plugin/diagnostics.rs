//! The figures of the plugin as Bevy diagnostics.

use std::time::Duration;

use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::prelude::*;

use super::BurrowFigures;
use super::figures::TaskTimes;
use crate::terrain::Terrain;

impl BurrowFigures {
    /// Milliseconds that a transaction took in its task, measured once per commit.
    pub const TRANSACTION: DiagnosticPath = DiagnosticPath::const_new("burrow/transaction");

    /// Milliseconds of a transaction in which the edits were applied and the surfaces extracted, measured once per
    /// commit.
    pub const EDIT: DiagnosticPath = DiagnosticPath::const_new("burrow/edit");

    /// Milliseconds of a transaction in which Bevy meshes were built and surface processors ran, measured once per
    /// commit.
    pub const MESH: DiagnosticPath = DiagnosticPath::const_new("burrow/mesh");

    /// Milliseconds that a commit took on the main thread, measured once per commit.
    pub const COMMIT: DiagnosticPath = DiagnosticPath::const_new("burrow/commit");

    /// Triangles in the meshes that a commit swapped in, measured once per commit.
    pub const TRIANGLES: DiagnosticPath = DiagnosticPath::const_new("burrow/triangles");

    /// Milliseconds that the plugin took on the main thread, measured once per frame.
    pub const MAIN_THREAD: DiagnosticPath = DiagnosticPath::const_new("burrow/main_thread");

    /// Edits and steps of history that wait for a transaction, over all terrains, measured once per frame.
    pub const WAITING: DiagnosticPath = DiagnosticPath::const_new("burrow/waiting");
}

/// Registers the diagnostics.
pub(super) fn register(app: &mut App) {
    for path in [
        BurrowFigures::TRANSACTION,
        BurrowFigures::EDIT,
        BurrowFigures::MESH,
        BurrowFigures::COMMIT,
        BurrowFigures::MAIN_THREAD,
    ] {
        app.register_diagnostic(Diagnostic::new(path).with_suffix("ms"));
    }
    for path in [BurrowFigures::TRIANGLES, BurrowFigures::WAITING] {
        app.register_diagnostic(Diagnostic::new(path));
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Measures a commit.
pub(super) fn measure_commit(
    diagnostics: &mut Diagnostics,
    task: TaskTimes,
    commit: Duration,
    triangles: usize,
) {
    for (path, time) in [
        (&BurrowFigures::TRANSACTION, task.total),
        (&BurrowFigures::EDIT, task.edit),
        (&BurrowFigures::MESH, task.mesh),
        (&BurrowFigures::COMMIT, commit),
    ] {
        diagnostics.add_measurement(path, || milliseconds(time));
    }
    diagnostics.add_measurement(&BurrowFigures::TRIANGLES, || triangles as f64);
}

/// Measures a frame.
pub(super) fn measure_frame(
    mut diagnostics: Diagnostics,
    figures: Res<BurrowFigures>,
    terrains: Query<&Terrain>,
) {
    diagnostics.add_measurement(&BurrowFigures::MAIN_THREAD, || milliseconds(figures.main_thread));
    diagnostics.add_measurement(&BurrowFigures::WAITING, || {
        terrains.iter().map(Terrain::queued).sum::<usize>() as f64
    });
}
