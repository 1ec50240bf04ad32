//! Drops tasks and entities of terrains that were replaced, removed, or get other vertices.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;

use super::load::Loading;
use super::task::InFlight;
use crate::plugin::SlimVertices;
use crate::plugin::entities::TerrainEntities;
use crate::plugin::entities::places::{LocalPlaces, TerrainPlace, place_terrain, scale};
use crate::plugin::lod_state::LodState;
use crate::plugin::reports::Reports;
use crate::terrain::Terrain;

/// Scales and places a new terrain at once, so that queries in the frame that spawned it, for example in `Startup`,
/// find it in its place. Tasks of another terrain on its entity are dropped. The tiles and chunks of that terrain stay
/// until the new one has loaded, unless they have another size.
pub(in crate::plugin) fn prepare_new(
    new: On<Insert, Terrain>,
    mut commands: Commands,
    terrains: Query<(&Terrain, Option<&TerrainEntities>, Option<&Children>), Allow<Disabled>>,
    mut places: ParamSet<(
        Query<(&mut Transform, &mut TerrainPlace), Allow<Disabled>>,
        LocalPlaces,
        Query<(&mut GlobalTransform, &mut TerrainPlace), Allow<Disabled>>,
    )>,
    reports: Reports,
) {
    let entity = new.entity;
    let Ok((terrain, entities, children)) = terrains.get(entity) else { return };
    commands.entity(entity).try_remove::<(Loading, InFlight)>();
    drop_resized(&mut commands, entity, terrain, entities, children);
    if let Ok((mut transform, mut place)) = places.p0().get_mut(entity) {
        scale((entity, terrain), &mut transform, &mut place, &reports);
    }
    let now = places.p1().of(entity);
    if let Ok((mut global, mut place)) = places.p2().get_mut(entity) {
        place_terrain(now, &mut global, &mut place);
    }
}

/// Drops tasks of terrains that have no entities: such a task belongs to a former terrain, and the new one must not
/// wait for it.
pub(in crate::plugin) fn drop_stray_tasks(
    mut commands: Commands,
    strays: Query<Entity, (With<Terrain>, With<InFlight>, Without<TerrainEntities>)>,
) {
    for entity in &strays {
        commands.entity(entity).try_remove::<InFlight>();
    }
}

/// Drops the load and the entities of a terrain that another one replaced without an insertion, for example by
/// `mem::swap`.
pub(in crate::plugin) fn drop_replaced(
    mut commands: Commands,
    terrains: Query<
        (Entity, &Terrain, Option<&Loading>, Option<&TerrainEntities>, Option<&Children>),
        Changed<Terrain>,
    >,
) {
    for (entity, terrain, loading, entities, children) in &terrains {
        if loading.is_some_and(|loading| !loading.is_of(terrain)) {
            commands.entity(entity).try_remove::<Loading>();
        }
        drop_resized(&mut commands, entity, terrain, entities, children);
    }
}

/// Despawns tiles and chunks that were built for voxels of another size: they would be drawn too large or too small.
fn drop_resized(
    commands: &mut Commands,
    entity: Entity,
    terrain: &Terrain,
    entities: Option<&TerrainEntities>,
    children: Option<&Children>,
) {
    if let Some(entities) = entities.filter(|entities| entities.voxel_size != terrain.voxel_size()) {
        entities.despawn(commands, children);
        // A running transaction belongs to the former terrain.
        commands.entity(entity).try_remove::<(TerrainEntities, InFlight)>();
    }
}

/// Despawns the entities below a terrain when only its component is removed.
pub(in crate::plugin) fn remove_with_terrain(
    gone: On<Remove, Terrain>,
    terrains: Query<(&TerrainEntities, Option<&Children>), Allow<Disabled>>,
    mut commands: Commands,
) {
    if let Ok((entities, children)) = terrains.get(gone.entity) {
        entities.despawn(&mut commands, children);
    }
    commands.entity(gone.entity).try_remove::<(TerrainEntities, Loading, InFlight, LodState)>();
}

/// Cancels a load without slim vertices when a terrain gets them; it is then loaded again with them.
pub(in crate::plugin) fn drop_other_vertices(
    new: On<Insert, SlimVertices>,
    mut commands: Commands,
    loading: Query<&Loading, Allow<Disabled>>,
) {
    if loading.get(new.entity).is_ok_and(|loading| !loading.vertices.is_slim) {
        commands.entity(new.entity).try_remove::<Loading>();
    }
}

/// Cancels a load with slim vertices when a terrain loses the marker; it is then loaded again without them.
pub(in crate::plugin) fn drop_slim_vertices(
    gone: On<Remove, SlimVertices>,
    mut commands: Commands,
    loading: Query<&Loading, Allow<Disabled>>,
) {
    if loading.get(gone.entity).is_ok_and(|loading| loading.vertices.is_slim) {
        commands.entity(gone.entity).try_remove::<Loading>();
    }
}
