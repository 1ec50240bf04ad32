//! The document: tables, ratios, checks and plots on one page of Markdown.

use std::fmt::Write;

use super::markdown::thousands;
use super::ratios::FASTER;
use super::{agreement, by_size, checks, medians, ratio_table, ratios, tables};
use crate::backend::Backend;
use crate::clock;
use crate::edits::Run;
use crate::full::Output;
use crate::machine::Machine;
use crate::measure::Measurements;
use crate::plots::PLOTS;
use crate::published;
use crate::setup::Subject;
use crate::stats;

/// The whole page.
pub fn document(measurements: &Measurements, machine: &Machine) -> String {
    let mut page = String::new();
    // Writing to a string never fails.
    let _ = write(&mut page, measurements, machine);
    page
}

fn write(page: &mut String, measurements: &Measurements, machine: &Machine) -> std::fmt::Result {
    writeln!(
        page,
        "# Results\n\n\
         The experiment of P. Andersson and S. Johansson, *Rendering with Marching Cubes, looking at Hybrid Solutions* \
         (2012), done again with this crate. Written by `make paper`; nothing here is typed by hand.\n"
    )?;
    if !machine.is_optimised {
        writeln!(page, "**This is not a release build: its times mean nothing.**\n")?;
    }
    machines(page, measurements, machine)?;
    experiment(page, measurements)?;

    writeln!(page, "## Ratios\n\n{}", ratio_table(&ratios(measurements)))?;
    writeln!(
        page,
        "The machines are more than a decade apart and the programs have nothing in common, so seconds do not compare; \
         ratios do, each taken on one machine between programs of one hand. \"Here\" takes totals and averages of all \
         repeats, as the paper does, and medians of edits from each edit's median; {} The paper states the first ratio as 3138 %. Its first run costs more than its second \
         because fields are allocated; how much more depends on the chunk size.\n",
        if clock::IS_KNOWN && measurements.setup.threads == 1 {
            "\"CPU time\" is the same by what the CPU spent on each edit, the median of its repeats. On a busy \
             machine a long edit waits for others more often than a short one, so the passing time flatters the hybrid; \
             targets are judged by CPU time."
        } else {
            "\"CPU time\" is not known here: it is the passing time of each edit, the median of its repeats."
        }
    )?;
    gains(page, measurements)?;

    writeln!(page, "## Tables 1 to 5\n")?;
    writeln!(
        page,
        "Total: mean of the repeats; average: of all edits and repeats; max and min: of all single edits. The paper's \
         clock ticks about every 2 ms, hence its zeros. \"Memory, process\" is the resident set of a process that runs \
         this one test and nothing else{}; \"terrain data\" is ground, samples, index and surface parts as the library \
         counts them, for the full field with positions and normals only its samples; \"undo history\" is what a terrain \
         keeps besides, up to a budget, to take edits back. The full field with the same output \
         has made and given back a world painted all over before its first edit, to get a mask of all cells; its process \
         may still hold some of that memory.\n",
        if measurements.measured.iter().any(|measured| measured.resident().is_none()) {
            " (n/a where the system does not tell)"
        } else {
            ""
        }
    )?;
    for table in tables(measurements) {
        writeln!(page, "{table}")?;
    }
    writeln!(page, "{}", medians(measurements))?;

    writeln!(page, "## Checks\n\n{}", checks(measurements))?;
    writeln!(page, "{}", agreement(measurements))?;
    scenarios(page, measurements)?;

    writeln!(page, "## Plots\n")?;
    for (file, title) in PLOTS {
        writeln!(page, "![{title}](plots/{file})\n")?;
    }
    differences(page)
}

