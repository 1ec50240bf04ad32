//! Connections over UDP, for programs whose players dig together.
//!
//! How players prove who they are is in [`ServerAuthentication`] and [`ClientAuthentication`]. `Unsecure` connections
//! are not encrypted, and anyone may join under any number: they are for friends. `Secure` ones need a token for each
//! connection, as `tokens.rs` issues them.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::{Duration, SystemTime};

use bevy::prelude::*;
use bevy_replicon::prelude::RepliconChannels;
use bevy_replicon_renet::netcode::{
    ClientAuthentication, NetcodeClientTransport, NetcodeServerTransport, ServerAuthentication, ServerConfig,
};
use bevy_replicon_renet::renet::ConnectionConfig;
use bevy_replicon_renet::{RenetChannelsExt, RenetClient, RenetServer};

/// The port that hosts listen on.
pub const PORT: u16 = 5100;

/// Programs with another number do not understand each other.
pub const PROTOCOL: u64 = 0x6275_7272_6f77;

/// Bytes a second that are sent to each player at most.
const BYTES: u64 = 4 << 20;

fn config(world: &World) -> ConnectionConfig {
    let channels = world.resource::<RepliconChannels>();
    ConnectionConfig {
        available_bytes_per_tick: BYTES / 60,
        server_channels_config: channels.server_configs(),
        client_channels_config: channels.client_configs(),
    }
}

/// Listens for players that need no token, up to a limit. All replicated types have to be registered before.
///
/// # Errors
/// When the address is taken.
pub fn listen(world: &mut World, address: SocketAddr, players: usize) -> Result<SocketAddr> {
    listen_as(world, address, None, players, ServerAuthentication::Unsecure)
}

/// Listens for players who prove who they are in this way. Tokens have to name the address that is returned, or the
/// public one if there is one.
///
/// # Errors
/// When the address is taken.
pub fn listen_as(
    world: &mut World,
    address: SocketAddr,
    public: Option<SocketAddr>,
    players: usize,
    authentication: ServerAuthentication,
) -> Result<SocketAddr> {
    let socket = UdpSocket::bind(address)?;
    let local = socket.local_addr()?;
    let config = ServerConfig {
        current_time: now()?,
        max_clients: players,
        protocol_id: PROTOCOL,
        authentication,
        public_addresses: vec![public.unwrap_or(local)],
    };
    let server = RenetServer::new(self::config(world));
    world.insert_resource(server);
    world.insert_resource(NetcodeServerTransport::new(config, socket)?);
    Ok(local)
}

/// Connects to a server that asks for no token, as the player of this number, and ends what was there before.
///
/// # Errors
/// When there is no network.
pub fn connect(world: &mut World, server: SocketAddr, player: u64) -> Result {
    let authentication = ClientAuthentication::Unsecure {
        client_id: player,
        protocol_id: PROTOCOL,
        server_addr: server,
        user_data: None,
    };
    connect_as(world, server, authentication)
}

/// Connects to a server as a player who proves who it is in this way, and ends what was there before.
///
/// # Errors
/// When there is no network.
pub fn connect_as(world: &mut World, server: SocketAddr, authentication: ClientAuthentication) -> Result {
    // Replicon notices a connection when its resource is added, and not when it replaces another one.
    leave(world);
    let any = if server.ip().is_loopback() { Ipv4Addr::LOCALHOST } else { Ipv4Addr::UNSPECIFIED };
    let socket = UdpSocket::bind((any, 0))?;
    let client = RenetClient::new(config(world));
    world.insert_resource(client);
    world.insert_resource(NetcodeClientTransport::new(now()?, authentication, socket)?);
    Ok(())
}

/// Ends all connections.
pub fn leave(world: &mut World) {
    if let Some(mut client) = world.remove_resource::<NetcodeClientTransport>() {
        client.disconnect();
    }
    let transport = world.remove_resource::<NetcodeServerTransport>();
    if let (Some(mut transport), Some(mut server)) = (transport, world.get_resource_mut::<RenetServer>()) {
        transport.disconnect_all(&mut server);
    }
    world.remove_resource::<RenetClient>();
    world.remove_resource::<RenetServer>();
}

/// Time since 1970, which connections and tokens count in.
pub fn now() -> Result<Duration> {
    Ok(SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?)
}
