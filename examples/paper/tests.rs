//! Tests of the experiment at a small size.

use std::fs;
use std::path::PathBuf;

use bevy_burrow::prelude::{Edit, Operation};
use clap::{CommandFactory, Parser};

use crate::alone::Alone;
use crate::backend::{Backend, NoBackend};
use crate::compare::{self, Ground, Surface};
use crate::edits::{Run, Scene};
use crate::full::{DenseField, FullWorld, Output};
use crate::machine::Machine;
use crate::measure::{Measurements, measure};
use crate::published::{self, CHUNK_SIZES};
use crate::setup::{Setup, Subject};
use crate::stats::{self, Statistics};
use crate::{Args, play, plots, publish, report, write};

const SMALL: Setup = Setup { side: 72, edits: 10, repeats: 2, threads: 1, seed: 7 };

fn measurements() -> Measurements {
    // Without CUDA on any machine, so that pages and tables are the same everywhere.
    let mut all =
        measure(SMALL, vec![(Backend::Cuda, NoBackend("CUDA"))], || ()).expect("a small experiment");
    // The test program cannot play a single test in a separate process, so this process does.
    assert!(all.measured.iter().all(|measured| measured.alone.is_empty()));
    for measured in &mut all.measured {
        let alone = (0..2).map(|_| Alone::here(measured.subject, &SMALL).expect("a small experiment"));
        measured.alone = alone.map(|alone| alone.of(measured.run).clone()).collect();
    }
    all
}

/// A temporary folder that is removed when dropped.
struct TempFolder(PathBuf);

impl TempFolder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("bevy_burrow-paper-{}-{name}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder for temporary files");
        Self(folder)
    }
}

impl Drop for TempFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_seed_determines_the_experiment() {
    let scene = |seed| Scene::new(72, 30, seed).expect("valid hills");
    for run in Run::BOTH {
        assert_eq!(scene(7).brushes(run), scene(7).brushes(run));
        assert_ne!(scene(7).brushes(run), scene(8).brushes(run));
    }
    assert_eq!(scene(7).ground, scene(7).ground);
    assert_ne!(scene(7).ground, scene(8).ground);
}

#[test]
fn the_hundred_edits_are_valid_of_both_kinds_and_all_shapes() {
    let scene = Args::parse_from(["paper"]).setup().scene().expect("the full size");
    assert_eq!((scene.ground.width(), scene.ground.depth()), (255, 255));
    let brushes = scene.brushes(Run::First);
    assert_eq!(brushes.len(), 100);
    assert!((35..=65).contains(&scene.digs()), "{}", scene.digs());
    let mut kinds: Vec<_> = brushes.iter().map(|brush| std::mem::discriminant(&brush.shape)).collect();
    kinds.dedup();
    assert!(kinds.len() > 30, "shapes take turns");
    for brush in &brushes {
        let reach = Edit::quantize(brush).expect("a valid brush").reach();
        assert!(reach.min.min_element() > 0 && reach.max.max_element() < 255, "{reach:?} leaves the field");
    }
    let (steep, steepest) = scene.steepness();
    assert!((0.05..0.5).contains(&steep) && steepest > 1.5, "{steep} {steepest}");
}

#[test]
fn the_second_run_reverses_the_first_at_the_same_places() {
    let scene = Scene::new(72, 30, 7).expect("valid hills");
    for (first, second) in scene.brushes(Run::First).iter().zip(scene.brushes(Run::Second)) {
        assert_eq!((first.shape, first.tag), (second.shape, second.tag));
        assert_ne!(first.operation == Operation::Dig, second.operation == Operation::Dig);
    }
}

