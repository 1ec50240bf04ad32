//! The report: the outcomes of the edits, and figures of the resulting world.

use std::collections::BTreeMap;
use std::fmt;
use std::time::{Duration, Instant};

use bevy_burrow::lattice::ONE;
use bevy_burrow::surface::SeamReport;
use bevy_burrow::terrain::{Memory, Receipt, ScenarioCounts, World};
use bevy_burrow::volume::{MaterialCounts, Refused};
use serde::Serialize;

use crate::lod::{LevelFigures, Levels};
use crate::play::Played;

/// The content of `report.json`. Everything except `timings` is the same on every machine for the same input.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Hash of the ground and every edited sample, in hexadecimal.
    pub hash: String,
    pub world: WorldFigures,
    /// The outcome of each edit, in order.
    pub edits: Vec<EditFigures>,
    pub totals: Totals,
    /// How often each of the paper's five scenarios occurred.
    pub scenarios: ScenarioCounts,
    /// Edited regions.
    pub fields: usize,
    /// Chunks that draw something.
    pub chunks: usize,
    /// Tiles of the heightmap.
    pub tiles: usize,
    /// Blocks of 8x8x8 samples that are stored.
    pub bricks: usize,
    /// Cells (x, z) whose ground marching cubes draws.
    pub volumetric_cells: usize,
    pub bytes: ByteFigures,
    pub seams: SeamFigures,
    /// Figures of the drawn mesh at each level, if levels of detail were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levels: Option<Vec<LevelFigures>>,
    /// The material of each channel of the splat maps, if they were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub splat_layers: Option<Vec<u8>>,
    /// Heights of black and white in elevation.png, in voxels, if it was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_range: Option<[f32; 2]>,
    pub timings: Timings,
}

#[derive(Debug, Serialize)]
pub struct WorldFigures {
    /// Cells along x.
    pub width: i32,
    /// Cells along z.
    pub depth: i32,
    /// Cells along a chunk's side.
    pub chunk_size: i32,
    /// Lowest and highest pristine height in voxels.
    pub heights: [f64; 2],
}

/// Voxels by material id.
type ByMaterial = BTreeMap<u8, u64>;

#[derive(Debug, Default, Serialize)]
pub struct EditFigures {
    /// The line in the file of edits.
    pub line: usize,
    /// Why the edit was rejected, if it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rejected: Option<String>,
    /// Voxels dug away, filled and repainted.
    pub removed: ByMaterial,
    pub added: ByMaterial,
    pub painted: ByMaterial,
    /// Voxels that rules kept as they were.
    pub refused: ByMaterial,
}

/// All edits together.
#[derive(Debug, Default, Serialize)]
pub struct Totals {
    /// Accepted edits.
    pub applied: usize,
    /// Rejected edits.
    pub rejected: usize,
    pub removed: ByMaterial,
    pub added: ByMaterial,
    pub painted: ByMaterial,
    pub refused: ByMaterial,
}

#[derive(Debug, Serialize)]
pub struct ByteFigures {
    #[serde(flatten)]
    pub world: Memory,
    /// All of it except the ground.
    pub edits: usize,
    /// Length of `mesh.obj`.
    pub mesh_obj: u64,
}

#[derive(Debug, Serialize)]
pub struct SeamFigures {
    pub closed: bool,
    pub flawless: bool,
    pub triangles: usize,
    pub vertices: usize,
    pub edges: usize,
    pub open: usize,
    pub unbalanced: usize,
    pub nonmanifold_edges: usize,
    pub nonmanifold_vertices: usize,
    pub degenerate: usize,
    pub euler: i64,
    /// Largest angle between the normals of vertices at the same position, in degrees.
    pub worst_normal_jump: f64,
    /// One position, in voxels, for each kind of fault that was found.
    pub first: BTreeMap<String, [f64; 3]>,
}

/// Timings in milliseconds.
#[derive(Debug, Default, Serialize)]
pub struct Timings {
    /// Reading the edits and the image.
    pub load_ms: f64,
    pub transactions: usize,
    /// Largest number of edits in a transaction.
    pub batch: usize,
    /// Time per transaction: median, 99th percentile and maximum.
    pub transaction_p50_ms: f64,
    pub transaction_p99_ms: f64,
    pub transaction_max_ms: f64,
    /// All transactions together.
    pub play_ms: f64,
    /// Checking every seam of the world.
    pub check_ms: f64,
    /// Writing `mesh.obj`.
    pub write_ms: f64,
}

