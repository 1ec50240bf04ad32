//! Dense meshing compared with public crates: `cargo bench --no-default-features --bench meshers`.
//!
//! Equal grids in one process, on one thread, in turns: see [`timing`]. Before timing, the meshes of closed grids
//! and of the first chunks of the streams are checked: see [`check`]. Then single grids are meshed repeatedly, which
//! keeps caches warm, and after that streams of different chunks, as in a game. Ratios are paired, round by round or
//! chunk by chunk.
//!
//! | module | subject |
//! | --- | --- |
//! | [`fields`] | what is meshed |
//! | [`contender`] | the interface of a contender, and the contents of its meshes |
//! | [`ours`], [`fast_surface_nets`], [`transvoxel`], [`mcubes`], [`isosurface`] | the contenders |
//! | [`registry`] | their lists |
//! | [`topology`], [`check`] | checks of the meshes |
//! | [`timing`], [`table`], [`targets`] | timings |
//! | [`export`], [`serve`] | the same for programs in other languages |

mod bricks;
mod check;
mod contender;
mod export;
mod fast_surface_nets;
mod fields;
mod isosurface;
mod mcubes;
mod ours;
mod registry;
mod serve;
mod table;
mod targets;
mod timing;
mod topology;
mod transvoxel;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use serde::Serialize;

use check::Finding;
use fields::{Border, Field};
use table::{Input, Row};
use targets::Target;
use timing::RoundLimits;

/// Times dense meshing with this crate and with public crates on the same grids.
#[derive(Parser)]
struct Args {
    /// Few rounds and short streams
    #[arg(long)]
    quick: bool,
    /// Fields to mesh
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = Field::ALL)]
    fields: Vec<Field>,
    /// Samples along a grid's side
    #[arg(long, value_delimiter = ',', default_values_t = [32, 64, 100, 128], value_parser = sizes)]
    sizes: Vec<usize>,
    /// Chunks of 32^3 cells in each stream; 0 for none
    #[arg(long, value_name = "N")]
    chunks: Option<usize>,
    /// Only check the meshes
    #[arg(long)]
    check: bool,
    /// Where to write all figures
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Only write the grids there, as raw little-endian f32
    #[arg(long, value_name = "DIR")]
    export: Option<PathBuf>,
    /// Only answer requests on standard input; see serve.rs
    #[arg(long)]
    serve: bool,
    /// Passed by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn sizes(text: &str) -> Result<usize, String> {
    let size: usize = text.parse().map_err(|_| "a number of samples".to_string())?;
    if (16..=256).contains(&size) { Ok(size) } else { Err("16 to 256 samples".into()) }
}

/// All figures of a run.
#[derive(Serialize)]
struct Report {
    findings: Vec<Finding>,
    rows: Vec<Row>,
    targets: Vec<Target>,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("meshers: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> std::io::Result<ExitCode> {
    if let Some(folder) = &args.export {
        export::write(folder, &args.fields, &args.sizes)?;
        return Ok(ExitCode::SUCCESS);
    }
    if args.serve {
        serve::run()?;
        return Ok(ExitCode::SUCCESS);
    }
    let findings = check_all(args);
    let are_chunks_right = check_streams(args);
    if findings.iter().any(|finding| finding.fatal) || !are_chunks_right {
        eprintln!("meshers: meshes are wrong, or not of the same surface; nothing is timed");
        return Ok(ExitCode::FAILURE);
    }
    if args.check {
        return Ok(ExitCode::SUCCESS);
    }
    let mut rows = time_grids(args);
    rows.extend(time_streams(args));
    let targets = targets::targets(&rows);
    print!("{}", targets::print(&targets));
    if let Some(file) = &args.json {
        std::fs::write(file, serde_json::to_vec_pretty(&Report { findings, rows, targets })?)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn check_all(args: &Args) -> Vec<Finding> {
    println!("closed grids, before anything is timed");
    let mut all = Vec::new();
    for &field in &args.fields {
        for &size in &args.sizes {
            let findings = check::closed_grid(&mut registry::all(), field, size);
            print!("{}", check::describe(&findings));
            all.extend(findings);
        }
    }
    all
}

/// Number of chunks of each stream that are checked.
const CHECKED: usize = 20;

fn check_streams(args: &Args) -> bool {
    let mut is_right = true;
    for &field in &args.fields {
        let chunks = timing::chunks(field, CHECKED);
        let remarks = |chunk| check::chunk(&mut registry::of_streams(), chunk);
        let remarks: Vec<String> = chunks.iter().flat_map(remarks).collect();
        println!("  {:<8} {CHECKED} chunks of the stream: {} faults", field.name(), remarks.len());
        remarks.iter().for_each(|remark| println!("      WRONG {remark}"));
        is_right &= remarks.is_empty();
    }
    is_right
}

fn time_grids(args: &Args) -> Vec<Row> {
    let limits = if args.quick {
        RoundLimits { least: 5, most: 21, budget: Duration::from_millis(300) }
    } else {
        RoundLimits { least: 15, most: 201, budget: Duration::from_secs(4) }
    };
    let mut all = Vec::new();
    for &field in &args.fields {
        for &size in &args.sizes {
            let grid = field.grid(size, Border::Cut);
            let times = timing::one_grid(&mut registry::all(), &grid, limits);
            let rows = table::rows(field, Input::Grid(size), grid.cells(), &times);
            print!("{}", table::print(&rows, grid.cells()));
            all.extend(rows);
        }
    }
    all
}

fn time_streams(args: &Args) -> Vec<Row> {
    let count = args.chunks.unwrap_or(if args.quick { 100 } else { 1000 });
    let mut all = Vec::new();
    if count == 0 {
        return all;
    }
    for &field in &args.fields {
        let chunks = timing::chunks(field, count);
        let megabytes = chunks.iter().map(fields::Grid::bytes).sum::<usize>() as f64 / 1e6;
        let times = timing::stream(&mut registry::of_streams(), &chunks);
        let cells = timing::CHUNK_CELLS.pow(3);
        let rows = table::rows(field, Input::Stream(count), cells, &times);
        print!("{}", table::print(&rows, cells));
        println!("    {megabytes:.0} MB of samples, f32 and i16 together");
        all.extend(rows);
    }
    all
}
