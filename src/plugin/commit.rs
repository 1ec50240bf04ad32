//! Starts transactions, and commits each of them whole in one frame.

use std::time::Duration;

use bevy::camera::visibility::VisibilityClass;
use bevy::diagnostic::Diagnostics;
use bevy::ecs::system::{SystemChangeTick, SystemParam};
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::collect::{HistoryMessages, send_history};
use super::diagnostics::measure_commit;
use super::entities::{TerrainEntities, apply_actions, is_empty, trigger_if_alive};
use super::figures::{MainThread, TaskTimes, start_measuring, stop_measuring};
use super::load::Loading;
use super::lod_state::{LodState, ShownLevels, WantedTiles, Watchers};
use super::meshes::{BuiltMesh, VertexExtras, VertexKind};
use super::processor::{BuildSettings, BuiltNode, BuiltSurface};
use super::reports::{Report, Reports};
use super::same_frame::SameFrame;
use super::task::{Change, InFlight, TaskCounter, TaskOutput};
use super::{
    BrushApplied, BurrowEngine, BurrowFigures, BurrowSettings, ChunkChanged, ChunkCreated, Held,
    LoosePieceFound, MaterialColors, SkyLight, SlimVertices,
};
use crate::lattice::ChunkPos;
#[cfg(any(feature = "scatter", feature = "landmass"))]
use crate::lattice::LatticeBox;
#[cfg(any(feature = "scatter", feature = "landmass"))]
use crate::terrain::Version;
use crate::terrain::{Asked, FieldChange, MeshKey, Receipt, Rejection, Terrain, World as TerrainWorld};
use crate::threads::free_later;

