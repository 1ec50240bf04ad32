//! Components of ground that has colliders.

use avian3d::prelude::*;
use bevy::prelude::*;

use crate::terrain::Drawn;

/// A tile's or chunk's collider: on the entity of the tile or chunk, while it has one.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
pub struct GroundCollider {
    /// The entity with the [`Collider`], a child of this one; `None` for a surface without triangles.
    #[entities]
    pub body: Option<Entity>,
    /// The revision of the world that it was made from.
    pub revision: u64,
}

/// The body of a tile or chunk: on the entity with the [`Collider`], which stays at the origin of its parent.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroundBody {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The tile's or chunk's entity.
    pub part: Entity,
    /// Which tile or chunk that is.
    pub drawn: Drawn,
}

/// What ground is to bodies. A change counts for each collider from when it is made, or made anew because its ground
/// changed; what a game puts on a [`GroundBody`] itself stays until then.
#[derive(Resource, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Resource, Default)]
pub struct GroundContact {
    /// How slippery it is; `None` for avian's `DefaultFriction`.
    pub friction: Option<Friction>,
    /// How bouncy it is; `None` for avian's `DefaultRestitution`.
    pub restitution: Option<Restitution>,
    /// What collides with it.
    pub layers: CollisionLayers,
}

/// The contact that a body of ground was given last.
#[derive(Component)]
struct Applied(GroundContact);

impl GroundContact {
    /// Gives a body of ground these components, unless it was given the same before: what a game put on that body itself stays.
    pub(super) fn apply(self, body: &mut EntityWorldMut) {
        if body.get::<Applied>().is_none_or(|applied| applied.0 != self) {
            body.insert(self.layers);
            set(body, self.friction);
            set(body, self.restitution);
            body.insert(Applied(self));
        }
    }
}

/// Puts a component on, or takes it off.
fn set<C: Component>(body: &mut EntityWorldMut, component: Option<C>) {
    match component {
        Some(component) => body.insert(component),
        None => body.remove::<C>(),
    };
}
