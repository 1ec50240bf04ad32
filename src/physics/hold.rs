//! Holds bodies over ground that has no collider yet, so that they do not fall through it.

use avian3d::physics_transform::PhysicsTransformConfig;
use avian3d::prelude::*;
use bevy::ecs::entity::EntityHashSet;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::QueryData;
use bevy::math::Affine3A;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::columns::{ColumnKey, Columns};
use super::frame::{AHEAD, TerrainFrame};
use super::solids::{Extent, FARTHEST, Reach, Solids};
use super::{ColliderSource, PhysicsFigures, TerrainPhysicsDisabled};
use crate::lattice::ChunkGrid;
use crate::plugin::{Places, TerrainEntities};
use crate::terrain::Terrain;

/// Marks a body that is held still until the ground below it has colliders, because the terrain is loading or the body
/// is outside the radius of every [`ColliderSource`].
///
/// The plugin inserts it on dynamic bodies, whose axes it locks, and on [`Character`](super::Character)s, and removes
/// it again. Bodies high above the ground are not held, nor are those that do not collide with it: sensors, and bodies
/// on other [layers](super::GroundContact::layers).
///
/// When it is removed, by the plugin or by the game, the body gets back its velocity and its `LockedAxes`. If a game
/// changes `LockedAxes` or sets a non-zero velocity while the body is held, those are used instead. To stop a held
/// body, set the velocity in this component.
#[derive(Component, Reflect, Clone, Copy, Debug, Default)]
#[reflect(Component, Default)]
pub struct HeldByGround {
    /// The velocity after release, in metres per second. Unused for characters, which have a
    /// [`CharacterMotion`](super::CharacterMotion).
    pub velocity: Vec3,
    /// The angular velocity after release, in radians per second.
    pub spin: Vec3,
    /// Whether the plugin locked all axes.
    is_locked: bool,
    /// The axes locked after release.
    locked: Option<LockedAxes>,
}

impl HeldByGround {
    /// The velocity after release, for a body whose axes are locked.
    pub(super) fn stopped(&self) -> Option<Vec3> {
        self.is_locked.then_some(self.velocity)
    }

    /// Locks all axes and stores which ones were locked.
    fn lock(&mut self, locked: Option<&LockedAxes>, entity: &mut EntityCommands) {
        (self.is_locked, self.locked) = (true, locked.copied());
        entity.try_insert(LockedAxes::ALL_LOCKED);
    }
}

/// Whether all axes are locked.
fn locks_all(locked: Option<&LockedAxes>) -> bool {
    locked.is_some_and(|locked| locked.to_bits() == LockedAxes::ALL_LOCKED.to_bits())
}

/// A body that may be held.
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
    /// Whether holding stops it: it moves by forces or steering.
    fn can_be_held(&self) -> bool {
        self.kind.is_dynamic() || self.extent.is_character
    }

    /// Whether it sleeps where it was, and its hold is unchanged.
    fn rests(&self) -> bool {
        let is_placed = self.transform.as_ref().is_some_and(DetectChanges::is_changed);
        let is_moved = is_placed || self.position.is_changed() || self.velocity.is_changed();
        let is_unchanged =
            |hold: &Mut<HeldByGround>| !hold.is_changed() && hold.is_locked && locks_all(self.locked);
        self.sleeps && !is_moved && self.hold.as_ref().is_none_or(is_unchanged)
    }

    /// How far a held body would move within [`AHEAD`] of its release, in metres; 0 for others.
    fn travel(&self) -> f32 {
        self.hold.as_ref().map_or(0.0, |hold| hold.velocity.length() * AHEAD)
    }

    /// Holds it. If it is held already, changes by the game are stored for its release.
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

    /// Releases it if it is held.
    fn release(&self, commands: &mut Commands) {
        if self.hold.is_some() {
            commands.entity(self.entity).try_remove::<HeldByGround>();
        }
    }
}

/// Restores the motion of a body that is no longer held.
pub(super) fn restore_motion(
    gone: On<Remove, HeldByGround>,
    mut bodies: Query<
        (&HeldByGround, &RigidBody, &mut LinearVelocity, &mut AngularVelocity, Option<&LockedAxes>),
        Allow<Disabled>,
    >,
    mut commands: Commands,
) {
    let Ok((hold, kind, mut velocity, mut spin, locked)) = bodies.get_mut(gone.entity) else { return };
    if !hold.is_locked {
        return;
    }
    if kind.is_dynamic() {
        // The change wakes it.
        let or = |now: Vec3, then: Vec3| if now == Vec3::ZERO { then } else { now };
        velocity.0 = or(velocity.0, hold.velocity);
        spin.0 = or(spin.0, hold.spin);
    }
    // Otherwise the game changed them.
    if locks_all(locked) {
        let mut entity = commands.entity(gone.entity);
        match hold.locked {
            Some(locked) => entity.try_insert(locked),
            None => entity.try_remove::<LockedAxes>(),
        };
    }
}

/// The state of a terrain that holding depends on. While it is unchanged, bodies at rest are not checked again.
#[derive(PartialEq)]
pub(super) struct TerrainState {
    terrain: Entity,
    inverse: Affine3A,
    is_shown: bool,
    grid: ChunkGrid,
    ground: u64,
    layers: CollisionLayers,
}

