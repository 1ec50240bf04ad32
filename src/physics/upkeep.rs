//! Adds colliders where a source arrives, and removes them where it leaves. Commits bring all others.

use std::any::Any;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use bevy::platform::collections::HashMap;
use bevy::platform::time::Instant;
use bevy::prelude::*;
use rayon::prelude::*;

use super::PhysicsFigures;
use super::colliders::{BuiltCollider, GroundColliders, detach};
use super::columns::{Columns, PartState, Parts};
use super::ground::{GroundBody, GroundCollider};
use super::near::Neighbourhood;
use crate::plugin::{Part, TerrainEntities};
use crate::terrain::{SurfaceDraft, Terrain};
use crate::threads::{ThreadTask, Threads, panic_message};

/// Colliders built by one task; few, so that the nearest ones are ready soon.
const BATCH: usize = 16;

/// Time in a frame for attaching colliders. At least one is attached, and all of them while a body is held.
const FRAME_TIME: Duration = Duration::from_micros(150);

/// How often a collider is built that panics.
const ATTEMPTS: u32 = 3;

/// The result of a task for a tile or chunk: its collider, or the message of a panic.
type Built = (Entity, Result<BuiltCollider, Failure>);

/// Building the collider of a part panicked.
struct Failure {
    part: Part,
    why: String,
}

/// Colliders being built, and those to be attached.
#[derive(Resource, Default)]
pub(super) struct ColliderTasks {
    task: Option<ThreadTask<Vec<Built>>>,
    /// Built, but not attached yet.
    done: VecDeque<Built>,
    /// How often the colliders of tiles and chunks failed in a row.
    failures: HashMap<Entity, u32>,
}

/// Attaches colliders that are built.
pub(super) fn finish(mut commands: Commands, mut tasks: ResMut<ColliderTasks>) {
    if let Some(done) = tasks.task.as_mut().and_then(ThreadTask::check) {
        tasks.task = None;
        match done {
            Ok(done) => tasks.done = done.into(),
            // They are missing as before, so the next task builds them.
            Err(panic) => error!("a task for colliders panicked: {}", panic_message(panic.as_ref())),
        }
    }
    if !tasks.done.is_empty() {
        commands.queue(attach);
    }
}

fn attach(world: &mut World) {
    let start = Instant::now();
    while let Some((entity, built)) = world.resource_mut::<ColliderTasks>().done.pop_front() {
        match built {
            Ok(collider) => {
                world.resource_mut::<ColliderTasks>().failures.remove(&entity);
                if let Ok(part) = world.get_entity_mut(entity) {
                    collider.attach(part);
                }
            }
            Err(failure) => fail(world, entity, &failure),
        }
        if start.elapsed() >= FRAME_TIME && world.resource::<PhysicsFigures>().held == 0 {
            break;
        }
    }
    world.resource_mut::<PhysicsFigures>().main_thread += start.elapsed();
}

/// Reports a collider that could not be built. It is missing, so it is built again; after some attempts its tile or
/// chunk stays as it is until its surface changes, because otherwise bodies would be held over it forever.
fn fail(world: &mut World, entity: Entity, Failure { part, why }: &Failure) {
    let mut tasks = world.resource_mut::<ColliderTasks>();
    let count = tasks.failures.entry(entity).or_default();
    *count += 1;
    let gives_up = *count >= ATTEMPTS;
    if gives_up {
        tasks.failures.remove(&entity);
    }
    let then = if gives_up { "it keeps the one that it had, or has none" } else { "it is built again" };
    error!("building the collider of {:?} of {} panicked, {then}: {why}", part.drawn, part.terrain);
    if gives_up {
        world.resource_mut::<PhysicsFigures>().failed += 1;
        let Ok(mut owner) = world.get_entity_mut(entity) else { return };
        if owner.get::<GroundCollider>().is_none_or(|old| old.revision < part.revision) {
            owner.insert(GroundCollider { revision: part.revision });
        }
    }
}

