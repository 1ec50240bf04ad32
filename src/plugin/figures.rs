//! Statistics of the plugin.

use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::Times;

/// Recent statistics of the plugin. It counts as changed in frames with a commit; [`main_thread`](Self::main_thread)
/// alone, which is measured in every frame, does not count.
///
/// Bevy's [`DiagnosticsStore`](bevy::diagnostic::DiagnosticsStore) has figures too, for `LogDiagnosticsPlugin` and
/// other tools: this type's constants are their paths. The bytes that a terrain takes are not measured in each frame,
/// because every brick would be visited: ask [`Terrain::memory`](crate::terrain::Terrain::memory).
#[derive(Resource, Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct BurrowFigures {
    /// Commits since the start.
    pub commits: u64,
    /// Brushes in these commits.
    pub brushes: u64,
    /// Meshes swapped since the start.
    pub swaps: u64,
    /// How long the last transaction took in its task.
    pub last_transaction: Duration,
    /// How long the last commit took on the main thread.
    pub last_commit: Duration,
    /// How long the latest transactions took in their tasks.
    pub transactions: Times,
    /// How long the latest commits took on the main thread.
    pub commit_times: Times,
    /// How long showing loaded terrains, collecting brushes, committing and starting transactions took together on the
    /// main thread in this frame: systems, and changes to entities.
    pub main_thread: Duration,
    /// How long showing loaded terrains took in this frame, until it is part of [`main_thread`](Self::main_thread).
    #[reflect(ignore)]
    loading: Duration,
}

/// The durations of the parts of a transaction in its task.
#[derive(Clone, Copy, Default)]
pub(super) struct TaskTimes {
    pub edit: Duration,
    pub mesh: Duration,
    pub total: Duration,
}

impl BurrowFigures {
    /// The shortest of the last four transactions: one that was slow by chance says little about the next.
    pub(super) fn usual_transaction(&self) -> Duration {
        let latest = self.transactions.iter();
        let older = latest.len().saturating_sub(4);
        latest.skip(older).min().unwrap_or_default()
    }

    /// Counts a commit: its brushes, and how long it took in its task and on the main thread.
    pub(super) fn count(&mut self, brushes: u64, transaction: Duration, commit: Duration) {
        self.commits += 1;
        self.brushes += brushes;
        self.last_transaction = transaction;
        self.transactions.push(transaction);
        self.last_commit = commit;
        self.commit_times.push(commit);
        self.main_thread += commit;
    }
}

/// How long the main thread took, without a change that the game would notice.
pub(super) trait MainThread {
    /// Notes how long showing loaded terrains took, before the frame begins.
    fn measure_loading(&mut self, took: Duration);

    /// Begins a frame with this time and that of loading, to which [`measure`](Self::measure) adds.
    fn begin_frame(&mut self, took: Duration);

    /// Adds to this frame.
    fn measure(&mut self, took: Duration);
}

impl MainThread for ResMut<'_, BurrowFigures> {
    fn measure_loading(&mut self, took: Duration) {
        self.bypass_change_detection().loading = took;
    }

    fn begin_frame(&mut self, took: Duration) {
        let figures = self.bypass_change_detection();
        figures.main_thread = took + std::mem::take(&mut figures.loading);
    }

    fn measure(&mut self, took: Duration) {
        self.bypass_change_detection().main_thread += took;
    }
}

/// When the commands of a frame's commits began to run.
#[derive(Resource)]
struct CommandsStart(Instant);

/// Queues a command that starts to measure the commands behind it.
pub(super) fn start_measuring(commands: &mut Commands) {
    commands.queue(|world: &mut World| world.insert_resource(CommandsStart(Instant::now())));
}

/// Queues a command that adds the time since [`start_measuring`] to the main thread's.
pub(super) fn stop_measuring(commands: &mut Commands) {
    commands.queue(|world: &mut World| {
        if let Some(CommandsStart(start)) = world.remove_resource() {
            world.resource_mut::<BurrowFigures>().main_thread += start.elapsed();
        }
    });
}
