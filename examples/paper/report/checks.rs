//! Checks of each run, without which the figures would mean nothing.

use std::fmt::Write;

use super::markdown::{Table, thousands};
use crate::edits::Run;
use crate::full::Output;
use crate::measure::Measurements;
use crate::setup::Subject;

/// Seams, hashes and edits without effect of each run.
pub fn checks(measurements: &Measurements) -> Table {
    let header = ["run", "seams", "world hash", "triangles", "edits that changed samples", "meshes"];
    let mut table = Table::new("What held after each run", header);
    let edits = measurements.setup.edits;
    for measured in &measurements.measured {
        let of_all = |without: usize| format!("{} of {edits}", edits - without);
        let world = measured.ending.world;
        let seams = world.map_or("-", |world| if world.is_flawless { "flawless" } else { "FAULTS" });
        let is_full = matches!(measured.subject, Subject::Full(_));
        table.row([
            format!("{}, {}", measured.subject.title(), measured.run.title()),
            seams.into(),
            world.map_or("-".into(), |world| format!("{:#018x}", world.hash)),
            thousands(measured.ending.triangles as u64),
            of_all(measured.unchanged),
            if is_full { "-".into() } else { of_all(measured.undrawn) },
        ]);
    }
    table
}

/// The comparison of full fields and hybrid, in words.
pub fn agreement(measurements: &Measurements) -> String {
    let mut text = String::new();
    for (run, (ground, surface)) in Run::BOTH.into_iter().zip(measurements.agreement) {
        // Writing to a string never fails.
        let _ = writeln!(
            text,
            "- {}, {}: of all {} lattice points {} are solid in it and not in the hybrid or the other way round, {} hold \
             another density.\n\
             - {}, {}: of the {} triangles that marching cubes draw in the hybrid {} are missing in it, and it has {} others \
             in their cells; {} corners have other materials, {} other normals (those at the mask's border left out, where \
             the hybrid takes the heightmap's).",
            Subject::Full(Output::Bare).title(),
            run.title(),
            thousands(ground.points as u64),
            ground.otherwise_solid,
            ground.otherwise_dense,
            Subject::Full(Output::Same).title(),
            run.title(),
            thousands(surface.triangles as u64),
            surface.missing,
            surface.extra,
            surface.other_materials,
            surface.other_normals,
        );
    }
    text
}

/// The failed checks; empty if all is well.
pub fn faults(measurements: &Measurements) -> Vec<String> {
    let mut faults = Vec::new();
    for run in Run::BOTH {
        let mut hashes = Vec::new();
        for measured in measurements.measured.iter().filter(|measured| measured.run == run) {
            let name = format!("{}, {}", measured.subject.key(), run.title());
            if let Some(world) = measured.ending.world {
                hashes.push(world.hash);
                if !world.is_flawless {
                    faults.push(format!("{name}: the seams have faults"));
                }
            }
            // An edit may coincide with an earlier one of the same run; only a few may.
            if measured.unchanged * 10 > measurements.setup.edits {
                faults.push(format!("{name}: {} edits changed nothing", measured.unchanged));
            }
        }
        hashes.dedup();
        if hashes.len() > 1 {
            faults.push(format!(
                "{}: worlds differ between chunk sizes, or from the full field's",
                run.title()
            ));
        }
    }
    if measurements.agreement.iter().any(|(ground, _)| ground.otherwise_solid + ground.otherwise_dense > 0) {
        faults.push("the dense field and the hybrid hold different ground".into());
    }
    if !measurements.agreement.iter().all(|(_, surface)| surface.is_the_same()) {
        faults.push("the full field and the hybrid draw different marching cubes".into());
    }
    faults
}
