//! The figures as files for other programs: every timing as CSV, all conclusions as JSON.

use std::fmt::Write;

use serde_json::{Value, json};

use super::ratios::ratios;
use crate::machine::Machine;
use crate::measure::{Measured, Measurements};
use crate::stats::Statistics;

/// Every timing: `test,run,repeat,edit,seconds,processor_seconds`.
pub fn timings(measurements: &Measurements) -> String {
    let mut csv = String::from("test,run,repeat,edit,seconds,processor_seconds\n");
    for measured in &measurements.measured {
        let (test, run) = (measured.subject.key(), measured.run.title());
        for (repeat, both) in measured.repeats.iter().zip(&measured.processor).enumerate() {
            for (edit, (seconds, processor)) in both.0.iter().zip(both.1).enumerate() {
                // Writing to a string never fails.
                let _ = writeln!(csv, "{test},{run},{repeat},{edit},{seconds:.9},{processor:.9}");
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
    let agreement = measurements.agreement;
    json!({
        "machine": machine,
        "setup": measurements.setup,
        "runs": runs,
        "first_run_scenarios": scenarios,
        "edit_sizes": measurements.sizes,
        "dense_field_against_hybrid": agreement.map(|(ground, _)| ground),
        "full_field_against_hybrid": agreement.map(|(_, surface)| surface),
        "missing": measurements.missing.iter().map(|(_, reason)| reason.to_string()).collect::<Vec<_>>(),
        "ratios": ratios(measurements),
    })
}

fn run(measured: &Measured) -> Value {
    let ending = measured.ending;
    let world = ending.world.map(|world| {
        json!({ "hash": format!("{:#018x}", world.hash), "is_flawless": world.is_flawless, "bytes": world.data })
    });
    json!({
        "test": measured.subject.key(),
        "run": measured.run,
        "seconds": Statistics::of(&measured.repeats),
        "processor_seconds": Statistics::of(&measured.processor),
        "voxels_by_edit": measured.voxels,
        "edits_without_changed_samples": measured.unchanged,
        "edits_without_changed_meshes": measured.undrawn,
        "process_kilobytes": measured.resident(),
        "alone": measured.alone,
        "triangles": ending.triangles,
        "world": world,
        "dense_sample_bytes": ending.sample_bytes,
        "full_mesh_bytes": ending.mesh_bytes,
    })
}
