//! Bodies over ground that has no collider yet are held, so that they do not fall through it.

use avian3d::physics_transform::PhysicsTransformConfig;
use avian3d::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::math::Affine3A;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::columns::{ColumnKey, Columns};
use super::frame::{AHEAD, TerrainFrame};
use super::solids::{Extent, FARTHEST, Reach, Solids};
use super::{ColliderSource, PhysicsFigures};
use crate::lattice::ChunkGrid;
use crate::plugin::TerrainEntities;
use crate::terrain::Terrain;

/// This body stands still until the ground under it has colliders: it is over a terrain that loads, or farther from all
/// [`ColliderSource`]s than their radius.
///
/// The plugin puts it on dynamic bodies, whose axes it locks, and on [`Character`](super::Character)s, and takes it away
/// again. Bodies high above the ground are not held, and neither are those that ground lets through: sensors, and what its
/// [layers](super::GroundContact::layers) do not meet.
///
/// The body goes on with the velocity that it had, and with its axes locked as they were, whoever takes this away. What a
/// game changes meanwhile counts: `LockedAxes`, and a velocity that is not zero, are kept for then. To stop a held body, set
/// the velocity here.
#[derive(Component, Reflect, Clone, Copy, Debug, Default)]
#[reflect(Component, Default)]
pub struct HeldByGround {
    /// The velocity that it goes on with, in metres per second. Not for characters, which have a motion of their own.
    pub velocity: Vec3,
    /// The angular velocity that it goes on with, in radians per second.
    pub spin: Vec3,
    /// Are all axes locked, because it is held?
    is_locked: bool,
    /// What would be locked otherwise.
    locked: Option<LockedAxes>,
}

impl HeldByGround {
    /// The velocity that was taken away from it, if one was.
    pub(super) fn stopped(&self) -> Option<Vec3> {
        self.is_locked.then_some(self.velocity)
    }

    /// Locks all axes, and remembers what was locked.
    fn lock(&mut self, locked: Option<&LockedAxes>, entity: &mut EntityCommands) {
        (self.is_locked, self.locked) = (true, locked.copied());
        entity.try_insert(LockedAxes::ALL_LOCKED);
    }
}

/// Are all axes locked?
fn locks_all(locked: Option<&LockedAxes>) -> bool {
    locked.is_some_and(|locked| locked.to_bits() == LockedAxes::ALL_LOCKED.to_bits())
}

/// A body as it can be held.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct Body {
    entity: Entity,
    kind: &'static RigidBody,
    sleeps: Has<Sleeping>,
    position: Ref<'static, Position>,
    transform: Option<Ref<'static, Transform>>,
    is_child: Has<ChildOf>,
    velocity: &'static mut LinearVelocity,
    spin: &'static mut AngularVelocity,
    locked: Option<&'static LockedAxes>,
    extent: Extent,
    hold: Option<&'static mut HeldByGround>,
}

impl BodyItem<'_, '_> {
    /// Does it move by what holding takes away: forces and steering?
    fn can_be_held(&self) -> bool {
        self.kind.is_dynamic() || self.extent.is_character
    }

    /// Does it lie where it lay, held or not?
    fn rests(&self) -> bool {
        let is_put = self.transform.as_ref().is_some_and(DetectChanges::is_changed);
        let is_moved = is_put || self.position.is_changed() || self.velocity.is_changed();
        let is_firm =
            |hold: &Mut<HeldByGround>| !hold.is_changed() && hold.is_locked && locks_all(self.locked);
        self.sleeps && !is_moved && self.hold.as_ref().is_none_or(is_firm)
    }

    /// How far it would go before ground has to have colliders, in metres; nowhere, unless it is held.
    fn longing(&self) -> f32 {
        self.hold.as_ref().map_or(0.0, |hold| hold.velocity.length() * AHEAD)
    }

    /// Holds it, or holds on to it: what the game changed since is kept for later.
    fn hold(&mut self, commands: &mut Commands) {
        let (velocity, spin) = (self.velocity.0, self.spin.0);
        let mut entity = commands.entity(self.entity);
        let Some(hold) = &mut self.hold else {
            let mut hold = HeldByGround { velocity, spin, ..default() };
            if !self.extent.is_character {
                hold.lock(self.locked, &mut entity);
                (self.velocity.0, self.spin.0) = (Vec3::ZERO, Vec3::ZERO);
            }
            entity.try_insert(hold);
            return;
        };
        if self.extent.is_character {
            return;
        }
        if velocity != Vec3::ZERO {
            (hold.velocity, self.velocity.0) = (velocity, Vec3::ZERO);
        }
        if spin != Vec3::ZERO {
            (hold.spin, self.spin.0) = (spin, Vec3::ZERO);
        }
        if !hold.is_locked || !locks_all(self.locked) {
            hold.lock(self.locked, &mut entity);
        }
    }

    /// Lets go of it, if it is held.
    fn release(&self, commands: &mut Commands) {
        if self.hold.is_some() {
            commands.entity(self.entity).try_remove::<HeldByGround>();
        }
    }
}

