//! Hosting and joining: sets up and removes connections together with the terrain's `SharedTerrain`.

use std::fmt;
use std::net::{AddrParseError, IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::str::FromStr;
use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::net::{ClientEvent, KickReason, Rate, Reach, Server, ServerSettings, UndoPolicy};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{GroundJoined, GroundServer, GroundServerEvent, SharedTerrain, TogetherPlugin};
use bevy_replicon::prelude::*;
use bevy_replicon_renet::RepliconRenetPlugins;

use super::udp;
use crate::ui::hud::Hint;
use crate::ui::texts;
use crate::world::landscape::{self, OriginalGround};
use crate::world::saves::{NotOpened, PlayedWorld};

/// Most players.
const PLAYERS: usize = 16;
/// Seconds until a lost connection is tried again.
const RETRY_PAUSE: f32 = 2.0;
/// How often a guest tries to join. One that has joined tries without an end.
const TRIES: u32 = 3;

/// The players in this world.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub enum Party {
    #[default]
    Alone,
    /// This machine has the world, and others may join at this port.
    Host(u16),
    /// The world of another machine, and its seed.
    Guest(SocketAddr, u32),
}

/// Text that is not an address.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("{0:?} is not a valid address. Try 192.168.0.7 or 192.168.0.7:5100.")]
pub struct NoAddress(String);

/// The address of a host, and the seed of its world, with or without a port and a seed: `192.168.0.7:5100#3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Address(pub SocketAddr, pub u32);

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.1 {
            0 => write!(f, "{}", self.0),
            seed => write!(f, "{}#{seed}", self.0),
        }
    }
}

impl FromStr for Address {
    type Err = NoAddress;

    fn from_str(text: &str) -> Result<Self, NoAddress> {
        let text = text.trim();
        let no_address = || NoAddress(text.into());
        let (place, seed) = text.split_once('#').unwrap_or((text, "0"));
        let seed = seed.parse::<u32>().map_err(|_| no_address())?;
        let numbers = match place.strip_prefix("localhost") {
            Some(port) => format!("127.0.0.1{port}"),
            None => place.into(),
        };
        let with_port = numbers.parse::<SocketAddrV4>();
        let address = with_port.or_else(|_| Ok(SocketAddrV4::new(numbers.parse()?, PORT)));
        address.map(|address| Self(address.into(), seed)).map_err(|_: AddrParseError| no_address())
    }
}

/// The port that hosts listen at if nothing else is said.
pub const PORT: u16 = udp::PORT;

/// The address at which others find this machine. Nothing is sent to find it out.
pub fn own_address() -> Option<IpAddr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
    Some(socket.local_addr().ok()?.ip())
}

/// The number that this program has in the network; the host itself has 0.
#[derive(Resource, Clone, Copy, Debug)]
pub struct OwnNumber(pub u64);

/// Seconds until a guest tries to connect, and how often it has tried.
#[derive(Resource)]
struct NextTry(f32, u32);

/// Hosting or joining has failed, or the host has removed the player, for this reason.
#[derive(Event, Clone, Debug)]
pub struct ConnectionFailed(pub String);

/// Shares the terrain with others.
pub struct ConnectionPlugin(pub Party);

impl Plugin for ConnectionPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((RepliconPlugins, RepliconRenetPlugins, TogetherPlugin))
            .insert_resource(self.0.clone())
            .insert_resource(OwnNumber(fastrand::u64(1..u64::MAX / 2)))
            .add_observer(open)
            .add_observer(close)
            .add_observer(tell_other_version)
            .add_systems(OnExit(ClientState::Connected), announce_loss)
            .add_systems(
                Update,
                (connect.run_if(in_state(ClientState::Disconnected)), follow_host, serve_unsaved),
            );
    }
}

/// Whether the world is shared with others.
pub fn is_shared(party: Option<Res<Party>>) -> bool {
    party.is_some_and(|party| *party != Party::Alone)
}

/// What the server allows. A bomb flies far from the player who threw it.
fn settings() -> ServerSettings {
    let reach = Reach { distance: 160, speed: 60, latency: Duration::from_secs(1) };
    // Home networks are fast, and the host gets its own saved world this way.
    let bulk = Rate { per_second: 2 << 20, burst: 128 << 10 };
    ServerSettings { reach: Some(reach), undo: UndoPolicy::Own, bulk, window: 2 << 20, ..default() }
}

fn open(
    new: On<Insert, SharedTerrain>,
    mut commands: Commands,
    party: Res<Party>,
    played: Res<PlayedWorld>,
    terrains: Query<&Terrain>,
    ground: Res<OriginalGround>,
    own: Res<OwnNumber>,
    mut time: ResMut<Time<Virtual>>,
) -> Result {
    // It may have been paused, and continues for all.
    time.unpause();
    let terrain = terrains.get(new.entity)?;
    match *party {
        Party::Alone => {}
        Party::Host(port) => {
            commands.insert_resource(OwnNumber(0));
            commands.insert_resource(match played.saved() {
                Some(saved) => GroundServer::saved(&saved, terrain, settings()),
                None => GroundServer::new(unsaved(&ground)?),
            });
            commands.queue(move |world: &mut World| {
                if let Err(why) = udp::listen(world, (Ipv4Addr::UNSPECIFIED, port).into(), PLAYERS) {
                    world.trigger(ConnectionFailed(texts::nobody_can_join(why)));
                }
            });
        }
        Party::Guest(..) => {
            if own.0 == 0 {
                commands.insert_resource(OwnNumber(fastrand::u64(1..u64::MAX / 2)));
            }
            commands.insert_resource(NextTry(0.0, 0));
        }
    }
    Ok(())
}

