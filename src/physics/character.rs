//! A character: a capsule that walks, jumps, climbs steps and slides on ground that is being dug.

use avian3d::prelude::*;
use bevy::prelude::*;

/// A character: a kinematic capsule for avian, moved by its [`CharacterSteering`].
///
/// Its `Transform` is at the middle of the capsule; [`feet`](Self::feet) and [`eyes`](Self::eyes) are measured from
/// there. A parent carries it along. If its height changes, its feet stay in place; before a game lets it stand up, it
/// must check that there is room. [`CharacterPlugin`](super::CharacterPlugin) moves it. Add avian's
/// `TransformInterpolation` for smooth motion at any frame rate. It needs colliders below it: give it, or the camera
/// that follows it, a [`ColliderSource`](super::ColliderSource).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::physics::{Character, CharacterSteering, ColliderSource};
/// fn spawn(mut commands: Commands) {
///     let character = Character::default();
///     let place = character.standing_at(Vec3::new(20.0, 8.0, 20.0));
///     commands.spawn((character, place, ColliderSource::default()));
/// }
///
/// fn steer(keys: Res<ButtonInput<KeyCode>>, mut characters: Query<&mut CharacterSteering>) {
///     for mut steering in &mut characters {
///         steering.direction = if keys.pressed(KeyCode::KeyW) { Vec2::NEG_Y } else { Vec2::ZERO };
///         steering.jump = keys.pressed(KeyCode::Space);
///     }
/// }
/// ```
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Default)]
#[require(
    CharacterSteering,
    CharacterMotion,
    Transform,
    Visibility,
    RigidBody::Kinematic,
    CustomPositionIntegration,
    SpeculativeMargin(0.0)
)]
pub struct Character {
    /// Half the capsule's width, in metres.
    pub radius: f32,
    /// From the soles to the top of the head, in metres.
    pub height: f32,
    /// From the soles to the eyes, in metres.
    pub eye_height: f32,
    /// Metres per second.
    pub walk_speed: f32,
    /// Metres per second.
    pub run_speed: f32,
    /// The height of a jump, in metres.
    pub jump_height: f32,
    /// Metres per second squared, downwards.
    pub gravity: f32,
    /// The fastest fall, in metres per second.
    pub fastest_fall: f32,
    /// The highest step that is climbed without a jump, in metres.
    pub step_height: f32,
    /// The steepest ground that can be stood on, in radians.
    pub steepest: f32,
    /// How fast the velocity follows the steering on the ground, per second.
    pub grip: f32,
    /// How fast it does so in the air.
    pub air_grip: f32,
}

impl Default for Character {
    fn default() -> Self {
        Self {
            radius: 0.4,
            height: 1.8,
            eye_height: 1.7,
            walk_speed: 5.0,
            run_speed: 10.0,
            jump_height: 1.4,
            gravity: 16.0,
            fastest_fall: 50.0,
            step_height: 0.6,
            steepest: 1.0,
            grip: 12.0,
            air_grip: 2.5,
        }
    }
}

impl Character {
    /// The transform of a character that stands at `feet`.
    pub fn standing_at(&self, feet: Vec3) -> Transform {
        Transform::from_translation(feet + Vec3::Y * (self.height / 2.0))
    }

    /// The lowest point of a character whose middle is here.
    pub fn feet(&self, middle: Vec3) -> Vec3 {
        middle - Vec3::Y * (self.height / 2.0)
    }

    /// The eyes of a character whose middle is here.
    pub fn eyes(&self, middle: Vec3) -> Vec3 {
        self.feet(middle) + Vec3::Y * self.eye_height
    }

    /// The capsule.
    pub fn collider(&self) -> Collider {
        let radius = self.radius.max(0.01);
        Collider::capsule(radius, (self.height - 2.0 * radius).max(0.01))
    }
}

/// The input of a character.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct CharacterSteering {
    /// The direction (x, z) in world space; its length, at most 1, scales the speed.
    pub direction: Vec2,
    /// Whether to run.
    pub run: bool,
    /// Whether to jump, if on the ground.
    pub jump: bool,
}

/// The motion of a character.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct CharacterMotion {
    /// Metres per second.
    pub velocity: Vec3,
    /// Whether it stands on something.
    pub grounded: bool,
    /// The normal of what it stands on; zero in the air.
    pub ground_normal: Vec3,
}
