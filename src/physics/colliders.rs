//! Colliders of tiles and chunks. They are built with the meshes and swapped in with them.

use std::sync::{Arc, PoisonError, RwLock};

use avian3d::collision::collider::EnlargedAabb;
use avian3d::parry::shape::SharedShape;
use avian3d::prelude::*;
use bevy::ecs::entity_disabling::Disabled;
use bevy::platform::collections::HashMap;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::PhysicsFigures;
use super::ground::{GroundBody, GroundCollider, GroundContact};
use super::near::Neighbourhood;
use super::shape::GroundShape;
use super::wake::{GroundChange, GroundChanges};
use crate::plugin::{CommitAction, Part, Places, ShownSurface, SurfaceProcessor};
use crate::surface::SurfaceMesh;
use crate::terrain::MeshKey;

/// State shared by tasks and the main thread.
#[derive(Default)]
struct Shared {
    near: RwLock<Neighbourhood>,
    shapes: RwLock<HashMap<(Entity, MeshKey), Arc<GroundShape>>>,
    /// How many more colliders panic while they are built.
    #[cfg(test)]
    panics: std::sync::atomic::AtomicU32,
}

/// Where colliders are wanted, and the shapes of those that exist.
#[derive(Resource, Clone, Default)]
pub(super) struct GroundColliders(Arc<Shared>);

impl GroundColliders {
    /// The area around sources, as last set.
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

    fn has_shape(&self, terrain: Entity, drawn: MeshKey) -> bool {
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

    /// Builds a collider. Call it in a task.
    pub fn build_collider(&self, part: &Part, surface: &SurfaceMesh) -> BuiltCollider {
        #[cfg(test)]
        self.panic_if_asked();
        let shape = GroundShape::new(surface, part.voxel_size).map(Arc::new);
        let changed = GroundShape::difference(self.shape(part).as_deref(), shape.as_deref());
        BuiltCollider { colliders: self.clone(), part: *part, shape, changed }
    }
}

#[cfg(test)]
impl GroundColliders {
    pub fn panic_times(&self) -> &std::sync::atomic::AtomicU32 {
        &self.0.panics
    }

    fn panic_if_asked(&self) {
        use std::sync::atomic::Ordering::Relaxed;
        let less = |left: u32| (left > 0).then(|| if left == u32::MAX { left } else { left - 1 });
        if self.0.panics.fetch_update(Relaxed, Relaxed, less).is_ok() {
            // Without a message: many do.
            std::panic::resume_unwind(Box::new("on purpose"));
        }
    }
}

impl SurfaceProcessor for GroundColliders {
    /// True within a source's radius. It also is a little beyond, where a collider remains: a dig there cuts a hole
    /// into the tile's collider, so the chunk that fills the hole must get its own in the same commit.
    fn wants(&self, part: &Part) -> bool {
        let near = self.0.near.read().unwrap_or_else(PoisonError::into_inner);
        let tile = part.drawn.tile();
        let has_shape = |drawn| self.has_shape(part.terrain, drawn);
        let stays = || has_shape(part.drawn) || has_shape(MeshKey::Tile(tile));
        near.distance((part.terrain, tile)).is_some_and(|distance| distance <= 0.0 || stays())
    }

