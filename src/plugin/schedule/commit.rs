//! Starts transactions, and commits each of them whole in one frame.

use std::time::Duration;

use bevy::ecs::system::{SystemChangeTick, SystemParam};
use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy::window::ClosingWindow;

use super::collect::{HistoryMessages, send_history};
use super::load::Loading;
use super::same_frame::SameFrame;
use super::task::{Change, InFlight, TaskCounter, TaskOutput, UPLOADS_PER_FRAME};
#[cfg(any(feature = "scatter", feature = "landmass"))]
use crate::lattice::LatticeBox;
use crate::plugin::diagnostics::measure_commit;
use crate::plugin::entities::{Display, TerrainEntities};
use crate::plugin::figures::{MainThread, TaskTimes, start_measuring, stop_measuring};
use crate::plugin::lod_state::{LodState, ShownLevels, Watchers};
use crate::plugin::meshes::{BuildSettings, BuiltNode, BuiltSurface, VertexExtras, VertexKind};
use crate::plugin::reports::{Report, Reports};
use crate::plugin::{
    BrushApplied, BurrowEngine, BurrowFigures, BurrowSettings, Held, LoosePieceFound, MaterialColors,
    SkyLight, SlimVertices,
};
#[cfg(any(feature = "scatter", feature = "landmass"))]
use crate::terrain::Version;
use crate::terrain::{Commit, OrderKind, PendingDisplay, Receipt, Rejection, Terrain};
use crate::threads::free_later;

/// Starts a transaction for each terrain that has brushes or steps waiting and none under way.
pub(in crate::plugin) fn begin_transactions(
    mut commands: Commands,
    mut terrains: Query<
        (
            Entity,
            &mut Terrain,
            &TerrainEntities,
            Option<&MaterialColors>,
            (Has<SlimVertices>, Option<&SkyLight>),
            Option<&mut LodState>,
        ),
        (Without<Loading>, Without<InFlight>, Without<Held>),
    >,
    build: BuildSettings,
    engine: Res<BurrowEngine>,
    mut figures: ResMut<BurrowFigures>,
    mut history: HistoryMessages,
    mut counter: ResMut<TaskCounter>,
    mut same_frame: ResMut<SameFrame>,
) {
    let start = Instant::now();
    for (entity, mut terrain, entities, colors, (is_slim, sky_light), levels) in &mut terrains {
        // The game moved a terrain here while a task of another entity ran for it.
        if terrain.waits_for_plugin() {
            terrain.abandon();
        }
        // Changes that the game made itself are shown first.
        let kind = VertexKind::of(is_slim, sky_light);
        if terrain.queued() == 0 || !entities.show(terrain.world()) || entities.vertices != kind {
            continue;
        }
        let work = terrain.waiting_work();
        let transaction = terrain.begin_for(true);
        send_history(entity, &mut terrain, &mut history);
        let Some(transaction) = transaction else { continue };
        if let Some(mut levels) = levels {
            levels.count_edit();
        }
        let engine = terrain.engine().unwrap_or(&engine).clone();
        let extras = VertexExtras::of(colors, kind);
        let mut builder = build.builder((entity, &terrain), extras);
        builder.revision += 1;
        let task = InFlight::transaction(counter.next(), entity, transaction, engine, builder);
        commands.entity(entity).try_insert(task);
        same_frame.note(entity, work);
    }
    figures.measure(start.elapsed());
}

/// The messages that commits send.
#[derive(SystemParam)]
pub(super) struct CommitMessages<'w> {
    receipts: MessageWriter<'w, BrushApplied>,
    history: HistoryMessages<'w>,
    found: MessageWriter<'w, LoosePieceFound>,
    #[cfg(any(feature = "scatter", feature = "landmass"))]
    changed: MessageWriter<'w, GroundChanged>,
}

/// A commit changed the ground of a terrain in this frame.
#[cfg(any(feature = "scatter", feature = "landmass"))]
#[derive(Message, Clone, Debug)]
pub(crate) struct GroundChanged {
    pub terrain: Entity,
    /// The versions before and after.
    pub versions: [Version; 2],
    /// Boxes around the samples that changed; `None` if they are not known.
    pub boxes: Option<Vec<LatticeBox>>,
}

