//! The player: keys and mouse steer a [`Body`], and the camera looks through its eyes.

use bevy::input::mouse::AccumulatedMouseMotion;
use bevy::prelude::*;
use bevy::window::{CursorGrabMode, CursorOptions, PrimaryWindow};
use bevy_burrow::prelude::*;

use crate::light::{Eyes, LampSwitch};
use crate::mover::{Body, Steering};
use crate::places::Places;

/// Radians for each pixel that the mouse moves.
const SENSITIVITY: f32 = 0.0024;

/// Who digs here.
#[derive(Component, Clone, Copy, Debug, Default)]
#[require(Steering)]
pub struct Player {
    /// Angle around the vertical; 0 looks along -z.
    pub yaw: f32,
    /// Angle above the horizon.
    pub pitch: f32,
    /// How far the eyes lag behind the body on steps, in metres.
    lag: f32,
}

/// The camera goes where it is told, and not with the player, while it has this.
#[derive(Component)]
pub struct Drone;

/// Systems that obey the mouse once it is captured; all of them come before [`BurrowSystems::Collect`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct UsesMouse;

/// Spawns the player when the terrain is there, and moves it.
pub struct PlayerPlugin;

impl Plugin for PlayerPlugin {
    fn build(&self, app: &mut App) {
        app.configure_sets(Update, UsesMouse.before(BurrowSystems::Collect))
            .add_observer(arrive)
            .add_systems(
                Update,
                (
                    capture_mouse.before(UsesMouse),
                    (look, steer, press_keys).run_if(mouse_is_captured).in_set(UsesMouse),
                    // After a commit, so that who was built over gets out in the same frame.
                    (walk, see).chain().after(BurrowSystems::Commit),
                ),
            );
    }
}

impl Player {
    /// Looking from one place at another.
    pub fn looking(from: Vec3, at: Vec3) -> Self {
        let way = at - from;
        Self { yaw: (-way.x).atan2(-way.z), pitch: way.y.atan2(way.xz().length()), lag: 0.0 }
    }

    /// How the head is turned.
    pub fn rotation(&self) -> Quat {
        Quat::from_euler(EulerRot::YXZ, self.yaw, self.pitch, 0.0)
    }
}

/// Does the mouse belong to the game? Never where there is no window.
pub fn mouse_is_captured(cursor: Query<&CursorOptions, With<PrimaryWindow>>) -> bool {
    cursor.single().is_ok_and(|cursor| cursor.grab_mode != CursorGrabMode::None)
}

fn arrive(ready: On<TerrainReady>, mut commands: Commands, terrains: Query<&Terrain>, places: Res<Places>) {
    let Ok(terrain) = terrains.get(ready.entity) else { return };
    let start = places.hillside.start().as_dvec2();
    let height = terrain.world().height(start.x, start.y).unwrap_or_default();
    let body = Body::at(Vec3::new(start.x as f32, height as f32, start.y as f32));
    let hill = places.hillside.mouth + Vec3::Y * 4.0;
    commands.spawn((Name::new("player"), Player::looking(body.eye(), hill), body));
}

/// A click takes the mouse, and does nothing else; Escape lets go of it.
fn capture_mouse(
    mut mouse: ResMut<ButtonInput<MouseButton>>,
    keys: Res<ButtonInput<KeyCode>>,
    mut cursors: Query<&mut CursorOptions, With<PrimaryWindow>>,
) {
    let Ok(mut cursor) = cursors.single_mut() else { return };
    let is_free = cursor.grab_mode == CursorGrabMode::None;
    if mouse.just_pressed(MouseButton::Left) && is_free {
        (cursor.visible, cursor.grab_mode) = (false, CursorGrabMode::Locked);
        mouse.reset(MouseButton::Left);
    }
    if keys.just_pressed(KeyCode::Escape) {
        (cursor.visible, cursor.grab_mode) = (true, CursorGrabMode::None);
    }
}

fn look(motion: Res<AccumulatedMouseMotion>, mut players: Query<&mut Player>) {
    for mut player in &mut players {
        player.yaw -= motion.delta.x * SENSITIVITY;
        player.pitch = (player.pitch - motion.delta.y * SENSITIVITY).clamp(-1.54, 1.54);
    }
}

fn steer(keys: Res<ButtonInput<KeyCode>>, mut players: Query<(&Player, &mut Steering)>) {
    let axis = |plus: [KeyCode; 2], minus: [KeyCode; 2]| {
        f32::from(u8::from(keys.any_pressed(plus))) - f32::from(u8::from(keys.any_pressed(minus)))
    };
    let ahead = axis([KeyCode::KeyW, KeyCode::ArrowUp], [KeyCode::KeyS, KeyCode::ArrowDown]);
    let aside = axis([KeyCode::KeyD, KeyCode::ArrowRight], [KeyCode::KeyA, KeyCode::ArrowLeft]);
    for (player, mut steering) in &mut players {
        let way = Quat::from_rotation_y(player.yaw) * Vec3::new(aside, 0.0, -ahead);
        steering.direction = way.xz().clamp_length_max(1.0);
        steering.run = keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]);
        steering.jump = keys.pressed(KeyCode::Space);
    }
}

fn press_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut lamp: ResMut<LampSwitch>,
    mut exit: MessageWriter<AppExit>,
) {
    if keys.just_pressed(KeyCode::KeyF) {
        lamp.0 = !lamp.0;
    }
    if keys.just_pressed(KeyCode::KeyQ) {
        exit.write(AppExit::Success);
    }
}

fn walk(time: Res<Time>, terrains: Terrains, mut players: Query<(&mut Player, &mut Body, &Steering)>) {
    for (mut player, mut body, steering) in &mut players {
        let before = body.feet.y;
        body.advance(&terrains, steering, time.delta_secs());
        // Eyes follow steps smoothly, but neither fall behind a jump out of the ground nor poke through a ceiling.
        let step = body.feet.y - before;
        let lag = if step.abs() > 1.0 || !body.grounded { 0.0 } else { player.lag + step };
        player.lag = (lag * (-14.0 * time.delta_secs()).exp()).clamp(-0.05, 0.6);
    }
}

fn see(players: Query<(&Player, &Body)>, mut eyes: Query<&mut Transform, (With<Eyes>, Without<Drone>)>) {
    let Ok((player, body)) = players.single() else { return };
    for mut eyes in &mut eyes {
        eyes.translation = body.eye() - Vec3::Y * player.lag;
        eyes.rotation = player.rotation();
    }
}
