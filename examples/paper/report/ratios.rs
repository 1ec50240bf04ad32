//! Ratios: the paper's conclusions from its tables, and the targets of this reproduction.

use super::markdown::{Table, significant};
use crate::backend::Backend;
use crate::edits::Run;
use crate::ending::Ending;
use crate::full::Output;
use crate::measure::{Measured, Measurements, both_clocks};
use crate::published::{self, CHUNK_SIZES};
use crate::setup::Subject;
use crate::stats::{self, Statistics};

/// How many times faster an edit of the hybrid must be than one of the full field, in the median.
pub const FASTER: f64 = 300.0;

/// The target of a ratio.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    AtLeast(f64),
    AtMost(f64),
}

/// One line of the comparison.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Ratio {
    pub what: String,
    pub paper: Option<f64>,
    /// From totals and averages, as in the paper.
    pub here: Option<f64>,
    /// From CPU time: the median of each edit's repeats.
    pub by_processor: Option<f64>,
    pub target: Option<Target>,
}

impl Ratio {
    /// Whether the target is reached, by CPU time if available. `None` without a target or a figure.
    pub fn is_met(&self) -> Option<bool> {
        let here = self.by_processor.or(self.here)?;
        Some(match self.target? {
            Target::AtLeast(least) => here >= least,
            Target::AtMost(most) => here <= most,
        })
    }
}

/// The average time of an edit in two ways: over all timings, and over each edit's median CPU time.
#[derive(Clone, Copy)]
struct Averages {
    plain: f64,
    medians: f64,
}

impl Averages {
    fn of(seconds: &[Vec<f64>], processor: &[Vec<f64>]) -> Self {
        Self {
            plain: Statistics::of(seconds).average,
            medians: Statistics::of(&[stats::by_edit(processor)]).average,
        }
    }
}

/// Timings from the separate processes: seconds of each edit by repeat, and the same in CPU time.
pub fn alone(measured: &Measured, threads: usize) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    measured.alone.iter().map(|alone| both_clocks(&alone.laps, threads)).unzip()
}