/// Parameters of the systems that commit.
#[derive(SystemParam)]
pub(in crate::plugin) struct Commits<'w, 's> {
    pub settings: Res<'w, BurrowSettings>,
    pub terrains: Query<
        'w,
        's,
        (
            Entity,
            &'static mut Terrain,
            &'static mut TerrainEntities,
            &'static mut InFlight,
            Option<(&'static mut LodState, Option<&'static mut ShownLevels>, &'static Watchers)>,
        ),
    >,
    display: Display<'w, 's>,
    messages: CommitMessages<'w>,
}

impl Commits<'_, '_> {
    /// Whether anything is drawn: a server has no meshes.
    pub fn has_meshes(&self) -> bool {
        self.display.assets.is_some()
    }

    /// Adds to the time of the main thread in this frame.
    pub fn measure(&mut self, took: Duration) {
        self.display.figures.measure(took);
    }

    /// Commits tasks that are done, by number and terrain: each transaction whole, as many as the frame's budget of
    /// swaps allows, and at least one.
    pub fn commit(&mut self, mut done: Vec<(u64, Entity)>, swapped: &mut usize) {
        if done.is_empty() {
            return;
        }
        // The oldest first: a task that had to wait for the budget is next.
        done.sort_unstable();
        let _span = info_span!("burrow_commit").entered();
        let Self { settings, terrains, display, messages } = self;
        start_measuring(&mut display.commands);
        for (_, entity) in done {
            let Ok((_, terrain, entities, mut task, levels)) = terrains.get_mut(entity) else { continue };
            let swaps = task.swaps();
            if *swapped > 0 && *swapped + swaps > settings.swaps_per_frame {
                continue;
            }
            let Some(output) = task.done.take() else { continue };
            let ticket = task.ticket;
            display.commands.entity(entity).try_remove::<InFlight>();
            if commit((entity, ticket), terrain, entities, levels, output.ok(), display, messages) {
                *swapped += swaps;
            }
        }
        stop_measuring(&mut display.commands);
    }
}

/// Commits what is done. The meshes of large results are passed to the renderer over several frames before.
pub(in crate::plugin) fn commit_transactions(mut commits: Commits, mut same_frame: ResMut<SameFrame>) {
    same_frame.begin();
    let mut done: Vec<(u64, Entity)> = Vec::new();
    let mut large: Vec<(u64, Entity)> = Vec::new();
    for (entity, terrain, _, mut task, _) in &mut commits.terrains {
        if !task.is_done() {
            continue;
        }
        let is_awaited = task.ticket.is_none_or(|ticket| terrain.waits_for(ticket));
        let is_large = is_awaited && task.swaps() > UPLOADS_PER_FRAME;
        if is_large { &mut large } else { &mut done }.push((task.number, entity));
    }
    // The oldest first, here too.
    large.sort_unstable();
    let mut budget = UPLOADS_PER_FRAME;
    for (number, entity) in large {
        let Ok((_, _, _, mut task, _)) = commits.terrains.get_mut(entity) else { continue };
        if commits.display.assets.as_mut().is_none_or(|assets| task.upload(assets, &mut budget)) {
            done.push((number, entity));
        }
    }
    commits.commit(done, &mut same_frame.swapped);
}

/// Commits the small transactions that began in this frame and are done in time.
pub(in crate::plugin) fn commit_begun(
    mut commits: Commits,
    mut same_frame: ResMut<SameFrame>,
    ticks: SystemChangeTick,
    exits: Option<Res<Messages<AppExit>>>,
    closing: Query<(), With<ClosingWindow>>,
    mut closed: RemovedComponents<Window>,
) {
    let begun = same_frame.bypass_change_detection().take();
    let most = commits.settings.same_frame;
    // A game that ends has no `Update` any more in which it could note what belongs to the edit. Bevy ends it after this
    // when its last window is closed, or despawned by the game.
    let closes = !closing.is_empty() || closed.read().count() > 0;
    let ends = closes || exits.is_some_and(|exits| !exits.is_empty());
    if begun.is_empty() || !commits.has_meshes() || most.is_zero() || ends {
        return;
    }
    let start = Instant::now();
    let mut done = Vec::new();
    let usual = commits.display.figures.usual_transaction();
    for (entity, work, begun) in begun {
        // A brick takes a microsecond or two.
        if u128::from(work) > most.as_micros() {
            continue;
        }
        let Ok((_, _, _, mut task, _)) = commits.terrains.get_mut(entity) else { continue };
        // Where transactions take longer, as they do with colliders on a slow machine, waiting would not help.
        let left = most.saturating_sub(start.elapsed());
        let wait = if usual <= begun.elapsed() + left { left } else { Duration::ZERO };
        if task.is_done_within(wait) && task.is_plain() {
            done.push((task.number, entity));
        }
    }
    commits.measure(start.elapsed());
    if !done.is_empty() {
        same_frame.commit(ticks.this_run());
        commits.commit(done, &mut same_frame.swapped);
    }
}

/// Commits one task's output, and returns whether it did. A transaction that the game abandoned is refused; its edits
/// wait in the queue again. If the task panicked, nothing changes, and its brushes and steps are answered with a
/// rejection.
fn commit(
    (entity, ticket): (Entity, Option<u64>),
    mut terrain: Mut<Terrain>,
    mut entities: Mut<TerrainEntities>,
    levels: Option<(Mut<LodState>, Option<Mut<ShownLevels>>, &Watchers)>,
    output: Option<TaskOutput>,
    display: &mut Display,
    messages: &mut CommitMessages,
) -> bool {
    let start = Instant::now();
    let Some(TaskOutput { change, surfaces, nodes, pieces, times }) =
        output.or_else(|| output_of_panicked((entity, &mut terrain), ticket, &display.reports))
    else {
        return false;
    };
    let commit = match change {
        Change::PendingDisplay(pending) => {
            let is_shown = pending.is_of(terrain.world()) && pending.follows(entities.shown);
            if is_shown {
                #[cfg(any(feature = "scatter", feature = "landmass"))]
                messages.changed.write(GroundChanged {
                    terrain: entity,
                    versions: [entities.shown, pending.version()],
                    boxes: Some(pending.boxes()),
                });
                show_pending((entity, &terrain), &mut entities, &pending, (surfaces, nodes), display);
                display.figures.measure(start.elapsed());
            }
            return is_shown;
        }
        Change::Transaction(commit) if ticket.is_some_and(|ticket| terrain.waits_for(ticket)) => *commit,
        Change::Transaction(commit) => {
            free_later((commit, surfaces, nodes));
            return false;
        }
    };
    if commit.is_cut() {
        let is_committed = commit_cut((entity, terrain), entities, levels, commit, nodes, display);
        if is_committed {
            display.figures.measure(start.elapsed());
        }
        return is_committed;
    }
    let triangles = surfaces.iter().map(BuiltSurface::triangles).sum();
    let built = (surfaces, nodes);
    let Some(receipts) = commit_edits((entity, terrain), entities, commit, built, display, messages) else {
        return false;
    };
    let brushes = receipts.len() as u64;
    send_receipts(entity, receipts, pieces, &display.reports, messages);
    let took = start.elapsed();
    display.figures.count(brushes, times.total, took);
    measure_commit(&mut display.diagnostics, times, took, triangles);
    true
}

/// Shows changes that the game made itself.
fn show_pending(
    (entity, terrain): (Entity, &Terrain),
    entities: &mut TerrainEntities,
    pending: &PendingDisplay,
    (surfaces, nodes): (Vec<BuiltSurface>, Vec<BuiltNode>),
    display: &mut Display,
) {
    entities.shown = pending.version();
    display.show((entity, terrain.world()), entities, surfaces, pending.fields(), true);
    display.show_nodes((entity, terrain.world()), entities, nodes);
    // A game that changes the ground in each frame is always one step ahead; all that was loaded is shown.
    entities.trigger_ready(&mut display.commands, entity);
}

/// Commits and shows another cut of a terrain's levels of detail; returns whether the terrain took it.
fn commit_cut(
    (entity, mut terrain): (Entity, Mut<Terrain>),
    mut entities: Mut<TerrainEntities>,
    levels: Option<(Mut<LodState>, Option<Mut<ShownLevels>>, &Watchers)>,
    commit: Commit,
    nodes: Vec<BuiltNode>,
    display: &mut Display,
) -> bool {
    let changed = nodes.len();
    if terrain.bypass_change_detection().commit_shown(commit).is_err() {
        return false;
    }
    display.show_nodes((entity, terrain.world()), &mut entities, nodes);
    if let (Some((mut state, shown, watchers)), Some(drawn)) = (levels, terrain.drawn_cut()) {
        let now = ShownLevels::of(drawn.cut(), state.count(changed));
        match shown {
            Some(mut shown) => {
                shown.set_if_neq(now);
            }
            // The game removed it.
            None => {
                display.commands.entity(entity).try_insert(now);
            }
        }
        if state.is_settled {
            let is_seen = display.assets.is_none() || !watchers.eyes.is_empty();
            if !is_seen && display.reports.is_new(entity, Report::NobodyLooks) {
                warn!(
                    "the terrain {entity} has levels of detail and is drawn at its coarsest, as no camera looks at it: \
                     spawn a `Camera3d` whose `RenderLayers` meet the terrain's, or a `DetailSource` while the game loads"
                );
            }
            entities.trigger_ready(&mut display.commands, entity);
        }
    }
    true
}

/// Commits and shows the edits and steps of a transaction. Returns the receipts of its edits, or `None` if the terrain
/// refused the commit.
fn commit_edits(
    (entity, mut terrain): (Entity, Mut<Terrain>),
    mut entities: Mut<TerrainEntities>,
    commit: Commit,
    (surfaces, nodes): (Vec<BuiltSurface>, Vec<BuiltNode>),
    display: &mut Display,
    messages: &mut CommitMessages,
) -> Option<Vec<Receipt>> {
    let is_whole = commit.is_whole();
    let fields = commit.field_news().to_vec();
    #[cfg(any(feature = "scatter", feature = "landmass"))]
    let (boxes, before) = (commit.changed_boxes(), terrain.world().version());
    let Ok((receipts, waste)) = terrain.commit_shown(commit) else { return None };
    if !waste.is_empty() {
        free_later(waste);
    }
    #[cfg(any(feature = "scatter", feature = "landmass"))]
    messages.changed.write(GroundChanged {
        terrain: entity,
        versions: [before, terrain.world().version()],
        boxes: (!is_whole).then_some(boxes),
    });
    let is_step = terrain.has_receipts(OrderKind::is_step);
    send_history(entity, &mut terrain, &mut messages.history);
    // Another world is loaded like a new terrain; until then the old one is shown.
    if !is_whole {
        entities.shown = terrain.world().version();
    }
    display.show((entity, terrain.world()), &mut entities, surfaces, &fields, is_step);
    display.show_nodes((entity, terrain.world()), &mut entities, nodes);
    Some(receipts)
}

/// Sends the receipts of a commit's edits and the pieces of ground that broke off, and logs the first panic.
fn send_receipts(
    terrain: Entity,
    receipts: Vec<Receipt>,
    pieces: Vec<LoosePieceFound>,
    reports: &Reports,
    messages: &mut CommitMessages,
) {
    let has_panicked = |receipt: &Receipt| receipt.outcome == Err(Rejection::Panicked);
    if receipts.iter().any(has_panicked) && reports.is_new(terrain, Report::BrushPanicked) {
        warn!(
            "a brush was rejected by the terrain {terrain} because applying it panicked; this is a bug, please report it"
        );
    }
    messages.found.write_batch(pieces);
    let applied = |receipt| BrushApplied { terrain: Some(terrain), receipt };
    messages.receipts.write_batch(receipts.into_iter().map(applied));
}

/// The commit after a task panicked: the rejection of its transaction. `None` if it was not a transaction, or
/// the terrain no longer waits for it; the terrain is then loaded again.
fn output_of_panicked(
    (entity, terrain): (Entity, &mut Mut<Terrain>),
    ticket: Option<u64>,
    reports: &Reports,
) -> Option<TaskOutput> {
    if reports.is_new(entity, Report::TaskPanicked) {
        error!("a task of the terrain {entity} panicked; this is a bug, please report it");
    }
    let rejected = ticket.and_then(|ticket| terrain.rejected(ticket));
    let Some(rejected) = rejected else {
        terrain.bypass_change_detection().forget_pending_display();
        return None;
    };
    let change = Change::Transaction(Box::new(rejected));
    let (surfaces, nodes, pieces) = (Vec::new(), Vec::new(), Vec::new());
    Some(TaskOutput { change, surfaces, nodes, pieces, times: TaskTimes::default() })
}
