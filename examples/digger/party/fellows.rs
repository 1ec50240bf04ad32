//! The players: each tells the host who and where it is, and the host tells all others.

use std::time::Duration;

use bevy::prelude::*;
use bevy::time::common_conditions::on_real_timer;
use bevy_burrow::net;
use bevy_burrow::together::{GroundServer, SharedTerrain};
use bevy_replicon::prelude::*;
use bevy_replicon::shared::backend::connected_client::NetworkId;
use serde::{Deserialize, Serialize};

use super::connection::{OwnNumber, Party, is_shared};
use crate::player::Player;
use crate::player::body::Body;
use crate::player::headlamp::HeadlampSwitch;
use crate::tools::Hand;
use crate::ui::hud::Hint;
use crate::ui::settings::Settings;
use crate::world::day::Clock;
use crate::world::landscape::ORIGIN;

/// How often players say where they are.
const POSE_EVERY: Duration = Duration::from_millis(50);
/// How often they say who they are, until the host has heard it.
const NAME_EVERY: Duration = Duration::from_millis(500);
/// Most letters of a name.
pub const MOST_LETTERS: usize = 16;
/// The host's clock is taken over where it differs by so many hours.
const CLOCK_DIFFERENCE: f32 = 0.02;

/// A player, this one too.
#[derive(Component, Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fellow {
    /// In the network; the host has 0.
    pub number: u64,
    pub name: String,
}

/// Where a player stands and looks, and what it holds.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub feet: Vec3,
    pub yaw: f32,
    pub pitch: f32,
    /// Of all tools.
    pub tool: u8,
    pub has_light: bool,
}

impl Pose {
    fn is_finite(&self) -> bool {
        self.feet.is_finite() && self.yaw.is_finite() && self.pitch.is_finite()
    }
}

/// The time of day at the host, on its own [`Fellow`].
#[derive(Component, Clone, Copy, Debug, Serialize, Deserialize)]
struct HostClock(f32);

/// A player says who it is.
#[derive(Message, Clone, Debug, Serialize, Deserialize)]
struct Introduction(String);

/// A player says where it is.
#[derive(Message, Clone, Copy, Debug, Serialize, Deserialize)]
struct Moved(Pose);

/// Tells all players of all others.
pub struct FellowsPlugin;

impl Plugin for FellowsPlugin {
    fn build(&self, app: &mut App) {
        app.replicate::<Fellow>()
            .replicate::<Pose>()
            .replicate::<HostClock>()
            .add_client_message::<Introduction>(Channel::Ordered)
            .add_client_message::<Moved>(Channel::Unreliable)
            .add_observer(welcome)
            .add_observer(say_goodbye)
            .add_observer(forget_all)
            .add_systems(OnExit(ClientState::Connected), forget_fellows)
            .add_systems(
                Update,
                (
                    introduce.run_if(on_real_timer(NAME_EVERY)),
                    tell_pose.run_if(on_real_timer(POSE_EVERY)),
                    place_ground,
                    follow_clock,
                    (enter, place).chain().run_if(resource_exists::<GroundServer>),
                )
                    .run_if(is_shared),
            );
    }
}

/// A name that can be shown.
pub fn cleaned(name: &str) -> String {
    let visible = name.chars().filter(|letter| letter.is_ascii_graphic() || *letter == ' ');
    let name: String = visible.take(MOST_LETTERS).collect();
    if name.trim().is_empty() { "somebody".into() } else { name.trim().into() }
}

/// The name from the settings, or the user's on this machine.
fn name_of(settings: &Settings) -> String {
    let user = || ["USER", "USERNAME"].into_iter().find_map(|name| std::env::var(name).ok());
    if settings.name.trim().is_empty() { user().unwrap_or_default() } else { settings.name.clone() }
}

fn introduce(
    settings: Res<Settings>,
    own: Res<OwnNumber>,
    fellows: Query<&Fellow>,
    mut messages: MessageWriter<Introduction>,
) {
    if fellows.iter().all(|fellow| fellow.number != own.0) {
        messages.write(Introduction(name_of(&settings)));
    }
}

fn tell_pose(
    players: Query<(&Player, Body)>,
    hand: Res<Hand>,
    lamp: Res<HeadlampSwitch>,
    mut messages: MessageWriter<Moved>,
) {
    for (player, body) in &players {
        let (tool, has_light) = (hand.tool as u8, lamp.0);
        let pose = Pose { feet: body.feet(), yaw: player.yaw, pitch: player.pitch, tool, has_light };
        messages.write(Moved(pose));
    }
}

