//! Transactions: started in tasks, committed whole in one frame.

use std::borrow::Cow;
use std::time::Duration;

use bevy::camera::visibility::NoAutoAabb;
use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

use super::companion::{Fresh, Workshop};
use super::entities::{TerrainEntities, tell};
use super::intake::{pieces, tell_steps};
use super::load::Loading;
use super::meshes::{Ready, Wardrobe};
use super::{
    Attachment, BrushApplied, BurrowEngine, BurrowFigures, BurrowSettings, ChunkChanged, ChunkCreated,
    Companions, HistoryMoved, LooseGround, LoosePieceFound, MaterialColors, Part, ShownSurface, free_later,
};
use crate::terrain::{Commit, Drawn, Terrain};

/// The transaction that a terrain waits for.
#[derive(Component)]
pub(super) struct InFlight {
    /// Counts transactions, over all terrains.
    number: u64,
    task: Task<Prepared>,
    done: Option<Prepared>,
}

/// A commit with its meshes and what goes with them, as they come from the task.
struct Prepared {
    commit: Commit,
    parts: Vec<Fresh>,
    pieces: Vec<LoosePieceFound>,
    took: Duration,
}

/// Starts a transaction for each terrain that has brushes or steps waiting and none under way.
pub(super) fn begin_transactions(
    mut commands: Commands,
    mut terrains: Query<
        (Entity, &mut Terrain, &TerrainEntities, &MaterialColors, Option<&LooseGround>),
        (Without<Loading>, Without<InFlight>),
    >,
    assets: Option<Res<Assets<Mesh>>>,
    companions: Res<Companions>,
    engine: Res<BurrowEngine>,
    mut figures: ResMut<BurrowFigures>,
    mut moved: MessageWriter<HistoryMoved>,
    mut number: Local<u64>,
) {
    let start = Instant::now();
    let draws = assets.is_some();
    for (entity, mut terrain, entities, colors, loose) in &mut terrains {
        // The game put a terrain here whose task another entity had.
        if terrain.waits_for_plugin() {
            terrain.abandon();
        }
        // A world that the game changed by itself is loaded again first.
        if terrain.queued() == 0 || !entities.show(terrain.world()) {
            continue;
        }
        if let Some(&loose) = loose {
            terrain.set_loose(Some(loose.into()));
        }
        let transaction = terrain.begin_for(true);
        tell_steps(entity, &mut terrain, &mut moved);
        let Some(transaction) = transaction else { continue };
        let engine = terrain.engine().unwrap_or(&engine).clone();
        let wardrobe = draws.then(|| Wardrobe::new(terrain.world(), colors));
        let workshop = Workshop { wardrobe, companions: companions.clone() };
        let (size, grid) = (terrain.voxel_size(), terrain.world().grid());
        let revision = terrain.world().revision() + 1;
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let start = Instant::now();
            let mut commit = transaction.run_on(&engine);
            let part = |drawn| Part::new(entity, size, grid, revision, drawn);
            // Taken out, so that they are dropped here and not on the main thread.
            let updates = std::mem::take(&mut commit.meshes);
            let tiles = updates.tiles.iter().map(|(tile, update)| {
                let part = part(Drawn::Tile(*tile));
                workshop.make(&part, update.indices.is_empty(), || Cow::Owned(update.mesh()))
            });
            let chunks = updates.chunks.iter().map(|(at, chunk)| {
                let part = part(Drawn::Chunk(*at));
                workshop.make(&part, chunk.is_empty(), || Cow::Borrowed(chunk.mesh()))
            });
            let parts = tiles.chain(chunks).collect();
            let mut pieces: Vec<LoosePieceFound> = pieces(entity, commit.receipts()).collect();
            if let Some(wardrobe) = &workshop.wardrobe {
                pieces.iter_mut().for_each(|piece| piece.dress(wardrobe));
            }
            Prepared { commit, parts, pieces, took: start.elapsed() }
        });
        *number += 1;
        commands.entity(entity).try_insert(InFlight { number: *number, task, done: None });
    }
    figures.main_thread += start.elapsed();
}

