//! Colliders of tiles and chunks: made with the meshes, put in their place with them.

use std::sync::{Arc, PoisonError, RwLock};

use avian3d::collision::collider::EnlargedAabb;
use avian3d::parry::shape::SharedShape;
use avian3d::prelude::*;
use bevy::platform::collections::HashMap;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::PhysicsFigures;
use super::columns::column;
use super::ground::{GroundBody, GroundCollider, GroundContact};
use super::near::Neighbourhood;
use super::shape::GroundShape;
use super::wake::{GroundChange, GroundChanges};
use crate::plugin::{CommitAction, Part, ShownSurface, SurfaceProcessor};
use crate::surface::SurfaceMesh;
use crate::terrain::Drawn;

/// What tasks and the main thread know of ground.
#[derive(Default)]
struct Known {
    near: RwLock<Neighbourhood>,
    shapes: RwLock<HashMap<(Entity, Drawn), Arc<GroundShape>>>,
}

/// Where colliders are wanted, and which there are; tasks look at it too.
#[derive(Resource, Clone, Default)]
pub(super) struct Grounds(Arc<Known>);

impl Grounds {
    /// A copy, for the main thread.
    pub fn near(&self) -> Neighbourhood {
        self.0.near.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub fn set_near(&self, near: Neighbourhood) {
        *self.0.near.write().unwrap_or_else(PoisonError::into_inner) = near;
    }

    fn shape(&self, part: &Part) -> Option<Arc<GroundShape>> {
        let shapes = self.0.shapes.read().unwrap_or_else(PoisonError::into_inner);
        shapes.get(&(part.terrain, part.drawn)).cloned()
    }

    fn has_shape(&self, terrain: Entity, drawn: Drawn) -> bool {
        let shapes = self.0.shapes.read().unwrap_or_else(PoisonError::into_inner);
        shapes.contains_key(&(terrain, drawn))
    }

    fn set_shape(&self, part: &Part, shape: Option<Arc<GroundShape>>) {
        let mut shapes = self.0.shapes.write().unwrap_or_else(PoisonError::into_inner);
        match shape {
            Some(shape) => shapes.insert((part.terrain, part.drawn), shape),
            None => shapes.remove(&(part.terrain, part.drawn)),
        };
    }

    /// Makes a collider, in a task.
    pub fn prepare(&self, part: &Part, surface: &SurfaceMesh) -> PreparedCollider {
        let shape = GroundShape::new(surface, part.voxel_size).map(Arc::new);
        let changed = GroundShape::difference(self.shape(part).as_deref(), shape.as_deref());
        PreparedCollider { grounds: self.clone(), part: *part, shape, changed }
    }
}

impl SurfaceProcessor for Grounds {
    /// Near sources, and a little farther off where there is a collider that has not gone yet: what is dug out of a tile
    /// there takes ground from it, so the chunk that draws the hole gets its collider with the tile's new one.
    fn wants(&self, part: &Part) -> bool {
        let near = self.0.near.read().unwrap_or_else(PoisonError::into_inner);
        let tile = column(part.drawn);
        let has_shape = |drawn| self.has_shape(part.terrain, drawn);
        let stays = || has_shape(part.drawn) || has_shape(Drawn::Tile(tile));
        near.distance((part.terrain, tile)).is_some_and(|distance| distance <= 0.0 || stays())
    }

