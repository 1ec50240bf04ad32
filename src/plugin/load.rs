//! New terrains: all their meshes are made in a task, and shown in one frame when all of them are there.

use std::collections::BTreeSet;
use std::sync::Arc;

use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::NoAutoAabb;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use rayon::prelude::*;

use super::commit::InFlight;
use super::entities::{TerrainEntities, tell};
use super::meshes::{Ready, Wardrobe};
use super::{BurrowSettings, ChunkCreated, MaterialColors};
use crate::lattice::ChunkPos;
use crate::terrain::{Drawn, Terrain, World};

/// A terrain's tiles are all shown, and it takes transactions.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerrainReady {
    /// The terrain's entity.
    pub entity: Entity,
}

/// Meshes on their way to the frame in which they are shown, all made from one snapshot.
#[derive(Component)]
pub(super) struct Loading {
    world: Arc<World>,
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
    assets: Option<Res<Assets<Mesh>>>,
) {
    for (entity, terrain, colors, mut transform, entities) in &mut terrains {
        if entities.is_some_and(|entities| entities.shown == terrain.world().version()) {
            continue;
        }
        let scale = Vec3::splat(terrain.voxel_size());
        if transform.scale != scale {
            transform.scale = scale;
        }
        let world = terrain.snapshot();
        let task = assets.is_some().then(|| {
            let (world, colors) = (Arc::clone(&world), colors.clone());
            AsyncComputeTaskPool::get().spawn(async move { mesh_all(&world, &colors) })
        });
        let loading = Loading { world, task, waiting: Vec::new(), uploaded: HashMap::default() };
        commands.entity(entity).try_insert(loading);
    }
}

/// Places terrains before anyone asks about them; Bevy itself does so only at the end of the frame, if at all.
pub(super) fn place_terrains(
    places: TransformHelper,
    mut terrains: Query<(Entity, &Terrain, &mut GlobalTransform)>,
) {
    for (entity, terrain, mut place) in &mut terrains {
        let Ok(now) = places.compute_global_transform(entity) else { continue };
        if *place != now {
            *place = now;
            warn_about_placement(&now, terrain.voxel_size());
        }
    }
}

/// Everything that a world draws.
fn mesh_all(world: &World, colors: &MaterialColors) -> Vec<(Drawn, Ready)> {
    let chunks = world.drawn_chunks().map(Drawn::Chunk);
    let all: Vec<Drawn> = world.grid().tiles().map(Drawn::Tile).chain(chunks).collect();
    let wardrobe = Wardrobe::new(world, colors);
    let mesh = |&drawn: &Drawn| {
        let surface = match drawn {
            Drawn::Tile(tile) => world.tile_mesh(tile),
            Drawn::Chunk(chunk) => world.chunk_mesh(chunk),
        };
        (drawn, wardrobe.build(drawn, &surface))
    };
    all.par_iter().map(mesh).collect()
}

/// Hands meshes to the renderer, a budget's worth per frame, and shows all of them once none waits; what was shown
/// before goes in that frame.
pub(super) fn finish_loading(
    mut commands: Commands,
    settings: Res<BurrowSettings>,
    mut assets: Option<ResMut<Assets<Mesh>>>,
    mut terrains: Query<(Entity, &mut Loading, Option<&TerrainEntities>)>,
) {
    for (entity, mut loading, old) in &mut terrains {
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
        for child in old.into_iter().flat_map(TerrainEntities::drawn) {
            commands.entity(child).try_despawn();
        }
        let entities = show(&mut commands, entity, &mut loading);
        commands.entity(entity).try_insert(entities).try_remove::<Loading>();
        tell(&mut commands, TerrainReady { entity });
    }
}

/// Spawns tiles, chunks and fields of a world that has loaded.
fn show(commands: &mut Commands, terrain: Entity, loading: &mut Loading) -> TerrainEntities {
    let world = Arc::clone(&loading.world);
    let mut entities = TerrainEntities::new(world.version());
    let with_fields = world.fields().map(|(chunk, _)| chunk);
    let with_meshes = loading.uploaded.keys().filter_map(|drawn| match drawn {
        Drawn::Chunk(chunk) => Some(*chunk),
        Drawn::Tile(_) => None,
    });
    let chunks: BTreeSet<ChunkPos> = with_fields.chain(with_meshes).collect();
    for drawn in world.grid().tiles().map(Drawn::Tile).chain(chunks.into_iter().map(Drawn::Chunk)) {
        let child = entities.spawn(commands, terrain, &world, drawn);
        if let Some((handle, bounds)) = loading.uploaded.remove(&drawn) {
            commands.entity(child).try_insert((Mesh3d(handle), bounds, NoAutoAabb));
        }
        if let Drawn::Chunk(_) = drawn {
            tell(commands, ChunkCreated { entity: child });
        }
    }
    for (chunk, fields) in world.fields() {
        for field in fields.iter() {
            entities.spawn_field(commands, chunk, field);
        }
    }
    entities
}

/// Seams have the same bits on both sides as long as a terrain is evenly scaled and moved by whole voxels.
fn warn_about_placement(place: &GlobalTransform, voxel_size: f32) {
    let (scale, rotation, translation) = place.to_scale_rotation_translation();
    let exact = scale == Vec3::splat(voxel_size)
        && rotation == Quat::IDENTITY
        && (translation / voxel_size).fract() == Vec3::ZERO;
    if !exact {
        warn_once!(
            "a terrain is rotated, stretched, or moved by a part of a voxel: hairline cracks may show at its seams"
        );
    }
}
