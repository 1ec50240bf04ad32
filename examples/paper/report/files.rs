//! The figures as files for other programs: each timing as CSV, everything that was concluded as JSON.

use std::fmt::Write;

use serde_json::{Value, json};

use super::ratios::ratios;
use crate::machine::Machine;
use crate::measure::{Ending, Measured, Measurements};
use crate::stats::Statistics;

/// Every single timing: `test,run,repeat,edit,seconds`.
pub fn timings(measurements: &Measurements) -> String {
    let mut csv = String::from("test,run,repeat,edit,seconds\n");
    for measured in &measurements.measured {
        let (test, run) = (measured.subject.key(), measured.run.title());
        for (repeat, seconds) in measured.repeats.iter().enumerate() {
            for (edit, seconds) in seconds.iter().enumerate() {
                // Writing to a string never fails.
                let _ = writeln!(csv, "{test},{run},{repeat},{edit},{seconds:.9}");
            }
        }
    }
    csv
}

/// Setup, machine, statistics, checks and ratios.
pub fn summary(measurements: &Measurements, machine: &Machine) -> Value {
    let runs: Vec<Value> = measurements.measured.iter().map(run).collect();
    let scenarios: Vec<Value> = measurements
        .scenarios
        .iter()
        .map(|(chunk_size, counts)| json!({ "chunk_size": chunk_size, "counts": counts }))
        .collect();
    json!({
        "machine": machine,
        "setup": measurements.setup,
        "runs": runs,
        "first_run_scenarios": scenarios,
        "full_field_against_hybrid": measurements.agreement,
        "missing": measurements.missing.iter().map(|(_, reason)| reason.to_string()).collect::<Vec<_>>(),
        "ratios": ratios(measurements),
    })
}

fn run(measured: &Measured) -> Value {
    let ending = match measured.ending {
        Ending::Hybrid { hash, is_flawless, triangles, data } => json!({
            "hash": format!("{hash:#018x}"),
            "is_flawless": is_flawless,
            "triangles": triangles,
            "bytes": {
                "ground": data.ground,
                "samples": data.samples,
                "materials": data.materials,
                "index": data.index,
                "meshes": data.meshes,
                "parts": data.parts,
            },
        }),
        Ending::Full { triangles, sample_bytes, mesh_bytes } => json!({
            "triangles": triangles,
            "bytes": { "samples": sample_bytes, "mesh": mesh_bytes },
        }),
    };
    json!({
        "test": measured.subject.key(),
        "run": measured.run,
        "seconds": Statistics::of(&measured.repeats),
        "edits_without_changed_samples": measured.unchanged,
        "edits_without_changed_meshes": measured.undrawn,
        "process_kilobytes": measured.resident,
        "ending": ending,
    })
}
