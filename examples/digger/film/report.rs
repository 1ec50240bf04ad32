//! The summary: what was done to the ground, and what it cost.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::backend::EngineState;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SeamReport;
use bevy_burrow::terrain::Memory;

use crate::world::veins;

/// What became of all brushes so far.
#[derive(Resource, Clone, Debug, Default)]
pub struct Logbook {
    /// Brushes that changed the ground, or found nothing to change.
    pub applied: usize,
    /// Brushes that were not valid or out of reach.
    pub rejected: usize,
    /// The paper's scenarios.
    pub scenarios: ScenarioCounts,
    /// Voxels dug away and filled.
    pub moved: (u64, u64),
    /// Why the latest rejected brush was rejected.
    pub rejection: Option<Rejection>,
}

impl Logbook {
    /// Brushes that got a receipt.
    pub fn answered(&self) -> usize {
        self.applied + self.rejected
    }
}

/// Keeps the [`Logbook`].
pub struct LogbookPlugin;

impl Plugin for LogbookPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Logbook>().add_systems(Update, file_receipts.after(BurrowSystems::Commit));
    }
}

fn file_receipts(mut receipts: MessageReader<BrushApplied>, mut logbook: ResMut<Logbook>) {
    // What was in the land from the first is nobody's work.
    for BrushApplied { receipt, .. } in receipts.read().filter(|answer| answer.receipt.tag != veins::TAG) {
        logbook.scenarios.count(receipt);
        match &receipt.outcome {
            Ok(applied) => {
                logbook.applied += 1;
                logbook.moved.0 += applied.removed.total();
                logbook.moved.1 += applied.added.total();
            }
            Err(rejection) => {
                logbook.rejected += 1;
                logbook.rejection = Some(rejection.clone());
            }
        }
    }
}

/// How long an edit took.
#[derive(Clone, Copy, Debug)]
pub struct EditTime {
    /// From sending the brush to reading its receipt, frames included.
    pub receipt: Duration,
    /// The transaction alone, in its task.
    pub transaction: Duration,
}

/// How long each of some frames took.
#[derive(Clone, Debug, Default)]
pub struct FrameTimes(Vec<Duration>);

impl FrameTimes {
    /// One frame more.
    pub fn count(&mut self, took: Duration) {
        self.0.push(took);
    }
}

impl fmt::Display for FrameTimes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} in p50 {} ms", self.0.len(), Percentiles::of(self.0.iter().copied()))
    }
}

/// All figures of a played script.
pub struct Report {
    pub renderer: Option<String>,
    pub engine: EngineState,
    /// Stages of transactions on the processor, and on a card.
    pub stages: (u64, u64),
    pub size: (i32, i32),
    pub tunnel: f32,
    pub logbook: Logbook,
    pub times: Vec<EditTime>,
    pub fields: usize,
    pub chunks: usize,
    pub seams: SeamReport,
    pub memory: Memory,
    pub pictures: Vec<PathBuf>,
    pub frames: FrameTimes,
    pub drawn: FrameTimes,
    /// How long until the land was there and painted, and all in all.
    pub ready: Duration,
    pub took: Duration,
}

impl Report {
    /// Is every seam closed?
    pub fn is_flawless(&self) -> bool {
        self.seams.is_flawless()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { logbook, seams, memory, .. } = self;
        let scenarios = logbook.scenarios;
        let renderer = self.renderer.as_deref().unwrap_or("no renderer, hence no pictures");
        writeln!(
            f,
            "digger: {} x {} voxels, {renderer}, ready after {:.1} s, {:.0} s in all",
            self.size.0,
            self.size.1,
            self.ready.as_secs_f64(),
            self.took.as_secs_f64()
        )?;
        writeln!(f, "  edits         {} applied, {} rejected", logbook.applied, logbook.rejected)?;
        writeln!(
            f,
            "  scenarios     {} created, {} changed, {} extended, {} merged; {} edits split over chunks",
            scenarios.created, scenarios.changed, scenarios.extended, scenarios.merged, scenarios.split
        )?;
        let (dug, filled) = logbook.moved;
        writeln!(
            f,
            "  ground        {dug} voxels dug, {filled} filled; the tunnel is {:.0} long",
            self.tunnel
        )?;
        writeln!(f, "  fields        {} in {} drawn chunks", self.fields, self.chunks)?;
        writeln!(
            f,
            "  seams         {} open edges, {} unbalanced, {} non-manifold, {} degenerate of {} triangles",
            seams.open,
            seams.unbalanced,
            seams.nonmanifold_edges + seams.nonmanifold_vertices,
            seams.degenerate,
            seams.triangles
        )?;
        writeln!(f, "                worst normal jump {:.3} degrees", seams.worst_normal_jump)?;
        let transaction = Percentiles::of(self.times.iter().map(|time| time.transaction));
        let receipt = Percentiles::of(self.times.iter().map(|time| time.receipt));
        writeln!(f, "  ms per edit   p50 {transaction} in the transaction,")?;
        writeln!(f, "                p50 {receipt} from brush to receipt, frames included")?;
        let (all, kib) = (memory.ground + memory.edits(), |bytes: usize| bytes as f64 / 1024.0);
        writeln!(
            f,
            "  terrain data  {all} bytes: ground {:.0} KiB, edits {:.0} KiB ({:.0} samples and materials, {:.0} surface, {:.0} index)",
            kib(memory.ground),
            kib(memory.edits()),
            kib(memory.samples + memory.materials),
            kib(memory.meshes + memory.parts),
            kib(memory.index)
        )?;
        let computer = match &self.engine {
            EngineState::Cuda(name) => name.as_str(),
            _ => "the processor",
        };
        let (cpu, cuda) = self.stages;
        writeln!(
            f,
            "  computed by   {computer}: {cuda} stages of transactions on a card, {cpu} on the processor"
        )?;
        writeln!(f, "  frames        {} walked and dug, {} drawn", self.frames, self.drawn)?;
        write!(f, "  pictures      {}", self.pictures.len())?;
        if let Some(folder) = self.pictures.first().and_then(|picture| picture.parent()) {
            write!(f, " in {}", folder.display())?;
        }
        Ok(())
    }
}

/// The middle and the nearly worst of some times: of all of them, while the plugin's own
/// [`Times`](bevy_burrow::plugin::Times) keep the latest few hundred, and a script has thousands of frames.
struct Percentiles {
    p50: Duration,
    p99: Duration,
}

impl Percentiles {
    fn of(times: impl Iterator<Item = Duration>) -> Self {
        let mut sorted: Vec<Duration> = times.collect();
        sorted.sort_unstable();
        // Nearest rank: the least time that so many percent do not exceed.
        let rank =
            |percent: usize| sorted.get((sorted.len() * percent).div_ceil(100).saturating_sub(1)).copied();
        Self { p50: rank(50).unwrap_or_default(), p99: rank(99).unwrap_or_default() }
    }
}

impl fmt::Display for Percentiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        write!(f, "{:.2}, p99 {:.2}", ms(self.p50), ms(self.p99))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_ranks() {
        let of = |count: u64| Percentiles::of((1..=count).rev().map(Duration::from_millis)).to_string();
        assert_eq!(of(200), "100.00, p99 198.00");
        assert_eq!(of(3), "2.00, p99 3.00");
        assert_eq!(of(0), "0.00, p99 0.00");
    }
}
