//! Transactions: started in tasks, committed whole in one frame.

use std::time::Duration;

use bevy::camera::visibility::NoAutoAabb;
use bevy::ecs::system::SystemParam;
use bevy::platform::time::Instant;
use bevy::prelude::*;
use rayon::prelude::*;

use super::companion::{Fresh, Workshop};
use super::entities::{TerrainEntities, tell};
use super::figures::{end_commands, start_commands};
use super::intake::{pieces, tell_steps};
use super::loading::Loading;
use super::meshes::{Ready, Wardrobe};
use super::threads::{ThreadTask, Threads};
use super::{
    Attachment, BrushApplied, BurrowEngine, BurrowFigures, BurrowSettings, ChunkChanged, ChunkCreated,
    Companions, HistoryMoved, LoosePieceFound, MaterialColors, Part, ShownSurface, free_later,
};
use crate::backend::Engine;
use crate::lattice::{ChunkGrid, ChunkPos};
use crate::terrain::{
    Commit, Drawn, FieldNews, Receipt, Rejection, SurfaceDraft, Terrain, Transaction, Unseen,
};

/// The transaction, or what is shown of what the game committed itself, that a terrain waits for.
#[derive(Component)]
pub(super) struct InFlight {
    /// Counts them, over all terrains.
    number: u64,
    /// Of the transaction, if it is one.
    ticket: Option<u64>,
    task: ThreadTask<Prepared>,
    /// The result, or that the task panicked.
    done: Option<Result<Prepared, TaskPanicked>>,
}

/// A task panicked; the panic's message has been printed.
struct TaskPanicked;

/// Meshes and what goes with them, as they come from the task, and what they show.
struct Prepared {
    what: Shows,
    parts: Vec<Fresh>,
    pieces: Vec<LoosePieceFound>,
    took: Duration,
}

/// What is shown.
enum Shows {
    /// A commit, once it is settled.
    Commit(Box<Commit>),
    /// What the game committed itself.
    Unseen(Unseen),
}

/// From how many tiles and chunks on threads share them.
const PARALLEL_PARTS: usize = 8;

/// A transaction on its way into a task, with what its meshes are made with.
struct Job {
    /// The terrain's entity.
    terrain: Entity,
    transaction: Transaction,
    engine: Engine,
    workshop: Workshop,
    /// Metres along a voxel's side.
    voxel_size: f32,
    grid: ChunkGrid,
    /// Of the world once this is committed.
    revision: u64,
}

impl Job {
    /// Runs the transaction, and makes all that is shown with its commit.
    fn run(self) -> Prepared {
        let _span = info_span!("burrow transaction").entered();
        let start = Instant::now();
        let Self { terrain, transaction, engine, workshop, voxel_size, grid, revision } = self;
        let mut commit = transaction.run_on(&engine);
        let part = |drawn| Part::new(terrain, voxel_size, grid, revision, drawn);
        // Taken out, so that they are dropped here and not on the main thread.
        let updates = std::mem::take(&mut commit.meshes);
        let tiles =
            updates.tiles.into_iter().map(|(tile, update)| (Drawn::Tile(tile), SurfaceDraft::Tile(update)));
        let chunks = updates.chunks.into_iter();
        let chunks = chunks.map(|(at, chunk)| (Drawn::Chunk(at), SurfaceDraft::Chunk(chunk)));
        let drafts: Vec<_> = tiles.chain(chunks).collect();
        let make =
            |(drawn, draft): (Drawn, SurfaceDraft)| workshop.make(&part(drawn), draft.is_empty(), || draft);
        let parts = info_span!("burrow surfaces").in_scope(|| for_each_part(drafts, make));
        let mut pieces: Vec<LoosePieceFound> = pieces(terrain, commit.receipts()).collect();
        if let Some(wardrobe) = &workshop.wardrobe {
            pieces.iter_mut().for_each(|piece| piece.dress(wardrobe));
        }
        Prepared { what: Shows::Commit(Box::new(commit)), parts, pieces, took: start.elapsed() }
    }
}

/// Makes parts, several at a time where there are many.
fn for_each_part<T: Send>(parts: Vec<T>, make: impl Fn(T) -> Fresh + Sync + Send) -> Vec<Fresh> {
    if parts.len() < PARALLEL_PARTS {
        parts.into_iter().map(make).collect()
    } else {
        parts.into_par_iter().map(make).collect()
    }
}

