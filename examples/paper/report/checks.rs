//! What must hold for the figures to mean anything, run by run.

use super::markdown::{Table, thousands};
use crate::edits::Run;
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
            if measured.subject == Subject::Full { "-".into() } else { of_all(measured.undrawn) },
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

/// What must hold and does not; nothing, if all is well.
pub fn faults(measurements: &Measurements) -> Vec<String> {
    let mut faults = Vec::new();
    for run in Run::BOTH {
        let mut hashes = Vec::new();
        for measured in measurements.measured.iter().filter(|measured| measured.run == run) {
            let name = format!("{}, {}", measured.subject.key(), run.title());
            if let Ending::Hybrid { hash, is_flawless, .. } = measured.ending {
                hashes.push(hash);
                if !is_flawless {
                    faults.push(format!("{name}: the seams have faults"));
                }
            }
            // An edit may fall on what another one of the same run made; not many do.
            if measured.unchanged * 10 > measurements.setup.edits {
                faults.push(format!("{name}: {} edits changed nothing", measured.unchanged));
            }
        }
        hashes.dedup();
        if hashes.len() > 1 {
            faults.push(format!("{}: worlds differ between chunk sizes", run.title()));
        }
    }
    if !measurements.agreement.iter().all(|agreement| agreement.is_complete()) {
        faults.push("the full field and the hybrid hold different ground".into());
    }
    faults
}
