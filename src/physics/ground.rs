//! Components of ground that has colliders.

use avian3d::prelude::*;
use bevy::prelude::*;

use crate::terrain::Drawn;

/// Marks a tile or chunk whose collider was made. The collider is on a child with a [`GroundBody`]; a surface without
/// triangles has none.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
pub struct GroundCollider {
    /// The revision of the world that the collider was made from.
    pub revision: u64,
}

/// The static body of a tile or chunk. It is on the entity with the [`Collider`], a child of the tile or chunk that stays
/// at its parent's origin.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
#[require(RigidBody::Static)]
pub struct GroundBody {
    /// The terrain's entity.
    pub terrain: Entity,
    /// Which tile or chunk of the terrain it is.
    pub drawn: Drawn,
}

/// The contact properties of ground. A change applies to each collider when it is next made; components that a game
/// inserts on a [`GroundBody`] itself stay until then.
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

/// The [`GroundContact`] that was last applied to a body.
#[derive(Component)]
struct Applied(GroundContact);

impl GroundContact {
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
