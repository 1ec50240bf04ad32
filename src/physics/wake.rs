//! Wakes sleeping bodies where ground changed, and lifts bodies that are in the ground.

use avian3d::dynamics::solver::islands::WakeBody;
use avian3d::prelude::*;
use bevy::diagnostic::FrameCount;
use bevy::ecs::system::SystemParam;
use bevy::math::{Affine3A, DVec3};
use bevy::platform::collections::HashMap;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::character::CharacterMotion;
use super::solids::Solids;
use super::{GroundBody, PhysicsFigures, TerrainPhysicsDisabled};
use crate::plugin::TerrainEntities;
use crate::terrain::{MeshKey, Terrain, World as TerrainWorld};

/// Bodies within this distance of a change are woken, in metres.
const NEAR: f32 = 0.2;

/// The gap between the ground and a body that was lifted, in metres.
const GAP: f32 = 0.02;

/// For how many frames with steps a body near a change is checked; about a second. A body that was partly built over is
/// still in the air, but the contacts may squeeze it into the ground later.
const WATCHED_FRAMES: u8 = 64;

/// Every body, wherever it is, is checked once in this many frames with steps.
const CHECK_INTERVAL: usize = 8;

/// A box in world space in which a collider changed, moved or was removed.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroundChange {
    terrain: Entity,
    low: Vec3,
    high: Vec3,
}

impl GroundChange {
    /// A box in metres from the origin of a part at `place`.
    pub fn new(terrain: Entity, place: &GlobalTransform, voxel_size: f32, low: Vec3, high: Vec3) -> Self {
        let corner = |number: usize| {
            let pick = |axis: usize| if number >> axis & 1 == 0 { low[axis] } else { high[axis] };
            place.transform_point(Vec3::from_array([pick(0), pick(1), pick(2)]) / voxel_size)
        };
        let (low, high) = (1..8)
            .map(corner)
            .fold((corner(0), corner(0)), |(low, high), corner| (low.min(corner), high.max(corner)));
        Self { terrain, low: low - NEAR, high: high + NEAR }
    }

    /// The box around a collider that was removed or moved.
    pub fn around(terrain: Entity, bounds: &ColliderAabb) -> Self {
        Self { terrain, low: bounds.min - NEAR, high: bounds.max + NEAR }
    }

    fn meets(&self, bounds: &ColliderAabb) -> bool {
        self.low.cmple(bounds.max).all() && self.high.cmpge(bounds.min).all()
    }
}

/// Changes since bodies were last woken. There is one box for each tile or chunk, as many edits may happen while
/// physics is paused.
#[derive(Resource, Default)]
pub(super) struct GroundChanges {
    boxes: Vec<GroundChange>,
    numbers: HashMap<(Entity, MeshKey), usize>,
}

impl GroundChanges {
    /// Adds a change of one tile or chunk of its terrain.
    pub fn add(&mut self, drawn: MeshKey, change: GroundChange) {
        let number = *self.numbers.entry((change.terrain, drawn)).or_insert(self.boxes.len());
        match self.boxes.get_mut(number) {
            Some(known) => (known.low, known.high) = (known.low.min(change.low), known.high.max(change.high)),
            None => self.boxes.push(change),
        }
    }

    /// How many boxes there are.
    pub fn len(&self) -> usize {
        self.boxes.len()
    }

    fn take(&mut self) -> Vec<GroundChange> {
        self.numbers.clear();
        std::mem::take(&mut self.boxes)
    }
}

/// Bodies near which a terrain changed recently, or that were found inside it, with the number of frames for which they
/// are still checked.
#[derive(Resource, Default)]
pub(super) struct WatchedBodies(HashMap<(Entity, Entity), u8>);

