//! The backend chosen for a stage of a transaction, and the reason.

use std::time::Duration;

/// A stage of a transaction that a backend runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Edits applied to bricks.
    Edit,
    /// Blocks meshed.
    Mesh,
}

/// Expected times of a stage on either backend, from recent stages of its kind. If none was timed, a lower
/// bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Estimate {
    /// On the CPU.
    pub cpu: Duration,
    /// On the GPU, uploads included.
    pub cuda: Duration,
}

/// The backend chosen for a stage, and the reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The stage.
    pub stage: Stage,
    /// Number of bricks that edits may reach, or of blocks to be meshed.
    pub amount: usize,
    /// Approximate number of bricks and ground stacks that the GPU does not have yet; 0 if they were not
    /// counted because the CPU was faster in any case.
    pub missing: usize,
    /// Expected times, for edits including the meshing that follows. `None` if there was no choice: the GPU
    /// is not available, busy, unable to do it, or does everything.
    pub estimate: Option<Estimate>,
    /// Whether the GPU ran it.
    pub is_cuda: bool,
    /// The duration of the stage.
    pub took: Duration,
    /// Time of uploads and kernels on the GPU.
    pub device: Duration,
    /// Time of the stage's kernel on the GPU.
    pub kernel: Duration,
}

impl Choice {
    /// An empty record for a stage.
    pub(super) fn of(stage: Stage, amount: usize) -> Self {
        Self {
            stage,
            amount,
            missing: 0,
            estimate: None,
            is_cuda: false,
            took: Duration::ZERO,
            device: Duration::ZERO,
            kernel: Duration::ZERO,
        }
    }
}
