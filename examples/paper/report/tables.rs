//! Tables 1 to 5, with the paper's figures and ours side by side.

use super::markdown::{Table, kilobytes, thousands};
use super::ratios::alone;
use crate::backend::Backend;
use crate::edits::Run;
use crate::ending::Ending;
use crate::full::Output;
use crate::measure::{Measured, Measurements};
use crate::published::{self, CHUNK_SIZES, Column};
use crate::setup::Subject;
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
        |measured, _| measured.resident().map_or("n/a".into(), process),
    ),
];

fn published_time(seconds: f64) -> String {
    format!("{seconds:.6}")
}

/// One digit more than in the paper, as our times are shorter.
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
    let columns: Vec<_> = published::hybrid(backend, run)
        .into_iter()
        .enumerate()
        .flat_map(|(at, paper)| {
            [Shown::Paper(paper), here.get(at).map_or(Shown::Nothing, |&here| Shown::Here(here))]
        })
        .collect();
    fill(&mut table, &columns);
    if here.is_empty() {
        let reason = measurements.missing.iter().find(|missing| missing.0 == backend);
        table.note = reason.map_or_else(String::new, |(_, reason)| format!("Here: {reason}."));
    } else {
        extra(&mut table, "Memory, terrain data", &columns, Ending::data_bytes);
        extra(&mut table, "Memory, undo history", &columns, Ending::undo_bytes);
    }
    table
}

fn full(measurements: &Measurements) -> Table {
    let of_run = |run: Run| {
        let who = ["paper"].into_iter().chain(Output::BOTH.map(Output::title));
        who.map(move |who| format!("{}, {who}", run.title()))
    };
    let header =
        std::iter::once("Full marching cubes".to_owned()).chain(Run::BOTH.into_iter().flat_map(of_run));
    let mut table = Table::new("Table 5: CPU, first and second run, the whole terrain as one field", header);
    let of_run = |run: Run| {
        let here = |output| measurements.get(Subject::Full(output), run).map_or(Shown::Nothing, Shown::Here);
        [Shown::Paper(published::full(run))].into_iter().chain(Output::BOTH.map(here))
    };
    let columns: Vec<_> = Run::BOTH.into_iter().flat_map(of_run).collect();
    fill(&mut table, &columns);
    extra(&mut table, "Memory, terrain data", &columns, Ending::data_bytes);
    extra(&mut table, "Memory, mesh", &columns, |ending| ending.mesh_bytes);
    table
}

/// The content of a column.
enum Shown<'a> {
    Paper(Column),
    Here(&'a Measured),
    Nothing,
}

/// Adds the rows that all tables share.
fn fill(table: &mut Table, columns: &[Shown]) {
    for (name, published, measured) in ROWS {
        let figures = columns.iter().map(|column| match column {
            Shown::Paper(paper) => published(paper),
            Shown::Here(here) => measured(here, &Statistics::of(&here.repeats)),
            Shown::Nothing => "-".into(),
        });
        table.row(std::iter::once(name.to_owned()).chain(figures));
    }
}

/// Adds a row of bytes, which the paper does not have.
fn extra(table: &mut Table, name: &str, columns: &[Shown], bytes: impl Fn(&Ending) -> usize) {
    let figures = columns.iter().map(|column| match column {
        Shown::Here(here) => kilobytes(bytes(&here.ending)),
        Shown::Paper(_) | Shown::Nothing => "-".into(),
    });
    table.row(std::iter::once(name.to_owned()).chain(figures));
}

/// The distribution of times in microseconds, which totals and averages do not show.
pub fn medians(measurements: &Measurements) -> Table {
    let header = [
        "us an edit",
        "median",
        "99th percentile",
        "longest",
        "CPU, median",
        "average of medians",
        "longest of medians",
    ];
    let mut table = Table::new("How times are spread", header);
    let mut row = |measured: &Measured, how: &str, seconds: &[Vec<f64>], processor: &[Vec<f64>]| {
        let all = Statistics::of(seconds);
        let by_edit = Statistics::of(&[stats::by_edit(processor)]);
        let processor = Statistics::of(processor);
        let figures = [all.median, all.p99, all.max, processor.median, by_edit.average, by_edit.max];
        let figures = figures.iter().map(|seconds| format!("{:.1}", seconds * 1e6));
        let name = format!("{}, {}{how}", measured.subject.title(), measured.run.title());
        table.row(std::iter::once(name).chain(figures));
    };
    for measured in &measurements.measured {
        row(measured, "", &measured.repeats, &measured.processor);
        if let (Subject::Hybrid { .. }, Run::First, [_, ..]) =
            (measured.subject, measured.run, &measured.alone[..])
        {
            let (seconds, processor) = alone(measured, measurements.setup.threads);
            row(measured, ", alone", &seconds, &processor);
        }
    }
    table.note = "The last three columns are CPU time, which leaves out what else the machine did meanwhile; the last \
                  two take each edit with its median over the repeats. \"Alone\": in processes that play one test each, one \
                  for each repeat, where nothing was allocated before; n/a where none could be started."
        .into();
    table
}