#[test]
fn statistics_of_a_known_list() {
    let repeats = [vec![4.0, 1.0, 3.0], vec![2.0, 5.0, 9.0]];
    let expected = Statistics { total: 12.0, average: 4.0, max: 9.0, min: 1.0, median: 3.5, p99: 9.0 };
    assert_eq!(Statistics::of(&repeats), expected);
    assert_eq!(stats::by_edit(&repeats), [3.0, 3.0, 6.0]);
    assert_eq!([stats::median([]), stats::median([3.0, 1.0, 2.0])], [0.0, 2.0]);
    let nothing = Statistics { total: 0.0, average: 0.0, max: 0.0, min: 0.0, median: 0.0, p99: 0.0 };
    assert_eq!(Statistics::of(&[]), nothing);
}

#[test]
fn the_papers_averages_are_hundredths_of_their_totals() {
    let columns = || {
        let of = |backend| Run::BOTH.map(|run| published::hybrid(backend, run));
        let full = Run::BOTH.map(published::full);
        Backend::ALL.into_iter().flat_map(of).flatten().chain(full)
    };
    let odd = columns().filter(|column| (column.total / 100.0 - column.average).abs() > 1.5e-6);
    // Except for three averages of the paper: Table 3, chunk size 100; Table 4, chunk size 50; Table 5, second run.
    assert_eq!(odd.map(|column| column.total).collect::<Vec<_>>(), [7.212891, 2.350781, 29.792974]);
    assert!(columns().all(|column| column.min < column.average && column.average < column.max));
}

#[test]
fn every_run_changes_the_ground_and_ends_equal_for_all_chunk_sizes() {
    let measurements = measurements();
    let mut hashes = Vec::new();
    for run in Run::BOTH {
        let runs = measurements.hybrid(Backend::Cpu, run);
        assert_eq!(runs.len(), CHUNK_SIZES.len());
        for measured in runs {
            assert_eq!(measured.repeats.iter().map(Vec::len).collect::<Vec<_>>(), [SMALL.edits; 2]);
            assert_eq!((measured.unchanged, measured.undrawn), (0, 0), "{:?} {run:?}", measured.subject);
            let world = measured.ending.world.expect("a hybrid");
            assert!(world.is_flawless);
            hashes.push(world.hash);
        }
        for output in Output::BOTH {
            let full = measurements.get(Subject::Full(output), run).expect("a full field");
            assert_eq!(full.unchanged, 0);
            hashes.extend(full.ending.world.map(|world| world.hash));
        }
    }
    hashes.dedup();
    assert_eq!(hashes.len(), 2, "one hash for each run");
    assert_eq!(report::faults(&measurements), Vec::<String>::new());
}

#[test]
fn dense_field_and_hybrid_are_solid_at_the_same_points() {
    let scene = SMALL.scene().expect("valid hills");
    let mut field = DenseField::new(&scene.ground).expect("a cube");
    let mut terrain = scene.terrain(25).expect("a valid chunk size");
    let same = Ground { points: 72 * 72 * 72, ..Ground::default() };
    for run in Run::BOTH {
        assert_eq!(Ground::compare(&field, terrain.world()), same);
        terrain.apply(scene.brushes(run));
        let apart = Ground::compare(&field, terrain.world());
        assert!(apart.otherwise_solid > 100 && apart.otherwise_dense > 100, "the comparison sees no edits");
        play::bare(&mut field, &scene.brushes(run)).expect("valid brushes");
        assert_eq!(Ground::compare(&field, terrain.world()), same);
    }
}

#[test]
fn the_full_field_draws_the_hybrids_triangles_and_is_closed() {
    let scene = SMALL.scene().expect("valid hills");
    let mut full = FullWorld::new(&scene).expect("valid hills");
    let mut terrain = scene.terrain(25).expect("a valid chunk size");
    let untouched = full.indices().len() / 3;
    assert!(full.check_seams().is_flawless() && untouched > 71 * 71);
    for run in Run::BOTH {
        terrain.apply(scene.brushes(run));
        let apart = Surface::compare(&full, terrain.world());
        assert!(apart.missing > 100 && apart.extra > 100, "the comparison sees no edits: {apart:?}");
        play::same(&mut full, &scene.brushes(run));
        let together = Surface::compare(&full, terrain.world());
        assert!(together.is_the_same() && together.triangles > 1000, "{together:?}");
        assert!(together.triangles < full.indices().len() / 3, "nothing is left to the heightmap");
        assert_eq!(full.world().hash(), terrain.world().hash());
        assert!(full.check_seams().is_flawless());
    }
}