/// Background figures for the ratios of full field and hybrid.
fn gains(page: &mut String, measurements: &Measurements) -> std::fmt::Result {
    for output in Output::BOTH {
        let Some(full) = measurements.get(Subject::Full(output), Run::Second) else { continue };
        let median = stats::median(stats::by_edit(&full.processor));
        writeln!(
            page,
            "- Full field, {}: an edit takes {:.1} ms of the CPU in the median, so that {FASTER:.0} times faster means {:.0} us.",
            output.title(),
            median * 1e3,
            median * 1e6 / FASTER
        )?;
    }
    if let Some(table) = by_size(measurements) {
        writeln!(page, "\n{table}")?;
    }
    writeln!(page)
}

/// Voxels that each edit of the second run digs or fills.
fn voxels(measurements: &Measurements) -> Option<&[u64]> {
    let hybrid = measurements.hybrid(Backend::Cpu, Run::Second);
    Some(&hybrid.first()?.voxels)
}

/// The sizes of the edits.
fn sizes(measurements: &Measurements) -> String {
    let tenths =
        |values: Vec<f64>| [0, 10, 50, 90, 100].map(|percent| stats::percentile_of(&values, percent));
    let [least, low, middle, high, most] = tenths(measurements.sizes.clone());
    let mut text = format!(
        "Their size is evenly spread: the radius of a ball, the longest half side of a box, half of the axis of a capsule \
         or cylinder is {least:.1} to {most:.1} voxels, {middle:.1} in the median, {low:.1} to {high:.1} for 80 % of them."
    );
    if let Some(voxels) = voxels(measurements) {
        let voxels = voxels.iter().map(|&voxels| voxels as f64).collect();
        let [least, low, middle, high, most] = tenths(voxels).map(|voxels| thousands(voxels as u64));
        text += &format!(
            " In the second run an edit digs or fills {least} to {most} voxels, {middle} in the median, {low} to {high} for \
             80 % of them."
        );
    }
    text
}

fn machines(page: &mut String, measurements: &Measurements, machine: &Machine) -> std::fmt::Result {
    let Machine { cpu, threads, system, rustc, .. } = machine;
    let used = match measurements.setup.threads {
        1 => "1 thread".to_owned(),
        threads => format!("{threads} threads"),
    };
    writeln!(page, "| | CPU | edits run on | system | compiler |\n| --- | --- | --- | --- | --- |")?;
    writeln!(page, "| paper | {} | not stated | Windows 7 | not stated |", published::MACHINE)?;
    writeln!(page, "| here | {cpu}, {threads} threads | {used} | {system} | {rustc} |\n")
}

