//! Bodies where ground changed: those that sleep are woken, those that were built over are lifted, at once or when they are
//! squeezed into it a moment later.

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
use super::{GroundBody, PhysicsFigures};
use crate::plugin::TerrainEntities;
use crate::terrain::{Drawn, Terrain, World as TerrainWorld};

/// How far from a change a body may sleep on, in metres.
const NEAR: f32 = 0.2;

/// How high above the ground a lifted body starts, in metres.
const GAP: f32 = 0.02;

/// In how many frames with steps bodies near a change are looked at: for a second as a rule. One that is built over in part
/// is still in the air, but between what pushes it up and what pushes it down it may leave through either.
const WATCHED: u8 = 64;

/// In so many frames with steps every body is looked at once, wherever it is.
const TURNS: usize = 8;

/// Where a collider changed, moved or went, in world space.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroundChange {
    terrain: Entity,
    low: Vec3,
    high: Vec3,
}

impl GroundChange {
    /// A box in metres from the origin of a part that stands at `place`.
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

    /// The box around a collider that went, or around where it was and is.
    pub fn around(terrain: Entity, bounds: &ColliderAabb) -> Self {
        Self { terrain, low: bounds.min - NEAR, high: bounds.max + NEAR }
    }

    fn meets(&self, bounds: &ColliderAabb) -> bool {
        self.low.cmple(bounds.max).all() && self.high.cmpge(bounds.min).all()
    }
}

/// Changes that bodies have not been told of: one box for each tile or chunk, for much is dug while time stands still.
#[derive(Resource, Default)]
pub(super) struct GroundChanges {
    boxes: Vec<GroundChange>,
    numbers: HashMap<(Entity, Drawn), usize>,
}

