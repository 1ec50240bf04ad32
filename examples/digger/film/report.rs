//! The summary of a script: its edits, their times and the memory they need.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::backend::EngineState;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SeamReport;
use bevy_burrow::terrain::Memory;

/// The results of all brushes.
#[derive(Resource, Clone, Debug, Default)]
pub struct EditLog {
    /// Brushes that were applied, including those that changed nothing.
    pub applied: usize,
    /// Brushes that were invalid or out of reach.
    pub rejected: usize,
    /// Counts of the scenarios of the paper.
    pub scenarios: ScenarioCounts,
    /// Voxels that were dug and filled.
    pub moved: (u64, u64),
    /// The reason of the latest rejection.
    pub rejection: Option<Rejection>,
}

impl EditLog {
    /// The number of receipts.
    pub fn answered(&self) -> usize {
        self.applied + self.rejected
    }
}

/// Keeps the [`EditLog`] up to date.
pub struct EditLogPlugin;

impl Plugin for EditLogPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<EditLog>().add_systems(Update, log_receipts.after(BurrowSystems::Commit));
    }
}

fn log_receipts(mut receipts: MessageReader<BrushApplied>, mut edit_log: ResMut<EditLog>) {
    for BrushApplied { receipt, .. } in receipts.read() {
        edit_log.scenarios.count(receipt);
        match &receipt.outcome {
            Ok(applied) => {
                edit_log.applied += 1;
                edit_log.moved.0 += applied.removed.total();
                edit_log.moved.1 += applied.added.total();
            }
            Err(rejection) => {
                edit_log.rejected += 1;
                edit_log.rejection = Some(rejection.clone());
            }
        }
    }
}

/// Durations of the same work, shown as percentiles. The plugin's own [`Times`](bevy_burrow::plugin::Times) keep only
/// the latest few hundred, but a script has thousands of frames.
#[derive(Clone, Debug, Default)]
pub struct Durations(Vec<Duration>);

impl Durations {
    pub fn push(&mut self, took: Duration) {
        self.0.push(took);
    }
}

impl fmt::Display for Durations {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut sorted = self.0.clone();
        sorted.sort_unstable();
        // The nearest rank: the least time that this percentage of frames does not exceed.
        let ms = |percent: usize| {
            let rank = (sorted.len() * percent).div_ceil(100).saturating_sub(1);
            sorted.get(rank).copied().unwrap_or_default().as_secs_f64() * 1e3
        };
        write!(f, "p50 {:.2}, p99 {:.2}", ms(50), ms(99))
    }
}

/// All results of a script.
pub struct Report {
    pub renderer: Option<String>,
    pub engine: EngineState,
    /// Stages of transactions on the CPU and on a GPU.
    pub stages: (u64, u64),
    pub size: (i32, i32),
    pub tunnel: f32,
    pub edit_log: EditLog,
    /// The transactions in their tasks.
    pub transactions: Durations,
    /// From sending a brush to its receipt, including the frames in between.
    pub receipts: Durations,
    pub fields: usize,
    pub chunks: usize,
    /// Seams of everything that is drawn.
    pub drawn_seams: SeamReport,
    /// Seams of what was dug and built, at full detail.
    pub edited_seams: SeamReport,
    pub memory: Memory,
    pub pictures: Vec<PathBuf>,
    /// Pixels of ground in these, and those where it is missing.
    pub holes: (usize, usize),
    pub frames: Durations,
    pub drawn: Durations,
    /// Time until the landscape was loaded, and in total.
    pub ready: Duration,
    pub took: Duration,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { edit_log, memory, transactions, receipts, frames, drawn, .. } = self;
        let renderer = self.renderer.as_deref().unwrap_or("no renderer, hence no pictures");
        let (ready, took) = (self.ready.as_secs_f64(), self.took.as_secs_f64());
        let (width, depth) = self.size;
        writeln!(
            f,
            "digger: {width} x {depth} voxels, {renderer}, ready after {ready:.1} s, {took:.0} s in all"
        )?;
        writeln!(f, "  edits         {} applied, {} rejected", edit_log.applied, edit_log.rejected)?;
        let ScenarioCounts { created, changed, extended, merged, split, .. } = edit_log.scenarios;
        writeln!(
            f,
            "  scenarios     {created} created, {changed} changed, {extended} extended, {merged} merged; {split} edits split over chunks"
        )?;
        let ((dug, filled), tunnel) = (edit_log.moved, self.tunnel);
        writeln!(f, "  ground        {dug} voxels dug, {filled} filled; the tunnel is {tunnel:.0} long")?;
        writeln!(f, "  fields        {} in {} drawn chunks", self.fields, self.chunks)?;
        for (name, seams) in [("drawn seams", &self.drawn_seams), ("edited seams", &self.edited_seams)] {
            let nonmanifold = seams.nonmanifold_edges + seams.nonmanifold_vertices;
            let SeamReport { open, unbalanced, degenerate, triangles, worst_normal_jump, .. } = seams;
            writeln!(
                f,
                "  {name:<13} {open} open edges, {unbalanced} unbalanced, {nonmanifold} non-manifold, {degenerate} degenerate of {triangles} triangles"
            )?;
            writeln!(f, "                worst normal jump {worst_normal_jump:.3} degrees")?;
        }
        let (ground, holes) = self.holes;
        writeln!(f, "  holes         {holes} of {ground} pixels of ground")?;
        writeln!(f, "  ms per edit   {transactions} in the transaction,")?;
        writeln!(f, "                {receipts} from brush to receipt, frames included")?;
        let all = memory.ground + memory.edits();
        let [ground, edits, samples, surface, index] = [
            memory.ground,
            memory.edits(),
            memory.samples + memory.materials,
            memory.meshes + memory.parts,
            memory.index,
        ]
        .map(|bytes| bytes as f64 / 1024.0);
        writeln!(
            f,
            "  terrain data  {all} bytes: ground {ground:.0} KiB, edits {edits:.0} KiB ({samples:.0} samples and materials, {surface:.0} surface, {index:.0} index)"
        )?;
        let computer = match &self.engine {
            EngineState::Cuda(name) => name.as_str(),
            _ => "the CPU",
        };
        let (cpu, cuda) = self.stages;
        writeln!(f, "  computed by   {computer}: {cuda} stages of transactions on a GPU, {cpu} on the CPU")?;
        let (played, shown) = (frames.0.len(), drawn.0.len());
        writeln!(f, "  frames        {played} played in {frames} ms, {shown} drawn in {drawn} ms")?;
        write!(f, "  pictures      {}", self.pictures.len())?;
        if let Some(folder) = self.pictures.first().and_then(|picture| picture.parent()) {
            write!(f, " in {}", folder.display())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_ranks() {
        let of = |count: u64| Durations((1..=count).rev().map(Duration::from_millis).collect()).to_string();
        assert_eq!(of(200), "p50 100.00, p99 198.00");
        assert_eq!(of(3), "p50 2.00, p99 3.00");
        assert_eq!(of(0), "p50 0.00, p99 0.00");
    }
}
