//! What must hold for the figures to mean anything, run by run.

use super::markdown::{Table, thousands};
use crate::measure::{Ending, Measurements, Subject};

/// Seams, hashes and edits without effect of each run.
pub fn checks(measurements: &Measurements) -> Table {
    let header = ["run", "seams", "world hash", "triangles", "edits that changed samples", "meshes"];
    let mut table = Table::new("What held after each run", header);
    let edits = measurements.setup.edits;
    for measured in &measurements.measured {
        let of_all = |without: usize| format!("{} of {edits}", edits - without);
        let (name, seams, hash, triangles) = match (measured.subject, measured.ending) {
            (
                Subject::Hybrid { backend, chunk_size },
                Ending::Hybrid { hash, is_flawless, triangles, .. },
            ) => {
                let seams = if is_flawless { "flawless" } else { "FAULTS" };
                (format!("{} {chunk_size}", backend.title()), seams, format!("{hash:#018x}"), triangles)
            }
            (_, Ending::Full { triangles, .. } | Ending::Hybrid { triangles, .. }) => {
                ("full field".into(), "-", "-".into(), triangles)
            }
        };
        table.row([
            format!("{name}, {}", measured.run.title()),
            seams.into(),
            hash,
            thousands(triangles as u64),
            of_all(measured.unchanged),
            of_all(measured.undrawn),
        ]);
    }
    let points = thousands(measurements.agreement[0].points as u64);
    let differ = measurements.agreement.map(|agreement| agreement.otherwise_dense);
    let solid = measurements.agreement.map(|agreement| agreement.otherwise_solid);
    table.note = format!(
        "Full field against hybrid at all {points} lattice points: {} and {} are solid in one and not in the other \
         (first and second run), {} and {} hold another density.",
        solid[0], solid[1], differ[0], differ[1]
    );
    table
}
