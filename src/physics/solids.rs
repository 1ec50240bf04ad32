//! What of a body may be in the way of ground, and how far it reaches. Sensors are nowhere in the way, and neither is what
//! the ground lets through.

use avian3d::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::character::Character;
use super::ground::GroundContact;

/// How far from its position a body reaches at most, in metres: boxes of what is fast are long.
pub(super) const FARTHEST: Vec3 = Vec3::splat(8.0);

/// How far into a collider the way through it begins, in metres: less than anything is thick.
const SKIN: f32 = 1e-3;

/// A collider as ground sees it.
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

    /// How far a point is from this collider, for a body that is placed so; and a place inside the collider: the point
    /// itself or, if it is outside, halfway through what is nearest to it, for right there a body may touch the ground.
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
    /// How far one of its colliders reaches.
    fn reach(&self, collider: &SolidColliderItem) -> Reach {
        let Some(position) = &self.position else { return Reach::UNKNOWN };
        let bounds = &collider.bounds;
        let (low, high) = (bounds.min - position.0, bounds.max - position.0);
        if !(low.is_finite() && high.is_finite() && low.cmple(high).all()) {
            return Reach::UNKNOWN;
        }
        // The box is as old as the last step. Whoever was put elsewhere since has it somewhere around.
        let is_put = position.is_changed_after(bounds.last_changed());
        let most = high.max(-low);
        let (low, high) = if is_put { (-most, most) } else { (low, high) };
        Reach { low: low.clamp(-FARTHEST, FARTHEST), high: high.clamp(-FARTHEST, FARTHEST) }
    }
}

/// How far a body reaches from its position along the axes of the world, in metres: lowest and highest corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    low: Vec3,
    high: Vec3,
}

impl Reach {
    /// That of a body whose collider, or whose collider's box, is still to come.
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

    /// How far it is to the box's farthest corner, along each axis.
    pub fn farthest(&self) -> Vec3 {
        self.low.abs().max(self.high.abs())
    }
}

/// Tells which colliders may be in the way of ground.
#[derive(SystemParam)]
pub(super) struct Solids<'w, 's> {
    colliders: Query<'w, 's, SolidCollider>,
    characters: Query<'w, 's, (), With<Character>>,
    ground: Res<'w, GroundContact>,
}

impl Solids<'_, '_> {
    fn meets(&self, collider: &SolidColliderItem) -> bool {
        !collider.is_sensor && !collider.is_disabled && self.ground.layers.interacts_with(collider.layers())
    }

    /// The same for a walker, which looks for ground by itself: with its own collider, and where its filters say.
    fn carries(&self, walker: &SolidColliderItem) -> bool {
        (walker.layers().filters & self.ground.layers.memberships) != LayerMask::NONE
    }

    /// The box around those colliders of a body that may be in the way; `None` of a body that nothing moves.
    pub fn bounds(&self, entity: Entity, body: &RigidBody, own: &RigidBodyColliders) -> Option<ColliderAabb> {
        if !body.is_dynamic() && !self.characters.contains(entity) {
            return None;
        }
        let solid = self.colliders.iter_many(own).filter(|collider| self.meets(collider));
        solid.map(|collider| *collider.bounds).reduce(|a, b| a.merged(b))
    }

    /// A place inside those colliders of a body that may be in the way: its middle, if that is in one of them. The middle of
    /// an arch is not, nor that of a ball which a game made heavy far below.
    pub fn inside(
        &self,
        own: &RigidBodyColliders,
        position: &Position,
        rotation: &Rotation,
        middle: Vec3,
    ) -> Vec3 {
        let solid = self.colliders.iter_many(own).filter(|collider| self.meets(collider));
        let places = solid.filter_map(|collider| collider.inside(position, rotation, middle));
        places.min_by(|(a, _), (b, _)| a.total_cmp(b)).map_or(middle, |(_, place)| place)
    }

    /// How far a body reaches with what may be in the way; `None` if ground lets all of it through.
    pub fn reach(&self, body: &ExtentItem) -> Option<Reach> {
        let all = body.all.map_or(&[][..], |all| &all[..]);
        let is_single = all.is_empty() || all == [body.entity];
        match &body.own {
            Some(own) if body.is_character => self.carries(own).then(|| body.reach(own)),
            Some(own) if is_single => self.meets(own).then(|| body.reach(own)),
            None if is_single => Some(Reach::UNKNOWN),
            _ => {
                let solid = self.colliders.iter_many(all).filter(|collider| self.meets(collider));
                solid.map(|collider| body.reach(&collider)).reduce(Reach::merged)
            }
        }
    }
}
