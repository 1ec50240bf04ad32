//! Reproduces the experiment of the paper behind this crate: P. Andersson and S. Johansson, *Rendering with Marching
//! Cubes, looking at Hybrid Solutions* (2012), Tables 1 to 5. Does not use Bevy.
//!
//! ```text
//! cargo run --release --no-default-features --example paper -- --out out/paper --results docs/RESULTS.md
//! ```
//!
//! A hundred edits on a terrain of 256 x 256 columns, in chunks of 25, 50, 75 and 100 cells and as one field of
//! marching cubes; a first run on untouched ground, a second one at the same places. It writes to `--out`:
//!
//! | file | what it holds |
//! | --- | --- |
//! | `timings.csv` | each single timing |
//! | `summary.json` | machine, statistics, checks, ratios |
//! | `RESULTS.md` | all tables, compared with the paper's figures |
//! | `plots/*.svg` | the plots that the page shows |
//!
//! It fails if a check fails: seams, equal worlds for all chunk sizes, ground and surface of the full fields against
//! the hybrid. If all checks pass, `--results` also copies the page there, and the plots into `plots/` next to it.

mod alone;
mod backend;
mod clock;
mod compare;
mod edits;
mod ending;
mod error;
mod full;
mod machine;
mod measure;
mod play;
mod plots;
mod published;
mod report;
mod setup;
mod stats;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};

use alone::Alone;
use error::PaperError;
use machine::Machine;
use measure::{Measurements, measure};
use setup::{Setup, Subject};

/// Reproduces the paper's Tables 1 to 5 and compares them with the paper's figures.
#[derive(Parser)]
struct Args {
    /// Folder for timings, summary, page and plots; created if missing
    #[arg(long, value_name = "DIR", default_value = "out/paper")]
    out: PathBuf,
    /// Writes the page here as well, and the plots next to it
    #[arg(long, value_name = "FILE")]
    results: Option<PathBuf>,
    /// How often each run is repeated
    #[arg(long, value_name = "N", default_value_t = published::REPEATS as u32)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Only one repeat, as a quick check
    #[arg(long, conflicts_with = "repeats")]
    quick: bool,
    /// Threads that edits may use
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=256))]
    threads: u32,
    /// Plays a single test and prints its measurements; the program runs itself with this option
    #[arg(long, hide = true)]
    alone: Option<Subject>,
}

impl Args {
    fn setup(&self) -> Setup {
        Setup {
            side: 256,
            edits: published::EDITS,
            repeats: if self.quick { 1 } else { self.repeats as usize },
            threads: self.threads as usize,
            seed: 2012,
        }
    }
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), PaperError> {
    let setup = args.setup();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(setup.threads).build()?;
    if let Some(subject) = args.alone {
        let alone = pool.install(|| Alone::here(subject, &setup))?;
        println!("{}", serde_json::to_string(&alone)?);
        return Ok(());
    }
    // Check the folders now, before the long measurements.
    let page = args.results.as_deref().map(folder_of);
    [Some(args.out.as_path()), page].into_iter().flatten().try_for_each(try_folder)?;
    let measurements = pool.install(|| {
        let bar = progress_bar(&setup);
        let measured = measure(setup, backend::Backend::missing(), || bar.inc(1));
        bar.finish_and_clear();
        measured
    })?;
    let machine = Machine::here();
    for table in report::tables(&measurements) {
        println!("{table}");
    }
    println!("{}", report::medians(&measurements));
    println!("{}", report::checks(&measurements));
    println!("{}", report::ratio_table(&report::ratios(&measurements)));
    write(&measurements, &machine, &args.out)?;
    // Results are only published if all checks passed.
    let faults = report::faults(&measurements);
    if !faults.is_empty() {
        return Err(PaperError::Faults(faults.join("\n")));
    }
    args.results.as_deref().map_or(Ok(()), |results| publish(&args.out, results))
}

/// A progress bar, which is only drawn between runs.
fn progress_bar(setup: &Setup) -> ProgressBar {
    let backends = backend::Backend::ALL.into_iter().filter(|backend| backend.open().is_ok()).count();
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {elapsed}, {eta} left");
    ProgressBar::new(setup.tests(backends) as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Writes all files into the folder, plots first, as the page refers to them.
fn write(measurements: &Measurements, machine: &Machine, out: &Path) -> Result<(), PaperError> {
    let plots = out.join("plots");
    make_folder(&plots)?;
    plots::draw(measurements, &plots)?;
    write_file(&out.join("timings.csv"), &report::timings(measurements))?;
    let mut summary = serde_json::to_string_pretty(&report::summary(measurements, machine))?;
    summary.push('\n');
    write_file(&out.join("summary.json"), &summary)?;
    write_file(&out.join("RESULTS.md"), &report::document(measurements, machine))
}

/// Copies the page and its plots to their published place.
fn publish(out: &Path, results: &Path) -> Result<(), PaperError> {
    let plots = folder_of(results).join("plots");
    make_folder(&plots)?;
    copy(&out.join("RESULTS.md"), results)?;
    plots::PLOTS.iter().try_for_each(|(file, _)| copy(&out.join("plots").join(file), &plots.join(file)))
}

fn folder_of(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

/// Creates a folder and its `plots` folder, and checks that both are writable.
fn try_folder(folder: &Path) -> Result<(), PaperError> {
    [folder.to_owned(), folder.join("plots")].iter().try_for_each(|folder| {
        make_folder(folder)?;
        let probe = folder.join(format!("paper-{}.tmp", std::process::id()));
        write_file(&probe, "")?;
        fs::remove_file(&probe).map_err(|reason| PaperError::Write { path: probe.clone(), reason })
    })
}

fn make_folder(path: &Path) -> Result<(), PaperError> {
    fs::create_dir_all(path).map_err(|reason| PaperError::Write { path: path.into(), reason })
}

fn write_file(path: &Path, content: &str) -> Result<(), PaperError> {
    fs::write(path, content).map_err(|reason| PaperError::Write { path: path.into(), reason })
}

fn copy(from: &Path, to: &Path) -> Result<(), PaperError> {
    // Copying a file onto itself would empty it.
    if fs::canonicalize(from).ok() == fs::canonicalize(to).ok() {
        return Ok(());
    }
    fs::copy(from, to).map(drop).map_err(|reason| PaperError::Write { path: to.into(), reason })
}
