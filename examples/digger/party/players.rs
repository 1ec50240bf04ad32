//! The players: each tells the host who and where it is, and the host tells all others.

use std::time::Duration;

use bevy::ecs::system::SystemParam;
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
use crate::ui::hud::Hint;
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::world::day::Clock;
use crate::world::landscape::ORIGIN;
use crate::world::saves::SavedPlace;

/// How often players say where they are.
const POSE_EVERY: Duration = Duration::from_millis(50);
/// How often they say who they are, until the host has heard it.
const NAME_EVERY: Duration = Duration::from_millis(500);
/// Most letters of a name.
pub const MAX_LETTERS: usize = 16;
/// The greatest possible distance of a player from the middle of the world, in metres.
const FAR: f32 = 20_000.0;
/// The host's clock is taken over if it differs by this many hours.
const CLOCK_DIFFERENCE: f32 = 0.02;

/// A player, this one too.
#[derive(Component, Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlayerInfo {
    /// In the network; the host has 0.
    pub number: u64,
    pub name: String,
}

/// Where a player stands and looks.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub feet: Vec3,
    pub yaw: f32,
    pub pitch: f32,
    pub has_light: bool,
}

impl Pose {
    /// Whether a player can be there.
    fn is_possible(&self) -> bool {
        self.feet.abs().max_element() < FAR && self.yaw.is_finite() && self.pitch.is_finite()
    }

    /// The voxel at the feet.
    fn voxel(&self) -> IVec3 {
        voxel(self.feet)
    }
}

/// The time of day at the host, on the host's [`PlayerInfo`].
#[derive(Component, Clone, Copy, Debug, Serialize, Deserialize)]
struct HostClock(f32);

/// A player says who it is.
#[derive(Message, Clone, Debug, Serialize, Deserialize)]
struct Introduction(String);

/// A player says where it is.
#[derive(Message, Clone, Copy, Debug, Serialize, Deserialize)]
struct Moved(Pose);

/// Tells all players of all others.
pub struct PlayersPlugin;

