//! The player: actions steer a character, and the camera looks through its eyes.

pub mod bindings;
pub mod body;
pub mod camera;
pub mod game_state;
pub mod headlamp;
pub mod input;
pub mod world_edge;

use bevy::prelude::*;
use bevy_burrow::physics::{CharacterSteering, CharacterSystems};
use bevy_burrow::prelude::*;
use bevy_burrow::together::SharedTerrain;

use self::game_state::GameState;
use self::input::{Action, Actions};
use crate::film::places::Places;
use crate::ui::settings::Settings;
use crate::world::landscape::{DespawnOnNewGame, NewGame, NextGround};
use crate::world::saves::SavedPlace;

/// The player's body and the direction of its head.
#[derive(Component, Clone, Copy, Debug, Default)]
#[require(DespawnOnNewGame)]
pub struct Player {
    /// Angle around the vertical in radians; 0 looks along -z.
    pub yaw: f32,
    /// Angle above the horizon in radians.
    pub pitch: f32,
}

/// A script steers this player: the keyboard and the mouse do not.
#[derive(Component)]
pub struct Scripted;

/// Systems in `Update` that turn the player's actions into movement and edits. They run before
/// [`BurrowSystems::Collect`], so that their brushes are in this frame's transaction.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlayerControlSystems;

/// Spawns the player once the terrain is ready, and steers it.
pub struct PlayerPlugin;

impl Plugin for PlayerPlugin {
    fn build(&self, app: &mut App) {
        app.configure_sets(Update, PlayerControlSystems.before(BurrowSystems::Collect))
            .add_observer(note_ready)
            .add_observer(|_: On<NewGame>, mut commands: Commands| {
                commands.remove_resource::<GroundIsReady>()
            })
            .add_systems(Update, spawn_player.run_if(resource_exists::<GroundIsReady>))
            .add_systems(
                Update,
                (look, steer).run_if(in_state(GameState::Playing)).in_set(PlayerControlSystems),
            )
            .add_systems(FixedUpdate, end_jump.after(CharacterSystems))
            .add_systems(OnExit(GameState::Playing), stop_walking);
    }
}

impl Player {
    /// A player who stands at one place and looks at another.
    pub fn looking(from: Vec3, at: Vec3) -> Self {
        let direction = at - from;
        Self { yaw: (-direction.x).atan2(-direction.z), pitch: direction.y.atan2(direction.xz().length()) }
    }

    /// The rotation of the head.
    pub fn rotation(&self) -> Quat {
        Quat::from_euler(EulerRot::YXZ, self.yaw, self.pitch, 0.0)
    }
}

/// The terrain has loaded since the game began.
#[derive(Resource)]
struct GroundIsReady;

/// A terrain of the world before may still become ready: it is no place for this world's player.
fn note_ready(_: On<TerrainReady>, mut commands: Commands, next: NextGround) {
    if !next.is_expected() {
        commands.insert_resource(GroundIsReady);
    }
}

/// Spawns the player where the ground is known: on shared terrain, once it has come.
fn spawn_player(
    mut commands: Commands,
    shared: Query<&SharedTerrain>,
    terrains: Terrains,
    places: Res<Places>,
    players: Query<(), With<Player>>,
    saved: Option<Res<SavedPlace>>,
) {
    if !players.is_empty() || shared.iter().any(|shared| !shared.is_playable()) {
        return;
    }
    if let Some(&SavedPlace { feet, yaw, pitch }) = saved.as_deref() {
        commands.spawn((Name::new("player"), Player { yaw, pitch }, body::standing_at(feet)));
        return;
    }
    let feet = start(&places, |place| terrains.height(place.x, place.y));
    let hill = places.hillside.mouth + Vec3::Y * 2.5;
    commands.spawn((Name::new("player"), Player::looking(feet, hill), body::standing_at(feet)));
}

/// Where the player starts: on the ground before the hill.
pub fn start(places: &Places, height: impl Fn(Vec2) -> Option<f32>) -> Vec3 {
    let start = places.hillside.start();
    Vec3::new(start.x, height(start).unwrap_or_default(), start.y)
}

fn look(actions: Res<Actions>, settings: Res<Settings>, mut players: Query<&mut Player>) {
    let up = if settings.invert_y { -1.0 } else { 1.0 };
    for mut player in &mut players {
        let turn = actions.look * settings.sensitivity;
        player.yaw -= turn.x;
        player.pitch = (player.pitch - up * turn.y).clamp(-1.54, 1.54);
    }
}

fn steer(actions: Res<Actions>, mut players: Query<(&Player, &mut CharacterSteering), Without<Scripted>>) {
    for (player, mut steering) in &mut players {
        let walk = Vec3::new(actions.walk.x, 0.0, -actions.walk.y);
        steering.direction = (Quat::from_rotation_y(player.yaw) * walk).xz();
        steering.run = actions.pressed(Action::Run);
        steering.jump |= actions.pressed(Action::Jump);
    }
}

/// Keeps a jump requested until a physics step has seen it: not every frame has one.
fn end_jump(mut players: Query<&mut CharacterSteering, (With<Player>, Without<Scripted>)>) {
    for mut steering in &mut players {
        steering.jump = false;
    }
}

/// Stops players that are not steered by a script.
pub fn stop_walking(mut players: Query<&mut CharacterSteering, Without<Scripted>>) {
    for mut steering in &mut players {
        *steering = default();
    }
}

#[cfg(test)]
mod tests;