/// Starts on what the game changed of a terrain that is shown.
pub(super) fn begin_unseen(
    commands: &mut Commands,
    (entity, terrain): (Entity, &Terrain),
    unseen: Unseen,
    workshop: Workshop,
    number: u64,
) {
    let (world, voxel_size) = (terrain.world(), terrain.voxel_size());
    let part = |drawn| Part::new(entity, voxel_size, world.grid(), world.revision(), drawn);
    let parts: Vec<(Part, SurfaceDraft)> =
        unseen.drawn().map(|drawn| (part(drawn), world.draft(drawn))).collect();
    let task = ThreadTask::start(Threads::Transactions, move || {
        let start = Instant::now();
        let parts = for_each_part(parts, |(part, draft)| workshop.make(&part, false, || draft));
        Prepared { what: Shows::Unseen(unseen), parts, pieces: Vec::new(), took: start.elapsed() }
    });
    commands.entity(entity).try_insert(InFlight { number, ticket: None, task, done: None });
}

/// Counts transactions over all terrains, so that they are committed in the order in which they began.
#[derive(Resource, Default)]
pub(super) struct Numbers(u64);

impl Numbers {
    pub fn next(&mut self) -> u64 {
        self.0 += 1;
        self.0
    }
}

/// Starts a transaction for each terrain that has brushes or steps waiting and none under way.
pub(super) fn begin_transactions(
    mut commands: Commands,
    mut terrains: Query<
        (Entity, &mut Terrain, &TerrainEntities, Option<&MaterialColors>),
        (Without<Loading>, Without<InFlight>),
    >,
    assets: Option<Res<Assets<Mesh>>>,
    companions: Res<Companions>,
    engine: Res<BurrowEngine>,
    mut figures: ResMut<BurrowFigures>,
    mut moved: MessageWriter<HistoryMoved>,
    mut numbers: ResMut<Numbers>,
) {
    let start = Instant::now();
    let draws = assets.is_some();
    for (entity, mut terrain, entities, colors) in &mut terrains {
        // The game put a terrain here whose task another entity had.
        if terrain.waits_for_plugin() {
            terrain.abandon();
        }
        // What the game changed by itself is shown first.
        if terrain.queued() == 0 || !entities.show(terrain.world()) {
            continue;
        }
        let transaction = terrain.begin_for(true);
        tell_steps(entity, &mut terrain, &mut moved);
        let Some(transaction) = transaction else { continue };
        let ticket = Some(transaction.ticket());
        let engine = terrain.engine().unwrap_or(&engine).clone();
        let wardrobe = draws.then(|| Wardrobe::new(terrain.world(), colors));
        let workshop = Workshop { wardrobe, companions: companions.clone() };
        let job = Job {
            terrain: entity,
            transaction,
            engine,
            workshop,
            voxel_size: terrain.voxel_size(),
            grid: terrain.world().grid(),
            revision: terrain.world().revision() + 1,
        };
        let task = ThreadTask::start(Threads::Transactions, move || job.run());
        let number = numbers.next();
        commands.entity(entity).try_insert(InFlight { number, ticket, task, done: None });
    }
    figures.main_thread += start.elapsed();
}

/// What shows commits: entities and their meshes.
#[derive(SystemParam)]
pub(super) struct Screen<'w, 's> {
    commands: Commands<'w, 's>,
    assets: Option<ResMut<'w, Assets<Mesh>>>,
    meshes: Query<'w, 's, &'static Mesh3d>,
    figures: ResMut<'w, BurrowFigures>,
}

/// What commits say in messages.
#[derive(SystemParam)]
pub(super) struct News<'w> {
    receipts: MessageWriter<'w, BrushApplied>,
    moved: MessageWriter<'w, HistoryMoved>,
    found: MessageWriter<'w, LoosePieceFound>,
}