    fn build(&self, part: &Part, surface: &SurfaceMesh) -> Option<CommitAction> {
        let collider = self.build_collider(part, surface);
        Some(Box::new(move |entity| {
            entity.queue_silenced(move |part: EntityWorldMut| collider.attach(part));
        }))
    }
}

/// The margin around a collider's bounding box, in metres; the same as avian's own.
const MARGIN: f32 = 0.05;

/// A collider that is to be attached to its tile or chunk.
pub(super) struct BuiltCollider {
    colliders: GroundColliders,
    part: Part,
    shape: Option<Arc<GroundShape>>,
    /// The box in which it differs from its predecessor, in metres from the part's origin.
    changed: Option<(Vec3, Vec3)>,
}

/// The child of a tile or chunk that has its collider.
fn body_of(part: &EntityWorldMut) -> Option<Entity> {
    let mut children = part.get::<Children>()?.iter();
    children.find(|&child| part.world().get::<GroundBody>(child).is_some())
}

/// How far from 1 a scale may be by rounding.
const ROUNDING: f32 = 1e-4;

/// Inserts a collider. Avian scales a new one at once by the scale of the body's `GlobalTransform`, and that of a
/// rotated terrain is not exactly 1: the shape would be copied here, on the main thread, and be a plain mesh until the
/// next step. So the body's place has no rotation while the collider is inserted.
fn insert_unscaled(body: &mut EntityWorldMut, collider: Collider) {
    let place = body.get::<GlobalTransform>().copied();
    let rounded = place.filter(|place| place.scale().abs_diff_eq(Vec3::ONE, ROUNDING));
    let set = |body: &mut EntityWorldMut, place: GlobalTransform| {
        if let Some(mut own) = body.get_mut::<GlobalTransform>() {
            *own.bypass_change_detection() = place;
        }
    };
    if let Some(place) = rounded {
        set(body, GlobalTransform::from_translation(place.translation()));
    }
    body.insert(collider);
    if let Some(place) = rounded {
        set(body, place);
    }
}

impl BuiltCollider {
    /// Replaces the part's collider, unless its surface has changed since this one was built.
    pub fn attach(self, mut part: EntityWorldMut) {
        let owner = part.id();
        let is_newer = |revision: u64| revision > self.part.revision;
        let shown = part.get::<ShownSurface>().is_some_and(|shown| is_newer(shown.revision));
        if shown || part.get::<GroundCollider>().is_some_and(|old| is_newer(old.revision)) {
            part.world_scope(|world| world.resource_mut::<PhysicsFigures>().stale += 1);
            return;
        }
        let old = body_of(&part);
        self.colliders.set_shape(&self.part, self.shape.clone());
        part.world_scope(|world| {
            if let Some((low, high)) = self.changed {
                // The GlobalTransform of a new part is not computed before the end of the frame.
                let terrain = world.get::<GlobalTransform>(self.part.terrain).copied().unwrap_or_default();
                let place = terrain * Transform::from_translation(self.part.origin.as_vec3());
                let change = GroundChange::new(self.part.terrain, &place, self.part.voxel_size, low, high);
                let mut changes = world.resource_mut::<GroundChanges>();
                changes.add(self.part.drawn, change);
                let count = changes.len();
                world.resource_mut::<PhysicsFigures>().changes = count;
            }
            world.resource_mut::<PhysicsFigures>().swaps += 1;
            let contact = GroundContact::of(world, self.part.terrain);
            match (self.shape, old.and_then(|old| world.get_entity_mut(old).ok())) {
                (None, None) => {}
                (None, Some(old)) => old.despawn(),
                (Some(shape), Some(mut old)) => {
                    // The entity stays, so contacts with it do too. Avian would find it by its old box until the next
                    // step, and a character that moves before would sink where the ground grew.
                    let collider = Collider::from(SharedShape(shape));
                    if let (Some(place), Some(turn)) = (old.get::<Position>(), old.get::<Rotation>()) {
                        let bounds = collider.aabb(place.0, *turn).grow(Vec3::splat(MARGIN));
                        old.insert((bounds, EnlargedAabb::new(bounds)));
                    }
                    contact.apply(&mut old);
                    insert_unscaled(&mut old, collider);
                }
                (Some(shape), None) => {
                    let mut body = world.spawn((
                        GroundBody { terrain: self.part.terrain, drawn: self.part.drawn },
                        // Shapes are in metres, parts in voxels.
                        Transform::from_scale(Vec3::splat(self.part.voxel_size.recip())),
                        ChildOf(owner),
                    ));
                    insert_unscaled(&mut body, Collider::from(SharedShape(shape)));
                    contact.apply(&mut body);
                }
            }
        });
        part.insert(GroundCollider { revision: self.part.revision });
    }
}

/// Removes a tile's or chunk's collider.
pub(super) fn detach(mut part: EntityWorldMut) {
    part.remove::<GroundCollider>();
    if let Some(body) = body_of(&part) {
        part.world_scope(|world| world.despawn(body));
    }
}

/// Drops the shape of a body that was removed by the plugin or by the game, and unmarks its tile or chunk. Unless the
/// plugin itself [detached](detach) it, ground is gone, so bodies that sleep on it have to wake.
pub(super) fn forget(
    gone: On<Remove, GroundBody>,
    bodies: Query<(&GroundBody, &ChildOf, Option<&ColliderAabb>), Allow<Disabled>>,
    parts: Query<Has<GroundCollider>, Allow<Disabled>>,
    colliders: Res<GroundColliders>,
    mut changes: ResMut<GroundChanges>,
    mut figures: ResMut<PhysicsFigures>,
    mut commands: Commands,
) {
    let Ok((body, part, bounds)) = bodies.get(gone.entity) else { return };
    let is_detached = parts.get(part.parent()).is_ok_and(|has_collider| !has_collider);
    if let Some(bounds) = bounds.filter(|_| !is_detached) {
        changes.add(body.drawn, GroundChange::around(body.terrain, bounds));
        figures.changes = changes.len();
    }
    let mut shapes = colliders.0.shapes.write().unwrap_or_else(PoisonError::into_inner);
    shapes.remove(&(body.terrain, body.drawn));
    let Ok(mut part) = commands.get_entity(part.parent()) else { return };
    part.queue_silenced(move |mut part: EntityWorldMut| {
        if body_of(&part).is_none() {
            part.remove::<GroundCollider>();
        }
    });
}

/// Moves colliders to their tiles and chunks before a step. Avian itself ignores rotations of less than a tenth of a
/// degree, so ground that turns slowly would leave its colliders behind.
pub(super) fn follow(
    parts: Query<
        (Entity, &Children),
        (With<GroundCollider>, Or<(Changed<GlobalTransform>, Changed<GroundCollider>)>),
    >,
    places: Places,
    mut bodies: Query<(&GroundBody, &Collider, Ref<ColliderAabb>, &mut Position, &mut Rotation)>,
    mut changes: ResMut<GroundChanges>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let start = Instant::now();
    for (part, children) in &parts {
        let mut bodies = bodies.iter_many_mut(children);
        let Some((body, collider, bounds, mut position, mut turn)) = bodies.fetch_next() else { continue };
        let Ok(place) = places.compute_global_transform(part).map(|place| place.compute_transform()) else {
            continue;
        };
        if !place.is_finite() {
            continue;
        }
        let is_put = position.set_if_neq(Position(place.translation));
        let is_turned = turn.set_if_neq(Rotation(place.rotation));
        // A new collider's change was recorded when it was attached.
        if (is_put || is_turned) && !bounds.is_added() {
            let bounds = bounds.merged(collider.aabb(place.translation, place.rotation));
            changes.add(body.drawn, GroundChange::around(body.terrain, &bounds));
            figures.changes = changes.len();
        }
    }
    figures.main_thread += start.elapsed();
}

/// Resets bodies of ground to the origins of their parts after a step. Avian computes their local transforms from the
/// global ones, and the rounding errors would add up.
pub(super) fn reset_to_parent(mut bodies: Query<&mut Transform, (With<GroundBody>, Changed<Transform>)>) {
    for mut transform in &mut bodies {
        let origin = Transform::from_scale(transform.scale);
        transform.set_if_neq(origin);
    }
}
