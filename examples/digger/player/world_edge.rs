//! Brings a player back that left the world or is deep inside rock.

use std::time::Duration;

use avian3d::prelude::*;
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use bevy::time::common_conditions::on_timer;
use bevy_burrow::physics::{Character, CharacterMotion};
use bevy_burrow::prelude::*;

use crate::film::places::Places;
use crate::player::{self, Player, Scripted};
use crate::ui::hud::Hint;
use crate::ui::texts;

/// Players this many metres below all air are lost. Players that were only built over are lifted by the plugin's
/// physics.
const DEPTH: f32 = 4.0;
/// A player that is lost in this many checks, two per second, is brought back.
const CHECKS: u32 = 4;

/// Keeps the player in the world. The walls around it are the plugin's
/// [`EdgeWalls`](bevy_burrow::physics::EdgeWalls).
pub struct WorldEdgePlugin;

impl Plugin for WorldEdgePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, bring_back.run_if(on_timer(Duration::from_millis(500))));
    }
}

fn bring_back(
    mut commands: Commands,
    terrains: Terrains,
    places: Option<Res<Places>>,
    players: Query<(Entity, &Character, &Transform), (With<Player>, Without<Scripted>)>,
    mut hints: MessageWriter<Hint>,
    mut checks: Local<EntityHashMap<u32>>,
) {
    let Some(places) = places else { return };
    for (player, character, place) in &players {
        let feet = character.feet(place.translation);
        if !is_lost(feet, &terrains.spans(feet.x, feet.z)) {
            checks.remove(&player);
            continue;
        }
        let lost = checks.entry(player).or_default();
        *lost += 1;
        if *lost < CHECKS {
            continue;
        }
        checks.remove(&player);
        let start = player::start(&places, |place| terrains.height(place.x, place.y));
        let place = character.standing_at(start + Vec3::Y * 0.1);
        commands.entity(player).insert((place, Position(place.translation), CharacterMotion::default()));
        hints.write(Hint(texts::BROUGHT_BACK.into()));
    }
}

/// Whether this position is outside the world, or below all air of its column.
fn is_lost(feet: Vec3, air: &[Span]) -> bool {
    let lowest = air.iter().map(|span| span.floor).reduce(f64::min);
    !feet.is_finite() || lowest.is_none_or(|floor| f64::from(feet.y) < floor - f64::from(DEPTH))
}

#[cfg(test)]
#[path = "world_edge_tests.rs"]
mod tests;
