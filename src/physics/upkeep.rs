//! Colliders that no commit brings: those of ground that a source comes near to, and those that it leaves behind.

use std::collections::VecDeque;
use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;
use rayon::prelude::*;

use super::PhysicsFigures;
use super::colliders::{Grounds, PreparedCollider, detach};
use super::columns::{Columns, Look, Parts};
use super::near::Neighbourhood;
use crate::plugin::{Part, TerrainEntities, ThreadTask, Threads};
use crate::terrain::{SurfaceDraft, Terrain};

/// Parts that one task makes colliders for: few, so that the nearest come soon.
const BATCH: usize = 16;

/// How long a frame puts colliders in their places: at least one, and all of them while a body is held.
const FRAME_TIME: Duration = Duration::from_micros(150);

/// The colliders under way.
#[derive(Resource, Default)]
pub(super) struct Work {
    task: Option<ThreadTask<Vec<(Entity, PreparedCollider)>>>,
    /// Done, and waiting for their frame.
    done: VecDeque<(Entity, PreparedCollider)>,
}

/// Puts colliders that are done in their places.
pub(super) fn finish(mut commands: Commands, mut work: ResMut<Work>) {
    if let Some(done) = work.task.as_mut().and_then(ThreadTask::finish) {
        (work.task, work.done) = (None, done.into());
    }
    if !work.done.is_empty() {
        commands.queue(place);
    }
}

fn place(world: &mut World) {
    let start = Instant::now();
    while let Some((entity, prepared)) = world.resource_mut::<Work>().done.pop_front() {
        if let Ok(part) = world.get_entity_mut(entity) {
            prepared.attach(part);
        }
        if start.elapsed() >= FRAME_TIME && world.resource::<PhysicsFigures>().held == 0 {
            break;
        }
    }
    world.resource_mut::<PhysicsFigures>().main_thread += start.elapsed();
}

/// Looks at the columns that something happened in, or that sources came to or left: removes colliders that are far from
/// all sources, and starts to make those that are missing, the nearest first.
pub(super) fn tend(
    mut commands: Commands,
    grounds: Res<Grounds>,
    terrains: Query<(&Terrain, &TerrainEntities)>,
    parts: Parts,
    mut columns: ResMut<Columns>,
    mut work: ResMut<Work>,
    mut figures: ResMut<PhysicsFigures>,
    mut known: Local<Neighbourhood>,
) {
    let start = Instant::now();
    let near = grounds.near();
    let mut touched = columns.take_news(&parts);
    if !near.is(&known) {
        near.changes(&known, |column| touched.extend([column]));
        *known = near;
    }
    for column in touched {
        let distance = known.distance(column);
        // A little farther off than sources reach, what is dug out of a tile with a collider is to have one too.
        let has_colliders = columns.has_colliders(column);
        let looked_at = columns.look(column, |part| {
            let (shown, ground, ..) = parts.get(part).ok()?;
            let is_outdated = ground.is_none_or(|ground| ground.revision < shown.revision);
            let goes = ground.is_some() && (distance.is_none() || is_outdated && shown.is_empty);
            if goes {
                commands.entity(part).queue_silenced(detach);
            }
            let is_near = distance.is_some_and(|distance| distance <= 0.0 || has_colliders);
            let is_wanted = ground.is_some() || is_near;
            Some(Look {
                has_collider: !goes && ground.is_some_and(|ground| ground.body.is_some()),
                is_missing: !goes && is_outdated && !shown.is_empty && is_wanted,
                is_there: shown.is_empty || !goes && ground.is_some(),
            })
        });
        figures.looked_at += looked_at as u64;
    }
    (figures.colliders, figures.missing) = columns.counts();
    if work.task.is_none() && work.done.is_empty() && figures.missing > 0 {
        work.task = begin(&grounds, &terrains, &columns, &known);
    }
    figures.main_thread += start.elapsed();
}

/// Starts on the nearest of the missing colliders, all of one terrain. One whose world is not shown yet has to wait: its
/// colliders would be of ground that nobody sees.
fn begin(
    grounds: &Grounds,
    terrains: &Query<(&Terrain, &TerrainEntities)>,
    columns: &Columns,
    near: &Neighbourhood,
) -> Option<ThreadTask<Vec<(Entity, PreparedCollider)>>> {
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
    let grounds = grounds.clone();
    Some(ThreadTask::start(Threads::Background, move || {
        let prepare = |(entity, part, recipe): &(Entity, Part, SurfaceDraft)| {
            (*entity, grounds.prepare(part, &recipe.surface()))
        };
        batch.par_iter().map(prepare).collect()
    }))
}
