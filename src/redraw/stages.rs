//! Times of the stages of a transaction.

use std::time::Duration;

use web_time::Instant;

/// Durations of the stages of a transaction. In large ones tiles and chunks are made side by side, so stages may take
/// longer than the whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stages {
    /// Edits, from distances to new bricks.
    pub edit: Duration,
    /// Marching cubes over dirty blocks, and finding these.
    pub meshing: Duration,
    /// Assembling chunk meshes from new and old parts, the first ones while others are still being copied
    /// from the GPU.
    pub assembly: Duration,
    /// The mask, rings and index lists.
    pub ring: Duration,
    /// The whole transaction: the above, fields and receipts, and a copy of the world's index where others hold the
    /// world.
    pub whole: Duration,
}

impl Stages {
    /// Runs `work` and adds the time it takes to a stage.
    pub(crate) fn time<T>(stage: &mut Duration, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        *stage += start.elapsed();
        result
    }
}
