//! What was chosen for a stage of a transaction, and why.

use std::time::Duration;

/// A stage of a transaction that a backend does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Edits applied to bricks.
    Edit,
    /// Blocks meshed.
    Mesh,
}

/// How long a stage may take on either backend, by what such stages took lately. Where none was timed, no more is known than
/// that it takes no less than this.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Estimate {
    /// On the processor.
    pub cpu: Duration,
    /// On the card, uploads included.
    pub cuda: Duration,
}

/// What was chosen for a stage, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Of which stage.
    pub stage: Stage,
    /// Bricks that edits may reach, or blocks to be meshed.
    pub amount: usize,
    /// Bricks and stacks of the ground that the card does not have yet, roughly; 0 where nobody looked, as it was the
    /// processor's even if the card had them all.
    pub missing: usize,
    /// What was expected, for edits with the meshing that follows; `None` where nothing had to be chosen: the card is not
    /// there, busy, could not do it, or does all.
    pub estimate: Option<Estimate>,
    /// Was it the card?
    pub is_cuda: bool,
    /// How long it took.
    pub took: Duration,
    /// On the card: how long uploads and kernels took.
    pub device: Duration,
    /// On the card: how long the stage's kernel took.
    pub kernel: Duration,
}

impl Choice {
    /// A choice that was not made yet.
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