impl TerrainState {
    fn of(frame: &TerrainFrame) -> Self {
        let TerrainFrame { terrain, model, inverse, is_shown, layers, .. } = *frame;
        let (grid, ground) = (model.world().grid(), model.world().ground().hash());
        Self { terrain, inverse, is_shown, grid, ground, layers }
    }
}

/// Decides which bodies are held in a frame.
struct HoldCheck<'a, 'w, 's> {
    frames: Vec<TerrainFrame<'a>>,
    /// Whether all terrains are as in the last frame.
    are_same: bool,
    columns: &'a Columns,
    /// Columns whose colliders changed since the last frame.
    changed: Vec<ColumnKey>,
    places: &'a Places<'w, 's>,
    /// Whether physics takes positions from transforms.
    follows_transform: bool,
}

impl HoldCheck<'_, '_, '_> {
    /// Whether the result of the last frame may be outdated.
    fn must_check(&self, body: &BodyItem) -> bool {
        !self.are_same || !body.rests() || self.has_changed_near(body)
    }

    /// Whether colliders changed near the body, or near where it was going.
    fn has_changed_near(&self, body: &BodyItem) -> bool {
        let has_changed = |frame: &TerrainFrame| {
            // A sleeping body may have some residual speed: hence 4 voxels more.
            let reach = (FARTHEST.x + body.travel()) / frame.size + 4.0;
            let place = frame.inverse.transform_point3(body.position.0).xz();
            let is_near = |tile| frame.distance(tile, place) <= reach;
            self.changed.iter().any(|&(terrain, tile)| terrain == frame.terrain && is_near(tile))
        };
        !self.changed.is_empty() && self.frames.iter().any(has_changed)
    }

    /// The terrain a body is held for: it collides with its ground and, if that has to be checked, may soon reach a
    /// place where this ground has no collider.
    fn holder(&self, body: &BodyItem, solids: &Solids, must_check: bool) -> Option<Entity> {
        let towards = body.hold.as_ref().map_or(body.velocity.0, |hold| hold.velocity);
        let placed = if must_check { self.placed(body) } else { None };
        // Most terrains have the same layers.
        let mut known: Option<(CollisionLayers, Option<Reach>)> = None;
        let must_hold = |frame: &&TerrainFrame| {
            let known = match known {
                Some(known) if known.0 == frame.layers => known,
                _ => *known.insert((frame.layers, solids.reach(&body.extent, frame.layers))),
            };
            let Some(reach) = known.1 else { return false };
            let lacks_ground_at =
                |place: Vec3| frame.lacks_ground(self.columns, place + reach.middle(), towards, reach.half());
            !must_check || lacks_ground_at(body.position.0) || placed.is_some_and(lacks_ground_at)
        };
        self.frames.iter().find(must_hold).map(|frame| frame.terrain)
    }

    /// Where a game has just moved the body by its transform. Physics takes that over in its next step.
    fn placed(&self, body: &BodyItem) -> Option<Vec3> {
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

/// Holds bodies and releases them.
pub(super) fn hold_bodies(
    mut commands: Commands,
    mut bodies: Query<Body, Without<super::GroundBody>>,
    places: Places,
    config: Option<Res<PhysicsTransformConfig>>,
    terrains: Query<(Entity, &Terrain, Option<&TerrainEntities>), Without<TerrainPhysicsDisabled>>,
    sources: Query<(), With<ColliderSource>>,
    mut columns: ResMut<Columns>,
    solids: Solids,
    mut known: Local<Vec<TerrainState>>,
    mut reported: Local<EntityHashSet>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    let frames: Vec<TerrainFrame> = terrains
        .iter()
        .filter_map(|(entity, model, entities)| {
            let place = places.compute_global_transform(entity).ok()?;
            Some(TerrainFrame::new(entity, model, entities, &place, solids.layers(entity)))
        })
        .collect();
    let states: Vec<TerrainState> = frames.iter().map(TerrainState::of).collect();
    let are_same = *known == states;
    *known = states;
    let changed = columns.take_changed();
    let follows_transform = config.is_none_or(|config| config.transform_to_position);
    let check =
        HoldCheck { frames, are_same, columns: &columns, changed, places: &places, follows_transform };
    let has_sources = !sources.is_empty();
    if has_sources {
        reported.clear();
    }
    let mut held = 0;
    for mut body in &mut bodies {
        let must_check = check.must_check(&body);
        if !must_check && body.hold.is_none() {
            continue;
        }
        // Without a check, a held body stays held.
        let holder = if body.can_be_held() { check.holder(&body, &solids, must_check) } else { None };
        let Some(terrain) = holder else {
            body.release(&mut commands);
            continue;
        };
        held += 1;
        body.hold(&mut commands);
        if !has_sources && reported.insert(terrain) {
            warn!(
                "the terrain {terrain} has no colliders, so the body {} and others above it are held: insert a ColliderSource \
                 on the player, for example",
                body.entity
            );
        }
    }
    figures.held = held;
    figures.main_thread += start.elapsed();
}
