//! What the process takes. Each test runs in a process of its own for that, so that none is charged for another's data.

use std::fs;
use std::process::{Command, Stdio};

use serde::{Deserialize, Serialize};

use crate::PaperError;
use crate::backend::Backend;
use crate::edits::{Run, Scene};
use crate::full::{DenseField, FullWorld, Output};
use crate::measure::{Setup, Subject};
use crate::play;

/// Kilobytes in memory (resident set) at the end of each run; `None` where the system does not tell.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Footprint {
    /// With the landscape made and nothing else.
    pub start: Option<u64>,
    pub first: Option<u64>,
    pub second: Option<u64>,
}

impl Footprint {
    pub fn after(&self, run: Run) -> Option<u64> {
        match run {
            Run::First => self.first,
            Run::Second => self.second,
        }
    }

    /// Plays both runs of a test in this process, untimed.
    pub fn here(subject: Subject, setup: &Setup) -> Result<Self, PaperError> {
        let scene = setup.scene()?;
        let mut footprint = Self { start: resident(), ..Self::default() };
        let mut ends = match subject {
            Subject::Hybrid { backend, chunk_size } => hybrid(&scene, backend, chunk_size)?,
            Subject::Full(Output::Same) => same(&scene)?,
            Subject::Full(Output::Bare) => bare(&scene)?,
        }
        .into_iter();
        footprint.first = ends.next().flatten();
        footprint.second = ends.next().flatten();
        Ok(footprint)
    }

    /// Plays both runs in a process of its own; nothing is known where none can be started.
    pub fn apart(subject: Subject, setup: &Setup) -> Self {
        let ask = || -> Option<Self> {
            let child = Command::new(std::env::current_exe().ok()?)
                .args(["--footprint-of", &subject.key()])
                .args(setup.arguments())
                .stderr(Stdio::null())
                .output()
                .ok()
                .filter(|child| child.status.success())?;
            serde_json::from_slice(&child.stdout).ok()
        };
        ask().unwrap_or_default()
    }
}

fn hybrid(scene: &Scene, backend: Backend, chunk_size: u32) -> Result<[Option<u64>; 2], PaperError> {
    let mut runner = backend.open()?;
    let mut terrain = play::terrain(scene, chunk_size)?;
    let mut ends = [None; 2];
    for (run, end) in Run::BOTH.into_iter().zip(&mut ends) {
        play::hybrid(&mut terrain, &mut runner, &scene.brushes(run))?;
        *end = resident();
    }
    Ok(ends)
}

fn same(scene: &Scene) -> Result<[Option<u64>; 2], PaperError> {
    let mut full = FullWorld::new(scene)?;
    Ok(Run::BOTH.map(|run| {
        play::same(&mut full, &scene.brushes(run));
        resident()
    }))
}

fn bare(scene: &Scene) -> Result<[Option<u64>; 2], PaperError> {
    let mut field = DenseField::new(&scene.ground)?;
    let mut ends = [None; 2];
    for (run, end) in Run::BOTH.into_iter().zip(&mut ends) {
        play::bare(&mut field, &scene.brushes(run))?;
        *end = resident();
    }
    Ok(ends)
}

/// Kilobytes that this process has in memory.
fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}
