//! The experiment: every test of the paper that this machine can run, repeated, with checks after each run.

use bevy_burrow::terrain::{ScenarioCounts, Terrain};

use crate::alone::{Alone, AloneRun};
use crate::backend::{Backend, NoBackend};
use crate::clock::Lap;
use crate::compare::{self, Ground, Surface};
use crate::edits::{Run, Scene};
use crate::ending::Ending;
use crate::error::PaperError;
use crate::full::{DenseField, FullWorld, Output};
use crate::play::{self, Played};
use crate::published::CHUNK_SIZES;
use crate::setup::{Setup, Subject};

/// One run of one subject, with all repeats.
#[derive(Clone, Debug)]
pub struct Measured {
    pub subject: Subject,
    pub run: Run,
    /// Seconds of each edit, by repeat.
    pub repeats: Vec<Vec<f64>>,
    /// CPU seconds of each edit, by repeat. With several threads they are not available, and these are wall-clock
    /// seconds.
    pub processor: Vec<Vec<f64>>,
    /// Voxels that each edit dug or filled; `None` for a dense field.
    pub voxels: Vec<u64>,
    /// Number of edits in one repeat that changed no sample, and that changed no mesh.
    pub unchanged: usize,
    pub undrawn: usize,
    /// This run in separate processes that each play a single test; empty if no process can be started.
    pub alone: Vec<AloneRun>,
    pub ending: Ending,
}

/// All measurements.
pub struct Measurements {
    pub setup: Setup,
    pub measured: Vec<Measured>,
    /// Backends of the paper that are not available.
    pub missing: Vec<(Backend, NoBackend)>,
    /// Comparison of the full fields with the hybrid, after each run.
    pub agreement: [(Ground, Surface); 2],
    /// The paper's five scenarios in the first run, by chunk size.
    pub scenarios: Vec<(u32, ScenarioCounts)>,
    pub digs: usize,
    /// Radius or half extent of each edit.
    pub sizes: Vec<f64>,
    /// Share of columns steeper than 45 degrees, and the steepest slope.
    pub steepness: (f64, f64),
}

impl Measured {
    /// Resident memory in kilobytes of a process after the run.
    pub fn resident(&self) -> Option<u64> {
        self.alone.first()?.resident
    }
}

impl Measurements {
    pub fn get(&self, subject: Subject, run: Run) -> Option<&Measured> {
        self.measured.iter().find(|measured| measured.subject == subject && measured.run == run)
    }

    /// The hybrid's runs on a backend, by chunk size; empty if the backend is missing.
    pub fn hybrid(&self, backend: Backend, run: Run) -> Vec<&Measured> {
        let of = |chunk_size| self.get(Subject::Hybrid { backend, chunk_size }, run);
        CHUNK_SIZES.into_iter().filter_map(of).collect()
    }
}

