//! Which colliders of a body collide with ground, and how far the body reaches. Sensors and colliders on other layers
//! do not.

use avian3d::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::character::Character;
use super::ground::{GroundContact, TerrainContact};

/// The largest distance that a body reaches from its position, in metres. Boxes of fast bodies are long.
pub(super) const FARTHEST: Vec3 = Vec3::splat(8.0);

/// How far inside a collider a ray through it starts, in metres; less than any body's thickness.
const SKIN: f32 = 1e-3;

/// The components that decide whether a collider collides with ground.
#[derive(QueryData)]
pub(super) struct SolidCollider {
    bounds: Ref<'static, ColliderAabb>,
    layers: Option<&'static CollisionLayers>,
    is_sensor: Has<Sensor>,
    is_disabled: Has<ColliderDisabled>,
    shape: Option<&'static Collider>,
    place: Option<&'static ColliderTransform>,
}

impl SolidColliderItem<'_, '_> {
    fn layers(&self) -> CollisionLayers {
        self.layers.copied().unwrap_or_default()
    }

    /// The distance from a point to this collider, for a body at this position and rotation; and a place inside the
    /// collider. That is the point itself, or, if it is outside, a place halfway through the nearest part, since the
    /// surface itself may touch the ground.
    fn inside(&self, position: &Position, rotation: &Rotation, point: Vec3) -> Option<(f32, Vec3)> {
        let (shape, own) = (self.shape?, self.place.copied().unwrap_or_default());
        let (place, turn) = (position.0 + rotation * own.translation, *rotation * own.rotation);
        if !(place.is_finite() && turn.is_finite() && point.is_finite()) {
            return None;
        }
        let (nearest, is_inside) = shape.project_point(place, turn, point, true);
        let way = Dir3::new_and_length(nearest - point).ok().filter(|_| !is_inside);
        let Some((way, distance)) = way else { return Some((0.0, point)) };
        let enter = nearest + way * SKIN;
        let through = shape.cast_ray(place, turn, enter, *way, f32::MAX, false);
        Some((distance, enter + way * through.map_or(0.0, |(through, _)| through / 2.0)))
    }
}

/// A body, or anything else with a place, and its colliders.
#[derive(QueryData)]
pub(super) struct Extent {
    entity: Entity,
    position: Option<Ref<'static, Position>>,
    own: Option<SolidCollider>,
    all: Option<&'static RigidBodyColliders>,
    pub is_character: Has<Character>,
}

impl ExtentItem<'_, '_> {
    /// The extent of one of its colliders.
    fn reach(&self, collider: &SolidColliderItem) -> Reach {
        let Some(position) = &self.position else { return Reach::UNKNOWN };
        let bounds = &collider.bounds;
        let (low, high) = (bounds.min - position.0, bounds.max - position.0);
        if !(low.is_finite() && high.is_finite() && low.cmple(high).all()) {
            return Reach::UNKNOWN;
        }
        // The box is that of the last step. If the body was moved since, its side is unknown.
        let is_put = position.is_changed_after(bounds.last_changed());
        let most = high.max(-low);
        let (low, high) = if is_put { (-most, most) } else { (low, high) };
        Reach { low: low.clamp(-FARTHEST, FARTHEST), high: high.clamp(-FARTHEST, FARTHEST) }
    }
}

/// A body's bounding box relative to its position, along the axes of the world, in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    low: Vec3,
    high: Vec3,
}

impl Reach {
    /// For a body whose collider, or the collider's box, does not exist yet.
    const UNKNOWN: Self = Self { low: Vec3::splat(-0.5), high: Vec3::splat(0.5) };

    fn merged(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The middle of the box, from the body's position.
    pub fn middle(&self) -> Vec3 {
        (self.low + self.high) / 2.0
    }

    /// Half the box's size.
    pub fn half(&self) -> Vec3 {
        (self.high - self.low) / 2.0
    }

    /// The distance to the farthest corner along each axis.
    pub fn farthest(&self) -> Vec3 {
        self.low.abs().max(self.high.abs())
    }
}

/// Whether a collider collides with ground on these layers.
fn meets(collider: &SolidColliderItem, ground: CollisionLayers) -> bool {
    !collider.is_sensor && !collider.is_disabled && ground.interacts_with(collider.layers())
}

/// Whether ground carries a character, which finds ground by casting its own collider with its own filters.
fn carries(walker: &SolidColliderItem, ground: CollisionLayers) -> bool {
    (walker.layers().filters & ground.memberships) != LayerMask::NONE
}

/// Finds which colliders collide with ground.
#[derive(SystemParam)]
pub(super) struct Solids<'w, 's> {
    colliders: Query<'w, 's, SolidCollider>,
    characters: Query<'w, 's, (), With<Character>>,
    ground: Res<'w, GroundContact>,
    terrains: Query<'w, 's, &'static TerrainContact>,
}

impl Solids<'_, '_> {
    /// The layers of a terrain's ground.
    pub fn layers(&self, terrain: Entity) -> CollisionLayers {
        self.terrains.get(terrain).map_or(self.ground.layers, |own| own.0.layers)
    }

    /// The box around a body's colliders that collide with ground on these layers; `None` if there are none, or if the
    /// body is static.
    pub fn bounds(
        &self,
        (entity, body, own): (Entity, &RigidBody, &RigidBodyColliders),
        ground: CollisionLayers,
    ) -> Option<ColliderAabb> {
        if !body.is_dynamic() && !self.characters.contains(entity) {
            return None;
        }
        let solid = self.colliders.iter_many(own).filter(|collider| meets(collider, ground));
        solid.map(|collider| *collider.bounds).reduce(|a, b| a.merged(b))
    }

    /// A place inside those colliders of a body that collide with ground: its middle, if one of them contains it. The
    /// middle of an arch, for example, is outside.
    pub fn inside(
        &self,
        own: &RigidBodyColliders,
        position: &Position,
        rotation: &Rotation,
        middle: Vec3,
        ground: CollisionLayers,
    ) -> Vec3 {
        let solid = self.colliders.iter_many(own).filter(|collider| meets(collider, ground));
        let places = solid.filter_map(|collider| collider.inside(position, rotation, middle));
        places.min_by(|(a, _), (b, _)| a.total_cmp(b)).map_or(middle, |(_, place)| place)
    }

    /// The extent of a body's colliders that collide with ground on these layers; `None` if there are none.
    pub fn reach(&self, body: &ExtentItem, ground: CollisionLayers) -> Option<Reach> {
        let all = body.all.map_or(&[][..], |all| &all[..]);
        let is_single = all.is_empty() || all == [body.entity];
        match &body.own {
            Some(own) if body.is_character => carries(own, ground).then(|| body.reach(own)),
            Some(own) if is_single => meets(own, ground).then(|| body.reach(own)),
            None if is_single => Some(Reach::UNKNOWN),
            _ => {
                let solid = self.colliders.iter_many(all).filter(|collider| meets(collider, ground));
                solid.map(|collider| body.reach(&collider)).reduce(Reach::merged)
            }
        }
    }
}
