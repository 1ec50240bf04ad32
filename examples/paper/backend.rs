//! The backend that runs transactions: the CPU, or a GPU as in the paper's Tables 3 and 4.

use std::time::Duration;

use bevy_burrow::backend::{Backend as Kind, Engine, EngineState};
use bevy_burrow::terrain::{Commit, Transaction};

/// What runs the transactions: the CPU or a CUDA GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backend {
    Cpu,
    Cuda,
}

/// Runs transactions to their commits.
pub struct Runner {
    /// The CUDA engine, or `None` for the CPU.
    engine: Option<Engine>,
}

impl Runner {
    pub fn run(&self, transaction: Transaction) -> Commit {
        match &self.engine {
            Some(engine) => transaction.run_on(engine),
            None => transaction.run(),
        }
    }

    /// Number of stages that a GPU left to the CPU.
    pub fn left_over(&self) -> u64 {
        self.engine.as_ref().map_or(0, |engine| engine.figures().cpu)
    }
}

/// Why a backend is not available.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {0} backend on this machine")]
pub struct NoBackend(pub &'static str);

impl Backend {
    pub const ALL: [Self; 2] = [Self::Cpu, Self::Cuda];

    /// Opens the backend.
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

    /// The backends that are not available, and why.
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
