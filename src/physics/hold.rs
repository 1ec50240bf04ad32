//! Bodies over ground that has no collider yet are held, so that they do not fall through it.

use avian3d::physics_transform::PhysicsTransformConfig;
use avian3d::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::math::bounding::{Aabb2d, AabbCast2d};
use bevy::math::{Affine3A, Vec3A};
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::columns::Columns;
use super::near::{ahead, voxel_size};
use super::solids::{Extent, FARTHEST, Solids};
use super::{ColliderSource, PhysicsFigures};
use crate::lattice::{ChunkGrid, Column, TilePos};
use crate::plugin::TerrainEntities;
use crate::terrain::Terrain;

/// How far ahead of a body ground must have colliders, in seconds: longer than any frame.
const AHEAD: f32 = 0.25;

/// Bodies this far above all ground are not held, in metres beyond what they fall in [`AHEAD`].
const CLEARANCE: f32 = 4.0;

/// How far apart the ground's height is asked on a body's way, in voxels, unless that makes more places than [`STOPS`].
const STRIDE: f32 = 2.0;

/// Places on a body's way in which the ground's height is asked, at most, beyond the first.
const STOPS: f32 = 16.0;

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
    mut known: Local<Vec<(Entity, Affine3A, bool, ChunkGrid, u64)>>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    let (turned, ready) = (columns.take_turned(), &*columns);
    let terrains: Vec<(Entity, &Terrain, Affine)> = terrains
        .iter()
        .filter_map(|(entity, terrain, entities)| {
            let place = places.compute_global_transform(entity).ok()?;
            let is_shown = entities.is_some_and(|entities| entities.show(terrain.world()));
            let (inverse, size) = (place.affine().inverse(), voxel_size(&place));
            Some((entity, terrain, Affine { inverse, size, is_shown }))
        })
        .collect();
    let now = terrains.iter().map(|(entity, model, affine)| {
        (*entity, affine.inverse, affine.is_shown, model.world().grid(), model.world().ground().hash())
    });
    let now: Vec<_> = now.collect();
    let are_same = *known == now;
    *known = now;
    // Where colliders came or went near a body, or near where it was going, it is looked at even if it rests.
    let is_turned = |body: &BodyItem| {
        let near = |(terrain, model, affine): &(Entity, &Terrain, Affine)| {
            let (grid, place) = (model.world().grid(), affine.inverse.transform_point3(body.position.0).xz());
            // Some voxels more than it reaches, for its residual speed.
            let reach = (FARTHEST.x + body.longing()) / affine.size + 4.0;
            let is_near = |tile| distance(grid, tile, place) <= reach;
            turned.iter().any(|&(of, tile)| of == *terrain && is_near(tile))
        };
        !turned.is_empty() && terrains.iter().any(near)
    };
    let follows_transform = config.is_none_or(|config| config.transform_to_position);
    let mut held = 0;
    for mut body in &mut bodies {
        let rests = are_same && body.rests() && !is_turned(&body);
        if rests && body.hold.is_none() {
            continue;
        }
        let reach = if body.can_be_held() { solids.reach(&body.extent) } else { None };
        let lacks_ground = reach.is_some_and(|reach| {
            if rests {
                // As it did before.
                return true;
            }
            let (middle, half) = (reach.middle(), reach.half());
            let towards = body.hold.as_ref().map_or(body.velocity.0, |hold| hold.velocity);
            let lacks_ground = |place: Vec3| {
                terrains.iter().any(|(terrain, model, affine)| {
                    affine.lacks_ground(*terrain, model, ready, place + middle, towards, half)
                })
            };
            // Where a game has just put it, physics will have it in its next step.
            let put = || match body.is_child {
                true => places.compute_global_transform(body.entity).ok().map(|put| put.translation()),
                false => body.transform.as_ref().map(|put| put.translation),
            };
            let is_put = |put: &Vec3| *put != body.position.0;
            lacks_ground(body.position.0)
                || follows_transform && put().filter(is_put).is_some_and(lacks_ground)
        });
        if lacks_ground {
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

/// From a place to a column along x or z, whichever is farther, in voxels.
fn distance(grid: ChunkGrid, tile: TilePos, place: Vec2) -> f32 {
    let size = grid.size() as f32;
    let corner = Vec2::new(tile.x as f32, tile.z as f32) * size;
    (place - place.clamp(corner, corner + size)).abs().max_element()
}

/// From the world to a terrain.
struct Affine {
    inverse: Affine3A,
    /// Metres along a voxel's side.
    size: f32,
    /// Do its tiles and chunks show the world that it has now?
    is_shown: bool,
}

impl Affine {
    /// May a body whose box has its middle here reach ground without a collider soon?
    fn lacks_ground(
        &self,
        terrain: Entity,
        model: &Terrain,
        ready: &Columns,
        place: Vec3,
        velocity: Vec3,
        half: Vec3,
    ) -> bool {
        let grid = model.world().grid();
        let from = self.inverse.transform_point3(place);
        let way = self.inverse.transform_vector3(velocity * AHEAD);
        if !(from.is_finite() && way.is_finite()) {
            return false;
        }
        let (way, half) = (ahead(way, grid), Vec3::from(self.inverse.matrix3.abs() * Vec3A::from(half)));
        let (low, high) = (from.min(from + way) - half, from.max(from + way) + half);
        let (first, last) = (low.floor().as_ivec3(), high.floor().as_ivec3());
        // A body that is off the terrain has nothing to wait for.
        let (first, last) = (
            Column::new(first.x.max(0), first.z.max(0)),
            Column::new(last.x.min(grid.width() - 1), last.z.min(grid.depth() - 1)),
        );
        if first.x > last.x || first.z > last.z {
            return false;
        }
        let (first, last) = (grid.tile_of_cell(first), grid.tile_of_cell(last));
        let tiles = (first.z..=last.z).flat_map(|z| (first.x..=last.x).map(move |x| TilePos { x, z }));
        // Where the game took the tile away, nothing is to come any more.
        let is_ready = |tile| ready.is_ready((terrain, tile)).unwrap_or(self.is_shown);
        let mut missing = tiles.filter(|&tile| !is_ready(tile)).peekable();
        if missing.peek().is_none() {
            return false;
        }
        let (body, from, way) = (Aabb2d::new(Vec2::ZERO, half.xz()), from.xz(), way.xz());
        let cast = AabbCast2d::new(body, from, Dir2::new(way).unwrap_or(Dir2::X), way.length());
        let meets = |tile: TilePos| {
            let corner = Vec2::new(tile.x as f32, tile.z as f32) * grid.size() as f32;
            cast.aabb_collision_at(Aabb2d { min: corner, max: corner + grid.size() as f32 }).is_some()
        };
        // Its front is farther ahead than its middle.
        let way = way + way.normalize_or_zero() * half.xz().length();
        missing.any(meets) && self.is_low(model, from, way, low.y)
    }

    /// Is its lowest point near the ground somewhere on its way, or under some of it?
    fn is_low(&self, model: &Terrain, from: Vec2, way: Vec2, low: f32) -> bool {
        let grid = model.world().grid();
        let end = Vec2::new(grid.width() as f32, grid.depth() as f32);
        let count = (way.length() / STRIDE).ceil().min(STOPS);
        (0..=count as u32).any(|stop| {
            let place = (from + way * (stop as f32 / count.max(1.0))).clamp(Vec2::ZERO, end).as_dvec2();
            let height = model.world().height(place.x, place.y);
            height.is_some_and(|height| f64::from(low) < height + f64::from(CLEARANCE / self.size))
        })
    }
}