/// Ground comes from the player outwards.
fn place_ground(players: Query<Body, With<Player>>, mut terrains: Query<&mut SharedTerrain>) {
    for (body, mut terrain) in players.iter().zip(&mut terrains) {
        terrain.bypass_change_detection().place = body.feet().as_ivec3() + ORIGIN;
    }
}

/// The host enters a player.
fn enter(
    mut commands: Commands,
    mut introductions: MessageReader<FromClient<Introduction>>,
    ids: Query<&NetworkId>,
    fellows: Query<&Fellow>,
    clock: Res<Clock>,
) {
    for FromClient { client_id, message } in introductions.read() {
        let name = cleaned(&message.0);
        match client_id.entity() {
            Some(client) => {
                let Ok(id) = ids.get(client) else { continue };
                let fellow = Fellow { number: id.get(), name };
                commands.entity(client).insert_if_new((Replicated, fellow, Pose::default()));
            }
            None if fellows.iter().all(|fellow| fellow.number != 0) => {
                let fellow = Fellow { number: 0, name };
                commands.spawn((Replicated, fellow, Pose::default(), HostClock(clock.hour)));
            }
            None => {}
        }
    }
}

/// The host moves a player.
fn place(
    mut moves: MessageReader<FromClient<Moved>>,
    ids: Query<&NetworkId>,
    mut fellows: Query<(&Fellow, &mut Pose, Option<&mut HostClock>)>,
    mut server: ResMut<GroundServer>,
    clock: Res<Clock>,
) {
    for FromClient { client_id, message: Moved(new) } in moves.read() {
        if !new.is_finite() {
            continue;
        }
        let number = client_id.entity().map_or(Some(0), |client| ids.get(client).ok().map(NetworkId::get));
        let found = fellows.iter_mut().find(|(fellow, ..)| Some(fellow.number) == number);
        let Some((_, mut pose, hours)) = found else { continue };
        pose.set_if_neq(*new);
        if let Some(mut hours) = hours
            && (hours.0 - clock.hour).abs() > CLOCK_DIFFERENCE / 2.0
        {
            hours.0 = clock.hour;
        }
        let (player, at) = (GroundServer::player(*client_id, &ids), new.feet.as_ivec3() + ORIGIN);
        server.with(move |server: &mut net::Server| server.set_place(player, Some(at)));
    }
}

/// It is as late as at the host's.
fn follow_clock(party: Res<Party>, hosts: Query<&HostClock, Changed<HostClock>>, mut clock: ResMut<Clock>) {
    for hour in hosts.iter().filter(|hour| hour.0.is_finite()) {
        if matches!(*party, Party::Guest(_)) && (clock.hour - hour.0).abs() > CLOCK_DIFFERENCE {
            clock.hour = hour.0.rem_euclid(24.0);
        }
    }
}

fn welcome(
    new: On<Add, Fellow>,
    fellows: Query<&Fellow>,
    own: Res<OwnNumber>,
    mut hints: MessageWriter<Hint>,
) {
    if let Some(fellow) = fellows.get(new.entity).ok().filter(|fellow| fellow.number != own.0) {
        hints.write(Hint(format!("{} is here", cleaned(&fellow.name))));
    }
}

fn say_goodbye(
    gone: On<Remove, Fellow>,
    fellows: Query<&Fellow>,
    own: Res<OwnNumber>,
    mut hints: MessageWriter<Hint>,
) {
    if let Some(fellow) = fellows.get(gone.entity).ok().filter(|fellow| fellow.number != own.0) {
        hints.write(Hint(format!("{} has gone", cleaned(&fellow.name))));
    }
}

/// Without a connection nobody is there.
fn forget_fellows(mut commands: Commands, fellows: Query<Entity, With<Fellow>>) {
    for fellow in &fellows {
        commands.entity(fellow).try_despawn();
    }
}

fn forget_all(_: On<Remove, SharedTerrain>, mut commands: Commands) {
    commands.run_system_cached(forget_fellows);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_short_and_visible() {
        for (name, shown) in [
            ("Ann", "Ann"),
            ("  Bob the digger of holes", "Bob the digger"),
            ("\u{7}\n", "somebody"),
            ("", "somebody"),
            ("J\u{202e}im", "Jim"),
        ] {
            assert_eq!(cleaned(name), shown);
        }
    }
}