impl Plugin for PlayersPlugin {
    fn build(&self, app: &mut App) {
        app.replicate::<PlayerInfo>()
            .replicate::<Pose>()
            .replicate::<HostClock>()
            .add_client_message::<Introduction>(Channel::Ordered)
            .add_client_message::<Moved>(Channel::Unreliable)
            .add_observer(announce_arrival)
            .add_observer(announce_leaving)
            .add_observer(forget_all)
            .add_systems(OnEnter(ClientState::Connected), (introduce, tell_pose))
            .add_systems(OnExit(ClientState::Connected), forget_players)
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

/// The voxel at a place.
pub fn voxel(place: Vec3) -> IVec3 {
    place.as_ivec3().saturating_add(ORIGIN)
}

/// A name that can be shown.
pub fn cleaned(name: &str) -> String {
    let visible = name.chars().filter(|letter| letter.is_ascii_graphic() || *letter == ' ');
    let name: String = visible.take(MAX_LETTERS).collect();
    if name.trim().is_empty() { texts::SOMEBODY.into() } else { name.trim().into() }
}

/// The name from the settings, or the user's on this machine.
fn name_of(settings: &Settings) -> String {
    let user = || ["USER", "USERNAME"].into_iter().find_map(|name| std::env::var(name).ok());
    if settings.name.trim().is_empty() { user().unwrap_or_default() } else { settings.name.clone() }
}

fn introduce(
    settings: Res<Settings>,
    own: Res<OwnNumber>,
    players: Query<&PlayerInfo>,
    mut messages: MessageWriter<Introduction>,
) {
    if players.iter().all(|player| player.number != own.0) {
        messages.write(Introduction(name_of(&settings)));
    }
}

fn tell_pose(players: Query<(&Player, Body)>, lamp: Res<HeadlampSwitch>, mut messages: MessageWriter<Moved>) {
    for (player, body) in &players {
        let pose = Pose { feet: body.feet(), yaw: player.yaw, pitch: player.pitch, has_light: lamp.0 };
        messages.write(Moved(pose));
    }
}

/// Ground comes from the player outwards, or from where a saved game puts it.
fn place_ground(
    players: Query<Body, With<Player>>,
    saved: Option<Res<SavedPlace>>,
    mut terrains: Query<&mut SharedTerrain>,
) {
    let player = players.iter().next().map(|body| body.feet());
    let Some(feet) = player.or(saved.map(|place| place.feet)) else { return };
    for mut terrain in &mut terrains {
        terrain.bypass_change_detection().position = voxel(feet);
    }
}

/// The host enters a player.
fn enter(
    mut commands: Commands,
    mut introductions: MessageReader<FromClient<Introduction>>,
    ids: Query<&NetworkId>,
    players: Query<&PlayerInfo>,
    clock: Res<Clock>,
) {
    for FromClient { client_id, message } in introductions.read() {
        let name = cleaned(&message.0);
        match client_id.entity() {
            Some(client) => {
                // 0 is the host's.
                let Some(id) = ids.get(client).ok().filter(|id| id.get() != 0) else { continue };
                let player = PlayerInfo { number: id.get(), name };
                commands.entity(client).insert_if_new((Replicated, player, Pose::default()));
            }
            None if players.iter().all(|player| player.number != 0) => {
                let player = PlayerInfo { number: 0, name };
                commands.spawn((Replicated, player, Pose::default(), HostClock(clock.hour)));
            }
            None => {}
        }
    }
}

/// The host moves a player.
fn place(
    mut moves: MessageReader<FromClient<Moved>>,
    ids: Query<&NetworkId>,
    mut players: Query<&mut Pose, Without<HostClock>>,
    mut host: Query<(&mut Pose, &mut HostClock)>,
    mut server: ResMut<GroundServer>,
    clock: Res<Clock>,
) {
    for FromClient { client_id, message: Moved(new) } in
        moves.read().filter(|moved| moved.message.0.is_possible())
    {
        if let Some(client) = client_id.entity() {
            if let Ok(mut pose) = players.get_mut(client) {
                pose.set_if_neq(*new);
            }
        } else if let Ok((mut pose, mut hours)) = host.single_mut() {
            pose.set_if_neq(*new);
            if (hours.0 - clock.hour).abs() > CLOCK_DIFFERENCE / 2.0 {
                hours.0 = clock.hour;
            }
        }
        let (player, at) = (GroundServer::player(*client_id, &ids), new.voxel());
        server.with(move |server: &mut net::Server| server.set_position(player, Some(at)));
    }
}

/// Follows the host's time of day.
fn follow_clock(party: Res<Party>, hosts: Query<&HostClock, Changed<HostClock>>, mut clock: ResMut<Clock>) {
    for hour in hosts.iter().filter(|hour| hour.0.is_finite()) {
        if matches!(*party, Party::Guest(..)) && (clock.hour - hour.0).abs() > CLOCK_DIFFERENCE {
            clock.hour = hour.0.rem_euclid(24.0);
        }
    }
}

fn announce_arrival(new: On<Add, PlayerInfo>, mut announcer: Announcer) {
    announcer.tell(new.entity, texts::ARRIVED);
}

fn announce_leaving(gone: On<Remove, PlayerInfo>, mut announcer: Announcer) {
    announcer.tell(gone.entity, texts::LEFT);
}

/// Says what other players do.
#[derive(SystemParam)]
struct Announcer<'w, 's> {
    players: Query<'w, 's, &'static PlayerInfo>,
    own: Res<'w, OwnNumber>,
    hints: MessageWriter<'w, Hint>,
}

impl Announcer<'_, '_> {
    fn tell(&mut self, player: Entity, what: &str) {
        if let Some(player) = self.players.get(player).ok().filter(|player| player.number != self.own.0) {
            self.hints.write(Hint(format!("{} {what}", cleaned(&player.name))));
        }
    }
}

/// Without a connection nobody is there.
fn forget_players(mut commands: Commands, players: Query<Entity, With<PlayerInfo>>) {
    for player in &players {
        commands.entity(player).try_despawn();
    }
}

fn forget_all(_: On<Remove, SharedTerrain>, mut commands: Commands) {
    commands.run_system_cached(forget_players);
}

#[cfg(test)]
mod tests {
    use bevy::ecs::system::RunSystemOnce;

    use super::*;

    #[test]
    fn the_ground_of_a_saved_game_comes_from_where_its_player_was() {
        let mut world = World::new();
        let terrain = world.spawn(SharedTerrain::default()).id();
        let feet = Vec3::new(700.5, 30.0, 9.0);
        world.insert_resource(SavedPlace { feet, yaw: 0.0, pitch: 0.0 });
        world.run_system_once(place_ground).expect("a system that runs");
        assert_eq!(world.get::<SharedTerrain>(terrain).expect("it is there").position, voxel(feet));
    }

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
