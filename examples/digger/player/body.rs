//! The player's body: a character of the plugin's physics, and what a script asks it.

use avian3d::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::prelude::*;
use bevy_burrow::physics::{
    Character, CharacterMotion, CharacterPlugin, ColliderSource, TerrainPhysicsPlugin,
};

/// Steps of the simulation in a second.
const HERTZ: f64 = 60.0;
/// Metres around the player in which ground can be stood on, and bombs bounce.
const GROUND: f32 = 64.0;

/// Ground to stand on, and bodies that do.
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

/// A body that stands at a place.
pub fn standing_at(feet: Vec3) -> impl Bundle {
    let character = Character::default();
    let place = character.standing_at(feet);
    (character, place, ColliderSource { radius: GROUND }, TransformInterpolation)
}

/// A body where it is now.
#[derive(QueryData)]
pub struct Body {
    character: &'static Character,
    place: &'static Transform,
    pub motion: &'static CharacterMotion,
}

impl BodyItem<'_, '_> {
    /// The soles.
    pub fn feet(&self) -> Vec3 {
        self.character.feet(self.place.translation)
    }

    /// Between the eyes.
    pub fn eye(&self) -> Vec3 {
        self.character.eyes(self.place.translation)
    }
}