/// Every ratio in the paper, and those with a target.
pub fn ratios(measurements: &Measurements) -> Vec<Ratio> {
    let cpu = |chunk_size| Subject::Hybrid { backend: Backend::Cpu, chunk_size };
    let averages = |subject, run| {
        let measured = measurements.get(subject, run)?;
        Some(Averages::of(&measured.repeats, &measured.processor))
    };
    let averages_alone = |subject, run| {
        let measured = measurements.get(subject, run).filter(|measured| !measured.alone.is_empty())?;
        let (seconds, processor) = alone(measured, measurements.setup.threads);
        Some(Averages::of(&seconds, &processor))
    };
    let divide = |what: String, paper, above: Option<Averages>, below: Option<Averages>, target| {
        let both = above.zip(below);
        Ratio {
            what,
            paper,
            here: both.map(|(above, below)| above.plain / below.plain),
            by_processor: both.map(|(above, below)| above.medians / below.medians),
            target,
        }
    };
    let paper = |backend, run, at: usize| published::hybrid(backend, run)[at];
    let (first, second) = (Run::First, Run::Second);
    let mut ratios = Vec::new();

    let paper_full = published::full(second).total;
    for (at, chunk_size) in CHUNK_SIZES.into_iter().enumerate() {
        for output in Output::BOTH {
            ratios.push(divide(
                format!("full over hybrid {chunk_size}, {}, total, second run", output.title()),
                // The paper has a single full field, with the same output as its hybrid.
                (output == Output::Same).then(|| paper_full / paper(Backend::Cpu, second, at).total),
                averages(Subject::Full(output), second),
                averages(cpu(chunk_size), second),
                None,
            ));
        }
    }
    let both = |all: Option<[Vec<f64>; 2]>, figure: &dyn Fn(Vec<f64>) -> f64| match all {
        Some(all) => all.map(|all| Some(figure(all))),
        None => [None; 2],
    };
    let target = |output| (output == Output::Same).then_some(Target::AtLeast(FASTER));
    for chunk_size in CHUNK_SIZES {
        for output in Output::BOTH {
            let all = by_edit(measurements, Subject::Full(output), cpu(chunk_size));
            let [here, by_processor] = both(all, &|all| stats::median(all));
            let what =
                format!("full over hybrid {chunk_size}, {}, median of edits, second run", output.title());
            ratios.push(Ratio { what, paper: None, here, by_processor, target: target(output) });
        }
    }
    let growth = |backend| {
        let average = |at| paper(backend, second, at).average;
        Some(average(3) / average(0))
    };
    ratios.push(divide(
        "chunk size 100 over 25, average, second run".into(),
        growth(Backend::Cpu),
        averages(cpu(100), second),
        averages(cpu(25), second),
        Some(Target::AtMost(1.3)),
    ));
    for (at, chunk_size) in CHUNK_SIZES.into_iter().enumerate() {
        ratios.push(divide(
            format!("first over second run, each process alone, average, chunk size {chunk_size}"),
            Some(paper(Backend::Cpu, first, at).average / paper(Backend::Cpu, second, at).average),
            averages_alone(cpu(chunk_size), first),
            averages_alone(cpu(chunk_size), second),
            Some(Target::AtMost(1.5)),
        ));
    }
    for run in Run::BOTH {
        for (at, chunk_size) in CHUNK_SIZES.into_iter().enumerate() {
            ratios.push(divide(
                format!("GPU over CPU, total, chunk size {chunk_size}, {}", run.title()),
                Some(paper(Backend::Cuda, run, at).total / paper(Backend::Cpu, run, at).total),
                averages(Subject::Hybrid { backend: Backend::Cuda, chunk_size }, run),
                averages(cpu(chunk_size), run),
                Some(Target::AtMost(1.0)),
            ));
        }
    }
    for chunk_size in CHUNK_SIZES {
        let here = measurements.get(cpu(chunk_size), first);
        let bytes = |ending: &Ending| ending.data_bytes() + ending.undo_bytes();
        let here = here.map(|measured| bytes(&measured.ending) as f64 / 1e6);
        ratios.push(Ratio {
            what: format!("terrain data and undo history after the first run, MB, chunk size {chunk_size}"),
            paper: None,
            here,
            by_processor: None,
            target: Some(Target::AtMost(20.0)),
        });
    }
    ratios
}

/// For each edit of the second run, the ratio of its median times in two tests: by wall clock and by CPU time.
pub fn by_edit(measurements: &Measurements, above: Subject, below: Subject) -> Option<[Vec<f64>; 2]> {
    let (above, below) = (measurements.get(above, Run::Second)?, measurements.get(below, Run::Second)?);
    let divide = |of: fn(&Measured) -> &[Vec<f64>]| {
        let (above, below) = (stats::by_edit(of(above)), stats::by_edit(of(below)));
        above.iter().zip(below).map(|(above, below)| above / below).collect()
    };
    Some([divide(|measured| &measured.repeats), divide(|measured| &measured.processor)])
}

/// The ratios as a table.
pub fn table(ratios: &[Ratio]) -> Table {
    let header = ["ratio", "paper", "here", "here, CPU time", "target", "reached"];
    let mut table = Table::new("Paper and reproduction", header);
    for ratio in ratios {
        let figure = |value: Option<f64>| value.map_or("-".into(), significant);
        let target = ratio.target.map_or("-".into(), |target| match target {
            Target::AtLeast(least) => format!(">= {least}"),
            Target::AtMost(most) => format!("<= {most}"),
        });
        let reached = match ratio.is_met() {
            Some(true) => "yes",
            Some(false) => "no",
            None => "-",
        };
        table.row([
            ratio.what.clone(),
            figure(ratio.paper),
            figure(ratio.here),
            figure(ratio.by_processor),
            target,
            reached.into(),
        ]);
    }
    table
}