#[test]
fn both_full_fields_have_the_same_number_of_triangles() {
    let scene = SMALL.scene().expect("valid hills");
    let mut field = DenseField::new(&scene.ground).expect("a cube");
    let mut full = FullWorld::new(&scene).expect("valid hills");
    for brush in scene.brushes(Run::First) {
        field.edit(&brush).expect("a valid brush");
        full.edit(&brush);
        assert_eq!(field.mesh().indices.len(), full.indices().len());
        assert_eq!(field.mesh().positions.len(), field.mesh().normals.len());
    }
    let found = compare::all(&scene).expect("valid hills");
    assert!(found.iter().all(|(_, surface)| surface.is_the_same()));
}

#[test]
fn edits_are_cut_into_fifths_by_their_voxels() {
    let voxels: Vec<u64> = (0..100).map(|edit| edit * 37 % 100).collect();
    let parts: Vec<Vec<u64>> =
        report::parts(&voxels).iter().map(|part| part.iter().map(|&edit| voxels[edit]).collect()).collect();
    assert!(parts.len() == 5 && parts[0] == (0..20).collect::<Vec<_>>());
    assert_eq!(parts.concat(), (0..100).collect::<Vec<_>>());
    assert_eq!(report::parts(&[5, 1, 3]).concat(), [1, 2, 0]);
    assert!(report::parts(&[]).is_empty());
}

#[test]
fn tables_have_the_papers_shape_and_the_page_holds_them_all() {
    let measurements = measurements();
    let tables = report::tables(&measurements);
    assert_eq!(tables.len(), 5);
    for (number, table) in (1..).zip(&tables) {
        assert!(table.title.starts_with(&format!("Table {number}: ")), "{}", table.title);
        let columns = if number == 5 { 1 + 2 * 3 } else { 1 + 2 * CHUNK_SIZES.len() };
        assert_eq!(table.header.len(), columns);
        assert!(table.rows.iter().all(|row| row.len() == columns), "{table}");
        let names: Vec<&str> = table.rows.iter().take(5).map(|row| row[0].as_str()).collect();
        let expected = ["Total time, s", "Average time, s", "Max time, s", "Min time, s", "Memory, process"];
        assert_eq!(names, expected);
    }
    assert_eq!(tables[0].rows[0][1], "14.955078");
    assert_eq!(tables[1].rows[4][7], "536,384 K");
    for table in &tables[2..4] {
        assert!(table.rows.iter().all(|row| row[2] == "-"));
        assert_eq!(table.note, "Here: no CUDA backend on this machine.");
    }

    let page = report::document(&measurements, &Machine::here());
    assert!(page.contains(&report::agreement(&measurements)));
    let sizes = report::by_size(&measurements).expect("both were played");
    let others = [&sizes, &report::medians(&measurements), &report::checks(&measurements)];
    for table in tables.iter().chain(others) {
        assert!(page.contains(&table.to_string()), "{} is missing", table.title);
    }
    assert!(page.contains(&report::ratio_table(&report::ratios(&measurements)).to_string()));
    assert!(page.contains("the paper counts 240") && page.contains("Here 24 were run"));
    assert!(!page.contains("FAULTS"));
}

