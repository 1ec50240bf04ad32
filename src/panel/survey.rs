//! Collects the statistics of the right column. Terrains are counted in tasks, so that no frame waits.

use std::time::Duration;

use bevy::prelude::*;

use super::plot::Line;
use super::state::{BurrowPanel, Note, Verdict};
use super::texts;
use crate::backend::{Choice, EngineState};
use crate::plugin::{BurrowEngine, BurrowFigures, MeshBytes};
use crate::surface::SeamReport;
use crate::terrain::{Memory, Terrain, Version, World};
use crate::threads::{ThreadTask, Threads};

/// How often the terrain and the engine are examined.
const PERIOD: Duration = Duration::from_millis(500);

/// Statistics of the chosen terrain.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    pub fields: usize,
    pub chunks: usize,
    pub bricks: usize,
    /// Cells that are meshed by marching cubes.
    pub cells: usize,
    pub memory: Memory,
    pub hash: u64,
}

/// Meshes that are on the GPU.
type Drawn<'w, 's> = Query<'w, 's, (&'static MeshBytes, &'static ChildOf), With<Mesh3d>>;

/// All statistics on the panel.
#[derive(Resource, Default)]
pub struct Survey {
    /// The terrain and the commit that `counts` belong to.
    of: Option<(Entity, Version)>,
    counting: Option<(Entity, Version, ThreadTask<Counts>)>,
    since: Duration,
    pub counts: Option<Counts>,
    /// Bytes of the chosen terrain's meshes on the GPU.
    pub mesh_bytes: usize,
    /// The engine's state, its stages on CPU and GPU, and its last choice.
    pub engine: Option<(EngineState, [u64; 2], Option<Choice>)>,
    /// One value per frame.
    pub frame_ms: Line,
    pub swaps: Line,
    pub main_thread_us: Line,
    pub swaps_now: u64,
    pub queued: usize,
    last_swaps: u64,
}

/// The terrain that the panel shows: the chosen one, or else the first.
pub fn chosen(panel: &BurrowPanel, terrains: &Query<(Entity, &Terrain)>) -> Option<Entity> {
    let is_there = |&entity: &Entity| terrains.contains(entity);
    panel.terrain.filter(is_there).or_else(|| terrains.iter().map(|(entity, _)| entity).min())
}

/// Records the statistics of a frame.
pub(super) fn follow_frames(
    time: Res<Time<Real>>,
    figures: Res<BurrowFigures>,
    terrains: Query<(Entity, &Terrain)>,
    mut survey: ResMut<Survey>,
) {
    let survey = &mut *survey;
    survey.swaps_now = figures.swaps.saturating_sub(survey.last_swaps);
    survey.last_swaps = figures.swaps;
    survey.queued = terrains.iter().map(|(_, terrain)| terrain.queued()).sum();
    survey.frame_ms.push(time.delta_secs() * 1e3);
    survey.swaps.push(survey.swaps_now as f32);
    survey.main_thread_us.push(figures.main_thread.as_secs_f32() * 1e6);
}

/// Counts the content of the chosen terrain in a task, if it has changed, and at most twice a second.
pub(super) fn count_terrain(
    time: Res<Time<Real>>,
    panel: Res<BurrowPanel>,
    engine: Res<BurrowEngine>,
    terrains: Query<(Entity, &Terrain)>,
    meshes: Drawn,
    mut survey: ResMut<Survey>,
) {
    let survey = &mut *survey;
    if let Some((entity, version, task)) = &mut survey.counting
        && let Some(counts) = task.finish()
    {
        (survey.of, survey.counts) = (Some((*entity, *version)), Some(counts));
        survey.counting = None;
    }
    let chosen = chosen(&panel, &terrains).and_then(|entity| terrains.get(entity).ok());
    if survey.of.is_some_and(|(of, _)| chosen.is_none_or(|(entity, _)| entity != of)) {
        (survey.of, survey.counts) = (None, None);
    }
    survey.since += time.delta();
    if !panel.is_open || survey.since < PERIOD && survey.counts.is_some() {
        return;
    }
    survey.since = Duration::ZERO;
    let engine = chosen.and_then(|(_, terrain)| terrain.engine()).unwrap_or(&engine);
    let figures = engine.figures();
    survey.engine = Some((engine.state(), [figures.cpu, figures.cuda], figures.choices.back().copied()));
    let own = meshes.iter().filter(|(_, parent)| chosen.is_some_and(|(entity, _)| parent.parent() == entity));
    survey.mesh_bytes = own.map(|(bytes, _)| bytes.0).sum();
    let Some((entity, terrain)) = chosen.filter(|_| survey.counting.is_none()) else { return };
    let version = terrain.world().version();
    if survey.of == Some((entity, version)) {
        return;
    }
    let world = terrain.snapshot();
    let task = ThreadTask::start(Threads::Background, move || count(&world));
    survey.counting = Some((entity, version, task));
}

fn count(world: &World) -> Counts {
    Counts {
        fields: world.fields().map(|(_, fields)| fields.len()).sum(),
        chunks: world.drawn_chunks().count(),
        bricks: world.bricks().count(),
        cells: world.mask().len(),
        memory: world.memory(),
        hash: world.hash(),
    }
}

/// A running seam check.
#[derive(Resource)]
pub(super) struct SeamCheck(ThreadTask<Verdict>);

/// Starts a seam check of a snapshot of the terrain.
pub(super) fn start_seam_check(
    commands: &mut Commands,
    panel: &mut BurrowPanel,
    entity: Entity,
    terrain: &Terrain,
) {
    let world = terrain.snapshot();
    let task = ThreadTask::start(Threads::Background, move || check_seams(entity, &world));
    panel.note = Some(Note::Busy(texts::CHECKING.into()));
    commands.insert_resource(SeamCheck(task));
}

/// Reports the result of a seam check.
pub(super) fn finish_seam_check(
    mut commands: Commands,
    check: Option<ResMut<SeamCheck>>,
    mut panel: ResMut<BurrowPanel>,
) {
    let Some(verdict) = check.and_then(|mut check| check.0.finish()) else { return };
    commands.remove_resource::<SeamCheck>();
    let Verdict { is_flawless, text, .. } = &verdict;
    if *is_flawless {
        info!("seam check: {text}");
    } else {
        warn!("seam check: {text}");
    }
    panel.note = Some(Note::Seams(verdict));
}

fn check_seams(terrain: Entity, world: &World) -> Verdict {
    let report = world.check_seams();
    let (is_flawless, text) = (report.is_flawless(), describe(&report));
    Verdict { terrain, revision: world.revision(), hash: world.hash(), is_flawless, text }
}

fn describe(report: &SeamReport) -> String {
    let triangles = super::widgets::count(report.triangles);
    if report.is_flawless() {
        return texts::closed(&triangles);
    }
    let (open, unbalanced) = (report.open, report.unbalanced);
    let touching = report.nonmanifold_edges + report.nonmanifold_vertices;
    let (flat, jump) = (report.degenerate, report.worst_normal_jump);
    format!(
        "{open} open, {unbalanced} unbalanced, {touching} non-manifold, {flat} flat of {triangles} triangles; \
         normals differ by up to {jump:.1}°"
    )
}
