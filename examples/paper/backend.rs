//! What computes a transaction: the CPU, or a GPU as the paper's Tables 3 and 4 have it.

use std::time::Duration;

use bevy_burrow::backend::{Backend as Kind, Engine, EngineState};
use bevy_burrow::terrain::{Commit, Transaction};

/// Who does the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backend {
    Cpu,
    Cuda,
}

/// Runs transactions to their commits.
pub struct Runner {
    /// The card's; without one, the processor does it.
    engine: Option<Engine>,
}

impl Runner {
    pub fn run(&self, transaction: Transaction) -> Commit {
        match &self.engine {
            Some(engine) => transaction.run_on(engine),
            None => transaction.run(),
        }
    }

    /// Stages that a card left to the processor, so far.
    pub fn left_over(&self) -> u64 {
        self.engine.as_ref().map_or(0, |engine| engine.figures().cpu)
    }
}

/// Why a backend computes nothing here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {0} backend on this machine")]
pub struct NoBackend(pub &'static str);

impl Backend {
    pub const ALL: [Self; 2] = [Self::Cpu, Self::Cuda];

    /// The backend, ready to run.
    pub fn open(self) -> Result<Runner, NoBackend> {
        let kind = match self {
            Self::Cpu => return Ok(Runner { engine: None }),
            Self::Cuda => Kind::Cuda,
        };
        let engine = Engine::new(kind);
        match engine.wait(Duration::from_secs(30)) {
            EngineState::Cuda(_) => Ok(Runner { engine: Some(engine) }),
            _ => Err(NoBackend("CUDA")),
        }
    }

    /// Backends that compute nothing here, and why.
    pub fn missing() -> Vec<(Self, NoBackend)> {
        Self::ALL.into_iter().filter_map(|backend| Some((backend, backend.open().err()?))).collect()
    }

    /// The paper's name for it.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Cpu => "CPU",
            Self::Cuda => "GPU",
        }
    }
}