impl Report {
    /// Computes the report of a world. The length of `mesh.obj` and the other timings are filled in later.
    pub fn new(world: &World, played: &Played, levels: Option<&Levels>) -> Self {
        let mut timings = Timings::transactions(played);
        let start = Instant::now();
        let seams =
            SeamFigures::from(levels.map_or_else(|| world.check_seams(), |own| own.check_seams(world)));
        timings.check_ms = milliseconds(start);

        let mut scenarios = ScenarioCounts::default();
        for (_, receipt) in &played.receipts {
            scenarios.count(receipt);
        }
        let edits: Vec<_> = played.receipts.iter().map(EditFigures::new).collect();
        let (memory, grid) = (world.memory(), world.grid());
        let (low, high) = world.ground().height_range();
        Self {
            hash: format!("{:#018x}", world.hash()),
            world: WorldFigures {
                width: grid.width(),
                depth: grid.depth(),
                chunk_size: grid.size(),
                heights: [low, high].map(|height| f64::from(height) / f64::from(ONE)),
            },
            totals: Totals::new(&edits),
            edits,
            scenarios,
            fields: world.fields().map(|(_, fields)| fields.len()).sum(),
            chunks: world.drawn_chunks().count(),
            tiles: grid.tiles().count(),
            bricks: world.bricks().count(),
            volumetric_cells: world.mask().len(),
            bytes: ByteFigures { world: memory, edits: memory.edits(), mesh_obj: 0 },
            seams,
            levels: levels.map(Levels::figures),
            splat_layers: None,
            elevation_range: None,
            timings,
        }
    }
}

/// The summary that the command prints.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { totals, scenarios, seams, timings, .. } = self;
        writeln!(f, "edits      {} applied, {} rejected", totals.applied, totals.rejected)?;
        let ScenarioCounts { created, changed, extended, merged, split } = scenarios;
        writeln!(
            f,
            "scenarios  {created} created, {changed} changed inside, {extended} extended, {merged} merged, \
             {split} split"
        )?;
        writeln!(f, "world      {} fields, {} chunks, {} bricks", self.fields, self.chunks, self.bricks)?;
        writeln!(
            f,
            "seams      {} triangles, {} open edges, {} unbalanced, {} non-manifold, {} degenerate",
            seams.triangles, seams.open, seams.unbalanced, seams.nonmanifold_edges, seams.degenerate
        )?;
        let (p50, p99) = (timings.transaction_p50_ms, timings.transaction_p99_ms);
        writeln!(f, "timing     {p50:.2} ms a transaction (p50), {p99:.2} ms (p99)")?;
        write!(f, "hash       {}", self.hash)
    }
}

impl EditFigures {
    fn new((line, receipt): &(usize, Receipt)) -> Self {
        let by_material =
            |counts: &MaterialCounts| counts.iter().map(|(material, voxels)| (material.0, voxels)).collect();
        match &receipt.outcome {
            Ok(applied) => {
                let Refused { protected, unbreakable, too_hard, slowed } = &applied.refused;
                let mut refused = MaterialCounts::default();
                [protected, unbreakable, too_hard, slowed].into_iter().for_each(|counts| refused.add(counts));
                Self {
                    line: *line,
                    rejected: None,
                    removed: by_material(&applied.removed),
                    added: by_material(&applied.added),
                    painted: by_material(&applied.painted),
                    refused: by_material(&refused),
                }
            }
            Err(reason) => Self { line: *line, rejected: Some(reason.to_string()), ..Self::default() },
        }
    }
}

impl Totals {
    fn new(edits: &[EditFigures]) -> Self {
        let rejected = edits.iter().filter(|edit| edit.rejected.is_some()).count();
        let mut totals = Self { applied: edits.len() - rejected, rejected, ..Self::default() };
        let add = |sum: &mut ByMaterial, own: &ByMaterial| {
            own.iter().for_each(|(&material, voxels)| *sum.entry(material).or_default() += voxels);
        };
        for edit in edits {
            add(&mut totals.removed, &edit.removed);
            add(&mut totals.added, &edit.added);
            add(&mut totals.painted, &edit.painted);
            add(&mut totals.refused, &edit.refused);
        }
        totals
    }
}

impl From<SeamReport> for SeamFigures {
    fn from(report: SeamReport) -> Self {
        Self {
            closed: report.is_closed(),
            flawless: report.is_flawless(),
            triangles: report.triangles,
            vertices: report.vertices,
            edges: report.edges,
            open: report.open,
            unbalanced: report.unbalanced,
            nonmanifold_edges: report.nonmanifold_edges,
            nonmanifold_vertices: report.nonmanifold_vertices,
            degenerate: report.degenerate,
            euler: report.euler,
            worst_normal_jump: report.worst_normal_jump,
            first: report.first.iter().map(|(fault, at)| (format!("{fault:?}"), at.to_array())).collect(),
        }
    }
}

impl Timings {
    fn transactions(played: &Played) -> Self {
        let mut times = played.transactions.clone();
        times.sort_unstable();
        Self {
            transactions: times.len(),
            batch: played.batch,
            transaction_p50_ms: percentile(&times, 50),
            transaction_p99_ms: percentile(&times, 99),
            transaction_max_ms: percentile(&times, 100),
            play_ms: times.iter().sum::<Duration>().as_secs_f64() * 1e3,
            ..Self::default()
        }
    }
}

/// The time in milliseconds that `percent` of the sorted times do not exceed (nearest rank); 0 if there are none.
fn percentile(sorted: &[Duration], percent: usize) -> f64 {
    let rank = (sorted.len() * percent).div_ceil(100).max(1);
    sorted.get(rank - 1).map_or(0.0, |time| time.as_secs_f64() * 1e3)
}

/// Milliseconds since an instant.
pub fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
