//! The player: actions steer a body, and the camera looks through its eyes.

pub mod bindings;
pub mod body;
pub mod game_state;
pub mod input;
pub mod world_edge;

use bevy::prelude::*;
use bevy_burrow::physics::{CharacterSteering, CharacterSystems};
use bevy_burrow::prelude::*;

use self::body::Body;
use crate::film::places::Places;
use crate::player::game_state::Phase;
use crate::player::input::{Action, Actions};
use crate::ui::settings::Settings;
use crate::world::landscape::NewGame;
use crate::world::light::Eyes;

/// Who digs here.
#[derive(Component, Clone, Copy, Debug, Default)]
pub struct Player {
    /// Angle around the vertical; 0 looks along -z.
    pub yaw: f32,
    /// Angle above the horizon.
    pub pitch: f32,
    /// How far the eyes lag behind the body on steps, in metres, and where its soles were a frame ago.
    lag: f32,
    before: Option<f32>,
}

/// The camera goes where it is told, and not with the player, while it has this.
#[derive(Component)]
pub struct Drone;

/// How hard the eyes are shaken by blows and blasts, 0 to 1.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct Tremor(f32);

impl Tremor {
    /// A shake more.
    pub fn nudge(&mut self, by: f32) {
        self.0 = (self.0 + by).min(1.2);
    }
}

/// Systems that obey the player; all of them come before [`BurrowSystems::Collect`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Playing;

/// Spawns the player when the terrain is there, and moves it.
pub struct PlayerPlugin;

impl Plugin for PlayerPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Tremor>()
            .configure_sets(Update, Playing.before(BurrowSystems::Collect))
            .add_observer(arrive)
            .add_observer(leave)
            .add_systems(
                Update,
                (
                    (look, steer).run_if(in_state(Phase::Playing)).in_set(Playing),
                    see.after(BurrowSystems::Commit),
                ),
            )
            .add_systems(FixedUpdate, feel_jump.after(CharacterSystems))
            .add_systems(OnExit(Phase::Playing), stand_still);
    }
}

impl Player {
    /// Looking from one place at another.
    pub fn looking(from: Vec3, at: Vec3) -> Self {
        let way = at - from;
        Self { yaw: (-way.x).atan2(-way.z), pitch: way.y.atan2(way.xz().length()), ..default() }
    }

    /// How the head is turned.
    pub fn rotation(&self) -> Quat {
        Quat::from_euler(EulerRot::YXZ, self.yaw, self.pitch, 0.0)
    }
}

fn arrive(
    ready: On<TerrainReady>,
    mut commands: Commands,
    terrains: Query<&Terrain>,
    places: Res<Places>,
    players: Query<(), With<Player>>,
) {
    let Ok(terrain) = terrains.get(ready.entity) else { return };
    // Land that was loaded anew under his feet.
    if !players.is_empty() {
        return;
    }
    let height = |place: Vec2| terrain.world().height(place.x.into(), place.y.into());
    let feet = world_edge::start(&places, |place| height(place).map(|height| height as f32));
    let hill = places.hillside.mouth + Vec3::Y * 2.5;
    commands.spawn((Name::new("player"), Player::looking(feet, hill), body::standing_at(feet)));
}

/// Another one arrives when the land is there.
fn leave(_: On<NewGame>, mut commands: Commands, players: Query<Entity, With<Player>>) {
    for player in &players {
        commands.entity(player).despawn();
    }
}

fn look(actions: Res<Actions>, settings: Res<Settings>, mut players: Query<&mut Player>) {
    let up = if settings.invert_y { -1.0 } else { 1.0 };
    for mut player in &mut players {
        let turn = actions.look * settings.sensitivity;
        player.yaw -= turn.x;
        player.pitch = (player.pitch - up * turn.y).clamp(-1.54, 1.54);
    }
}

/// Steered by nobody: a script has put down its own way.
#[derive(Component)]
pub struct Scripted;

fn steer(actions: Res<Actions>, mut players: Query<(&Player, &mut CharacterSteering), Without<Scripted>>) {
    for (player, mut steering) in &mut players {
        let way = Quat::from_rotation_y(player.yaw) * Vec3::new(actions.walk.x, 0.0, -actions.walk.y);
        steering.direction = way.xz();
        steering.run = actions.pressed(Action::Run);
        steering.jump |= actions.pressed(Action::Jump);
    }
}

/// The wish to jump lasts until the body has felt it: not every frame has a step of the physics.
fn feel_jump(mut players: Query<&mut CharacterSteering, (With<Player>, Without<Scripted>)>) {
    for mut steering in &mut players {
        steering.jump = false;
    }
}

/// Walks no further by itself.
pub fn stand_still(mut players: Query<&mut CharacterSteering, Without<Scripted>>) {
    for mut steering in &mut players {
        *steering = default();
    }
}

/// Looks through the player's eyes, shaken as they are.
pub fn see(
    time: Res<Time>,
    mut tremor: ResMut<Tremor>,
    mut players: Query<(&mut Player, Body)>,
    mut eyes: Query<&mut Transform, (With<Eyes>, Without<Drone>, Without<Player>)>,
) {
    tremor.0 *= (-6.5 * time.delta_secs()).exp();
    let Ok((mut player, body)) = players.single_mut() else { return };
    // Eyes follow steps smoothly, but neither fall behind a jump nor poke through a ceiling.
    let feet = body.feet().y;
    let step = feet - player.before.replace(feet).unwrap_or(feet);
    let lag = if step.abs() > 1.0 || !body.motion.grounded { 0.0 } else { player.lag + step };
    player.lag = (lag * (-14.0 * time.delta_secs()).exp()).clamp(-0.05, 0.6);
    // Three sines that never meet: nobody sees that it is no chance.
    let (t, strength) = (time.elapsed_secs(), 0.022 * tremor.0 * tremor.0.max(0.35));
    let shake = Vec3::new((t * 61.0).sin(), (t * 47.0 + 1.0).sin(), (t * 39.0 + 2.0).sin()) * strength;
    for mut eyes in &mut eyes {
        eyes.translation = body.eye() - Vec3::Y * player.lag;
        eyes.rotation = player.rotation() * Quat::from_euler(EulerRot::YXZ, shake.x, shake.y, shake.z);
    }
}

#[cfg(test)]
mod tests;
