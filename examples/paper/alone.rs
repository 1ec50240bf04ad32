//! Plays a test in a separate process: its memory, and the time of its edits when no memory was allocated before.

use std::fs;
use std::process::{Command, Stdio};

use serde::{Deserialize, Serialize};

use crate::clock::Lap;
use crate::edits::Run;
use crate::error::PaperError;
use crate::full::{DenseField, FullWorld, Output};
use crate::play::{self, Played};
use crate::setup::{Setup, Subject};

/// Both runs of a test in a process that does nothing else.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Alone {
    /// Resident memory in kilobytes with only the landscape created; `None` where the system does not report it.
    pub start: Option<u64>,
    pub first: AloneRun,
    pub second: AloneRun,
}

/// One of the runs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AloneRun {
    /// Resident memory in kilobytes at its end.
    pub resident: Option<u64>,
    /// The time of each edit.
    pub laps: Vec<Lap>,
}

impl Alone {
    pub fn of(&self, run: Run) -> &AloneRun {
        match run {
            Run::First => &self.first,
            Run::Second => &self.second,
        }
    }

    /// Plays both runs of a test in this process.
    pub fn here(subject: Subject, setup: &Setup) -> Result<Self, PaperError> {
        let scene = setup.scene()?;
        let (start, brushes) = (resident(), Run::BOTH.map(|run| scene.brushes(run)));
        let ran = |played: Played| AloneRun { resident: resident(), laps: played.laps };
        let [first, second] = match subject {
            Subject::Hybrid { backend, chunk_size } => {
                let (runner, mut terrain) = (backend.open()?, scene.terrain(chunk_size)?);
                let mut run = |brushes: &[_]| play::hybrid(&mut terrain, &runner, brushes).map(ran);
                [run(&brushes[0])?, run(&brushes[1])?]
            }
            Subject::Full(Output::Same) => {
                let mut full = FullWorld::new(&scene)?;
                brushes.map(|brushes| ran(play::same(&mut full, &brushes)))
            }
            Subject::Full(Output::Bare) => {
                let mut field = DenseField::new(&scene.ground)?;
                let mut run = |brushes: &[_]| play::bare(&mut field, brushes).map(ran);
                [run(&brushes[0])?, run(&brushes[1])?]
            }
        };
        Ok(Self { start, first, second })
    }

    /// Plays both runs in a separate process; `None` if none can be started.
    pub fn apart(subject: Subject, setup: &Setup) -> Option<Self> {
        let child = Command::new(std::env::current_exe().ok()?)
            .args(["--alone", &subject.key()])
            .args(setup.arguments())
            .stderr(Stdio::null())
            .output()
            .ok()
            .filter(|child| child.status.success())?;
        serde_json::from_slice(&child.stdout).ok()
    }
}

/// Resident memory of this process in kilobytes.
fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}