/// Runs the experiment on all backends except missing ones; `progress` is called after each run of edits.
pub fn measure(
    setup: Setup,
    missing: Vec<(Backend, NoBackend)>,
    mut progress: impl FnMut(),
) -> Result<Measurements, PaperError> {
    let scene = setup.scene()?;
    let is_here = |backend: &Backend| missing.iter().all(|(other, _)| other != backend);
    let hybrid = |backend| CHUNK_SIZES.map(|chunk_size| Subject::Hybrid { backend, chunk_size });
    let mut subjects: Vec<Subject> = Backend::ALL.into_iter().filter(is_here).flat_map(hybrid).collect();
    subjects.extend(Output::BOTH.map(Subject::Full));

    let mut measured: Vec<Measured> = Vec::new();
    // Repeats are the outer loop, so that other load and the state left by the previous test affect all subjects
    // alike: none always follows the same one.
    let (mut rng, mut order) = (fastrand::Rng::with_seed(setup.seed), subjects.clone());
    for _ in 0..setup.repeats {
        for &subject in &order {
            let mut keep = |run, played, ending| {
                progress();
                keep(&mut measured, setup.threads, subject, run, played, ending)
            };
            match subject {
                Subject::Hybrid { backend, chunk_size } => {
                    let runner = backend.open()?;
                    let mut terrain = scene.terrain(chunk_size)?;
                    for run in Run::BOTH {
                        let played = play::hybrid(&mut terrain, &runner, &scene.brushes(run))?;
                        keep(run, played, Ending::of_terrain(&terrain))?;
                    }
                }
                Subject::Full(Output::Same) => {
                    let mut full = FullWorld::new(&scene)?;
                    for run in Run::BOTH {
                        let played = play::same(&mut full, &scene.brushes(run));
                        keep(run, played, Ending::of_full(&full))?;
                    }
                }
                Subject::Full(Output::Bare) => {
                    let mut field = DenseField::new(&scene.ground)?;
                    for run in Run::BOTH {
                        let played = play::bare(&mut field, &scene.brushes(run))?;
                        keep(run, played, Ending::of_field(&field))?;
                    }
                }
            }
        }
        rng.shuffle(&mut order);
    }
    for &subject in &subjects {
        // For full fields, only their memory is measured in separate processes.
        let times = if matches!(subject, Subject::Full(_)) { 1 } else { setup.repeats };
        let alone: Option<Vec<Alone>> = (0..times).map(|_| Alone::apart(subject, &setup)).collect();
        let alone = alone.unwrap_or_default();
        for measured in measured.iter_mut().filter(|measured| measured.subject == subject) {
            measured.alone = alone.iter().map(|alone| alone.of(measured.run).clone()).collect();
        }
    }
    Ok(Measurements {
        setup,
        measured,
        missing,
        agreement: compare::all(&scene)?,
        scenarios: count_scenarios(&scene)?,
        digs: scene.digs(),
        sizes: scene.sizes(),
        steepness: scene.steepness(),
    })
}

/// Adds a repeat to the earlier ones; its result must equal theirs.
fn keep(
    measured: &mut Vec<Measured>,
    threads: usize,
    subject: Subject,
    run: Run,
    played: Played,
    ending: Ending,
) -> Result<(), PaperError> {
    let Played { laps, voxels, unchanged, undrawn } = played;
    let (seconds, processor) = both_clocks(&laps, threads);
    match measured.iter_mut().find(|measured| measured.subject == subject && measured.run == run) {
        Some(earlier) if !earlier.ending.agrees(&ending) => Err(PaperError::Unrepeatable(subject.key())),
        Some(earlier) => {
            earlier.repeats.push(seconds);
            earlier.processor.push(processor);
            Ok(())
        }
        None => {
            let (repeats, processor) = (vec![seconds], vec![processor]);
            measured.push(Measured {
                subject,
                run,
                repeats,
                processor,
                voxels,
                unchanged,
                undrawn,
                alone: Vec::new(),
                ending,
            });
            Ok(())
        }
    }
}

/// Seconds by both clocks. With several threads, CPU time is not available, and wall-clock time replaces it.
pub fn both_clocks(laps: &[Lap], threads: usize) -> (Vec<f64>, Vec<f64>) {
    let processor = |lap: &Lap| if threads == 1 { lap.processor } else { lap.seconds };
    (laps.iter().map(|lap| lap.seconds).collect(), laps.iter().map(processor).collect())
}

/// Counts the paper's scenarios in the first run.
fn count_scenarios(scene: &Scene) -> Result<Vec<(u32, ScenarioCounts)>, PaperError> {
    let count = |chunk_size| {
        let mut terrain: Terrain = scene.terrain(chunk_size)?;
        let mut counts = ScenarioCounts::default();
        for receipt in terrain.apply(scene.brushes(Run::First)) {
            counts.count(&receipt);
        }
        Ok((chunk_size, counts))
    };
    CHUNK_SIZES.into_iter().map(count).collect()
}