impl GroundChanges {
    /// Adds a change of one tile or chunk of its terrain.
    pub fn add(&mut self, drawn: Drawn, change: GroundChange) {
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

/// Bodies near which a terrain changed a moment ago, or that were found in it; and how often they will be looked at.
#[derive(Resource, Default)]
pub(super) struct Watched(HashMap<(Entity, Entity), u8>);

/// Wakes bodies near changes, and has them watched.
pub(super) fn wake(
    mut commands: Commands,
    mut changes: ResMut<GroundChanges>,
    mut watched: ResMut<Watched>,
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
    for (entity, body, own, bounds, sleeps) in &bodies {
        // Most bodies are far off, and have one collider, their own.
        let is_far = |bounds: &ColliderAabb| !changes.iter().any(|change| change.meets(bounds));
        if own[..] == [entity] && bounds.is_some_and(is_far) {
            continue;
        }
        let Some(bounds) = solids.bounds(entity, body, own) else { continue };
        let mut near = changes.iter().filter(|change| change.meets(&bounds)).peekable();
        if near.peek().is_some() && sleeps {
            commands.queue_silenced(WakeBody(entity));
            figures.woken += 1;
        }
        watched.0.extend(near.map(|change| ((entity, change.terrain), WATCHED)));
    }
    figures.main_thread += start.elapsed();
}

/// Has bodies watched that are in the ground, some in each frame: ground has one side only, and whoever got in where nothing
/// changed, pressed by others or put there, would fall for ever. What is to be buried sleeps, or cannot move up and down.
pub(super) fn patrol(
    mut watched: ResMut<Watched>,
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
    terrains: Query<(Entity, &Terrain, &GlobalTransform, &TerrainEntities)>,
    mut turn: Local<usize>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    *turn = (*turn + 1) % TURNS;
    // Ground that nobody sees yet is no ground yet.
    let ground: Vec<_> = terrains
        .iter()
        .filter(|(_, model, _, entities)| entities.show(model.world()))
        .map(|(entity, model, place, _)| (entity, model.world(), place.affine().inverse()))
        .collect();
    for (entity, body, own, position, rotation, center, locked) in bodies.iter().skip(*turn).step_by(TURNS) {
        if locked.is_some_and(LockedAxes::is_translation_y_locked) {
            continue;
        }
        let middle = middle(position, rotation, center);
        let local = |inverse: &Affine3A| inverse.transform_point3(middle).as_dvec3();
        // Terrains may be above each other: air of one is air.
        let is_in_air = |(_, world, inverse): &(Entity, &TerrainWorld, Affine3A)| {
            let place = local(inverse);
            world.height(place.x, place.z).is_some() && !world.is_solid(place)
        };
        for (terrain, world, inverse) in &ground {
            if world.is_buried(local(inverse))
                && solids.bounds(entity, body, own).is_some()
                && !ground.iter().any(is_in_air)
            {
                watched.0.entry((entity, *terrain)).or_insert(1);
            }
        }
    }
    figures.main_thread += start.elapsed();
}

/// What it takes to lift bodies that are watched out of the ground.
#[derive(SystemParam)]
pub(super) struct Rescue<'w, 's> {
    watched: ResMut<'w, Watched>,
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
    terrains: Query<'w, 's, (Entity, &'static Terrain, &'static GlobalTransform, &'static TerrainEntities)>,
    time: Option<Res<'w, Time<Physics>>>,
    figures: ResMut<'w, PhysicsFigures>,
}

impl Rescue<'_, '_> {
    /// Lifts whoever is in the ground; `passes` counts the look.
    fn run(&mut self, passes: bool) {
        let Self { watched, bodies, solids, terrains, figures, .. } = self;
        if watched.0.is_empty() {
            return;
        }
        let start = Instant::now();
        // A world that is not shown yet comes with colliders that have bodies watched anew.
        let terrains: Vec<_> = terrains
            .iter()
            .filter(|(_, terrain, _, entities)| entities.show(terrain.world()))
            .map(|(entity, terrain, place, _)| (entity, terrain.world(), place, place.affine().inverse()))
            .collect();
        watched.0.retain(|&(entity, terrain), looks| {
            *looks -= u8::from(passes);
            let terrain = terrains.iter().find(|known| known.0 == terrain);
            let (Ok(body), Some((_, world, place, inverse))) = (bodies.get_mut(entity), terrain) else {
                return false;
            };
            let (body, own, mut position, rotation, center, mut velocity, transform, motion, is_child) = body;
            let local = |place: Vec3| inverse.transform_point3(place).as_dvec3();
            let is_in_ground = |place: Vec3| local(place).is_finite() && world.is_solid(local(place));
            let middle = middle(&position, rotation, center);
            if !is_in_ground(middle) {
                return *looks > 0;
            }
            let Some(bounds) = solids.bounds(entity, body, own) else { return false };
            let inside = solids.inside(own, &position, rotation, middle);
            if !is_in_ground(inside) {
                return *looks > 0;
            }
            if let Some((up, lift)) = lift(world, place, local(inside), inside, &bounds) {
                position.0 += up * lift;
                if let Some(mut transform) = transform.filter(|_| !is_child) {
                    transform.translation += up * lift;
                }
                velocity.0 = rising(velocity.0, up);
                if let Some(mut motion) = motion {
                    motion.velocity = rising(motion.velocity, up);
                }
                figures.lifted += 1;
            }
            *looks > 0
        });
        figures.main_thread += start.elapsed();
    }
}

/// Lifts bodies that the ground was built over since the last frame.
pub(super) fn rescue_before(mut rescue: Rescue) {
    rescue.run(false);
}

/// Lifts bodies that a step has squeezed into the ground, so that nobody sees them there.
pub(super) fn rescue_after(mut rescue: Rescue) {
    // While time stands still nobody is squeezed.
    let passes = rescue.time.as_ref().is_none_or(|time| !time.is_paused());
    rescue.run(passes);
}

/// Run condition: the last step of a frame. What happens between two steps of one frame nobody sees.
pub(super) fn is_last_step(time: Option<Res<Time<Fixed>>>) -> bool {
    time.is_none_or(|time| time.overstep() < time.timestep())
}

/// Run condition: the first step of a frame. Between two steps of one frame no ground changes.
pub(super) fn is_first_step(frame: Option<Res<FrameCount>>, mut last: Local<Option<u32>>) -> bool {
    frame.is_none_or(|frame| last.replace(frame.0) != Some(frame.0))
}

/// The middle of a body, which need not be where its shapes count from: if that is in the air, so is the body.
fn middle(position: &Position, rotation: &Rotation, center: Option<&ComputedCenterOfMass>) -> Vec3 {
    position.0 + center.map_or(Vec3::ZERO, |center| rotation * center.0)
}

/// What is left of a velocity when nothing of it leads down.
fn rising(velocity: Vec3, up: Dir3) -> Vec3 {
    velocity - up * velocity.dot(*up).min(0.0)
}

/// Which way is up in a terrain, and how far up a body must go that is in the ground with a point `inside` it, which is at
/// `local` in the terrain.
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
    // The box is as old as the last step, and somebody may have been lifted since.
    let below = f64::from(up.dot(inside - bounds.center()) + half) / size;
    let below = below.clamp(0.0, tall.max(0.0));
    let fits = |floor: f64, ceiling: Option<f64>| ceiling.is_none_or(|ceiling| ceiling - floor >= tall);
    let spans = world.spans(local.x, local.z);
    let above = spans.iter().filter(|span| span.floor >= local.y && fits(span.floor, span.ceiling));
    let floor = above.map(|span| span.floor).next()?;
    let lift = ((floor + below - local.y) * size) as f32 + GAP;
    lift.is_finite().then_some((up, lift))
}