fn unsaved(ground: &OriginalGround) -> Result<Server> {
    Ok(Server::new(landscape::new_terrain(&ground.0)?, settings()))
}

/// Serves a world that is not saved while the player reads why the saved one can't be opened.
fn serve_unsaved(
    mut events: MessageReader<GroundServerEvent>,
    ground: Option<Res<OriginalGround>>,
    mut server: Option<ResMut<GroundServer>>,
    mut hints: MessageWriter<Hint>,
    mut commands: Commands,
) -> Result {
    for event in events.read() {
        match event {
            GroundServerEvent::Opened(Err(why)) => {
                commands.trigger(NotOpened(why.to_string()));
                if let (Some(ground), Some(server)) = (&ground, &mut server) {
                    server.serve_instead(unsaved(ground)?);
                }
            }
            GroundServerEvent::Warning(warning) => {
                hints.write(Hint(warning.to_string()));
            }
            _ => {}
        }
    }
    Ok(())
}

fn close(_: On<Remove, SharedTerrain>, mut commands: Commands) {
    commands.remove_resource::<NextTry>();
    commands.remove_resource::<GroundServer>();
    commands.queue(udp::leave);
}

/// Connects a guest, again and again once it was in the host's world.
fn connect(
    mut commands: Commands,
    time: Res<Time<Real>>,
    party: Res<Party>,
    own: Res<OwnNumber>,
    shared: Query<&SharedTerrain>,
    next: Option<ResMut<NextTry>>,
) {
    let (&Party::Guest(server, _), Some(mut next)) = (&*party, next) else { return };
    next.0 -= time.delta_secs();
    if next.0 > 0.0 {
        return;
    }
    if next.1 >= TRIES && !shared.iter().any(SharedTerrain::is_playable) {
        commands.trigger(ConnectionFailed(texts::unreachable(server, texts::NO_ANSWER)));
        return;
    }
    (next.0, next.1) = (RETRY_PAUSE, next.1 + 1);
    let number = own.0;
    commands.queue(move |world: &mut World| {
        if let Err(why) = udp::connect(world, server, number) {
            world.write_message(Hint(texts::unreachable(server, why)));
        }
    });
}

fn announce_loss(next: Option<Res<NextTry>>, mut hints: MessageWriter<Hint>) {
    // A player that has left does not try again.
    if next.is_some() {
        hints.write(Hint(texts::HOST_LOST.into()));
    }
}

fn tell_other_version(_: On<ProtocolMismatch>, mut commands: Commands) {
    commands.trigger(ConnectionFailed(texts::OTHER_VERSION.into()));
}

/// What the host's server says about this player.
fn follow_host(mut commands: Commands, mut joined: MessageReader<GroundJoined>) {
    for message in joined.read() {
        if let ClientEvent::Kicked(why) = message.event {
            let is_other = why == KickReason::Ground;
            let why = if is_other { texts::other_seed() } else { texts::removed(why) };
            commands.trigger(ConnectionFailed(why));
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::ecs::system::RunSystemOnce;

    use super::*;

    #[derive(Resource, Default)]
    struct Failures(Vec<String>);

    #[test]
    fn a_guest_gives_up_when_nobody_answers() {
        let mut world = World::new();
        world.init_resource::<Time<Real>>();
        world.init_resource::<Failures>();
        world.insert_resource(Party::Guest(([10, 0, 0, 3], PORT).into(), 0));
        world.insert_resource(OwnNumber(7));
        world.insert_resource(NextTry(0.0, TRIES));
        world.add_observer(|failed: On<ConnectionFailed>, mut failures: ResMut<Failures>| {
            failures.0.push(failed.0.clone());
        });
        world.run_system_once(connect).expect("a system that runs");
        let expected = texts::unreachable("10.0.0.3:5100", texts::NO_ANSWER);
        assert_eq!(world.resource::<Failures>().0, [expected]);
    }

    #[test]
    fn addresses_may_lack_their_port() {
        for (text, expected) in [
            ("192.168.0.7", Some("192.168.0.7:5100")),
            (" 10.0.0.1:99 ", Some("10.0.0.1:99")),
            ("localhost", Some("127.0.0.1:5100")),
            ("localhost:7", Some("127.0.0.1:7")),
            ("10.0.0.1#12", Some("10.0.0.1:5100#12")),
            ("10.0.0.1#x", None),
            // Sockets are of version 4.
            ("::1", None),
            ("", None),
            ("ann", None),
            ("192.168.0.7:port", None),
        ] {
            let address: Result<Address, NoAddress> = text.parse();
            assert_eq!(address.ok().map(|address| address.to_string()).as_deref(), expected, "{text}");
        }
    }
}
