//! One step of a walking character.

use std::time::Duration;

use avian3d::prelude::*;
use bevy::prelude::*;

use super::character::{Character, CharacterMotion, CharacterSteering};

/// The distance kept from obstacles, in metres.
const SKIN: f32 = 0.01;

/// The shortest forward move onto a step, in metres.
const ONTO: f32 = 3.0 * SKIN;

/// How far behind an edge, and how far above it, the ground is searched for that a character stands on, in metres.
const EDGE: f32 = 0.03;

/// A character and what it needs to move.
pub(super) struct Walk<'a, 'w, 's> {
    mover: &'a MoveAndSlide<'w, 's>,
    collider: &'a Collider,
    character: &'a Character,
    filter: SpatialQueryFilter,
    /// The cosine of the steepest slope.
    level: f32,
}

impl<'a, 'w, 's> Walk<'a, 'w, 's> {
    /// A character that ignores its `own` entities.
    pub(super) fn new(
        mover: &'a MoveAndSlide<'w, 's>,
        collider: &'a Collider,
        layers: Option<&CollisionLayers>,
        character: &'a Character,
        own: impl IntoIterator<Item = Entity>,
    ) -> Self {
        let filter = SpatialQueryFilter::from_excluded_entities(own)
            .with_mask(layers.copied().unwrap_or_default().filters);
        Self { mover, collider, character, filter, level: character.steepest.clamp(0.0, 1.5).cos() }
    }

    /// The character's place and motion after `dt` seconds.
    pub(super) fn advance(
        &self,
        from: Vec3,
        before: CharacterMotion,
        steering: &CharacterSteering,
        dt: f32,
    ) -> (Vec3, CharacterMotion) {
        let Character { walk_speed, run_speed, grip, air_grip, gravity, jump_height, .. } = *self.character;
        let CharacterMotion { mut velocity, mut grounded, ground_normal } = before;
        let wish =
            steering.direction.clamp_length_max(1.0) * if steering.run { run_speed } else { walk_speed };
        let follow = 1.0 - (-(if grounded { grip } else { air_grip }) * dt).exp();
        let level = velocity.xz().lerp(wish, follow);
        let jumps = steering.jump && grounded;
        if jumps {
            velocity.y = (2.0 * gravity * jump_height).max(0.0).sqrt();
            grounded = false;
        } else if grounded {
            velocity.y = 0.0;
        } else {
            velocity.y = (velocity.y - gravity * dt).max(-self.character.fastest_fall);
        }
        velocity = Vec3::new(level.x, velocity.y, level.y);

        let (mut place, slid) = if grounded {
            self.stride(from, velocity, ground_normal, dt)
        } else {
            self.slide(from, velocity, &[], dt)
        };
        velocity = if grounded { Vec3::new(slid.x, 0.0, slid.z) } else { slid };

        let mut after = CharacterMotion { velocity, grounded: false, ground_normal: Vec3::ZERO };
        if velocity.y <= 0.0 {
            let reach = if grounded { self.character.step_height } else { 2.0 * SKIN };
            if let Some((down, normal)) = self.footing(place, reach) {
                place.y -= down;
                after.velocity.y = 0.0;
                (after.grounded, after.ground_normal) = (true, normal);
            }
        }
        (place, after)
    }

    /// Moves along the ground, at the same horizontal speed uphill and downhill, and up a step that is in the way.
    fn stride(&self, from: Vec3, velocity: Vec3, normal: Vec3, dt: f32) -> (Vec3, Vec3) {
        // Along the plane of the ground, by the wanted distance in x and z.
        let rise =
            if normal.y > 0.1 { -(normal.x * velocity.x + normal.z * velocity.z) / normal.y } else { 0.0 };
        let along = velocity.with_y(rise);
        let planes: Vec<Dir3> = Dir3::new(normal).into_iter().collect();
        let (place, slid) = self.slide(from, along, &planes, dt);
        let wanted = velocity.xz() * dt;
        let went = (place - from).xz().dot(wanted.normalize_or_zero());
        if wanted.length() > 1e-4
            && went < 0.9 * wanted.length()
            && let Some((up, speed)) = self.step(from, velocity, dt)
            && (up - from).xz().dot(wanted.normalize_or_zero()) > went + 1e-4
        {
            return (up, speed);
        }
        (place, slid)
    }

    /// Moves up, ahead and down again, if that ends on ground that can be stood on.
    fn step(&self, from: Vec3, velocity: Vec3, dt: f32) -> Option<(Vec3, Vec3)> {
        let height = self.character.step_height;
        let cast = |place: Vec3, way: Vec3| {
            self.mover.cast_move(self.collider, place, Quat::IDENTITY, way, SKIN, &self.filter)
        };
        let up = cast(from, Vec3::Y * height).map_or(height, |hit| hit.distance);
        let above = from + Vec3::Y * up;
        // Far enough to cross the edge despite the skin.
        let level = velocity.with_y(0.0);
        let least = ONTO / dt;
        let (ahead, slid) = self.slide(above, level.normalize_or_zero() * level.length().max(least), &[], dt);
        let (down, _) = self.footing(ahead, up + SKIN)?;
        Some((ahead - Vec3::Y * down, slid.with_y(0.0).clamp_length_max(level.length())))
    }

    /// Moves and slides along obstacles. On the ground, slopes that are too steep count as walls.
    fn slide(&self, from: Vec3, velocity: Vec3, planes: &[Dir3], dt: f32) -> (Vec3, Vec3) {
        let config = MoveAndSlideConfig { skin_width: SKIN, planes: planes.to_vec(), ..default() };
        let is_walking = !planes.is_empty();
        let level = self.level;
        let out = self.mover.move_and_slide(
            self.collider,
            from,
            Quat::IDENTITY,
            velocity,
            Duration::from_secs_f32(dt),
            &config,
            &self.filter,
            |hit| {
                let is_steep = hit.normal.y < level && hit.normal.y > -0.1;
                if is_walking
                    && is_steep
                    && let Ok(wall) = Dir3::new(hit.normal.with_y(0.0))
                {
                    *hit.normal = wall;
                }
                MoveAndSlideHitResponse::Accept
            },
        );
        let place = if out.position.is_finite() { out.position } else { from };
        let velocity = if out.projected_velocity.is_finite() { out.projected_velocity } else { Vec3::ZERO };
        (place, velocity)
    }

    /// The distance down to ground that can be stood on, within `reach`, and its normal.
    fn footing(&self, place: Vec3, reach: f32) -> Option<(f32, Vec3)> {
        let way = Vec3::NEG_Y * reach;
        let hit = self.mover.cast_move(self.collider, place, Quat::IDENTITY, way, SKIN, &self.filter)?;
        if hit.normal1.y >= self.level {
            return Some((hit.distance, hit.normal1));
        }
        // The round foot of the capsule touches an edge from the side. The ground that carries it is behind the edge.
        let behind = hit.point1 - hit.normal1.with_y(0.0).normalize_or_zero() * EDGE;
        let normal = self.ground_at(behind + Vec3::Y * EDGE, 2.0 * EDGE)?;
        (normal.y >= self.level).then_some((hit.distance, normal))
    }

    /// The normal of the ground below a place, within `reach`.
    fn ground_at(&self, place: Vec3, reach: f32) -> Option<Vec3> {
        let query = &self.mover.spatial_query;
        // Sensors do not count.
        let is_solid = |collider: Entity| self.mover.colliders.contains(collider);
        let hit = query.cast_ray_predicate(place, Dir3::NEG_Y, reach, true, &self.filter, &is_solid)?;
        Some(hit.normal)
    }
}
