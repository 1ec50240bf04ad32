//! Adds colliders where a source arrives, and removes them where it leaves. Commits bring all others.

use std::collections::VecDeque;
use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;
use rayon::prelude::*;

use super::PhysicsFigures;
use super::colliders::{BuiltCollider, GroundColliders, detach};
use super::columns::{Columns, PartState, Parts};
use super::ground::GroundBody;
use super::near::Neighbourhood;
use crate::plugin::{Part, TerrainEntities, ThreadTask, Threads};
use crate::terrain::{SurfaceDraft, Terrain};

/// Colliders built by one task; few, so that the nearest ones are ready soon.
const BATCH: usize = 16;

/// Time in a frame for attaching colliders. At least one is attached, and all of them while a body is held.
const FRAME_TIME: Duration = Duration::from_micros(150);

/// Colliders being built, and those to be attached.
#[derive(Resource, Default)]
pub(super) struct ColliderTasks {
    task: Option<ThreadTask<Vec<(Entity, BuiltCollider)>>>,
    /// Built, but not attached yet.
    done: VecDeque<(Entity, BuiltCollider)>,
}

/// Attaches colliders that are built.
pub(super) fn finish(mut commands: Commands, mut tasks: ResMut<ColliderTasks>) {
    if let Some(done) = tasks.task.as_mut().and_then(ThreadTask::finish) {
        (tasks.task, tasks.done) = (None, done.into());
    }
    if !tasks.done.is_empty() {
        commands.queue(attach);
    }
}

fn attach(world: &mut World) {
    let start = Instant::now();
    while let Some((entity, collider)) = world.resource_mut::<ColliderTasks>().done.pop_front() {
        if let Ok(part) = world.get_entity_mut(entity) {
            collider.attach(part);
        }
        if start.elapsed() >= FRAME_TIME && world.resource::<PhysicsFigures>().held == 0 {
            break;
        }
    }
    world.resource_mut::<PhysicsFigures>().main_thread += start.elapsed();
}

/// Checks the columns that changed, or that sources entered or left. Removes colliders far from all sources, and starts to
/// build missing ones, the nearest first.
pub(super) fn update(
    mut commands: Commands,
    colliders: Res<GroundColliders>,
    terrains: Query<(&Terrain, &TerrainEntities)>,
    parts: Parts,
    mut columns: ResMut<Columns>,
    bodies: Query<(), With<GroundBody>>,
    mut tasks: ResMut<ColliderTasks>,
    mut figures: ResMut<PhysicsFigures>,
    mut known: Local<Neighbourhood>,
) {
    let start = Instant::now();
    let near = colliders.near();
    let mut touched = columns.take_touched(&parts);
    if !near.is(&known) {
        near.changes(&known, |column| touched.extend([column]));
        *known = near;
    }
    for column in touched {
        let distance = known.distance(column);
        // Slightly beyond a source's radius, a chunk in a hole of a tile with a collider needs its own.
        let has_colliders = columns.has_colliders(column);
        let checked = columns.check(column, |part| {
            let (shown, ground, children, ..) = parts.get(part).ok()?;
            let is_outdated = ground.is_none_or(|ground| ground.revision < shown.revision);
            let goes = ground.is_some() && (distance.is_none() || is_outdated && shown.is_empty);
            if goes {
                commands.entity(part).queue_silenced(detach);
            }
            let is_near = distance.is_some_and(|distance| distance <= 0.0 || has_colliders);
            let is_wanted = ground.is_some() || is_near;
            let has_body = || children.is_some_and(|children| bodies.iter_many(children).next().is_some());
            Some(PartState {
                has_collider: !goes && has_body(),
                is_missing: !goes && is_outdated && !shown.is_empty && is_wanted,
                is_ready: shown.is_empty || !goes && ground.is_some(),
            })
        });
        figures.looked_at += checked as u64;
    }
    (figures.colliders, figures.missing) = columns.counts();
    if tasks.task.is_none() && tasks.done.is_empty() && figures.missing > 0 {
        tasks.task = begin(&colliders, &terrains, &columns, &known);
    }
    figures.main_thread += start.elapsed();
}

/// Starts to build the nearest missing colliders, all of one terrain. A terrain whose current world is not shown yet has to
/// wait, since its colliders would differ from what is drawn.
fn begin(
    colliders: &GroundColliders,
    terrains: &Query<(&Terrain, &TerrainEntities)>,
    columns: &Columns,
    near: &Neighbourhood,
) -> Option<ThreadTask<Vec<(Entity, BuiltCollider)>>> {
    let is_shown =
        |&terrain: &Entity| terrains.get(terrain).is_ok_and(|(model, entities)| entities.show(model.world()));
    let missing = columns.waiting().filter(is_shown).flat_map(|terrain| {
        let distance = move |tile| near.distance((terrain, tile)).unwrap_or(f32::INFINITY);
        columns.missing(terrain).map(move |(tile, part, drawn)| (distance(tile), terrain, part, drawn))
    });
    let mut missing: Vec<_> = missing.collect();
    let nearer = |a: &(f32, Entity, Entity, _), b: &(f32, Entity, Entity, _)| {
        a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2)))
    };
    let terrain = missing.iter().min_by(|a, b| nearer(a, b))?.1;
    missing.retain(|part| part.1 == terrain);
    if missing.len() > BATCH {
        missing.select_nth_unstable_by(BATCH, nearer);
        missing.truncate(BATCH);
    }
    missing.sort_unstable_by(nearer);
    let (model, _) = terrains.get(terrain).ok()?;
    let (world, voxel_size) = (model.world(), model.voxel_size());
    let batch: Vec<(Entity, Part, SurfaceDraft)> = missing
        .into_iter()
        .map(|(.., entity, drawn)| {
            let part = Part::new(terrain, voxel_size, world.grid(), world.revision(), drawn);
            (entity, part, world.draft(drawn))
        })
        .collect();
    let colliders = colliders.clone();
    Some(ThreadTask::start(Threads::Background, move || {
        let build = |(entity, part, draft): &(Entity, Part, SurfaceDraft)| {
            (*entity, colliders.build_collider(part, &draft.surface()))
        };
        batch.par_iter().map(build).collect()
    }))
}
