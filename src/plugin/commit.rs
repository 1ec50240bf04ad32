//! Transactions: started in tasks, committed whole in one frame.

use std::time::Duration;

use bevy::camera::visibility::NoAutoAabb;
use bevy::platform::collections::HashMap;
use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

use super::load::Loading;
use super::meshes::{self, Ready};
use super::{
    BrushApplied, BurrowFigures, BurrowSettings, Chunk, ChunkChanged, ChunkCreated, Field, FieldChanged,
    FieldCreated, FieldMerged, MaterialColors,
};
use crate::lattice::{ChunkPos, TilePos};
use crate::terrain::{Commit, Drawn, FieldNews, Terrain, Version, World};
use crate::volume::{self, FieldId};

/// The entities below a terrain, and the world that they show. Its presence says that the terrain has loaded.
#[derive(Component)]
pub struct TerrainEntities {
    pub(super) shown: Version,
    pub(super) tiles: HashMap<TilePos, Entity>,
    pub(super) chunks: HashMap<ChunkPos, Entity>,
    pub(super) fields: HashMap<FieldId, Entity>,
}

impl TerrainEntities {
    pub(super) fn new(shown: Version) -> Self {
        Self { shown, tiles: HashMap::default(), chunks: HashMap::default(), fields: HashMap::default() }
    }

    /// Tiles and chunks; fields lie below these.
    pub(super) fn drawn(&self) -> impl Iterator<Item = Entity> {
        self.tiles.values().chain(self.chunks.values()).copied()
    }
}

/// The transaction that a terrain waits for.
#[derive(Component)]
pub(super) struct InFlight {
    task: Task<Prepared>,
    done: Option<Prepared>,
}

/// A commit with its meshes, as they come from the task.
struct Prepared {
    commit: Commit,
    meshes: Vec<(Drawn, Ready)>,
    took: Duration,
}

/// Starts a transaction for each terrain that has brushes waiting and none under way.
pub(super) fn begin_transactions(
    mut commands: Commands,
    mut terrains: Query<
        (Entity, &mut Terrain, &TerrainEntities, &MaterialColors),
        (Without<Loading>, Without<InFlight>),
    >,
    assets: Option<Res<Assets<Mesh>>>,
    mut figures: ResMut<BurrowFigures>,
) {
    let start = Instant::now();
    let draws = assets.is_some();
    for (entity, mut terrain, entities, colors) in &mut terrains {
        // A world that the game changed by itself is loaded again first.
        if terrain.queued() == 0 || terrain.world().version() != entities.shown {
            continue;
        }
        let Some(transaction) = terrain.begin() else { continue };
        let colors = colors.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let start = Instant::now();
            let mut commit = transaction.run();
            let updates = std::mem::take(&mut commit.meshes);
            let tiles = updates.tiles.iter().map(|(tile, surface)| (Drawn::Tile(*tile), surface));
            let chunks = updates.chunks.iter().map(|(chunk, surface)| (Drawn::Chunk(*chunk), surface));
            let build =
                |(drawn, surface)| (drawn, if draws { meshes::build(surface, &colors) } else { None });
            let meshes = tiles.chain(chunks).map(build).collect();
            Prepared { commit, meshes, took: start.elapsed() }
        });
        commands.entity(entity).insert(InFlight { task, done: None });
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
) {
    let mut swapped = 0;
    for (entity, mut terrain, mut entities, mut transaction) in &mut terrains {
        if transaction.done.is_none() {
            transaction.done = check_ready(&mut transaction.task);
        }
        let swaps = transaction.done.as_ref().map_or(0, |prepared| prepared.meshes.len());
        if swapped > 0 && swapped + swaps > settings.swaps_per_frame {
            continue;
        }
        let Some(Prepared { commit, meshes, took }) = transaction.done.take() else { continue };
        commands.entity(entity).remove::<InFlight>();
        let start = Instant::now();
        let news = commit.field_news().to_vec();
        let committed = match terrain.commit(commit) {
            Ok(committed) => committed,
            // The game gave the transaction up, and with it has taken its edits back.
            Err(_) => continue,
        };
        swapped += swaps;
        let world = terrain.world();
        entities.shown = world.version();
        for (drawn, ready) in meshes {
            let child = match drawn {
                Drawn::Tile(tile) => entities.tiles.get(&tile).copied(),
                Drawn::Chunk(chunk) => Some(match entities.chunks.get(&chunk) {
                    Some(&child) => {
                        commands.trigger(ChunkChanged { entity: child });
                        child
                    }
                    None if ready.is_some() => {
                        spawn_chunk(&mut commands, &mut entities, entity, world, chunk)
                    }
                    None => continue,
                }),
            };
            if let (Some(child), Some(assets)) = (child, &mut assets) {
                swap(&mut commands, assets, child, shown.get(child).ok(), ready);
            }
        }
        tell_fields(&mut commands, &mut entities, entity, world, &news);
        figures.commits += 1;
        figures.brushes += committed.len() as u64;
        figures.swaps += swaps as u64;
        figures.last_transaction = took;
        let applied = |receipt| BrushApplied { terrain: Some(entity), receipt };
        receipts.write_batch(committed.into_iter().map(applied));
        let took = start.elapsed();
        figures.last_commit = took;
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

/// Entities and events of fields that changed.
fn tell_fields(
    commands: &mut Commands,
    entities: &mut TerrainEntities,
    terrain: Entity,
    world: &World,
    news: &[(ChunkPos, FieldNews)],
) {
    for &(chunk, news) in news {
        let field = |id| world.fields_of(chunk).and_then(|fields| fields.get(id));
        match news {
            FieldNews::Created(id) => {
                if !entities.chunks.contains_key(&chunk) {
                    spawn_chunk(commands, entities, terrain, world, chunk);
                }
                if let Some(field) = field(id) {
                    spawn_field(commands, entities, chunk, field);
                }
            }
            FieldNews::Changed(id) => {
                if let (Some(field), Some(&child)) = (field(id), entities.fields.get(&id)) {
                    commands.entity(child).try_insert(Field::from(field));
                    commands.trigger(FieldChanged { entity: child });
                }
            }
            FieldNews::Merged { gone, into } => {
                let into = entities.fields.get(&into).copied();
                if let (Some(child), Some(into)) = (entities.fields.remove(&gone), into) {
                    commands.trigger(FieldMerged { entity: child, into });
                    commands.entity(child).try_despawn();
                }
            }
        }
    }
}

/// Spawns the entity of a chunk below its terrain.
pub(super) fn spawn_chunk(
    commands: &mut Commands,
    entities: &mut TerrainEntities,
    terrain: Entity,
    world: &World,
    chunk: ChunkPos,
) -> Entity {
    let place = Transform::from_translation(world.origin(Drawn::Chunk(chunk)).as_vec3());
    let child = commands.spawn((Chunk::from(chunk), place, ChildOf(terrain))).id();
    entities.chunks.insert(chunk, child);
    commands.trigger(ChunkCreated { entity: child });
    child
}

/// Spawns the entity of a field below its chunk, which must have one.
pub(super) fn spawn_field(
    commands: &mut Commands,
    entities: &mut TerrainEntities,
    chunk: ChunkPos,
    field: &volume::Field,
) {
    let Some(&parent) = entities.chunks.get(&chunk) else { return };
    let child = commands.spawn((Field::from(field), ChildOf(parent))).id();
    entities.fields.insert(field.id, child);
    commands.trigger(FieldCreated { entity: child });
}