/// A body that is not held any more goes on as it was, whoever let go of it.
pub(super) fn go_on(
    gone: On<Remove, HeldByGround>,
    mut bodies: Query<(
        &HeldByGround,
        &RigidBody,
        &mut LinearVelocity,
        &mut AngularVelocity,
        Option<&LockedAxes>,
    )>,
    mut commands: Commands,
) {
    let Ok((hold, kind, mut velocity, mut spin, locked)) = bodies.get_mut(gone.entity) else { return };
    if !hold.is_locked {
        return;
    }
    // Only what falls is to go on falling.
    if kind.is_dynamic() {
        // Told so by the change, avian wakes it.
        let or = |now: Vec3, then: Vec3| if now == Vec3::ZERO { then } else { now };
        velocity.0 = or(velocity.0, hold.velocity);
        spin.0 = or(spin.0, hold.spin);
    }
    // Others are the game's own already.
    if locks_all(locked) {
        let mut entity = commands.entity(gone.entity);
        match hold.locked {
            Some(locked) => entity.try_insert(locked),
            None => entity.try_remove::<LockedAxes>(),
        };
    }
}

/// What of a terrain decides on bodies that rest: while all of it stays, they need no look.
#[derive(PartialEq)]
pub(super) struct Standing {
    terrain: Entity,
    inverse: Affine3A,
    is_shown: bool,
    grid: ChunkGrid,
    ground: u64,
}

impl Standing {
    fn of(frame: &TerrainFrame) -> Self {
        let TerrainFrame { terrain, model, inverse, is_shown, .. } = *frame;
        let (grid, ground) = (model.world().grid(), model.world().ground().hash());
        Self { terrain, inverse, is_shown, grid, ground }
    }
}

/// What bodies are judged by in a frame.
struct Judge<'a, 'w, 's> {
    frames: Vec<TerrainFrame<'a>>,
    /// Do terrains stand as they stood in the last frame?
    are_same: bool,
    columns: &'a Columns,
    /// Columns in which colliders came or went since the last frame.
    turned: Vec<ColumnKey>,
    places: &'a TransformHelper<'w, 's>,
    /// Does physics take over where transforms put bodies?
    follows_transform: bool,
}

impl Judge<'_, '_, '_> {
    /// Is it not enough to know what a body was found to be in the last frame? Where colliders came or went near it, or near
    /// where it was going, it is looked at even if it rests.
    fn needs_a_look(&self, body: &BodyItem) -> bool {
        !self.are_same || !body.rests() || self.has_turned_near(body)
    }

    fn has_turned_near(&self, body: &BodyItem) -> bool {
        let has_turned = |frame: &TerrainFrame| {
            // Some voxels more than it reaches, for its residual speed.
            let reach = (FARTHEST.x + body.longing()) / frame.size + 4.0;
            let place = frame.inverse.transform_point3(body.position.0).xz();
            let is_near = |tile| frame.distance(tile, place) <= reach;
            self.turned.iter().any(|&(terrain, tile)| terrain == frame.terrain && is_near(tile))
        };
        !self.turned.is_empty() && self.frames.iter().any(has_turned)
    }

    /// May a body that reaches so far come to ground without a collider soon?
    fn lacks_ground(&self, body: &BodyItem, reach: Reach) -> bool {
        let (middle, half) = (reach.middle(), reach.half());
        let towards = body.hold.as_ref().map_or(body.velocity.0, |hold| hold.velocity);
        let lacks_ground_at = |place: Vec3| {
            let lacks =
                |frame: &TerrainFrame| frame.lacks_ground(self.columns, place + middle, towards, half);
            self.frames.iter().any(lacks)
        };
        lacks_ground_at(body.position.0) || self.put(body).is_some_and(lacks_ground_at)
    }

    /// Where a game has just put a body: physics will have it there in its next step.
    fn put(&self, body: &BodyItem) -> Option<Vec3> {
        if !self.follows_transform {
            return None;
        }
        let place = match body.is_child {
            true => self.places.compute_global_transform(body.entity).ok()?.translation(),
            false => body.transform.as_ref()?.translation,
        };
        (place != body.position.0).then_some(place)
    }
}

/// Holds bodies and lets them go.
pub(super) fn hold(
    mut commands: Commands,
    mut bodies: Query<Body, Without<super::GroundBody>>,
    places: TransformHelper,
    config: Option<Res<PhysicsTransformConfig>>,
    terrains: Query<(Entity, &Terrain, Option<&TerrainEntities>)>,
    sources: Query<(), With<ColliderSource>>,
    mut columns: ResMut<Columns>,
    solids: Solids,
    mut known: Local<Vec<Standing>>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    let frames: Vec<TerrainFrame> = terrains
        .iter()
        .filter_map(|(entity, model, entities)| {
            let place = places.compute_global_transform(entity).ok()?;
            Some(TerrainFrame::new(entity, model, entities, &place))
        })
        .collect();
    let standing: Vec<Standing> = frames.iter().map(Standing::of).collect();
    let are_same = *known == standing;
    *known = standing;
    let turned = columns.take_turned();
    let follows_transform = config.is_none_or(|config| config.transform_to_position);
    let judge = Judge { frames, are_same, columns: &columns, turned, places: &places, follows_transform };
    let mut held = 0;
    for mut body in &mut bodies {
        let needs_a_look = judge.needs_a_look(&body);
        if !needs_a_look && body.hold.is_none() {
            continue;
        }
        let reach = if body.can_be_held() { solids.reach(&body.extent) } else { None };
        // One that is not looked at is held as before.
        if reach.is_some_and(|reach| !needs_a_look || judge.lacks_ground(&body, reach)) {
            held += 1;
            body.hold(&mut commands);
        } else {
            body.release(&mut commands);
        }
    }
    figures.held = held;
    if held > 0 && sources.is_empty() {
        warn_once!(
            "bodies over a terrain are held still: there is no ColliderSource, so ground has no colliders"
        );
    }
    figures.main_thread += start.elapsed();
}