/// Commits what is done: each commit whole, as many of them as the frame's budget of swaps allows, and at least one.
pub(super) fn commit_transactions(
    settings: Res<BurrowSettings>,
    mut terrains: Query<(Entity, &mut Terrain, &mut TerrainEntities, &mut InFlight)>,
    mut screen: Screen,
    mut news: News,
) {
    let done = done_in_order(&mut terrains);
    if done.is_empty() {
        return;
    }
    start_commands(&mut screen.commands);
    let mut swapped = 0;
    for entity in done {
        let Ok((_, terrain, entities, mut transaction)) = terrains.get_mut(entity) else { continue };
        let done = transaction.done.as_ref().and_then(|done| done.as_ref().ok());
        let swaps = done.map_or(0, |prepared| prepared.parts.len());
        if swapped > 0 && swapped + swaps > settings.swaps_per_frame {
            continue;
        }
        let Some(prepared) = transaction.done.take() else { continue };
        let ticket = transaction.ticket;
        screen.commands.entity(entity).try_remove::<InFlight>();
        if commit((entity, ticket), terrain, entities, prepared.ok(), &mut screen, &mut news) {
            swapped += swaps;
        }
    }
    end_commands(&mut screen.commands);
}

/// The terrains whose transactions are done, the oldest first: whoever had to wait for the budget is next.
fn done_in_order(
    terrains: &mut Query<(Entity, &mut Terrain, &mut TerrainEntities, &mut InFlight)>,
) -> Vec<Entity> {
    let mut done = Vec::new();
    for (entity, _, _, mut transaction) in terrains.iter_mut() {
        if transaction.done.is_none() {
            transaction.done = transaction.task.check().map(|done| done.map_err(|_| TaskPanicked));
        }
        if transaction.done.is_some() {
            done.push((transaction.number, entity));
        }
    }
    done.sort_unstable();
    done.into_iter().map(|(_, entity)| entity).collect()
}

/// Commits one transaction, and says whether it did: one that the game gave up is refused, and its edits wait in the
/// queue again. Where the task panicked, nothing is changed, and all that it was for is answered so.
fn commit(
    (entity, ticket): (Entity, Option<u64>),
    mut terrain: Mut<Terrain>,
    mut entities: Mut<TerrainEntities>,
    prepared: Option<Prepared>,
    screen: &mut Screen,
    news: &mut News,
) -> bool {
    let _span = info_span!("burrow commit").entered();
    let start = Instant::now();
    let (what, parts, pieces, took) = match (prepared, ticket) {
        (Some(Prepared { what, parts, pieces, took }), _) => (what, parts, pieces, took),
        (None, ticket) => {
            error_once!("a task of the plugin's panicked; this is a bug, please report it");
            let refused = ticket.and_then(|ticket| terrain.rejected(ticket));
            let Some(refused) = refused else {
                // What it was to show is shown by loading all of it.
                terrain.bypass_change_detection().forget_unseen();
                return false;
            };
            (Shows::Commit(Box::new(refused)), Vec::new(), Vec::new(), Duration::ZERO)
        }
    };
    let commit = match what {
        Shows::Unseen(unseen) => {
            let is_shown = unseen.is_of(terrain.world()) && unseen.follows(entities.shown);
            if is_shown {
                entities.shown = unseen.version();
                screen.show(entity, &terrain, &mut entities, parts, unseen.fields(), true);
                // Who changes the ground in each frame is always one step ahead; all of what was loaded is there.
                entities.tell_ready(&mut screen.commands, entity);
                screen.figures.main_thread += start.elapsed();
            }
            return is_shown;
        }
        Shows::Commit(commit) if ticket.is_some_and(|ticket| terrain.waits_for(ticket)) => *commit,
        Shows::Commit(commit) => {
            free_later((commit, parts));
            return false;
        }
    };
    let fields = commit.field_news().to_vec();
    let Ok((receipts, waste)) = terrain.commit_shown(commit) else { return false };
    if !waste.is_empty() {
        free_later(waste);
    }
    let is_step = terrain.has_history_receipts();
    tell_steps(entity, &mut terrain, &mut news.moved);
    entities.shown = terrain.world().version();
    screen.show(entity, &terrain, &mut entities, parts, &fields, is_step);
    let brushes = receipts.len() as u64;
    if receipts.iter().any(|receipt| receipt.outcome == Err(Rejection::Panicked)) {
        warn_once!("a brush was rejected because applying it panicked; this is a bug, please report it");
    }
    news.tell(entity, receipts, pieces);
    screen.figures.count(brushes, took, start.elapsed());
    true
}