/// Starts a transaction for each terrain that has brushes or steps waiting and none under way.
pub(super) fn begin_transactions(
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

/// The parameters of systems that commit: entities, meshes and figures.
#[derive(SystemParam)]
pub(super) struct Display<'w, 's> {
    commands: Commands<'w, 's>,
    assets: Option<ResMut<'w, Assets<Mesh>>>,
    meshes: Query<'w, 's, &'static Mesh3d>,
    wanted: Res<'w, WantedTiles>,
    reports: Reports<'w>,
    figures: ResMut<'w, BurrowFigures>,
    diagnostics: Diagnostics<'w, 's>,
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

/// All that it takes to commit.
#[derive(SystemParam)]
pub(super) struct Commits<'w, 's> {
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
            let swaps = match &task.done {
                Some(Ok(output)) => output.swaps(),
                _ => 0,
            };
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

/// Commits what is done.
pub(super) fn commit_transactions(mut commits: Commits, mut same_frame: ResMut<SameFrame>) {
    same_frame.begin();
    let mut done: Vec<(u64, Entity)> = Vec::new();
    for (entity, _, _, mut task, _) in &mut commits.terrains {
        if task.is_done() {
            done.push((task.number, entity));
        }
    }
    commits.commit(done, &mut same_frame.swapped);
}

/// Commits the small transactions that began in this frame and are done in time.
pub(super) fn commit_begun(
    mut commits: Commits,
    mut same_frame: ResMut<SameFrame>,
    ticks: SystemChangeTick,
    exits: Option<Res<Messages<AppExit>>>,
) {
    let begun = same_frame.bypass_change_detection().take();
    let most = commits.settings.same_frame;
    // A game that ends has no `Update` any more in which it could note what belongs to the edit.
    let ends = exits.is_some_and(|exits| !exits.is_empty());
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
        // Where transactions take longer, as they do with colliders on a slow machine, waiting would be in vain.
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

/// Commits one task's output, and says whether it did. A transaction that the game abandoned is refused; its edits wait
/// in the queue again. If the task panicked, nothing changes, and its brushes and steps are answered with a rejection.
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
                    boxes: None,
                });
                entities.shown = pending.version();
                display.show((entity, terrain.world()), &mut entities, surfaces, pending.fields(), true);
                display.show_nodes((entity, terrain.world()), &mut entities, nodes);
                // A game that changes the ground in each frame is always one step ahead; all that was loaded is shown.
                entities.trigger_ready(&mut display.commands, entity);
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
        display.figures.measure(start.elapsed());
        return true;
    }
    let is_whole = commit.is_whole();
    let fields = commit.field_news().to_vec();
    #[cfg(any(feature = "scatter", feature = "landmass"))]
    let (boxes, before) = (commit.changed_boxes(), terrain.world().version());
    let Ok((receipts, waste)) = terrain.commit_shown(commit) else { return false };
    if !waste.is_empty() {
        free_later(waste);
    }
    #[cfg(any(feature = "scatter", feature = "landmass"))]
    messages.changed.write(GroundChanged {
        terrain: entity,
        versions: [before, terrain.world().version()],
        boxes: (!is_whole).then_some(boxes),
    });
    let is_step = terrain.has_receipts(Asked::is_step);
    send_history(entity, &mut terrain, &mut messages.history);
    // Another world is loaded like a new terrain; until then the old one is shown.
    if !is_whole {
        entities.shown = terrain.world().version();
    }
    let triangles = surfaces.iter().map(BuiltSurface::triangles).sum();
    display.show((entity, terrain.world()), &mut entities, surfaces, &fields, is_step);
    display.show_nodes((entity, terrain.world()), &mut entities, nodes);
    let has_panicked = |receipt: &Receipt| receipt.outcome == Err(Rejection::Panicked);
    if receipts.iter().any(has_panicked) && display.reports.is_new(entity, Report::BrushPanicked) {
        warn!(
            "a brush was rejected by the terrain {entity} because applying it panicked; this is a bug, please report it"
        );
    }
    let brushes = receipts.len() as u64;
    messages.found.write_batch(pieces);
    let applied = |receipt| BrushApplied { terrain: Some(entity), receipt };
    messages.receipts.write_batch(receipts.into_iter().map(applied));
    let took = start.elapsed();
    display.figures.count(brushes, times.total, took);
    measure_commit(&mut display.diagnostics, times, took, triangles);
    true
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

impl Display<'_, '_> {
    /// Shows all that a commit changed of a terrain.
    fn show(
        &mut self,
        (entity, world): (Entity, &TerrainWorld),
        entities: &mut TerrainEntities,
        surfaces: Vec<BuiltSurface>,
        fields: &[(ChunkPos, FieldChange)],
        is_step: bool,
    ) {
        let with_fields = fields.iter().map(|&(chunk, _)| (MeshKey::Chunk(chunk), None));
        let with_surfaces = surfaces.into_iter().map(|built| (built.drawn, Some(built)));
        let mut touched = Vec::new();
        for (drawn, built) in with_surfaces.chain(with_fields) {
            if let (MeshKey::Chunk(chunk), true) = (drawn, is_step) {
                touched.push(chunk);
            }
            self.show_part((entity, world), entities, drawn, built);
        }
        entities.update_fields(&mut self.commands, world, fields);
        entities.drop_empty(&mut self.commands, world, touched);
    }

    /// Shows a tile or chunk with its new surface, if it has a new one; spawns its entity if it has none yet.
    fn show_part(
        &mut self,
        (entity, world): (Entity, &TerrainWorld),
        entities: &mut TerrainEntities,
        drawn: MeshKey,
        built: Option<BuiltSurface>,
    ) {
        let commands = &mut self.commands;
        let child = entities.get(commands, drawn);
        let is_new = child.is_none();
        let is_gone = match drawn {
            MeshKey::Chunk(chunk) => is_empty(world, chunk),
            // It has an entity while it is drawn, or wanted.
            MeshKey::Tile(_) => built.as_ref().is_some_and(|built| !built.is_drawn),
        };
        if is_new && (is_gone || built.as_ref().is_some_and(|built| built.shown.is_empty)) {
            return;
        }
        let child = child.unwrap_or_else(|| entities.spawn(commands, entity, world, drawn));
        let has_changed = built.is_some();
        if let Some(BuiltSurface { mesh, shown, actions, is_drawn, .. }) = built {
            if let Some(assets) = &mut self.assets
                && is_drawn
            {
                swap(commands, assets, child, self.meshes.get(child).ok(), mesh);
                self.figures.swaps += 1;
            }
            apply_actions(commands, child, shown, actions);
        }
        match drawn {
            MeshKey::Chunk(_) if is_new => trigger_if_alive(commands, ChunkCreated { entity: child }),
            MeshKey::Chunk(_) if has_changed => trigger_if_alive(commands, ChunkChanged { entity: child }),
            _ => {}
        }
    }
}

impl Display<'_, '_> {
    /// Shows nodes as they are drawn from now on.
    fn show_nodes(
        &mut self,
        (entity, world): (Entity, &TerrainWorld),
        entities: &mut TerrainEntities,
        nodes: Vec<BuiltNode>,
    ) {
        for BuiltNode { node, mesh, shown, hidden } in nodes {
            for drawn in hidden {
                self.hide_part(entity, entities, drawn);
            }
            for built in shown {
                self.show_part((entity, world), entities, built.drawn, Some(built));
            }
            let commands = &mut self.commands;
            let Some(mesh) = mesh else {
                entities.despawn_node(commands, node);
                continue;
            };
            let child = entities.node(commands, entity, world, node);
            if let Some(assets) = &mut self.assets {
                swap(commands, assets, child, self.meshes.get(child).ok(), mesh);
                self.figures.swaps += 1;
            }
        }
    }

    /// Draws a tile or chunk no more. A tile that nothing else needs has no entity any more.
    fn hide_part(&mut self, terrain: Entity, entities: &mut TerrainEntities, drawn: MeshKey) {
        let Some(child) = entities.get(&mut self.commands, drawn) else { return };
        match drawn {
            MeshKey::Tile(tile) if !self.wanted.has(terrain, tile) => {
                entities.despawn_tile(&mut self.commands, tile);
            }
            _ => {
                self.commands.entity(child).try_remove::<Drawing>();
            }
        }
    }
}

/// The components that an entity loses when it draws nothing. Bevy adds to the list of visibility classes with each
/// `Mesh3d` that is inserted and never takes anything from it: the entity would be seen twice after the next one.
type Drawing = (Mesh3d, VisibilityClass);

/// Bevy's renderer forgets which material an entity has when its mesh is removed, and asks again only when it comes
/// into view or gets another material.
fn refresh_material(mut child: EntityWorldMut) {
    if let Some(mut visibility) = child.get_mut::<ViewVisibility>() {
        visibility.set_changed();
    }
}

/// Replaces an entity's mesh under the same handle.
fn swap(
    commands: &mut Commands,
    assets: &mut Assets<Mesh>,
    child: Entity,
    shown: Option<&Mesh3d>,
    mesh: BuiltMesh,
) {
    let Ok(mut child) = commands.get_entity(child) else { return };
    match (mesh, shown) {
        (None, _) => {
            child.try_remove::<Drawing>();
        }
        (Some((mesh, facts)), shown) => {
            let mut new = Some(mesh);
            if let Some(Mesh3d(handle)) = shown
                && let Some(mesh) = new.take()
                && let Err(error) = assets.insert(handle, mesh)
            {
                warn!("a mesh could not be swapped: {error}");
            }
            if let Some(mesh) = new {
                child.try_insert(Mesh3d(assets.add(mesh))).queue_silenced(refresh_material);
            }
            child.try_insert(facts);
        }
    }
}
