//! Names of history steps on standard output. Shared by examples, which include this file by path.

use bevy_burrow::terrain::HistoryStep;

/// The name of a step.
pub fn name(step: HistoryStep) -> &'static str {
    match step {
        HistoryStep::Undo => "undo",
        HistoryStep::Redo => "redo",
    }
}
