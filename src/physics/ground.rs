//! Components of ground that has colliders.

use avian3d::prelude::*;
use bevy::prelude::*;

use crate::terrain::MeshKey;

/// Marks a tile or chunk whose collider was made. The collider is on a child with a [`GroundBody`]; a surface without
/// triangles has none.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
pub struct GroundCollider {
    /// The revision of the world that the collider was made from.
    pub revision: u64,
}

/// The static body of a tile or chunk. It is on the entity with the [`Collider`], a child of the tile or chunk that
/// stays at its parent's origin.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
#[require(RigidBody::Static)]
pub struct GroundBody {
    /// The terrain's entity.
    pub terrain: Entity,
    /// Which tile or chunk of the terrain it is.
    pub drawn: MeshKey,
}

/// The contact properties of ground, for all terrains without a [`TerrainContact`]. A change applies to each collider
/// when it is next made; components that a game inserts on a [`GroundBody`] itself stay until then.
#[derive(Resource, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Resource, Default)]
pub struct GroundContact {
    /// The friction; `None` for avian's `DefaultFriction`.
    pub friction: Option<Friction>,
    /// The restitution; `None` for avian's `DefaultRestitution`.
    pub restitution: Option<Restitution>,
    /// The collision layers.
    pub layers: CollisionLayers,
}

/// The contact properties of one terrain's ground, instead of those of the resource [`GroundContact`]. Put it on the
/// terrain's entity. When it is inserted or removed, all colliders of the terrain change at once.
///
/// ```
/// # use avian3d::prelude::*;
/// # use bevy::prelude::*;
/// # use bevy_burrow::physics::{GroundContact, TerrainContact};
/// # use bevy_burrow::prelude::*;
/// # fn spawn(mut commands: Commands, ice: Terrain) {
/// let contact = GroundContact { friction: Some(Friction::new(0.05)), ..default() };
/// commands.spawn((ice, TerrainContact(contact)));
/// # }
/// ```
#[derive(Component, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct TerrainContact(pub GroundContact);

/// Leaves a terrain out of physics: it gets no colliders and loses those that it has, and no body is held or lifted by
/// it. Useful for a backdrop. Put it on the terrain's entity; its [`EdgeWalls`](super::EdgeWalls) stay.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct TerrainPhysicsDisabled;

/// Applies a terrain's contact properties to all of its colliders.
pub(super) fn change_contact(new: On<Insert, TerrainContact>, mut commands: Commands) {
    let terrain = new.entity;
    commands.queue(move |world: &mut World| apply_to_all(world, terrain));
}

/// Applies those of the resource again.
pub(super) fn reset_contact(gone: On<Remove, TerrainContact>, mut commands: Commands) {
    let terrain = gone.entity;
    commands.queue(move |world: &mut World| apply_to_all(world, terrain));
}

fn apply_to_all(world: &mut World, terrain: Entity) {
    let contact = GroundContact::of(world, terrain);
    let mut bodies = world.query::<(Entity, &GroundBody)>();
    let own = bodies.iter(world).filter(|(_, body)| body.terrain == terrain);
    let own: Vec<Entity> = own.map(|(body, _)| body).collect();
    for body in own {
        if let Ok(mut body) = world.get_entity_mut(body) {
            contact.clone().apply(&mut body);
        }
    }
}

/// The [`GroundContact`] that was last applied to a body.
#[derive(Component)]
struct Applied(GroundContact);

impl GroundContact {
    /// The contact of a terrain's ground.
    pub(super) fn of(world: &World, terrain: Entity) -> Self {
        let own = world.get::<TerrainContact>(terrain).map(|own| own.0.clone());
        own.unwrap_or_else(|| world.resource::<Self>().clone())
    }

    /// Inserts these components on a body, unless the same ones were inserted last: the game's own components stay.
    pub(super) fn apply(self, body: &mut EntityWorldMut) {
        if body.get::<Applied>().is_none_or(|applied| applied.0 != self) {
            body.insert(self.layers);
            set(body, self.friction);
            set(body, self.restitution);
            body.insert(Applied(self));
        }
    }
}

/// Inserts or removes a component.
fn set<C: Component>(body: &mut EntityWorldMut, component: Option<C>) {
    match component {
        Some(component) => body.insert(component),
        None => body.remove::<C>(),
    };
}