    fn build(&self, part: &Part, surface: &SurfaceMesh) -> Option<CommitAction> {
        let prepared = self.prepare(part, surface);
        Some(Box::new(move |entity| {
            entity.queue_silenced(move |part: EntityWorldMut| prepared.attach(part));
        }))
    }
}

/// What is added to the box around a collider, in metres: as much as avian adds itself.
const MARGIN: f32 = 0.05;

/// A collider on its way to its tile or chunk.
pub(super) struct PreparedCollider {
    grounds: Grounds,
    part: Part,
    shape: Option<Arc<GroundShape>>,
    /// Where it differs from the one before, in metres from the part's origin.
    changed: Option<(Vec3, Vec3)>,
}

impl PreparedCollider {
    /// Puts the collider in place of the old one, unless the surface has changed since it was made.
    pub fn attach(self, mut part: EntityWorldMut) {
        let owner = part.id();
        let is_newer = |revision: u64| revision > self.part.revision;
        let shown = part.get::<ShownSurface>().is_some_and(|shown| is_newer(shown.revision));
        let old = part.get::<GroundCollider>().copied();
        if shown || old.is_some_and(|old| is_newer(old.revision)) {
            part.world_scope(|world| world.resource_mut::<PhysicsFigures>().stale += 1);
            return;
        }
        let old = old.and_then(|old| old.body);
        self.grounds.set_shape(&self.part, self.shape.clone());
        let body = part.world_scope(|world| {
            if let Some((low, high)) = self.changed {
                // A new part is not placed itself before the end of the frame.
                let terrain = world.get::<GlobalTransform>(self.part.terrain).copied().unwrap_or_default();
                let place = terrain * Transform::from_translation(self.part.origin.as_vec3());
                let change = GroundChange::new(self.part.terrain, &place, self.part.voxel_size, low, high);
                let mut changes = world.resource_mut::<GroundChanges>();
                changes.add(self.part.drawn, change);
                let count = changes.len();
                world.resource_mut::<PhysicsFigures>().changes = count;
            }
            world.resource_mut::<PhysicsFigures>().swaps += 1;
            let contact = world.resource::<GroundContact>().clone();
            match (self.shape, old.and_then(|old| world.get_entity_mut(old).ok())) {
                (None, None) => None,
                (None, Some(old)) => {
                    old.despawn();
                    None
                }
                (Some(shape), Some(mut old)) => {
                    // Under the same entity: who touches it keeps touching it. Avian looks for it by its old box up to
                    // the next step; who walks before would sink where it has grown.
                    let collider = Collider::from(SharedShape(shape));
                    if let (Some(place), Some(turn)) = (old.get::<Position>(), old.get::<Rotation>()) {
                        let bounds = collider.aabb(place.0, *turn).grow(Vec3::splat(MARGIN));
                        old.insert((bounds, EnlargedAabb::new(bounds)));
                    }
                    contact.apply(&mut old);
                    old.insert(collider);
                    Some(old.id())
                }
                (Some(shape), None) => {
                    let mut body = world.spawn((
                        GroundBody { terrain: self.part.terrain, part: owner, drawn: self.part.drawn },
                        RigidBody::Static,
                        // Shapes are in metres already.
                        Transform::from_scale(Vec3::splat(self.part.voxel_size.recip())),
                        ChildOf(owner),
                        Collider::from(SharedShape(shape)),
                    ));
                    contact.apply(&mut body);
                    Some(body.id())
                }
            }
        });
        part.insert(GroundCollider { body, revision: self.part.revision });
    }
}

/// Takes a tile's or chunk's collider away.
pub(super) fn detach(mut part: EntityWorldMut) {
    let Some(old) = part.take::<GroundCollider>() else { return };
    part.world_scope(|world| {
        if let Some(Ok(body)) = old.body.map(|body| world.get_entity_mut(body)) {
            body.despawn();
        }
    });
}

/// Lets go of a shape whose collider is gone, whoever despawned it; its tile or chunk has no collider then. Where nobody
/// [detached](detach) it, ground has gone, and who sleeps there is told.
pub(super) fn forget(
    gone: On<Remove, GroundBody>,
    bodies: Query<(&GroundBody, Option<&ColliderAabb>)>,
    parts: Query<Has<GroundCollider>>,
    grounds: Res<Grounds>,
    mut changes: ResMut<GroundChanges>,
    mut figures: ResMut<PhysicsFigures>,
    mut commands: Commands,
) {
    let gone = gone.entity;
    let Ok((body, bounds)) = bodies.get(gone) else { return };
    let is_detached = parts.get(body.part).is_ok_and(|has_collider| !has_collider);
    if let Some(bounds) = bounds.filter(|_| !is_detached) {
        changes.add(body.drawn, GroundChange::around(body.terrain, bounds));
        figures.changes = changes.len();
    }
    let mut shapes = grounds.0.shapes.write().unwrap_or_else(PoisonError::into_inner);
    shapes.remove(&(body.terrain, body.drawn));
    let Ok(mut part) = commands.get_entity(body.part) else { return };
    part.queue_silenced(move |mut part: EntityWorldMut| {
        if part.get::<GroundCollider>().is_some_and(|ground| ground.body == Some(gone)) {
            part.remove::<GroundCollider>();
        }
    });
}

/// Puts colliders where their tiles and chunks are, before a step. Avian itself would take over no turn of less than a tenth
/// of a degree: ground that turns slowly would leave its colliders behind.
pub(super) fn follow(
    parts: Query<(Entity, &GroundCollider), Or<(Changed<GlobalTransform>, Changed<GroundCollider>)>>,
    places: TransformHelper,
    mut bodies: Query<(&GroundBody, &Collider, Ref<ColliderAabb>, &mut Position, &mut Rotation)>,
    mut changes: ResMut<GroundChanges>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    for (part, ground) in &parts {
        let Some(body) = ground.body else { continue };
        let (Ok(body), Ok(place)) = (bodies.get_mut(body), places.compute_global_transform(part)) else {
            continue;
        };
        let (body, collider, bounds, mut position, mut turn) = body;
        let place = place.compute_transform();
        if !place.is_finite() {
            continue;
        }
        let is_put = position.set_if_neq(Position(place.translation));
        let is_turned = turn.set_if_neq(Rotation(place.rotation));
        // Whoever was there before a collider has been told when it came.
        if (is_put || is_turned) && !bounds.is_added() {
            let bounds = bounds.merged(collider.aabb(place.translation, place.rotation));
            changes.add(body.drawn, GroundChange::around(body.terrain, &bounds));
            figures.changes = changes.len();
        }
    }
    figures.main_thread += start.elapsed();
}

/// Keeps bodies of ground at the origins of their tiles and chunks, after a step: Avian works out from where they are in the
/// world where that is below their parents, and what it rounds would add up.
pub(super) fn stay(mut bodies: Query<&mut Transform, (With<GroundBody>, Changed<Transform>)>) {
    for mut place in &mut bodies {
        let home = Transform::from_scale(place.scale);
        place.set_if_neq(home);
    }
}