fn experiment(page: &mut String, measurements: &Measurements) -> std::fmt::Result {
    let setup = &measurements.setup;
    let (steep, steepest) = measurements.steepness;
    let side = setup.side;
    writeln!(page, "## The experiment\n")?;
    writeln!(
        page,
        "- **Terrain**: {side} x {side} columns of noise with the seed {}; {:.0} % of them are steeper than 45 degrees, \
         the steepest rises {steepest:.1} voxels a voxel.",
        setup.seed,
        steep * 100.0
    )?;
    writeln!(
        page,
        "- **Edits**: {}, {} of which dig and the others build: balls, boxes, turned boxes, capsules and cylinders across \
         the surface. {}",
        setup.edits,
        measurements.digs,
        sizes(measurements)
    )?;
    writeln!(
        page,
        "- **First run**: the terrain is not edited yet, nothing is allocated. **Second run**: the same shapes at the same \
         places with the polarity reversed. A second dig of the same hole would change nothing here and cost next to \
         nothing; reversed, each edit changes samples and meshes that are there already. The table of checks counts those \
         that did not; none is left out of the times. The ratio of both runs comes from processes that play one test and \
         nothing else, so that their first edits find no memory that another test used."
    )?;
    writeln!(
        page,
        "- **One edit is timed** as in the paper, from its start to the meshes: brush checked, samples and fields changed, \
         vertex and index buffers of every changed chunk filled, and index list and rings of every changed tile, whose \
         other vertices no edit moves; world committed. Drawing is not part of it."
    )?;
    writeln!(
        page,
        "- **Full field, same output** (Table 5, ratios with a target): the whole terrain is marching cubes from the start. \
         An edit is the same transaction as the hybrid's; then every block of the cube of {side}^3 samples is meshed again \
         by the hybrid's own mesher into one vertex and one index buffer, which are kept: integer positions, materials, the \
         heightmap's normals where nothing was edited. The few blocks that the transaction meshes for itself are timed as \
         well."
    )?;
    writeln!(
        page,
        "- **Full field, positions and normals only** (for comparison): one cube of {side}^3 samples of 16 bits that holds the \
         same ground. An edit changes only the samples in its reach; then the whole mesh is made again by the library's \
         dense mesher into buffers that are kept: positions and gradient normals in floats, nothing else."
    )?;
    if setup.threads > 1 {
        writeln!(
            page,
            "- **Threads**: the hybrid may use all of its threads, the full fields are meshed by one."
        )?;
    }
    let ours = setup.tests(Backend::ALL.len() - measurements.missing.len());
    writeln!(
        page,
        "- **Tests**: the paper counts {} (4 scenarios x CPU, GPU and full field x 2 runs x {} repeats). Here {ours} were \
         run: {} of each run, and each full field once for all chunk sizes, as it has none.",
        published::TESTS,
        published::REPEATS,
        if setup.repeats == 1 { "1 repeat".into() } else { format!("{} repeats", setup.repeats) }
    )?;
    if measurements.missing.iter().all(|(backend, _)| *backend != Backend::Cuda) {
        writeln!(
            page,
            "- **GPU**: every edit is applied and meshed on the GPU, the smallest too. The paper's GPU lost to its CPU in \
             every test because each call sent the whole field over and the mesh back, and waited. Here bricks and heights \
             stay on the GPU: an edit sends a list of jobs, some kilobytes, and two launches write what changed, samples, \
             vertices and indices, straight into memory that the CPU reads. Two round trips an edit remain \
             of the old cost, which pay for large edits but not for small ones; the ratios below show the result. A game leaves that choice to `Backend::Auto`; here it is not made, so that the columns compare."
        )?;
    }
    for (backend, reason) in &measurements.missing {
        writeln!(
            page,
            "- **{}**: {reason}; Tables 3 and 4 show the paper's figures alone.",
            backend.title()
        )?;
    }
    writeln!(page)
}

fn scenarios(page: &mut String, measurements: &Measurements) -> std::fmt::Result {
    let header = ["chunk size", "1 created", "2 changed", "3 extended", "4 merged", "5 split over chunks"];
    let mut table = super::Table::new("The paper's scenarios in the first run, chunk by chunk", header);
    for (chunk_size, counts) in &measurements.scenarios {
        let figures = [counts.created, counts.changed, counts.extended, counts.merged, counts.split];
        table.row(std::iter::once(chunk_size.to_string()).chain(figures.map(|count| count.to_string())));
    }
    writeln!(page, "{table}")
}

/// The differences between the compared programs, so that readers can judge the fairness of the comparison.
fn differences(page: &mut String) -> std::fmt::Result {
    writeln!(
        page,
        "## What is not alike\n\n\
         - The full field with the same output holds the ground as the hybrid does: samples that nobody edited are not \
         stored, but computed from the heights when they are meshed.\n\
         - The hybrid does more for a vertex than the full field with positions and normals only: it brings materials, takes \
         the normals of the heightmap where a seam lies, rebuilds the index lists of tiles, and answers with a receipt and \
         the scenarios of its fields. That field's samples change in the edit's reach only. All of that favours it.\n\
         - The buffers of both full fields are never allocated again; the hybrid's meshes are new ones with each edit, as \
         the caller keeps them.\n\
         - The heightmap around the edits is drawn by the hybrid as well, but no edit makes it again; that is the point of \
         the method, the paper's as ours.\n\
         - The paper repeats its edits with the same polarity in the second run as far as one can tell; here it is \
         reversed, see above.\n\
         - The paper tells neither its terrain's size nor its edits' sizes, but that the full field has the chunk size \
         256."
    )
}
