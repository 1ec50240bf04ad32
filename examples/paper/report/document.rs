//! The document: tables, ratios, checks and plots in one page of Markdown.

use std::fmt::Write;

use super::ratios::FASTER;
use super::{checks, medians, ratio_table, ratios, tables};
use crate::edits::Run;
use crate::machine::Machine;
use crate::measure::{Measurements, Subject};
use crate::mesher;
use crate::plots::PLOTS;
use crate::published;
use crate::stats::Statistics;

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
        writeln!(page, "**This is no release build: its times mean nothing.**\n")?;
    }
    machines(page, measurements, machine)?;
    experiment(page, measurements)?;

    writeln!(page, "## Ratios\n\n{}", ratio_table(&ratios(measurements)))?;
    writeln!(
        page,
        "The machines are more than a decade apart and the programs have nothing in common, so seconds do not compare; \
         ratios do, each taken on one machine between programs of one hand. \"Here\" takes totals and averages of all \
         repeats, as the paper does; \"medians of repeats\" takes each edit with its median, which leaves out what else \
         the machine did meanwhile. The paper states the first ratio as 3138 %. Its first run costs more than its second \
         because fields are allocated; how much more depends on the chunk size."
    )?;
    if let Some(full) = measurements.get(Subject::Full, Run::Second) {
        let median = Statistics::of(&full.repeats).median;
        writeln!(
            page,
            "What the hybrid gains over the full field depends on how well the full field is meshed: here an edit of it takes \
             {:.1} ms, so that {FASTER:.0} times faster means {:.0} us.\n",
            median * 1e3,
            median * 1e6 / FASTER
        )?;
    }

    writeln!(page, "## Tables 1 to 5\n")?;
    writeln!(
        page,
        "Total: mean of the repeats; average: of all edits and repeats; max and min: of all single edits. The paper's \
         clock ticks about every 2 ms, hence its zeros. \"Memory, process\" is the resident set of a process that runs \
         this one test and nothing else{}; \"terrain data\" is ground, samples, index and surface parts as the library \
         counts them.\n",
        if measurements.measured.iter().any(|measured| measured.resident.is_none()) {
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
    scenarios(page, measurements)?;

    writeln!(page, "## Plots\n")?;
    for (file, title) in PLOTS {
        writeln!(page, "![{title}](plots/{file})\n")?;
    }
    differences(page)
}

fn machines(page: &mut String, measurements: &Measurements, machine: &Machine) -> std::fmt::Result {
    let Machine { cpu, threads, system, rustc, .. } = machine;
    let used = match measurements.setup.threads {
        1 => "1 thread".to_owned(),
        threads => format!("{threads} threads"),
    };
    writeln!(page, "| | processor | edits run on | system | compiler |\n| --- | --- | --- | --- | --- |")?;
    writeln!(page, "| paper | {} | not told | Windows 7 | not told |", published::MACHINE)?;
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
        "- **Edits**: {}, {} of which dig and the others build: balls, boxes, turned boxes, capsules and cylinders of 2 to \
         9 voxels (radius or half side) across the surface.",
        setup.edits, measurements.digs
    )?;
    writeln!(
        page,
        "- **First run**: nobody has edited the terrain, nothing is allocated. **Second run**: the same shapes at the same \
         places with the polarity reversed. A second dig of the same hole would change nothing here and cost next to \
         nothing; reversed, each edit changes samples and meshes that are there already. The table of checks counts those \
         that did not; none is left out of the times."
    )?;
    writeln!(
        page,
        "- **One edit is timed** as in the paper, from its start to the meshes: brush checked, samples and fields changed, \
         vertex and index buffers of every changed chunk and tile filled, world committed. Drawing is not part of it."
    )?;
    writeln!(
        page,
        "- **Full field** (Table 5): one cube of {side}^3 samples of 16 bits that holds the same ground. An edit changes \
         only the samples in its reach; then the whole mesh is made again into buffers that are kept, by {}.",
        mesher::DESCRIPTION
    )?;
    let ours = setup.tests(crate::backend::Backend::ALL.len() - measurements.missing.len());
    writeln!(
        page,
        "- **Tests**: the paper counts {} (4 scenarios x CPU, GPU and full field x 2 runs x {} repeats). Here {ours} were \
         run: {} repeats of each run, and the full field once for all chunk sizes, as it has none.",
        published::TESTS,
        published::REPEATS,
        setup.repeats
    )?;
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

/// What is compared with what, for readers who want to know how fair it is.
fn differences(page: &mut String) -> std::fmt::Result {
    writeln!(
        page,
        "## What is not alike\n\n\
         - The hybrid does more for a vertex than the full field: it brings materials, takes the normals of the heightmap \
         where a seam lies, rebuilds the index lists of tiles, and answers with a receipt and the scenarios of its fields. \
         The full field gets positions and gradient normals only, its samples change in the edit's reach only, and its \
         buffers are never allocated again. All of that favours the full field.\n\
         - The heightmap around the edits is drawn by the hybrid as well, but no edit makes it again; that is the point of \
         the method, the paper's as ours.\n\
         - The paper repeats its edits with the same polarity in the second run as far as one can tell; here it is \
         reversed, see above.\n\
         - The paper tells neither its terrain's size nor its edits' sizes, but that the full field has the chunk size \
         256."
    )
}