#[test]
fn the_papers_ratios_are_those_of_its_text() {
    let ratios = report::ratios(&measurements());
    let paper = |what: &str| {
        let ratio = ratios.iter().find(|ratio| ratio.what.starts_with(what)).expect("the ratio");
        assert!(ratio.here.is_some_and(f64::is_finite), "{what}");
        ratio.paper.expect("a figure of the paper")
    };
    // 3138 %.
    assert!((paper("full over hybrid 25, same output, total") - 31.38).abs() < 0.01);
    assert!((paper("chunk size 100 over 25") - 3.84).abs() < 0.01);
    assert!(
        (paper("first over second run, each process alone, average, chunk size 25") - 15.76).abs() < 0.01
    );
    let gpu = ratios.iter().filter(|ratio| ratio.what.starts_with("GPU over CPU"));
    assert!(gpu.clone().count() == 8 && gpu.clone().all(|ratio| ratio.here.is_none()));
    assert!(gpu.clone().all(|ratio| ratio.paper.is_some_and(|ratio| ratio > 1.0)), "the GPU always lost");
}

#[test]
fn everything_is_written_and_published() {
    let temp = TempFolder::new("files");
    let (out, results) = (temp.0.join("out"), temp.0.join("docs/RESULTS.md"));
    let measurements = measurements();
    write(&measurements, &Machine::here(), &out).expect("a writable folder");
    publish(&out, &results).expect("a writable folder");

    // The page may be published where it was written.
    publish(&out, &out.join("RESULTS.md")).expect("a writable folder");

    let csv = fs::read_to_string(out.join("timings.csv")).expect("timings");
    assert_eq!(csv.lines().count(), 1 + SMALL.tests(1) * SMALL.edits);
    assert!(csv.lines().skip(1).all(|line| line.split(',').count() == 6));
    let summary = fs::read_to_string(out.join("summary.json")).expect("a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("valid JSON");
    assert_eq!(summary["runs"].as_array().map(Vec::len), Some(12));
    assert_eq!(summary["dense_field_against_hybrid"][1]["otherwise_dense"], 0);
    assert_eq!(summary["full_field_against_hybrid"][1]["missing"], 0);

    let page = fs::read_to_string(&results).expect("the page");
    assert_eq!(fs::read_to_string(out.join("RESULTS.md")).expect("the page"), page);
    for (file, _) in plots::PLOTS {
        let plot = fs::read_to_string(temp.0.join("docs/plots").join(file)).expect("a plot");
        assert!(plot.starts_with("<svg") && plot.trim_end().ends_with("</svg>") && plot.len() < 100_000);
        assert!(page.contains(&format!("(plots/{file})")));
    }
}

#[test]
fn the_process_reports_its_memory() {
    let hybrid = Subject::Hybrid { backend: Backend::Cpu, chunk_size: 25 };
    for subject in Output::BOTH.map(Subject::Full).into_iter().chain([hybrid]) {
        let alone = Alone::here(subject, &SMALL).expect("a small experiment");
        let Alone { start, first, second } = &alone;
        let known = [*start, first.resident, second.resident].map(|figure| figure.is_some());
        assert_eq!(known, [cfg!(target_os = "linux"); 3]);
        assert_eq!([first, second].map(|run| run.laps.len()), [SMALL.edits; 2]);
        assert!(first.laps.iter().chain(&second.laps).all(|lap| lap.seconds > 0.0));
        assert_eq!(subject.key().parse(), Ok(subject));
    }
    let on_a_card = Subject::Hybrid { backend: Backend::Cuda, chunk_size: 25 };
    assert_eq!(Alone::here(on_a_card, &SMALL).is_err(), Backend::Cuda.open().is_err());
}

#[test]
fn bad_arguments_are_refused() {
    Args::command().debug_assert();
    for line in [
        &["paper", "--repeats", "0"][..],
        &["paper", "--threads", "0"],
        &["paper", "--threads", "-1"],
        &["paper", "--quick", "--repeats", "3"],
        &["paper", "--alone", "cpu_26"],
        &["paper", "--chunk-size", "25"],
    ] {
        assert!(Args::try_parse_from(line).is_err(), "{line:?}");
    }
    assert_eq!(Args::parse_from(["paper"]).setup().repeats, 10);
    assert_eq!(Args::parse_from(["paper", "--quick"]).setup().repeats, 1);
}
