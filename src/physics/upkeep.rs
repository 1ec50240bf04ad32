//! Colliders that no commit brings: those of ground that a source comes near to, and those that it leaves behind.

use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use rayon::prelude::*;

use super::PhysicsFigures;
use super::colliders::{GroundBody, GroundCollider, Grounds, Prepared, detach, is_far};
use super::near::Neighbourhood;
use crate::lattice::{ChunkPos, TilePos};
use crate::plugin::{Chunk, Part, ShownSurface, TerrainEntities, Tile};
use crate::terrain::{Drawn, Terrain};

/// Parts that one task makes colliders for: few, so that the nearest come soon and the snapshot is soon let go of.
const BATCH: usize = 16;

/// The columns of chunks in which everything that has triangles has a collider.
#[derive(Resource, Default)]
pub(super) struct ReadyColumns(HashSet<(Entity, TilePos)>);

impl ReadyColumns {
    pub fn contains(&self, terrain: Entity, tile: TilePos) -> bool {
        self.0.contains(&(terrain, tile))
    }
}

/// The colliders under way.
#[derive(Resource, Default)]
pub(super) struct Work(Option<Task<Vec<(Entity, Prepared)>>>);

/// Which tile or chunk an entity is.
pub(super) fn drawn(tile: Option<&Tile>, chunk: Option<&Chunk>) -> Option<Drawn> {
    let tile = tile.map(|&Tile { x, z }| Drawn::Tile(TilePos { x, z }));
    tile.or(chunk.map(|&Chunk { x, y, z }| Drawn::Chunk(ChunkPos { x, y, z })))
}

fn column(drawn: Drawn) -> TilePos {
    match drawn {
        Drawn::Tile(tile) => tile,
        Drawn::Chunk(chunk) => chunk.tile(),
    }
}

/// Puts colliders that are done in their places.
pub(super) fn finish(mut commands: Commands, mut work: ResMut<Work>) {
    let Some(done) = work.0.as_mut().and_then(check_ready) else { return };
    work.0 = None;
    for (entity, prepared) in done {
        if let Ok(mut part) = commands.get_entity(entity) {
            part.queue_silenced(move |part: EntityWorldMut| prepared.attach(part));
        }
    }
}

/// A tile or chunk, and the collider it has.
type Parts<'w, 's> = Query<
    'w,
    's,
    (
        Entity,
        Ref<'static, ShownSurface>,
        Option<Ref<'static, GroundCollider>>,
        &'static ChildOf,
        Option<&'static Tile>,
        Option<&'static Chunk>,
    ),
    Or<(With<Tile>, With<Chunk>)>,
>;

/// Looks at every part, when something is new: removes colliders that are far from all sources, and starts to make those
/// that are missing, the nearest first.
pub(super) fn tend(
    mut commands: Commands,
    grounds: Res<Grounds>,
    terrains: Query<(&Terrain, &TerrainEntities)>,
    parts: Parts,
    mut gone: RemovedComponents<ShownSurface>,
    mut detached: RemovedComponents<GroundBody>,
    mut work: ResMut<Work>,
    mut ready: ResMut<ReadyColumns>,
    mut figures: ResMut<PhysicsFigures>,
    mut known: Local<Neighbourhood>,
) {
    let near = grounds.near();
    let is_new = |shown: &Ref<ShownSurface>, ground: &Option<Ref<GroundCollider>>| {
        shown.is_changed() || ground.as_ref().is_some_and(|ground| ground.is_changed())
    };
    let is_quiet = gone.read().count() + detached.read().count() == 0
        && near == *known
        && !parts.iter().any(|(_, shown, ground, ..)| is_new(&shown, &ground));
    if is_quiet && figures.missing == 0 {
        return;
    }
    let mut columns: HashMap<(Entity, TilePos), bool> = HashMap::default();
    let mut missing: Vec<(f32, Entity, Part)> = Vec::new();
    let mut count = 0;
    for (entity, shown, ground, parent, tile, chunk) in &parts {
        let (Some(drawn), Ok((terrain, _))) = (drawn(tile, chunk), terrains.get(parent.parent())) else {
            continue;
        };
        let world = terrain.world();
        let part = Part::new(parent.parent(), terrain.voxel_size(), world.grid(), world.revision(), drawn);
        let distance = near.distance(&part).unwrap_or(f32::INFINITY);
        let mut has_collider = ground.as_ref().is_some_and(|ground| ground.body.is_some());
        let is_outdated = ground.as_ref().is_none_or(|ground| ground.revision < shown.revision);
        let goes = is_far(&part, distance);
        if ground.is_some() && (goes || is_outdated && shown.is_empty) {
            commands.entity(entity).queue_silenced(detach);
            has_collider = false;
        } else if is_outdated && !shown.is_empty && (distance <= 0.0 || ground.is_some()) {
            missing.push((distance, entity, part));
        }
        count += usize::from(has_collider);
        let is_there = ground.is_some() && !goes || shown.is_empty;
        *columns.entry((part.terrain, column(drawn))).or_insert(true) &= is_there;
    }
    ready.0 = columns.into_iter().filter(|(_, is_ready)| *is_ready).map(|(column, _)| column).collect();
    (figures.colliders, figures.missing) = (count, missing.len());
    *known = near;
    if work.0.is_none() && !missing.is_empty() {
        missing.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        work.0 = begin(&grounds, &terrains, missing);
    }
}

/// Starts on the nearest of the missing colliders, all of one terrain. One whose world is not shown yet has to wait: its
/// colliders would be of ground that nobody sees.
fn begin(
    grounds: &Grounds,
    terrains: &Query<(&Terrain, &TerrainEntities)>,
    missing: Vec<(f32, Entity, Part)>,
) -> Option<Task<Vec<(Entity, Prepared)>>> {
    let snapshot = |terrain: Entity| {
        let (model, entities) = terrains.get(terrain).ok()?;
        entities.show(model.world()).then(|| (terrain, model.snapshot()))
    };
    let (terrain, world) = missing.iter().find_map(|(_, _, part)| snapshot(part.terrain))?;
    let grounds = grounds.clone();
    let batch: Vec<(Entity, Part)> = missing
        .into_iter()
        .filter(|(_, _, part)| part.terrain == terrain)
        .map(|(_, entity, part)| (entity, part))
        .take(BATCH)
        .collect();
    Some(AsyncComputeTaskPool::get().spawn(async move {
        let prepare =
            |&(entity, part): &(Entity, Part)| (entity, grounds.prepare(&part, &part.surface_in(&world)));
        batch.par_iter().map(prepare).collect()
    }))
}
