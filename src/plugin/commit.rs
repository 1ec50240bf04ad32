//! Transactions: started in tasks, committed whole in one frame.

use std::time::Duration;

use bevy::camera::visibility::NoAutoAabb;
use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

use super::entities::{TerrainEntities, tell};
use super::intake::tell_steps;
use super::load::Loading;
use super::meshes::{Ready, Wardrobe};
use super::{
    BrushApplied, BurrowEngine, BurrowFigures, BurrowSettings, ChunkChanged, ChunkCreated, HistoryMoved,
    MaterialColors,
};
use crate::surface::SurfaceMesh;
use crate::terrain::{Commit, Drawn, Terrain};

/// The transaction that a terrain waits for.
#[derive(Component)]
pub(super) struct InFlight {
    /// Counts transactions, over all terrains.
    number: u64,
    task: Task<Prepared>,
    done: Option<Prepared>,
}

/// A commit with its meshes, as they come from the task.
struct Prepared {
    commit: Commit,
    meshes: Vec<(Drawn, Ready)>,
    took: Duration,
}

/// Starts a transaction for each terrain that has brushes or steps waiting and none under way.
pub(super) fn begin_transactions(
    mut commands: Commands,
    mut terrains: Query<
        (Entity, &mut Terrain, &TerrainEntities, &MaterialColors),
        (Without<Loading>, Without<InFlight>),
    >,
    assets: Option<Res<Assets<Mesh>>>,
    engine: Res<BurrowEngine>,
    mut figures: ResMut<BurrowFigures>,
    mut moved: MessageWriter<HistoryMoved>,
    mut number: Local<u64>,
) {
    let start = Instant::now();
    let draws = assets.is_some();
    for (entity, mut terrain, entities, colors) in &mut terrains {
        // A world that the game changed by itself is loaded again first.
        if terrain.queued() == 0 || terrain.world().version() != entities.shown {
            continue;
        }
        let transaction = terrain.begin();
        tell_steps(entity, &mut terrain, &mut moved);
        let Some(transaction) = transaction else { continue };
        let wardrobe = Wardrobe::new(terrain.world(), colors);
        let engine = terrain.engine().unwrap_or(&engine).clone();
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let start = Instant::now();
            let mut commit = transaction.run_on(&engine);
            let build = |drawn: Drawn, surface: &SurfaceMesh| {
                if draws { wardrobe.build(drawn, surface) } else { None }
            };
            // Taken out, so that they are dropped here and not on the main thread.
            let updates = std::mem::take(&mut commit.meshes);
            let tiles = updates.tiles.iter().map(|(tile, update)| {
                let drawn = Drawn::Tile(*tile);
                (drawn, if draws { build(drawn, &update.mesh()) } else { None })
            });
            let chunks = updates.chunks.iter().map(|(at, chunk)| {
                let drawn = Drawn::Chunk(*at);
                (drawn, build(drawn, chunk.mesh()))
            });
            let meshes = tiles.chain(chunks).collect();
            Prepared { commit, meshes, took: start.elapsed() }
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
    // The oldest first: whoever had to wait for the budget is next.
    done.sort_unstable();
    let mut swapped = 0;
    for (_, entity) in done {
        let Ok((_, mut terrain, mut entities, mut transaction)) = terrains.get_mut(entity) else { continue };
        let swaps = transaction.done.as_ref().map_or(0, |prepared| prepared.meshes.len());
        if swapped > 0 && swapped + swaps > settings.swaps_per_frame {
            continue;
        }
        let Some(Prepared { commit, meshes, took }) = transaction.done.take() else { continue };
        commands.entity(entity).try_remove::<InFlight>();
        let start = Instant::now();
        let news = commit.field_news().to_vec();
        // A transaction that the game gave up is refused; its edits wait in the queue again.
        let Ok((committed, waste)) = terrain.settle(commit) else { continue };
        if !waste.is_empty() {
            AsyncComputeTaskPool::get().spawn(async move { drop(waste) }).detach();
        }
        tell_steps(entity, &mut terrain, &mut moved);
        swapped += swaps;
        let world = terrain.world();
        entities.shown = world.version();
        let with_fields = news.iter().map(|&(chunk, _)| (Drawn::Chunk(chunk), None));
        let with_meshes = meshes.into_iter().map(|(drawn, ready)| (drawn, Some(ready)));
        let mut touched = Vec::new();
        for (drawn, ready) in with_meshes.chain(with_fields) {
            if let Drawn::Chunk(chunk) = drawn {
                touched.push(chunk);
            }
            let child = entities.get(&mut commands, drawn);
            let is_new = child.is_none();
            if is_new && matches!(ready, Some(None)) {
                continue;
            }
            let child = child.unwrap_or_else(|| entities.spawn(&mut commands, entity, world, drawn));
            if let (Some(ready), Some(assets)) = (ready, &mut assets) {
                swap(&mut commands, assets, child, shown.get(child).ok(), ready);
                figures.swaps += 1;
                if let (Drawn::Chunk(_), false) = (drawn, is_new) {
                    tell(&mut commands, ChunkChanged { entity: child });
                }
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
        let applied = |receipt| BrushApplied { terrain: Some(entity), receipt };
        receipts.write_batch(committed.into_iter().map(applied));
        let took = start.elapsed();
        figures.last_commit = took;
        figures.commit_times.push(took);
        figures.main_thread += took;
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
                child.try_insert(Mesh3d(assets.add(mesh)));
            }
            child.try_insert((bounds, NoAutoAabb));
        }
    }
}
