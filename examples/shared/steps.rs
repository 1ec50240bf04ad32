//! What steps through history are called on standard output. Examples have it in common; each takes it in by its path.

use bevy_burrow::terrain::HistoryStep;

/// The name of a step.
pub fn name(step: HistoryStep) -> &'static str {
    match step {
        HistoryStep::Undo => "undo",
        HistoryStep::Redo => "redo",
    }
}
