//! Tables 1 to 5, the paper's figures and ours side by side.

use super::markdown::{Table, kilobytes, thousands};
use crate::backend::Backend;
use crate::edits::Run;
use crate::measure::{Ending, Measured, Measurements, Subject};
use crate::published::{self, CHUNK_SIZES, Column};
use crate::stats::{self, Statistics};

/// Tables 1 to 5 in order.
pub fn all(measurements: &Measurements) -> Vec<Table> {
    let mut tables = Vec::new();
    for backend in Backend::ALL {
        for run in Run::BOTH {
            tables.push(hybrid(measurements, backend, run, tables.len() + 1));
        }
    }
    tables.push(full(measurements));
    tables
}

/// The rows that all tables share: a name, the paper's figure, ours.
type Row = (&'static str, fn(&Column) -> String, fn(&Measured, &Statistics) -> String);

const ROWS: [Row; 5] = [
    ("Total time, s", |paper| published_time(paper.total), |_, here| time(here.total)),
    ("Average time, s", |paper| published_time(paper.average), |_, here| time(here.average)),
    ("Max time, s", |paper| published_time(paper.max), |_, here| time(here.max)),
    ("Min time, s", |paper| published_time(paper.min), |_, here| time(here.min)),
    (
        "Memory, process",
        |paper| paper.memory.map_or("-".into(), process),
        |measured, _| measured.resident.map_or("n/a".into(), process),
    ),
];

fn published_time(seconds: f64) -> String {
    format!("{seconds:.6}")
}

/// One digit more than the paper's: our times are shorter.
fn time(seconds: f64) -> String {
    format!("{seconds:.7}")
}

fn process(kilobytes: u64) -> String {
    format!("{} K", thousands(kilobytes))
}

fn hybrid(measurements: &Measurements, backend: Backend, run: Run, number: usize) -> Table {
    let name = backend.title();
    let pairs = CHUNK_SIZES.iter().flat_map(|size| [format!("{size}, paper"), format!("{size}, here")]);
    let header = std::iter::once(format!("{name} {}, chunk size", run.title())).chain(pairs);
    let title = format!("Table {number}: {name}, {}, chunk size 25 to 100", run.title());
    let mut table = Table::new(title, header);
    let here = measurements.hybrid(backend, run);
    fill(&mut table, &published::hybrid(backend, run), &here);
    if here.is_empty() {
        let reason = measurements.missing.iter().find(|missing| missing.0 == backend);
        table.note = reason.map_or_else(String::new, |(_, reason)| format!("Here: {reason}."));
    } else {
        let data = |ending: &Ending| match ending {
            Ending::Hybrid { data, .. } => kilobytes(data.ground + data.edits()),
            Ending::Full { .. } => String::new(),
        };
        extra(&mut table, "Memory, terrain data", &here, data);
    }
    table
}

fn full(measurements: &Measurements) -> Table {
    let pairs =
        Run::BOTH.iter().flat_map(|run| ["paper", "here"].map(|who| format!("{}, {who}", run.title())));
    let header = std::iter::once("Full marching cubes".to_owned()).chain(pairs);
    let mut table = Table::new("Table 5: CPU, first and second run, the whole terrain as one field", header);
    let here: Vec<_> = Run::BOTH.iter().filter_map(|&run| measurements.get(Subject::Full, run)).collect();
    fill(&mut table, &Run::BOTH.map(published::full), &here);
    extra(&mut table, "Memory, samples", &here, |ending| match ending {
        Ending::Full { sample_bytes, .. } => kilobytes(*sample_bytes),
        Ending::Hybrid { .. } => String::new(),
    });
    extra(&mut table, "Memory, mesh", &here, |ending| match ending {
        Ending::Full { mesh_bytes, .. } => kilobytes(*mesh_bytes),
        Ending::Hybrid { .. } => String::new(),
    });
    table
}

/// Puts in the shared rows: for each column of the paper its figure and ours.
fn fill(table: &mut Table, paper: &[Column], here: &[&Measured]) {
    let statistics: Vec<_> = here.iter().map(|measured| Statistics::of(&measured.repeats)).collect();
    for (name, published, measured) in ROWS {
        let pairs = paper.iter().enumerate().flat_map(|(at, paper)| {
            let ours = here.get(at).zip(statistics.get(at));
            [published(paper), ours.map_or("-".into(), |(here, statistics)| measured(here, statistics))]
        });
        table.row(std::iter::once(name.to_owned()).chain(pairs));
    }
}

/// A row of figures that the paper does not have.
fn extra(table: &mut Table, name: &str, here: &[&Measured], figure: impl Fn(&Ending) -> String) {
    let pairs = here.iter().flat_map(|measured| ["-".to_owned(), figure(&measured.ending)]);
    table.row(std::iter::once(name.to_owned()).chain(pairs));
}

/// How times are spread, in microseconds: what totals and averages do not tell.
pub fn medians(measurements: &Measurements) -> Table {
    let header =
        ["us an edit", "median", "99th percentile", "longest", "average of medians", "longest of medians"];
    let mut table = Table::new("How times are spread", header);
    for measured in &measurements.measured {
        let name = match measured.subject {
            Subject::Hybrid { backend, chunk_size } => format!("{} {chunk_size}", backend.title()),
            Subject::Full => "full field".into(),
        };
        let all = Statistics::of(&measured.repeats);
        let by_edit = Statistics::of(&[stats::by_edit(&measured.repeats)]);
        let figures = [all.median, all.p99, all.max, by_edit.average, by_edit.max];
        let figures = figures.iter().map(|seconds| format!("{:.1}", seconds * 1e6));
        table.row(std::iter::once(format!("{name}, {}", measured.run.title())).chain(figures));
    }
    table.note =
        "The last two columns take each edit with its median over the repeats, which leaves out what else \
                  the machine did meanwhile."
            .into();
    table
}