/// Commits what is done: each commit whole, as many of them as the frame's budget of swaps allows, and at least one.
pub(super) fn commit_transactions(
    mut commands: Commands,
    settings: Res<BurrowSettings>,
    mut figures: ResMut<BurrowFigures>,
    mut assets: Option<ResMut<Assets<Mesh>>>,
    mut terrains: Query<(Entity, &mut Terrain, &mut TerrainEntities, &mut InFlight)>,
    shown: Query<&Mesh3d>,
    mut receipts: MessageWriter<BrushApplied>,
    mut moved: MessageWriter<HistoryMoved>,
    mut found: MessageWriter<LoosePieceFound>,
) {
    let mut done = Vec::new();
    for (entity, _, _, mut transaction) in &mut terrains {
        if transaction.done.is_none() {
            transaction.done = check_ready(&mut transaction.task);
        }
        if transaction.done.is_some() {
            done.push((transaction.number, entity));
        }
    }
    if done.is_empty() {
        return;
    }
    // The oldest first: whoever had to wait for the budget is next.
    done.sort_unstable();
    commands.queue(|world: &mut World| world.insert_resource(Applying(Instant::now())));
    let mut swapped = 0;
    for (_, entity) in done {
        let Ok((_, mut terrain, mut entities, mut transaction)) = terrains.get_mut(entity) else { continue };
        let swaps = transaction.done.as_ref().map_or(0, |prepared| prepared.parts.len());
        if swapped > 0 && swapped + swaps > settings.swaps_per_frame {
            continue;
        }
        let Some(Prepared { commit, parts, pieces, took }) = transaction.done.take() else { continue };
        commands.entity(entity).try_remove::<InFlight>();
        let start = Instant::now();
        let news = commit.field_news().to_vec();
        // A transaction that the game gave up is refused; its edits wait in the queue again.
        let Ok((committed, waste)) = terrain.settle(commit) else { continue };
        if !waste.is_empty() {
            free_later(waste);
        }
        let is_step = terrain.has_history_receipts();
        tell_steps(entity, &mut terrain, &mut moved);
        swapped += swaps;
        let world = terrain.world();
        entities.shown = world.version();
        let with_fields = news.iter().map(|&(chunk, _)| (Drawn::Chunk(chunk), None));
        let with_surfaces = parts.into_iter().map(|fresh| (fresh.drawn, Some(fresh)));
        let mut touched = Vec::new();
        for (drawn, fresh) in with_surfaces.chain(with_fields) {
            if let (Drawn::Chunk(chunk), true) = (drawn, is_step) {
                touched.push(chunk);
            }
            let child = entities.get(&mut commands, drawn);
            let is_new = child.is_none();
            if is_new && fresh.as_ref().is_some_and(|fresh| fresh.shown.is_empty) {
                continue;
            }
            let child = child.unwrap_or_else(|| entities.spawn(&mut commands, entity, world, drawn));
            if let Some(fresh) = fresh {
                if let Some(assets) = &mut assets {
                    swap(&mut commands, assets, child, shown.get(child).ok(), fresh.mesh);
                    figures.swaps += 1;
                    if let (Drawn::Chunk(_), false) = (drawn, is_new) {
                        tell(&mut commands, ChunkChanged { entity: child });
                    }
                }
                attach(&mut commands, child, fresh.shown, fresh.attachments);
            }
            if let (Drawn::Chunk(_), true) = (drawn, is_new) {
                tell(&mut commands, ChunkCreated { entity: child });
            }
        }
        entities.tell_fields(&mut commands, world, &news);
        entities.drop_empty(&mut commands, world, touched);
        figures.commits += 1;
        figures.brushes += committed.len() as u64;
        figures.last_transaction = took;
        figures.transactions.push(took);
        found.write_batch(pieces);
        let applied = |receipt| BrushApplied { terrain: Some(entity), receipt };
        receipts.write_batch(committed.into_iter().map(applied));
        let took = start.elapsed();
        figures.last_commit = took;
        figures.commit_times.push(took);
        figures.main_thread += took;
    }
    commands.queue(|world: &mut World| {
        if let Some(Applying(start)) = world.remove_resource() {
            world.resource_mut::<BurrowFigures>().main_thread += start.elapsed();
        }
    });
}

/// When the entities that a frame's commits change began to be changed.
#[derive(Resource)]
struct Applying(Instant);

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