/// Wakes bodies near changes, and adds them to the watched ones.
pub(super) fn wake(
    mut commands: Commands,
    mut changes: ResMut<GroundChanges>,
    mut watched: ResMut<WatchedBodies>,
    bodies: Query<
        (Entity, &RigidBody, &RigidBodyColliders, Option<&ColliderAabb>, Has<Sleeping>),
        (Without<GroundBody>, Without<RigidBodyDisabled>),
    >,
    solids: Solids,
    mut figures: ResMut<PhysicsFigures>,
) {
    if changes.len() == 0 {
        return;
    }
    let start = Instant::now();
    let changes = changes.take();
    figures.changes = 0;
    let mut terrains: Vec<Entity> = changes.iter().map(|change| change.terrain).collect();
    terrains.sort_unstable();
    terrains.dedup();
    let terrains: Vec<_> = terrains.into_iter().map(|terrain| (terrain, solids.layers(terrain))).collect();
    for (entity, body, own, bounds, sleeps) in &bodies {
        // Fast path: most bodies are far away and are their own only collider.
        let is_far = |bounds: &ColliderAabb| !changes.iter().any(|change| change.meets(bounds));
        if own[..] == [entity] && bounds.is_some_and(is_far) {
            continue;
        }
        let mut is_near = false;
        for &(terrain, layers) in &terrains {
            let Some(bounds) = solids.bounds((entity, body, own), layers) else { continue };
            if changes.iter().any(|change| change.terrain == terrain && change.meets(&bounds)) {
                is_near = true;
                watched.0.insert((entity, terrain), WATCHED_FRAMES);
            }
        }
        if is_near && sleeps {
            commands.queue_silenced(WakeBody(entity));
            figures.woken += 1;
        }
    }
    figures.main_thread += start.elapsed();
}

/// Finds bodies in the ground where nothing changed, a share of all bodies in each frame, and adds them to the watched
/// ones. Ground is one-sided, so a body that was pushed or placed inside would fall forever. Bodies that sleep or are
/// locked along y are left alone.
pub(super) fn find_buried(
    mut watched: ResMut<WatchedBodies>,
    bodies: Query<
        (
            Entity,
            &RigidBody,
            &RigidBodyColliders,
            &Position,
            &Rotation,
            Option<&ComputedCenterOfMass>,
            Option<&LockedAxes>,
        ),
        (Without<GroundBody>, Without<Sleeping>, Without<RigidBodyDisabled>),
    >,
    solids: Solids,
    terrains: Query<(Entity, &Terrain, &GlobalTransform, &TerrainEntities), Without<TerrainPhysicsDisabled>>,
    mut turn: Local<usize>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    *turn = (*turn + 1) % CHECK_INTERVAL;
    // Ground that is not shown yet does not count.
    let ground: Vec<_> = terrains
        .iter()
        .filter(|(_, model, _, entities)| entities.show(model.world()))
        .map(|(entity, model, place, _)| (entity, model.world(), place.affine().inverse()))
        .collect();
    for (entity, body, own, position, rotation, center, locked) in
        bodies.iter().skip(*turn).step_by(CHECK_INTERVAL)
    {
        if locked.is_some_and(LockedAxes::is_translation_y_locked) {
            continue;
        }
        let middle = middle(position, rotation, center);
        let local = |inverse: &Affine3A| inverse.transform_point3(middle).as_dvec3();
        // Terrains may overlap; a body in the air of one of them is not buried.
        let is_in_air = |(_, world, inverse): &(Entity, &TerrainWorld, Affine3A)| {
            let place = local(inverse);
            world.height(place.x, place.z).is_some() && !world.is_solid(place)
        };
        for (terrain, world, inverse) in &ground {
            if world.is_buried(local(inverse))
                && solids.bounds((entity, body, own), solids.layers(*terrain)).is_some()
                && !ground.iter().any(is_in_air)
            {
                watched.0.entry((entity, *terrain)).or_insert(1);
            }
        }
    }
    figures.main_thread += start.elapsed();
}