impl Screen<'_, '_> {
    /// Shows all that a commit changed of a terrain.
    fn show(
        &mut self,
        entity: Entity,
        terrain: &Terrain,
        entities: &mut TerrainEntities,
        parts: Vec<Fresh>,
        fields: &[(ChunkPos, FieldNews)],
        is_step: bool,
    ) {
        let world = terrain.world();
        let with_fields = fields.iter().map(|&(chunk, _)| (Drawn::Chunk(chunk), None));
        let with_surfaces = parts.into_iter().map(|fresh| (fresh.drawn, Some(fresh)));
        let mut touched = Vec::new();
        for (drawn, fresh) in with_surfaces.chain(with_fields) {
            if let (Drawn::Chunk(chunk), true) = (drawn, is_step) {
                touched.push(chunk);
            }
            self.show_part((entity, terrain), entities, drawn, fresh);
        }
        entities.tell_fields(&mut self.commands, world, fields);
        entities.drop_empty(&mut self.commands, world, touched);
    }

    /// Shows a tile or chunk with its new surface, if it has a new one; spawns it where it has no entity yet.
    fn show_part(
        &mut self,
        (entity, terrain): (Entity, &Terrain),
        entities: &mut TerrainEntities,
        drawn: Drawn,
        fresh: Option<Fresh>,
    ) {
        let commands = &mut self.commands;
        let child = entities.get(commands, drawn);
        let is_new = child.is_none();
        let is_gone = match drawn {
            Drawn::Chunk(chunk) => {
                terrain.world().fields_of(chunk).is_none() && !terrain.world().draws(chunk)
            }
            Drawn::Tile(_) => false,
        };
        if is_new && (is_gone || fresh.as_ref().is_some_and(|fresh| fresh.shown.is_empty)) {
            return;
        }
        let child = child.unwrap_or_else(|| entities.spawn(commands, entity, terrain.world(), drawn));
        let has_changed = fresh.is_some();
        if let Some(fresh) = fresh {
            if let Some(assets) = &mut self.assets {
                swap(commands, assets, child, self.meshes.get(child).ok(), fresh.mesh);
                self.figures.swaps += 1;
            }
            attach(commands, child, fresh.shown, fresh.attachments);
        }
        match drawn {
            Drawn::Chunk(_) if is_new => tell(commands, ChunkCreated { entity: child }),
            Drawn::Chunk(_) if has_changed => tell(commands, ChunkChanged { entity: child }),
            _ => {}
        }
    }
}

impl News<'_> {
    /// Tells what became of a transaction's brushes, and what they cut off.
    fn tell(&mut self, terrain: Entity, receipts: Vec<Receipt>, pieces: Vec<LoosePieceFound>) {
        self.found.write_batch(pieces);
        let applied = |receipt| BrushApplied { terrain: Some(terrain), receipt };
        self.receipts.write_batch(receipts.into_iter().map(applied));
    }
}

/// Tells which surface an entity shows, and does to it what goes with that.
pub(super) fn attach(
    commands: &mut Commands,
    child: Entity,
    shown: ShownSurface,
    attachments: Vec<Attachment>,
) {
    let Ok(mut child) = commands.get_entity(child) else { return };
    child.try_insert(shown);
    for attachment in attachments {
        attachment(&mut child);
    }
}

/// Bevy's renderer forgets which material an entity has when its mesh is removed, and asks again only when it comes into
/// view or gets another material.
fn look_again(mut child: EntityWorldMut) {
    if let Some(mut visibility) = child.get_mut::<ViewVisibility>() {
        visibility.set_changed();
    }
}

/// Puts a mesh in place of an entity's old one, under the same handle.
fn swap(
    commands: &mut Commands,
    assets: &mut Assets<Mesh>,
    child: Entity,
    shown: Option<&Mesh3d>,
    ready: Ready,
) {
    let Ok(mut child) = commands.get_entity(child) else { return };
    match (ready, shown) {
        (None, _) => {
            child.try_remove::<Mesh3d>();
        }
        (Some((mesh, bounds)), shown) => {
            let mut fresh = Some(mesh);
            if let Some(Mesh3d(handle)) = shown
                && let Some(mesh) = fresh.take()
                && let Err(error) = assets.insert(handle, mesh)
            {
                warn!("a mesh could not be swapped: {error}");
            }
            if let Some(mesh) = fresh {
                child.try_insert(Mesh3d(assets.add(mesh))).queue_silenced(look_again);
            }
            child.try_insert((bounds, NoAutoAabb));
        }
    }
}
