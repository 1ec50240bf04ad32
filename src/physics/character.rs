//! A body that walks: a capsule that walks, jumps, steps and slides over ground that is being dug.

use avian3d::prelude::*;
use bevy::prelude::*;

/// A walking body: a kinematic capsule for avian, moved by its [`CharacterSteering`].
///
/// Its `Transform` is at the capsule's middle; [`feet`](Self::feet) and [`eyes`](Self::eyes) are measured from there. Below
/// a parent it is carried along, and walks in the world all the same. Change its height, and its feet stay where they are:
/// a game that lets it stand up again makes sure first that there is room.
/// [`CharacterPlugin`](super::CharacterPlugin) moves it; with avian's `TransformInterpolation` beside it, it moves smoothly at any frame rate. It
/// needs colliders under it: give it, or the camera that follows it, a [`ColliderSource`](super::ColliderSource).
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
    /// Metres per second, in a hurry.
    pub run_speed: f32,
    /// How high a jump lifts the soles, in metres.
    pub jump_height: f32,
    /// Metres per second squared, downwards.
    pub gravity: f32,
    /// The fastest fall, in metres per second.
    pub fastest_fall: f32,
    /// The highest step that is walked up without a jump, in metres.
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
    /// Where to put a character that is to stand at `feet`.
    pub fn standing_at(&self, feet: Vec3) -> Transform {
        Transform::from_translation(feet + Vec3::Y * (self.height / 2.0))
    }

    /// The lowest point of a character whose middle is here.
    pub fn feet(&self, middle: Vec3) -> Vec3 {
        middle - Vec3::Y * (self.height / 2.0)
    }

    /// Between the eyes of a character whose middle is here.
    pub fn eyes(&self, middle: Vec3) -> Vec3 {
        self.feet(middle) + Vec3::Y * self.eye_height
    }

    /// The capsule.
    pub fn collider(&self) -> Collider {
        let radius = self.radius.max(0.01);
        Collider::capsule(radius, (self.height - 2.0 * radius).max(0.01))
    }
}

/// What a character wants.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct CharacterSteering {
    /// Where to, as (x, z) of the world; longer than 1 counts as 1.
    pub direction: Vec2,
    /// In a hurry?
    pub run: bool,
    /// Off the ground, if on it?
    pub jump: bool,
}

/// How a character moves.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct CharacterMotion {
    /// Metres per second.
    pub velocity: Vec3,
    /// Does it stand on something?
    pub grounded: bool,
    /// The normal of what it stands on, if it does.
    pub ground_normal: Vec3,
}