/// Lifts watched bodies out of the ground.
#[derive(SystemParam)]
pub(super) struct BodyLifter<'w, 's> {
    watched: ResMut<'w, WatchedBodies>,
    bodies: Query<
        'w,
        's,
        (
            &'static RigidBody,
            &'static RigidBodyColliders,
            &'static mut Position,
            &'static Rotation,
            Option<&'static ComputedCenterOfMass>,
            &'static mut LinearVelocity,
            Option<&'static mut Transform>,
            Option<&'static mut CharacterMotion>,
            Has<ChildOf>,
        ),
    >,
    solids: Solids<'w, 's>,
    terrains: Query<
        'w,
        's,
        (Entity, &'static Terrain, &'static GlobalTransform, &'static TerrainEntities),
        Without<TerrainPhysicsDisabled>,
    >,
    time: Option<Res<'w, Time<Physics>>>,
    figures: ResMut<'w, PhysicsFigures>,
}

impl BodyLifter<'_, '_> {
    /// Lifts all watched bodies that are in the ground. If `counts`, they are watched for one frame less.
    fn run(&mut self, counts: bool) {
        let Self { watched, bodies, solids, terrains, figures, .. } = self;
        if watched.0.is_empty() {
            return;
        }
        let start = Instant::now();
        // A world that is not shown yet brings new colliders, so its bodies will be watched again.
        let terrains: Vec<_> = terrains
            .iter()
            .filter(|(_, terrain, _, entities)| entities.show(terrain.world()))
            .map(|(entity, terrain, place, _)| (entity, terrain.world(), place, place.affine().inverse()))
            .collect();
        watched.0.retain(|&(entity, terrain), frames| {
            *frames -= u8::from(counts);
            let terrain = terrains.iter().find(|known| known.0 == terrain);
            let (Ok(body), Some((known, world, place, inverse))) = (bodies.get_mut(entity), terrain) else {
                return false;
            };
            let (body, own, mut position, rotation, center, mut velocity, transform, motion, is_child) = body;
            let local = |place: Vec3| inverse.transform_point3(place).as_dvec3();
            let is_in_ground = |place: Vec3| local(place).is_finite() && world.is_solid(local(place));
            let middle = middle(&position, rotation, center);
            if !is_in_ground(middle) {
                return *frames > 0;
            }
            let layers = solids.layers(*known);
            let Some(bounds) = solids.bounds((entity, body, own), layers) else { return false };
            let inside = solids.inside(own, &position, rotation, middle, layers);
            if !is_in_ground(inside) {
                return *frames > 0;
            }
            if let Some((up, lift)) = lift(world, place, local(inside), inside, &bounds) {
                position.0 += up * lift;
                if let Some(mut transform) = transform.filter(|_| !is_child) {
                    transform.translation += up * lift;
                }
                velocity.0 = without_fall(velocity.0, up);
                if let Some(mut motion) = motion {
                    motion.velocity = without_fall(motion.velocity, up);
                }
                figures.lifted += 1;
            }
            *frames > 0
        });
        figures.main_thread += start.elapsed();
    }
}

/// Lifts bodies that were built over since the last frame.
pub(super) fn lift_before_steps(mut lifter: BodyLifter) {
    lifter.run(false);
}

/// Lifts bodies that a step has squeezed into the ground, before they are drawn.
pub(super) fn lift_after_steps(mut lifter: BodyLifter) {
    let counts = lifter.time.as_ref().is_none_or(|time| !time.is_paused());
    lifter.run(counts);
}

/// Run condition: the last step of a frame. Only its result is drawn.
pub(super) fn is_last_step(time: Option<Res<Time<Fixed>>>) -> bool {
    time.is_none_or(|time| time.overstep() < time.timestep())
}

/// Run condition: the first step of a frame. No ground changes between the steps of a frame.
pub(super) fn is_first_step(frame: Option<Res<FrameCount>>, mut last: Local<Option<u32>>) -> bool {
    frame.is_none_or(|frame| last.replace(frame.0) != Some(frame.0))
}

/// The centre of mass of a body. If it is in the air, the body counts as in the air.
fn middle(position: &Position, rotation: &Rotation, center: Option<&ComputedCenterOfMass>) -> Vec3 {
    position.0 + center.map_or(Vec3::ZERO, |center| rotation * center.0)
}

/// A velocity without its downward part.
fn without_fall(velocity: Vec3, up: Dir3) -> Vec3 {
    velocity - up * velocity.dot(*up).min(0.0)
}

/// The terrain's up direction, and how far along it a body must move to leave the ground. `inside` is a point of the
/// body in the ground, and `local` the same point in voxels of the terrain.
fn lift(
    world: &TerrainWorld,
    place: &GlobalTransform,
    local: DVec3,
    inside: Vec3,
    bounds: &ColliderAabb,
) -> Option<(Dir3, f32)> {
    let (up, size) = Dir3::new_and_length(place.affine().transform_vector3(Vec3::Y)).ok()?;
    let (half, size) = (up.abs().dot(bounds.size()) / 2.0, f64::from(size));
    let tall = f64::from(2.0 * half) / size;
    // The box is that of the last step, and the body may have been lifted since.
    let below = f64::from(up.dot(inside - bounds.center()) + half) / size;
    let below = below.clamp(0.0, tall.max(0.0));
    let fits = |floor: f64, ceiling: Option<f64>| ceiling.is_none_or(|ceiling| ceiling - floor >= tall);
    let spans = world.spans(local.x, local.z);
    let above = spans.iter().filter(|span| span.floor >= local.y && fits(span.floor, span.ceiling));
    let floor = above.map(|span| span.floor).next()?;
    let lift = ((floor + below - local.y) * size) as f32 + GAP;
    lift.is_finite().then_some((up, lift))
}
