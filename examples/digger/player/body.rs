//! The player's body: a character of the plugin's physics.

use avian3d::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::prelude::*;
use bevy_burrow::physics::{
    Character, CharacterMotion, CharacterPlugin, ColliderSource, TerrainPhysicsPlugin,
};

/// Physics steps per second.
const HERTZ: f64 = 60.0;
/// Ground has colliders within this many metres of the player.
const COLLIDER_RADIUS: f32 = 64.0;

/// Adds the physics: colliders for the ground, and characters.
pub struct BodyPlugin;

impl Plugin for BodyPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Time::<Fixed>::from_hz(HERTZ)).add_plugins((
            PhysicsPlugins::default(),
            TerrainPhysicsPlugin,
            CharacterPlugin::default(),
        ));
    }
}

/// The components of a body whose feet are at a place.
pub fn standing_at(feet: Vec3) -> impl Bundle {
    let character = Character::default();
    let place = character.standing_at(feet);
    (character, place, ColliderSource { radius: COLLIDER_RADIUS }, TransformInterpolation)
}

/// Where a body is and how it moves.
#[derive(QueryData)]
pub struct Body {
    character: &'static Character,
    place: &'static Transform,
    pub motion: &'static CharacterMotion,
}

impl BodyItem<'_, '_> {
    /// The position of the feet.
    pub fn feet(&self) -> Vec3 {
        self.character.feet(self.place.translation)
    }

    /// The position of the eyes.
    pub fn eye(&self) -> Vec3 {
        self.character.eyes(self.place.translation)
    }
}
