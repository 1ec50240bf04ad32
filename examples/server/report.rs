//! Prints a line for each receipt, and a summary at the end.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_burrow::plugin::HistoryMoved;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::Memory;

use crate::output::say;

/// Counts of events since the start.
#[derive(Resource)]
pub struct Report {
    /// Brushes and steps that were answered.
    pub answered: u64,
    /// Lines that could not be read.
    pub faults: u64,
    /// Whether the summary was requested.
    pub is_done: bool,
    quiet: bool,
    rejected: u64,
    scenarios: ScenarioCounts,
    moved: (u64, u64),
    start: Instant,
}

/// Prints what comes in unless `quiet`, and the summary when the program ends unless `silent`.
pub fn add(app: &mut App, quiet: bool, silent: bool) {
    let report = Report {
        answered: 0,
        faults: 0,
        is_done: false,
        quiet: quiet || silent,
        rejected: 0,
        scenarios: ScenarioCounts::default(),
        moved: (0, 0),
        start: Instant::now(),
    };
    app.insert_resource(report)
        .add_systems(Update, (enter_receipts, enter_steps).after(BurrowSystems::Commit))
        .add_systems(Last, sum_up.run_if(on_message::<AppExit>.and_then(move || !silent)));
}

fn enter_receipts(mut receipts: MessageReader<BrushApplied>, mut report: ResMut<Report>) {
    for BrushApplied { receipt, .. } in receipts.read() {
        report.answered += 1;
        report.scenarios.count(receipt);
        let tag = receipt.tag;
        match &receipt.outcome {
            Ok(applied) => {
                let (removed, added) = (applied.removed.total(), applied.added.total());
                let painted = applied.painted.total();
                report.moved = (report.moved.0 + removed, report.moved.1 + added);
                if !report.quiet {
                    let chunks = applied.chunks.len();
                    say(format_args!(
                        "brush {tag}: {removed} removed, {added} added, {painted} painted in {chunks} chunks"
                    ));
                }
            }
            Err(rejection) => {
                report.rejected += 1;
                if !report.quiet {
                    say(format_args!("brush {tag}: rejected, {rejection}"));
                }
            }
        }
    }
}

fn enter_steps(mut moves: MessageReader<HistoryMoved>, mut report: ResMut<Report>) {
    for HistoryMoved { receipt, .. } in moves.read() {
        report.answered += 1;
        let name = receipt.kind;
        match &receipt.outcome {
            Ok(restored) if !report.quiet => {
                say(format_args!(
                    "{name}: {} removed, {} added",
                    restored.removed.total(),
                    restored.added.total()
                ));
            }
            Err(why) if !report.quiet => say(format_args!("{name}: {why}")),
            _ => {}
        }
    }
}

fn sum_up(report: Res<Report>, figures: Res<BurrowFigures>, terrains: Query<&Terrain>) {
    let Report { answered, rejected, scenarios, moved, start, .. } = &*report;
    say(format_args!("{answered} answered, {rejected} rejected, in {:.2} s", start.elapsed().as_secs_f64()));
    say(format_args!(
        "scenarios: {} created, {} changed, {} extended, {} merged, {} split over chunks",
        scenarios.created, scenarios.changed, scenarios.extended, scenarios.merged, scenarios.split
    ));
    say(format_args!("voxels: {} removed, {} added", moved.0, moved.1));
    let ms = |time: Option<Duration>| time.unwrap_or_default().as_secs_f64() * 1e3;
    let [p50, p95, p99] = [50, 95, 99].map(|percent| ms(figures.transactions.percentile(percent)));
    say(format_args!(
        "transactions: {} commits, p50 {p50:.2}, p95 {p95:.2}, p99 {p99:.2} ms",
        figures.commits
    ));
    for terrain in &terrains {
        let (world, memory) = (terrain.world(), terrain.memory());
        let fields: usize = world.fields().map(|(_, fields)| fields.len()).sum();
        say(format_args!(
            "world: {fields} fields, {} bricks, {} drawn chunks",
            world.bricks().count(),
            world.drawn_chunks().count()
        ));
        say(format_args!("memory: {}", in_words(&memory)));
        say(format_args!("hash: {:016x}", world.hash()));
    }
}

fn in_words(memory: &Memory) -> String {
    let kib = |bytes: usize| bytes.div_ceil(1024);
    format!(
        "ground {} KiB, samples {}, materials {}, meshes {}, parts {}, index {}, undo {}",
        kib(memory.ground),
        kib(memory.samples),
        kib(memory.materials),
        kib(memory.meshes),
        kib(memory.parts),
        kib(memory.index),
        kib(memory.undo)
    )
}
