//! The world's rim: walls that nobody sees, and a way back for whoever got past them or into the rock.

use std::time::Duration;

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::common_conditions::on_timer;
use bevy_burrow::physics::{Character, CharacterMotion};
use bevy_burrow::prelude::*;

use crate::film::places::Places;
use crate::player::{Player, Scripted};
use crate::ui::hud::Hint;

/// How thick the walls are, and how far they reach up and down: farther than anyone jumps, and than most dig.
const THICK: f32 = 8.0;
const REACH: f32 = 1500.0;
/// So far below all air there is, nobody stays for long: whoever is built over is lifted out.
const DEEP: f32 = 4.0;
/// Looks, two a second, at which somebody has to be lost before he is brought back.
const LOOKS: u32 = 4;

/// Keeps the player in the world.
pub struct RimPlugin;

impl Plugin for RimPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(put_up_walls)
            .add_systems(Update, bring_back.run_if(on_timer(Duration::from_millis(500))));
    }
}

/// One of the four.
#[derive(Component)]
#[require(RigidBody::Static)]
struct Wall;

fn put_up_walls(
    ready: On<TerrainReady>,
    mut commands: Commands,
    terrains: Query<&Terrain>,
    old: Query<Entity, With<Wall>>,
) {
    let Ok(terrain) = terrains.get(ready.entity) else { return };
    for wall in &old {
        commands.entity(wall).despawn();
    }
    let (grid, size) = (terrain.world().grid(), terrain.voxel_size());
    let (width, depth) = (grid.width() as f32 * size, grid.depth() as f32 * size);
    let out = THICK / 2.0;
    for (x, z, along_x, along_z) in [
        (-out, depth / 2.0, THICK, depth),
        (width + out, depth / 2.0, THICK, depth),
        (width / 2.0, -out, width + 2.0 * THICK, THICK),
        (width / 2.0, depth + out, width + 2.0 * THICK, THICK),
    ] {
        let collider = Collider::cuboid(along_x, 2.0 * REACH, along_z);
        commands.spawn((Name::new("rim"), Wall, collider, Transform::from_xyz(x, 0.0, z)));
    }
}

/// Where the player begins, and begins anew.
pub fn start(places: &Places, height: impl Fn(Vec2) -> Option<f32>) -> Vec3 {
    let start = places.hillside.start();
    Vec3::new(start.x, height(start).unwrap_or_default(), start.y)
}

/// Who is outside the world, or deep in the rock, where nothing was dug, would stay there for good.
fn bring_back(
    mut commands: Commands,
    terrains: Terrains,
    places: Option<Res<Places>>,
    players: Query<(Entity, &Character, &Transform), (With<Player>, Without<Scripted>)>,
    mut hints: MessageWriter<Hint>,
    mut looks: Local<u32>,
) {
    let Some(places) = places else { return };
    for (player, character, place) in &players {
        let feet = character.feet(place.translation);
        let lost = is_lost(feet, &terrains.spans(feet.x, feet.z));
        *looks = if lost { *looks + 1 } else { 0 };
        if *looks < LOOKS {
            continue;
        }
        *looks = 0;
        let start = start(&places, |place| terrains.height(place.x, place.y));
        let place = character.standing_at(start + Vec3::Y * 0.1);
        commands.entity(player).insert((place, Position(place.translation), CharacterMotion::default()));
        hints.write(Hint::new("back on solid ground"));
    }
}

/// Is somebody out of the world, or below all of the air over his place?
fn is_lost(feet: Vec3, air: &[Span]) -> bool {
    let lowest = air.iter().map(|span| span.floor).reduce(f64::min);
    !feet.is_finite() || lowest.is_none_or(|floor| f64::from(feet.y) < floor - f64::from(DEEP))
}

#[cfg(test)]
#[path = "world_edge_tests.rs"]
mod tests;