/// Checks the columns that changed, or that sources entered or left. Removes colliders far from all sources, and starts
/// to build missing ones, the nearest first.
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
    if !near.is_same(&known) {
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

/// Starts to build the nearest missing colliders, all of one terrain. A terrain whose current world is not shown yet
/// has to wait, since its colliders would differ from what is drawn.
fn begin(
    colliders: &GroundColliders,
    terrains: &Query<(&Terrain, &TerrainEntities)>,
    columns: &Columns,
    near: &Neighbourhood,
) -> Option<ThreadTask<Vec<Built>>> {
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
    Some(ThreadTask::start(Threads::Colliders, move || {
        let build = |(entity, part, draft): &(Entity, Part, SurfaceDraft)| {
            let build = AssertUnwindSafe(|| colliders.build_collider(part, &draft.surface()));
            let failure = |panic: Box<dyn Any + Send>| Failure {
                part: *part,
                why: panic_message(panic.as_ref()).to_owned(),
            };
            (*entity, catch_unwind(build).map_err(failure))
        };
        batch.par_iter().map(build).collect()
    }))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;
    use std::time::Duration;

    use avian3d::prelude::*;
    use bevy::time::TimeUpdateStrategy;

    use super::*;
    use crate::BurrowPlugins;
    use crate::ground::Ground;
    use crate::physics::{ColliderSource, HeldByGround, TerrainPhysicsPlugin};
    use crate::terrain::TerrainSettings;

    /// An app with level ground of four tiles, where building the first `panics` colliders panics.
    fn app(panics: u32) -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, PhysicsPlugins::default(), BurrowPlugins, TerrainPhysicsPlugin))
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)));
        app.finish();
        app.cleanup();
        let ground = Ground::flat(32, 32, 8.0).expect("valid ground");
        let settings = TerrainSettings { chunk_size: 16, voxel_size: 1.0 };
        let terrain = Terrain::new(ground, &settings).expect("valid settings");
        app.world().resource::<GroundColliders>().panic_times().store(panics, Ordering::Relaxed);
        app.world_mut().spawn(terrain);
        // It arrives when the ground is there, so that a task builds the colliders, and not the load.
        let is_shown = |app: &App| app.world().resource::<Columns>().counts() != (0, 0);
        for _ in 0..200 {
            app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(!is_shown(&app), "without a source there are no colliders");
        app.world_mut().spawn((Transform::from_xyz(16.0, 8.0, 16.0), ColliderSource { radius: 100.0 }));
        app
    }

    fn run_until(app: &mut App, is_so: impl Fn(&PhysicsFigures) -> bool) {
        let start = Instant::now();
        while !is_so(app.world().resource::<PhysicsFigures>()) {
            assert!(
                start.elapsed() < Duration::from_secs(60),
                "{:?}",
                app.world().resource::<PhysicsFigures>()
            );
            app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_collider_that_panics_once_is_built_again() {
        let mut app = app(2);
        run_until(&mut app, |figures| figures.colliders == 4 && figures.missing == 0);
        assert_eq!(app.world().resource::<PhysicsFigures>().failed, 0);
    }

    #[test]
    fn colliders_that_always_panic_are_given_up_and_hold_nothing() {
        let mut app = app(u32::MAX);
        run_until(&mut app, |figures| figures.missing > 0);
        let ball = (RigidBody::Dynamic, Collider::sphere(0.5), Transform::from_xyz(16.0, 9.0, 16.0));
        let ball = app.world_mut().spawn(ball).id();
        run_until(&mut app, |figures| figures.missing == 0);
        assert_eq!(app.world().resource::<PhysicsFigures>().failed, 4);
        for _ in 0..5 {
            app.update();
        }
        assert!(!app.world().entity(ball).contains::<HeldByGround>(), "a body is held for ever");
    }
}
