//! New terrains: all their meshes are made in a task, and shown in one frame when all of them are there.

use std::sync::Arc;

use bevy::camera::primitives::Aabb;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use rayon::prelude::*;

use super::commit::{InFlight, TerrainEntities, spawn_chunk, spawn_field};
use super::meshes::{self, Ready};
use super::{BurrowSettings, MaterialColors, Tile};
use crate::terrain::{Drawn, Terrain, Version, World};

/// A terrain's tiles are all shown, and it takes transactions.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerrainReady {
    /// The terrain's entity.
    pub entity: Entity,
}

/// Meshes on their way to a terrain's first frame.
#[derive(Component)]
pub(super) struct Loading {
    world: Version,
    task: Option<Task<Vec<(Drawn, Ready)>>>,
    waiting: Vec<(Drawn, Ready)>,
    uploaded: HashMap<Drawn, (Handle<Mesh>, Aabb)>,
}

/// Terrains that no task works for.
type Idle = (Without<Loading>, Without<InFlight>);

/// Starts the task of each terrain that is new, or whose world the game changed by itself, and scales its entity to the
/// voxel size.
pub(super) fn start_loading(
    mut commands: Commands,
    mut terrains: Query<(Entity, &Terrain, &MaterialColors, &mut Transform, Option<&TerrainEntities>), Idle>,
) {
    for (entity, terrain, colors, mut transform, entities) in &mut terrains {
        let version = terrain.world().version();
        if entities.is_some_and(|entities| entities.shown == version) {
            continue;
        }
        if entities.is_none() {
            transform.scale = Vec3::splat(terrain.voxel_size());
            warn_about_placement(&transform);
        }
        let (world, colors) = (terrain.snapshot(), colors.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move { mesh_all(&world, &colors) });
        let loading =
            Loading { world: version, task: Some(task), waiting: Vec::new(), uploaded: HashMap::default() };
        commands.entity(entity).insert(loading);
    }
}

/// Everything that a world draws.
fn mesh_all(world: &Arc<World>, colors: &MaterialColors) -> Vec<(Drawn, Ready)> {
    let chunks = world.drawn_chunks().map(Drawn::Chunk);
    let all: Vec<Drawn> = world.grid().tiles().map(Drawn::Tile).chain(chunks).collect();
    let mesh = |&drawn: &Drawn| {
        let surface = match drawn {
            Drawn::Tile(tile) => world.tile_mesh(tile),
            Drawn::Chunk(chunk) => world.chunk_mesh(chunk),
        };
        (drawn, meshes::build(&surface, colors))
    };
    all.par_iter().map(mesh).collect()
}

/// Hands meshes to the renderer, a budget's worth per frame, and spawns all entities once none waits.
pub(super) fn finish_loading(
    mut commands: Commands,
    settings: Res<BurrowSettings>,
    mut assets: Option<ResMut<Assets<Mesh>>>,
    mut terrains: Query<(Entity, &Terrain, &mut Loading, Option<&TerrainEntities>)>,
) {
    for (entity, terrain, mut loading, old) in &mut terrains {
        if let Some(task) = &mut loading.task {
            let Some(meshes) = check_ready(task) else { continue };
            (loading.task, loading.waiting) = (None, meshes);
        }
        if let Some(assets) = &mut assets {
            let rest = loading.waiting.len().saturating_sub(settings.loads_per_frame.max(1));
            for (drawn, ready) in loading.waiting.split_off(rest) {
                if let Some((mesh, bounds)) = ready {
                    loading.uploaded.insert(drawn, (assets.add(mesh), bounds));
                }
            }
            if !loading.waiting.is_empty() {
                continue;
            }
        }
        commands.entity(entity).remove::<Loading>();
        let world = terrain.world();
        if world.version() != loading.world {
            continue; // changed meanwhile: once more, from the start
        }
        for child in old.into_iter().flat_map(TerrainEntities::drawn) {
            commands.entity(child).try_despawn();
        }
        let mut entities = TerrainEntities::new(loading.world);
        let mut dress = |commands: &mut Commands, drawn, child| {
            if let Some((handle, bounds)) = loading.uploaded.remove(&drawn) {
                let shown = (Mesh3d(handle), bounds, bevy::camera::visibility::NoAutoAabb);
                commands.entity(child).insert(shown);
            }
        };
        for tile in world.grid().tiles() {
            let place = Transform::from_translation(world.origin(Drawn::Tile(tile)).as_vec3());
            let child = commands.spawn((Tile::from(tile), place, ChildOf(entity))).id();
            dress(&mut commands, Drawn::Tile(tile), child);
            entities.tiles.insert(tile, child);
        }
        let with_fields = world.fields().map(|(chunk, _)| chunk);
        for chunk in world.drawn_chunks().chain(with_fields) {
            if !entities.chunks.contains_key(&chunk) {
                let child = spawn_chunk(&mut commands, &mut entities, entity, world, chunk);
                dress(&mut commands, Drawn::Chunk(chunk), child);
            }
        }
        for (chunk, fields) in world.fields() {
            for field in fields.iter() {
                spawn_field(&mut commands, &mut entities, chunk, field);
            }
        }
        commands.entity(entity).insert(entities);
        commands.trigger(TerrainReady { entity });
    }
}

/// Seams have the same bits on both sides as long as a terrain is only moved and evenly scaled.
fn warn_about_placement(transform: &Transform) {
    let even = transform.scale.x == transform.scale.y && transform.scale.y == transform.scale.z;
    if !even || transform.rotation != Quat::IDENTITY {
        warn_once!("a terrain is rotated or unevenly scaled: hairline cracks may show at its seams");
    }
}
