//! Settings and figures, as reflected resources.

use std::time::Duration;

use bevy::prelude::*;

/// How the plugin spends its frames.
#[derive(Resource, Reflect, Clone, Debug, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct BurrowSettings {
    /// Meshes swapped per frame. A commit is never cut: one that is larger goes in whole, and others wait for the next
    /// frame.
    pub swaps_per_frame: usize,
    /// Tile meshes handed to the renderer per frame while a terrain loads. They show only when all are there.
    pub loads_per_frame: usize,
}

impl Default for BurrowSettings {
    fn default() -> Self {
        Self { swaps_per_frame: 256, loads_per_frame: 256 }
    }
}

/// What the plugin did lately.
#[derive(Resource, Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct BurrowFigures {
    /// Commits so far.
    pub commits: u64,
    /// Brushes that got a receipt so far.
    pub brushes: u64,
    /// Meshes swapped so far.
    pub swaps: u64,
    /// How long the last transaction took in its task.
    pub last_transaction: Duration,
    /// How long the last commit took on the main thread.
    pub last_commit: Duration,
    /// What this frame's intake, commits and starts of transactions took together on the main thread.
    pub main_thread: Duration,
}
